"""The report of several modes: one page that loads nothing, its pictures, lines for the screen."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.arrays import Mask
from thesis_lib.measure.modes.search import STANDS_OUT
from thesis_lib.measure.radiation.files import MEANINGS as SOUND_FILES
from thesis_lib.measure.radiation.report import sound_section
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import html
from thesis_lib.measure.report.figures import WIDE
from thesis_lib.measure.report.meanings import Note
from thesis_lib.measure.report.notes import note_pace, note_repeats, source_of_size
from thesis_lib.measure.report.page import Pictures
from thesis_lib.measure.report.tables import texts
from thesis_lib.measure.report.view import shape_view
from thesis_lib.plotting.style import HIGHLIGHT, REFERENCE, color, in_style, saved, subplots
from thesis_lib.web.shell import shell

SAME_F, SAME_DAMPING = 0.01, 0.05  # relative, within which a pole holds from fit to fit
CLOSE = 10.0  # power left near a mode over noise, from which on it is told
ALIKE = 0.9  # MAC from which on two shapes are hardly told apart
UNSURE = 0.2  # relative error of a damping ratio, from which on it is told
LOST = 0.05  # share of the frames from which on a camera's lost markers are told
STRAYS = 0.01  # share of the centres that are left out, from which on it is told
FILES = (
    "modes.nc: frequencies, damping, shapes and all they rest on (xarray)",
    "modes.csv, shapes.csv: the tables, for any spreadsheet",
    "modes.uff: geometry and every mode, datasets 15, 82 and 55 (modal software)",
    "vtk/mode-1/period.pvd and so on: one period of each mode for ParaView",
    "mode-1.mp4, mode-1.gif and so on: each mode in motion",
    "motion.nc, motion.csv, motion.uff: every marker from frame to frame, if no mode is too fast",
    "response.nc, response.uff: motion over force, if a force was recorded",
    "cameras.yaml, cameras.toml: the calibrated cameras for OpenCV, and for aniposelib",
    "calibration.nc: the same with their errors, as calibration of another manifest can reuse it",
)


def figures(data: xr.Dataset) -> Pictures:
    """The pictures of the report, by name."""
    made = {"stabilisation": stabilisation(data), "assurance": assurance(data)}
    return {name: ("svg", saved(figure, "svg")) for name, figure in made.items()}


def holds(data: xr.Dataset) -> Mask:
    """Which poles are where they were in the fit with one mode less, (orders, places)."""
    f, zeta = data["order_frequency"].values, data["order_damping"].values
    kept = np.zeros(f.shape, bool)
    for n in range(1, len(f)):
        with np.errstate(invalid="ignore", divide="ignore"):
            near = np.abs(f[n][:, None] / f[n - 1] - 1) < SAME_F
            near &= np.abs(zeta[n][:, None] - zeta[n - 1]) <= SAME_DAMPING * np.abs(zeta[n - 1])
        kept[n] = near.any(axis=1)
    return kept


def stabilisation(data: xr.Dataset) -> Figure:
    """The spectrum, and the poles of the fits with one mode, two modes and so on."""
    with in_style():
        figure, (top, low) = subplots(2, 1, figsize=(WIDE, 5.0), layout="constrained", sharex=True)
        for name, ink in (("before", color(0)), ("after", REFERENCE)):
            label = "tracks" if name == "before" else "what the modes leave"
            top.semilogy(data["line"], data[name], color=ink, linewidth=0.8, label=label)
        top.axhline(STANDS_OUT, color=HIGHLIGHT, linewidth=0.6, label="stands out")
        top.set(ylabel="power over noise")
        top.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        top.legend(ncols=3)
        f, kept = data["order_frequency"].values, holds(data)
        orders = np.broadcast_to(np.arange(1, len(f) + 1)[:, None], f.shape)
        known = np.isfinite(f)
        low.plot(f[known & kept], orders[known & kept], "o", color=color(0), label="holds")
        low.plot(
            f[known & ~kept], orders[known & ~kept], "x", color=HIGHLIGHT, label="new, or moved"
        )
        for value in data["frequency"].values:
            low.axvline(value, color=REFERENCE, linewidth=0.6, zorder=0)
        low.set(xlabel="frequency in Hz", ylabel="modes fitted", yticks=np.arange(1, len(f) + 1))
        low.legend()
    return figure


def assurance(data: xr.Dataset) -> Figure:
    """The MAC matrix of the modes among each other."""
    mac = data["assurance"].values
    names = [f"{f:.4g}" for f in data["frequency"].values]
    with in_style():
        figure, axes = subplots(figsize=(4.2, 3.6), layout="constrained")
        drawn = axes.imshow(mac, cmap="viridis", vmin=0, vmax=1)
        for (i, j), value in np.ndenumerate(mac):
            ink = "black" if value > 0.6 else "white"
            axes.text(j, i, f"{value:.3f}", ha="center", va="center", color=ink, fontsize=7)
        axes.set(
            xticks=range(len(names)), yticks=range(len(names)), xticklabels=names,
            yticklabels=names, xlabel="frequency in Hz", ylabel="frequency in Hz",
        )  # fmt: skip
        axes.grid(visible=False)
        figure.colorbar(drawn, ax=axes, label="MAC")
    return figure


def modes(data: xr.Dataset) -> pd.DataFrame:
    """The modes as a table of texts."""
    size = 1e3 * np.nanmax(
        np.hypot(data["amplitude_real"].values, data["amplitude_imag"].values), axis=1
    )
    damped = data["damping"].values != 0
    table = {
        "mode": np.arange(1, len(size) + 1),
        "frequency in Hz": texts(data["frequency"].values, "#.6g"),
        "± Hz": texts(data["frequency_deviation"].values, ".1g"),
        "damping in %": texts(np.where(damped, 100 * data["damping"].values, np.nan), "#.4g"),
        "± %": texts(np.where(damped, 100 * data["damping_deviation"].values, np.nan), ".1g"),
        "largest amplitude in mm": texts(size, "#.4g"),
        "± mm, a marker": texts(1e3 * np.sqrt((data["standard_error"] ** 2).mean("marker").values),
                                ".2g"),
    }  # fmt: skip
    if data.sizes["candidate"]:
        best = np.argmax(np.nan_to_num(data["mac"].values), axis=1)
        table["most similar"] = data["candidate"].values[best]
        table["MAC"] = texts(data["mac"].values[np.arange(len(best)), best], ".5f")
    return pd.DataFrame(table)


def shapes(data: xr.Dataset) -> pd.DataFrame:
    """Every marker's complex amplitudes and their errors, in mm."""
    table = pd.DataFrame({f"{k}_mm": np.round(1e3 * data[k].values, 6) for k in ("x", "y")})
    table.insert(0, "marker", np.arange(1, len(table) + 1))
    for k in range(data.sizes["mode"]):
        one = data.isel(mode=k)
        for part in ("real", "imag"):
            values = 1e3 * one[f"amplitude_{part}"].values
            table[f"mode_{k + 1}_{part}_mm"] = np.round(values, 7)
        table[f"mode_{k + 1}_standard_error_mm"] = np.round(1e3 * one["standard_error"].values, 7)
    return table


