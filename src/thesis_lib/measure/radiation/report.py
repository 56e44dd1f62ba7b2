"""The sound in the report: in words and numbers, as fields that play, and what was assumed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
import xarray as xr

from thesis_lib.measure.radiation.bands import ALL
from thesis_lib.measure.radiation.files import absolute, place
from thesis_lib.measure.radiation.radiated import complex_of
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import html
from thesis_lib.measure.report.meanings import Note
from thesis_lib.plotting.maps import DIVERGING
from thesis_lib.plotting.viewer_data import encoded
from thesis_lib.web.fragment import VIEWER_CSS, joined, static_html

WITHOUT = "This picture needs JavaScript; radiated.nc has the same field."
HEARD = 20.0  # Hz; below, nobody hears it
ALONE = (
    "<p>Radiation modes are ways of moving that radiate one beside the other, without "
    "interference: their powers add up.</p>"
)
LEFT = 3.0  # times what noise explains, from which on what a surface leaves is told


def summary(data: xr.Dataset | None) -> list[str]:
    """What was found, in a few lines; none if no sound was asked for."""
    if data is None:
        return []
    lines = []
    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        energy = f", {_pm(one, 'energy', '.3g')} J in all" if "energy" in one else ""
        lines.append(
            f"sound power {'of the mode ' if energy else ''}at {_hertz(one)} Hz: "
            f"{_power(one, '')}{energy}, radiation efficiency {_pm(one, 'efficiency', '.3g')}"
        )
    if data.sizes["tone"] > 1:
        lines.append(f"sound power of all together: {_power(data.sel(band=ALL), 'band_')}")
    if "moment" in data.attrs:
        lines.append(_moment(data))
    return lines


def _moment(data: xr.Dataset) -> str:
    """When the powers are those of modes that die away."""
    return (
        f"the sound powers are those of one moment, {data.attrs['moment']:.3f} s on the first "
        "camera's clock, from which on each mode dies away"
    )


def _power(one: xr.Dataset, of: str) -> str:
    level, power = _pm(one, f"{of}power_level", ".1f"), _pm(one, f"{of}power", ".3g")
    return f"{level} dB re 1 pW ({power} W)"


def _hertz(one: xr.Dataset) -> str:
    return f"{float(one['frequency']):.4g}"


def _pm(one: xr.Dataset, name: str, form: str) -> str:
    """A number with its standard error."""
    value, error = float(one[name]), float(one[f"{name}_error"])
    return f"{value:{form}} ± {error:.2g}" if np.isfinite(value) else "unknown"


def sound_section(data: xr.Dataset, manifest: Manifest) -> str:
    """A part of the report: levels, fields, modes, warnings, assumptions."""
    several = data.sizes["tone"] > 1
    parts = [
        "<h2>Sound</h2>",
        html.frame(_powers(data)) if several else html.items(summary(data)),
        html.items([_moment(data)]) if several and "moment" in data.attrs else "",
        html.warned([*_notes(data)]),
        *(_played(data.isel(tone=tone), manifest) for tone in range(data.sizes["tone"])),
        "<h3>At the points</h3>" + html.frame(_points(data)),
        "<h3>By octave</h3>" + html.frame(_bands(data)) if several else "",
        html.details("Power by radiation mode", ALONE + html.frame(_modes(data))),
        html.details("What the sound rests on", html.items(_assumed(data, manifest))),
    ]
    return "\n".join(part for part in parts if part)


def _played(one: xr.Dataset, manifest: Manifest) -> str:
    """The field of one tone, moving."""
    u, z = 1000 * one["u"].values, 1000 * one["z"].values
    field = complex_of(one, "field")
    names = [str(name) for name in one["plane"].values]
    size = {"X": manifest.structure.length_mm / 2, "Y": manifest.structure.width_mm / 2}
    share = float(np.sqrt(np.mean(one["field_error"].values ** 2)) / np.abs(field).max())
    state = {
        "planes": [
            {
                "name": name,
                "u_mm": [float(u[0]), float(u[-1])],
                "z_mm": [float(z[0]), float(z[-1])],
                "shape": [len(u), len(z)],
            }
            for name in names
        ],
        "fields": [encoded(part) for part in field],
        "halves": [size[name[0]] for name in names],
        "frequency": float(one["frequency"]),
        "colormap": list(DIVERGING),
        "words": f"Sound pressure at {float(one['frequency']):.4g} Hz above the structure, in two "
        f"planes through its centre. Its standard error is {100 * share:.2g} % of the largest "
        "pressure (rms).",
    }
    return static_html(joined("radiated"), VIEWER_CSS, {"data": state}, WITHOUT)


def _powers(data: xr.Dataset) -> pd.DataFrame:
    """Power, energy and efficiency of each tone, and the power of all."""
    decays, rows = "energy" in data, []
    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        row = {"frequency in Hz": _hertz(one), **_row(one, "")}
        row |= {"energy in J": _pm(one, "energy", ".3g")} if decays else {}
        rows.append(row | {"radiation efficiency": _pm(one, "efficiency", ".3g")})
    rows.append({"frequency in Hz": ALL, **_row(data.sel(band=ALL), "band_")})
    return pd.DataFrame(rows)


def _row(one: xr.Dataset, of: str) -> dict[str, str]:
    return {
        "sound power in dB re 1 pW": _pm(one, f"{of}power_level", ".1f"),
        "in W": _pm(one, f"{of}power", ".3g"),
    }


def _points(data: xr.Dataset) -> pd.DataFrame:
    """Levels at the points."""
    rows = []
    for tone in range(data.sizes["tone"]):
        for point in range(data.sizes["point"]):
            one = data.isel(tone=tone, point=point)
            rows.append(
                {
                    "X, Y, Z in mm": place(one),
                    "frequency in Hz": _hertz(one),
                    "pressure in Pa": _pm(one.assign(pressure=absolute(one)), "pressure", ".3g"),
                    "level in dB re 20 µPa": _pm(one, "level", ".1f"),
                }
            )
    return pd.DataFrame(rows)


def _bands(data: xr.Dataset) -> pd.DataFrame:
    """Sound power, and levels at the points, by octave."""
    rows = []
    for band in data["band"].values:
        one = data.sel(band=band)
        row = {
            "octave in Hz": band,
            "sound power in dB re 1 pW": _pm(one, "band_power_level", ".1f"),
        }
        for point in range(one.sizes["point"]):
            here = one.isel(point=point)
            row[f"dB re 20 µPa at {place(here)} mm"] = _pm(here, "band_level", ".1f")
        rows.append(row)
    return pd.DataFrame(rows)


def _modes(data: xr.Dataset) -> pd.DataFrame:
    """Power by radiation mode, in % of all."""
    frame = pd.DataFrame({"mode": np.arange(1, data.sizes["mode"] + 1)})
    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        whole = float(one["power"])
        frame[f"share at {float(one['frequency']):.4g} Hz in %"] = [
            f"{100 * value / whole:.2f} ± {100 * error / whole:.2g}"
            for value, error in zip(
                one["mode_power"].values, one["mode_power_error"].values, strict=True
            )
        ]
    return frame


def _notes(data: xr.Dataset) -> Iterator[Note]:
    """What a reader should know before trusting the sound."""
    highest, step = float(data.attrs["highest"]), 1000 * float(data.attrs["spacing"])
    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        hertz = float(one["frequency"])
        if hertz > highest:
            yield Note(
                "waves-too-short",
                f"At {hertz:.4g} Hz flexural waves of the manifest's material are shorter than "
                f"two spacings of {step:.3g} mm, which markers tell up to {highest:.4g} Hz: put "
                "them closer, or film lower frequencies.",
            )
        left, noise = float(one["left"]), float(one["left_by_noise"])
        if left > LEFT * noise:
            what = "the model's modes leave" if data.attrs["between"] == "model" else "others miss"
            yield Note(
                "surface-unknown",
                f"At {hertz:.4g} Hz {what} {left:.1%} of the markers' motion, noise explains "
                f"{noise:.1%}: between markers the surface is no better known, which standard "
                "errors do not hold. More markers would tell.",
            )
        if hertz < HEARD:
            yield Note(
                "not-heard",
                f"{hertz:.4g} Hz is below what is heard; the sound files hold it nevertheless.",
            )


def _assumed(data: xr.Dataset, manifest: Manifest) -> Iterator[str]:
    """What the sound rests on and nothing in it can prove."""
    step, highest = 1000 * float(data.attrs["spacing"]), float(data.attrs["highest"])
    if data.attrs["between"] == "model":
        yield (
            f"Between markers the {manifest.structure.kind} moves as the first "
            f"{data.attrs['modes']} modes of its model do, fitted to all markers."
        )
    else:
        held = int(data.attrs["held"])
        still = f", at rest along {held} edges" if held else ", with free edges"
        yield f"Between markers the surface is a thin plate spline through all of them{still}."
    yield (
        f"Markers are up to {step:.3g} mm apart: they tell flexural waves of {2 * step:.3g} mm and "
        f"longer, which the manifest's material has up to {highest:.4g} Hz."
    )
    length = max(manifest.structure.length_mm, manifest.structure.width_mm) / 1000
    speed = float(data.attrs["speed_of_sound"])
    yield (
        "The structure lies in a rigid wall (a baffle) that is infinite, and radiates to one side "
        "into free space. Without one, air flows around its edges: below about "
        f"{speed / (2 * length):.3g} Hz, where half a wave is longer than the structure, it then "
        "radiates less, and nearly nothing far below."
    )
    yield (
        f"The air has {speed:g} m/s and {float(data.attrs['air_density']):g} kg/m³; it does not "
        "change how the structure moves, and there is no room around it."
    )
    if data.sizes["tone"] > 1:
        yield (
            "Powers of all together, and of octaves, are means over times that are long against "
            "the beats of their tones. The sound files hold the tones with the phases that were "
            "measured."
        )
    if "moment" in data.attrs:
        way = float(np.linalg.norm(data["place"].values, axis=1).max())
        lost = float(data["decay"].max()) * way / speed
        yield (
            "A mode that dies away counts as the steady tone that it is at one moment. At the "
            f"farthest point, {way:.3g} m away, what is heard left the structure when it moved up "
            f"to {100 * lost:.2g} % more."
        )
    yield (
        "Standard errors come from those of the markers, from the covariance of the calibration, "
        "which moves all markers and all tones together, and from an error of size where the grid "
        "does not fit; of a decay also from how well it is known. Frequencies count as exact. The "
        "power that errors of the markers have of their own is taken off."
    )
