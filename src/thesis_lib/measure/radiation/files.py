"""Files of the sound: numbers, and what is heard at each point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from scipy.io import wavfile

from thesis_lib.arrays import Array
from thesis_lib.measure.radiation.radiated import complex_of
from thesis_lib.measure.recordings.text_files import write_csv
from thesis_lib.studies import storage

SOUND_RATE_HZ, SOUND_LENGTH_S = 48000, 4.0  # samples per second; length of a sound file, s
FADE_S, RISE_S = 0.05, 0.005  # s by which it fades in and out; and in, where something decays


def write_sound(folder: Path, data: xr.Dataset) -> None:
    """Write the sound, as numbers and as files that play, into a folder that is there."""
    storage.write_netcdf(data, folder / "radiated.nc")
    write_csv(sound_table(data), folder / "radiated.csv", "%.6g")
    for number in range(data.sizes["point"]):
        samples = audible_pressure(data, number).astype(np.float32)
        wavfile.write(folder / f"heard-{number + 1}.wav", SOUND_RATE_HZ, samples)


def audible_pressure(data: xr.Dataset, point: int) -> Array:
    """Return the pressure in Pa at a point over time, all tones together, faded in and out.

    Tones have the phases that were measured. Modes die away from the moment on that their
    amplitudes are of.
    """
    times = np.arange(int(SOUND_RATE_HZ * SOUND_LENGTH_S)) / SOUND_RATE_HZ
    pressure = complex_of(data, "pressure")[:, point]
    decay = np.maximum(data.get("decay", 0 * data["frequency"]).values, 0)
    waves = np.exp((2j * np.pi * data["frequency"].values - decay)[:, None] * times)
    rise = RISE_S if np.any(decay) else FADE_S
    fade = np.clip(np.minimum(times / rise, (SOUND_LENGTH_S - times) / FADE_S), 0, 1)
    return np.asarray(np.real(pressure @ waves) * fade)


def sound_table(data: xr.Dataset) -> pd.DataFrame:
    """Return every number with its standard error, one in a row."""
    rows: list[tuple[object, ...]] = []

    def add_row(of: object, name: str, what: object, one: xr.Dataset) -> None:
        rows.append((of, name, what, float(one[name]), float(error_of(one, name)), one[name].units))

    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        hertz = f"{float(one['frequency']):.6g}"
        for name in (
            "power",
            "power_level",
            "efficiency",
            *(["energy"] if "energy" in one else []),
            "no_wall_change",
            "no_wall_below",
        ):
            add_row(hertz, name, "", one)
        for mode in range(one.sizes["mode"]):
            add_row(hertz, "mode_power", mode + 1, one.isel(mode=mode))
        for point in range(one.sizes["point"]):
            here = one.isel(point=point)
            add_row(
                hertz, "pressure", format_point(here), here.assign(pressure=absolute_pressure(here))
            )
            add_row(hertz, "level", format_point(here), here)
    for band in data["band"].values if data.sizes["tone"] > 1 else ():
        one = data.sel(band=band)
        for name in ("band_power", "band_power_level"):
            add_row(band, name, "", one)
        for point in range(one.sizes["point"]):
            add_row(band, "band_level", format_point(one.isel(point=point)), one.isel(point=point))
    names = ["frequency_hz", "quantity", "mode_or_point_mm", "value", "standard_error", "unit"]
    return pd.DataFrame(rows, columns=names)


def error_of(one: xr.Dataset, name: str) -> xr.DataArray:
    """Return the standard error of a number; NaN if it has none."""
    return next(
        (one[of] for of in (f"{name}_error", f"{name}_std") if of in one), xr.DataArray(np.nan)
    )


def format_point(one: xr.Dataset) -> str:
    """Format the position of a point, in mm."""
    return " ".join(f"{1000 * x:g}" for x in one["place"].values)


def absolute_pressure(one: xr.Dataset) -> xr.DataArray:
    """Return the absolute value of a pressure."""
    return abs(one["pressure_real"] + 1j * one["pressure_imag"]).assign_attrs(units="Pa")