def summary(data: xr.Dataset) -> list[str]:
    """What was found, in a few lines."""
    lines = []
    for _, row in modes(data).iterrows():
        damping = "" if row["damping in %"] == "—" else (
            f", damping {row['damping in %']} ± {row['± %']} %")  # fmt: skip
        like = f", most similar to {row['most similar']}: MAC {row['MAC']}" if "MAC" in row else ""
        lines.append(
            f"mode {row['mode']}: {row['frequency in Hz']} ± {row['± Hz']} Hz{damping}, up to "
            f"{row['largest amplitude in mm']} mm{like}"
        )
    begin, end = data["window"].values
    lines.append(f"from {begin:.3f} to {end:.3f} s on the first camera's clock")
    return lines


def notes(data: xr.Dataset, manifest: Manifest) -> Iterator[Note]:
    """What a reader should know before trusting the result."""
    yield from note_repeats(data)
    hertz, sought = data["frequency"].values, manifest.excitation.modes
    seconds = float(np.diff(data["window"].values)[0])
    if sought.count and len(hertz) < sought.count:
        yield Note(
            "fewer-modes",
            f"{len(hertz)} of the {sought.count} modes that are asked for stand out of the noise: "
            "tap or drive harder or elsewhere, film nearer, or ask for fewer.",
        )
    for k, f in enumerate(hertz):
        one = data.isel(mode=k)
        own, other = float(one["out_of_step"]), float(one["rival_out_of_step"])
        if other < 3 * own:
            yield Note(
                "mode-alias",
                f"{f:.6g} Hz may be an alias of {float(one['rival']):.6g} Hz: cameras are "
                f"{own:.0f}° out of step with the one, {other:.0f}° with the other. Film with "
                "unlike frame rates, or narrow modes.from_hz and to_hz.",
            )
        if float(one["beside"]) > CLOSE:
            yield Note(
                "left-near-mode",
                f"Near {f:.5g} Hz {float(one['beside']):.0f} times the noise is left: another "
                f"mode closer than the {1 / seconds:.2g} Hz that {seconds:.3g} s tell apart, or a "
                "vibration that changes. Film longer, or end steady_s before it changes.",
            )
        error, zeta = float(one["damping_deviation"]), float(one["damping"])
        if zeta and error > UNSURE * abs(zeta):
            yield Note(
                "damping-unsure",
                f"The damping at {f:.5g} Hz is known to {error / abs(zeta):.0%} only: film longer "
                "or nearer, or tap where this mode moves most.",
            )
    mac = np.triu(data["assurance"].values, 1)
    for i, j in np.argwhere(mac > ALIKE):
        yield Note(
            "shapes-alike",
            f"The shapes at {hertz[i]:.5g} and {hertz[j]:.5g} Hz look alike at these markers (MAC "
            f"{mac[i, j]:.2f}): add markers where they differ, as between those there are.",
        )
    for k, name in enumerate(data["camera"].values):
        if (lost := float(data["missing"][k].mean())) > LOST:
            yield Note(
                "markers-lost",
                f"Camera {name} lost {lost:.0%} of its marker images.",
            )
        if (strays := float(data["left_out"][k])) > STRAYS:
            yield Note(
                "markers-strayed",
                f"{strays:.1%} of camera {name}'s marker images move unlike those beside them, and "
                "were left out.",
            )
        yield from of_clock(
            str(name), str(data["camera"].values[0]), float(data["lag"][k]), float(data["pace"][k])
        )


