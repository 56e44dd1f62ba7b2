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
from thesis_lib.plotting.style import DIVERGING
from thesis_lib.plotting.viewer_data import encoded
from thesis_lib.web.fragment import VIEWER_CSS, joined, static_html

WITHOUT = "This picture needs JavaScript; radiated.nc has the same field."
WALL = ", in a rigid wall"
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
    lines, bare = [], data.attrs["wall"] == "no"
    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        energy = f", {_pm(one, 'energy', '.3g')} J in all" if "energy" in one else ""
        of = f"sound power {'of the mode ' if energy else ''}at {_hertz(one)} Hz"
        without = f" {_without(one)}" if data.attrs["wall"] == "unknown" else ""
        lines += [f"{of} without a wall: {_bare(one)}"] if bare else []
        lines.append(
            f"{of}: {_power(one, '')}{energy}, radiation efficiency "
            f"{_pm(one, 'efficiency', '.3g')}, all in a rigid wall{without}"
        )
    if data.sizes["tone"] > 1:
        whole = _power(data.sel(band=ALL), "band_")
        lines.append(f"sound power of all together: {whole}, in a rigid wall")
    if "moment" in data.attrs:
        lines.append(_moment(data))
    return lines


def _moment(data: xr.Dataset) -> str:
    """When the powers are those of modes that die away."""
    return (
        f"the sound powers are those of one moment, {data.attrs['moment']:.3f} s on the first "
        "camera's clock, from which on each mode dies away"
    )


def _without(one: xr.Dataset) -> str:
    """How much less a structure radiates without a wall, in a bracket."""
    change, std = float(one["no_wall_change"]), float(one["no_wall_change_std"])
    below = f"air flows around its edges below about {float(one['no_wall_below']):.3g} Hz"
    if not np.isfinite(change):
        return f"(without one not estimated; {below})"
    way = "less" if change < 0 else "more"
    return f"(without one an estimated {abs(change):.1f} ± {std:.2g} dB {way}; {below})"


def _bare(one: xr.Dataset) -> str:
    """Estimated level without a wall."""
    change, std = float(one["no_wall_change"]), float(one["no_wall_change_std"])
    if not np.isfinite(change + float(one["power_level"])):
        return "not estimated"
    level, error = float(one["power_level"]) + change, np.hypot(std, one["power_level_error"])
    return f"an estimated {level:.1f} ± {error:.2g} dB re 1 pW on each side"


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
        html.details(f"Power by radiation mode{WALL}", ALONE + html.frame(_modes(data))),
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
        "words": f"Sound pressure at {float(one['frequency']):.4g} Hz above the structure in a "
        "rigid wall, in two planes through its centre. Its standard error is "
        f"{100 * share:.2g} % of the largest pressure (rms).",
    }
    return static_html(joined("radiated"), VIEWER_CSS, {"data": state}, WITHOUT)


def _powers(data: xr.Dataset) -> pd.DataFrame:
    """Power, energy and efficiency of each tone, and the power of all."""
    decays, rows = "energy" in data, []
    for tone in range(data.sizes["tone"]):
        one = data.isel(tone=tone)
        row = {"frequency in Hz": _hertz(one), **_row(one, "")}
        row |= {f"energy in J{WALL}": _pm(one, "energy", ".3g")} if decays else {}
        row |= {f"radiation efficiency{WALL}": _pm(one, "efficiency", ".3g")}
        row |= {"without a wall, dB": _change(one)} if data.attrs["wall"] != "yes" else {}
        rows.append(
            row | {"without a wall less below about, Hz": f"{float(one['no_wall_below']):.3g}"}
        )
    rows.append({"frequency in Hz": ALL, **_row(data.sel(band=ALL), "band_")})
    return pd.DataFrame(rows)


def _row(one: xr.Dataset, of: str) -> dict[str, str]:
    return {
        f"sound power in dB re 1 pW{WALL}": _pm(one, f"{of}power_level", ".1f"),
        "in W": _pm(one, f"{of}power", ".3g"),
    }


def _change(one: xr.Dataset) -> str:
    change, std = float(one["no_wall_change"]), float(one["no_wall_change_std"])
    return f"{change:+.1f} ± {std:.2g}" if np.isfinite(change) else "not estimated"


def _points(data: xr.Dataset) -> pd.DataFrame:
    """Levels at the points."""
    rows = []
    for tone in range(data.sizes["tone"]):
        for point in range(data.sizes["point"]):
            one = data.isel(tone=tone, point=point)
            size = one.assign(pressure=absolute(one))
            rows.append(
                {
                    "X, Y, Z in mm": place(one),
                    "frequency in Hz": _hertz(one),
                    f"pressure in Pa{WALL}": _pm(size, "pressure", ".3g"),
                    f"level in dB re 20 µPa{WALL}": _pm(one, "level", ".1f"),
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
            f"sound power in dB re 1 pW{WALL}": _pm(one, "band_power_level", ".1f"),
        }
        for point in range(one.sizes["point"]):
            here = one.isel(point=point)
            row[f"dB re 20 µPa at {place(here)} mm{WALL}"] = _pm(here, "band_level", ".1f")
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
    is_low = data["frequency"].values < data["no_wall_below"].values
    low = data.isel(tone=is_low & ~(data["no_wall_change"].values > 0))
    if data.attrs["wall"] != "yes" and low.sizes["tone"]:
        tones = [low.isel(tone=tone) for tone in range(low.sizes["tone"])]
        changes = "; ".join(f"at {_hertz(one)} Hz {_change(one)} dB" for one in tones)
        yield Note(
            "no-wall",
            "Without a wall the structure radiates less than pressures, fields and powers in a "
            f"rigid wall say, as estimated: {changes}.",
        )
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
    speed = float(data.attrs["speed_of_sound"])
    yield (
        "The structure lies in a rigid wall (a baffle) that is infinite, and radiates to one side "
        "into free space. Without one, air flows around its edges. The change of its power is then "
        "estimated for a thin structure that nothing surrounds, with neither frame nor supports."
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
