"""Files of the sound: numbers, and what is heard at each point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from scipy.io import wavfile

from thesis_lib.arrays import Array
from thesis_lib.measure.radiation.radiated import complex_of
from thesis_lib.studies import storage

RATE, SECONDS, FADE = 48000, 4.0, 0.05  # samples per second; length and fades of a sound file, s
MEANINGS = (
    "radiated.nc, radiated.csv: sound power, pressures and fields, with their standard errors",
    "heard-1.wav …: what would be heard at each point, one sound file for each; samples are "
    "pressures in Pa (32-bit floating point), so that players may have to be turned up",
)


def write(folder: Path, data: xr.Dataset) -> None:
    """Write the sound, as numbers and as files that play, into a folder that is there."""
    storage.write(data, folder / "radiated.nc")
    table(data).to_csv(folder / "radiated.csv", index=False, float_format="%.6g")
    for number in range(data.sizes["point"]):
        samples = heard(data, number).astype(np.float32)
        wavfile.write(folder / f"heard-{number + 1}.wav", RATE, samples)


def heard(data: xr.Dataset, point: int) -> Array:
    """Pressure in Pa at a point over time, all tones together, faded in and out."""
    times = np.arange(int(RATE * SECONDS)) / RATE
    pressure = complex_of(data, "pressure")[:, point]
    waves = np.exp(2j * np.pi * data["frequency"].values[:, None] * times)
    fade = np.clip(np.minimum(times, SECONDS - times) / FADE, 0, 1)
    return np.asarray(np.real(pressure @ waves) * fade)


def table(data: xr.Dataset) -> pd.DataFrame:
    """Every number with its standard error, one in a row."""
    rows = []
    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        hertz = float(one["frequency"])
        for name in ("power", "power_level", "efficiency"):
            rows.append((hertz, name, "", one[name], one[f"{name}_error"], one[name].units))
        for mode in range(one.sizes["mode"]):
            value, error = (one[key][mode] for key in ("mode_power", "mode_power_error"))
            rows.append((hertz, "mode_power", str(mode + 1), value, error, value.units))
        sizes = np.abs(complex_of(one, "pressure"))
        for point in range(one.sizes["point"]):
            at = " ".join(f"{1000 * x:g}" for x in one["place"].values[point])
            error = one["pressure_error"][point]
            rows.append((hertz, "pressure", at, sizes[point], error, error.units))
            value, error = (one[key][point] for key in ("level", "level_error"))
            rows.append((hertz, "level", at, value, error, value.units))
    names = ["frequency_hz", "quantity", "mode_or_point_mm", "value", "standard_error", "unit"]
    frame = pd.DataFrame(rows, columns=names)
    return frame.astype({"value": float, "standard_error": float})