def of_clock(name: str, first: str, late: float, pace: float) -> Iterator[Note]:
    """What was corrected of a camera's clock: a start that was late by some s, a relative pace."""
    if late:
        yield Note(
            "start-by-pictures",
            f"By the pictures camera {name} started {1e3 * abs(late):.2g} ms "
            f"{'later' if late > 0 else 'earlier'} than by the sound; the pictures decide.",
        )
    if pace:
        yield note_pace(name, first, pace)


def page(
    data: xr.Dataset,
    manifest: Manifest,
    pictures: Pictures,
    further: str = "",
    radiated: xr.Dataset | None = None,
) -> str:
    """The report as one HTML page, with sections on force and sound where there are any."""
    extent = manifest.structure.length_mm / 1e3, manifest.structure.width_mm / 1e3
    parts = [
        f"<h1>{escape(data.attrs['title'])}</h1>",
        html.items(summary(data)),
        html.warned([*notes(data, manifest)]),
        "<h2>Modes</h2>" + html.frame(modes(data)),
        html.figure(
            pictures, "stabilisation",
            "Above, the power of all tracks over the noise, before and after the modes are taken "
            "away. Below, the frequencies of fits with one mode, two modes, and so on: what is a "
            "mode of the structure stays when another one is added.",
        ),
        html.figure(
            pictures, "assurance",
            "Modal assurance criterion of the shapes among each other: 1 on the diagonal, and near "
            "0 beside it if the markers tell the shapes apart.",
        ),
        *(
            f"<h2>Mode {k + 1}: {float(f):.5g} Hz</h2>"
            + shape_view(data.isel(mode=k), extent)
            for k, f in enumerate(data["frequency"].values)
        ),
        html.details("The numbers, marker by marker", html.frame(shapes(data))),
        "" if radiated is None else sound_section(radiated, manifest),
        further and f"<h2>Motion over force</h2>{further}",
        "<h2>Files</h2>" + html.items([*FILES, *(() if radiated is None else SOUND_FILES)]),
        "<h2>What was assumed</h2>" + html.items(assumed(data, manifest)),
        html.details("Synchronisation", html.items(str(data.attrs["synchronisation"]).split("\n"))),
        html.details("The manifest", f"<pre>{escape(manifest.model_dump_json(indent=1))}</pre>"),
    ]  # fmt: skip
    return shell(data.attrs["title"], "\n".join(part for part in parts if part))


def assumed(data: xr.Dataset, manifest: Manifest) -> Iterator[str]:
    """What the result rests on and nothing in it can prove."""
    yield (
        f"The size of everything comes from {source_of_size(manifest)}; by "
        f"that the markers' grid is {100 * (float(data['grid_scale']) - 1):+.3f} % larger than the "
        "manifest says."
    )
    yield "The structure is flat at rest, and moves along its normal."
    if manifest.excitation.kind == "decay":
        yield "Nothing drives the structure in the part that is fitted: each mode decays freely."
    else:
        yield "Each tone is steady. Its shape is that of the motion, which may hold several modes."
    yield (
        "Standard errors are those by the scatter of the centres, times what cameras disagree by, "
        "what is left near a mode, and what markers seem to do in the plane, where that is more; "
        "frequency and damping also hold what a further mode, fitted beside them, changes."
    )
