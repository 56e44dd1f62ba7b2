"""What plates without symmetry show: their modes, and what a mirror does to a single run.

Let cameras and plate be each other's mirror image in X = 0. Two markers at ±x then have mirrored
images, whole pixels included, and measured deflections of the same size: the literal run draws
half as many errors as there are markers. Random shifts of the pixel grids undo that.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.arrays import IntArray
from thesis_lib.facts import setups
from thesis_lib.figure_sets.parametric.parameters import camera_study
from thesis_lib.studies import outlines
from thesis_lib.vibration.finite_elements import plate_modes
from thesis_lib.vibration.meshing import triangulated
from thesis_lib.web.markdown import columns, markdown_table, table

PLATE = "plate-arrays"
NAMES = {PLATE: "rectangle", "shape-l": "L", "shape-holes": "holes"}
MIRRORED = ("4a", "4a'", "4b", "4d")  # sets of cameras that are their own mirror image in X = 0
SAME = 1e-7  # m: float32 on disk rounds 10 mm to less
SIZES_MM = (40.0, 20.0, 10.0)


def modes(cube: xr.Dataset) -> Markdown:
    """Frequencies beside those of the thesis's plate, and how evenly the markers move."""
    asked = camera_study(cube.attrs["figure_set"], json.loads(cube.attrs["parameters"]))
    structure, plate = asked.structure, setups.plate()
    highest = max(cube["mode"].values.tolist())
    rectangle = plate.angular_frequencies(highest) / (2 * np.pi)
    reference = np.abs(cube["reference_deflection"].values)
    rows = [
        [
            str(mode),
            f"{hertz:.1f}",
            f"{rectangle[mode - 1]:.1f}",
            f"{structure.shape_peak(mode):.2f}",
            f"{100 * np.mean(moved) / np.max(moved):.1f}",
        ]
        for mode, hertz, moved in zip(
            cube["mode"].values.tolist(), cube["frequency"].values, reference, strict=True
        )
    ]
    header = [
        "mode",
        "natural frequency, Hz",
        "of the whole plate, Hz",
        "peak over rms deflection",
        "mean deflection of the markers, % of the largest",
    ]
    return markdown_table(header, rows, f"{cube.sizes['point']} markers.")


@dataclass(frozen=True)
class Symmetry:
    """What a mirror does to one case of one structure."""

    #: Share of the markers with a mirrored partner on the plate whose literal deflections have the
    #: same size as their partner's
    same: float
    #: Root mean square of ln(error / law), of the literal runs and of the trials
    literal: float
    drawn: float
    #: Error over that of the rectangle, median over settings and modes, by trials and by the law
    simulated: float
    predicted: float


def symmetry(cube: xr.Dataset, plate: xr.Dataset, cases: Sequence[str]) -> Symmetry:
    """Compare cases of a cube with the same cases of the rectangle's cube."""
    rows, rows_ = (np.flatnonzero(np.isin(c["case"].values, cases)) for c in (cube, plate))
    part, whole = cube.isel(setting=rows), plate.isel(setting=rows_)
    one, other = _partners(part)
    size = np.abs(part["measured_deflection"].isel(trial=0).values)
    off = np.log(part["mean_error"].values / part["predicted_error"].values[..., None])
    rms = [np.sqrt(np.mean((c["mean_error"].values[..., 1:]) ** 2, axis=-1)) for c in (part, whole)]
    law = part["predicted_error"].values / whole["predicted_error"].values
    return Symmetry(
        float(np.mean(np.abs(size[..., one] - size[..., other]) < SAME)),
        float(np.sqrt(np.mean(off[..., 0] ** 2))),
        float(np.sqrt(np.mean(off[..., 1:] ** 2))),
        float(np.median(rms[0] / rms[1])),
        float(np.median(law)),
    )


def _partners(cube: xr.Dataset) -> tuple[IntArray, IntArray]:
    """Numbers of the markers at x < 0 and at −x, of those that have both; x from the middle."""
    half = np.array(outlines.extent(cube)) / 2
    x, y = (cube[axis].values - h for axis, h in zip(("x", "y"), half, strict=True))
    one, other = np.nonzero(
        (np.abs(x[:, None] + x) < 1e-9) & (np.abs(y[:, None] - y) < 1e-9) & (x[:, None] < -1e-9)
    )
    return one, other


def symmetries(opened: Mapping[str, xr.Dataset]) -> str:
    """The mirror's work in every case, for the rectangle, the L and the plate with holes."""
    cubes_ = {word: opened[name] for name, word in NAMES.items()}
    cases = dict.fromkeys(opened[PLATE]["case"].values.tolist())
    rows = []
    for case in cases:
        found = [symmetry(cube, opened[PLATE], [case]) for cube in cubes_.values()]
        rows.append(
            {
                "case": case + ("" if case in MIRRORED else " (not mirrored)"),
                "mirrored markers of the same size": " · ".join(f"{one.same:.0%}" for one in found),
                "literal run off the law, %": " · ".join(
                    f"{100 * one.literal:.1f}" for one in found
                ),
                "trials off the law, %": " · ".join(f"{100 * one.drawn:.1f}" for one in found),
            }
        )
    return columns(rows) + f"\nEach cell: {' · '.join(NAMES.values())}.\n"


def accuracies(opened: Mapping[str, xr.Dataset]) -> str:
    """Errors of the shapes over those of the rectangle, mode by mode, and how exact the law is."""
    plate, rows = opened[PLATE], []
    for name, word in list(NAMES.items())[1:]:
        cube = opened[name]
        rms = [
            np.sqrt(np.mean(c["mean_error"].values[..., 1:] ** 2, axis=-1)) for c in (cube, plate)
        ]
        ratio, laws = rms[0] / rms[1], [c["predicted_error"].values for c in (cube, plate)]
        exact = rms[0] / laws[0]
        for m, mode in enumerate(cube["mode"].values.tolist()):
            reference = [np.abs(c["reference_deflection"].values[m]) for c in (cube, plate)]
            even = [100 * np.mean(w) / np.max(w) for w in reference]
            rows.append(
                [
                    word,
                    str(mode),
                    f"{even[0]:.0f} ({even[1]:.0f})",
                    f"×{np.median(ratio[:, m]):.2f}",
                    f"×{np.median(laws[0][:, m] / laws[1][:, m]):.2f}",
                    f"×{ratio[:, m].min():.2f}–{ratio[:, m].max():.2f}",
                    f"{100 * (exact[:, m].min() - 1):+.1f} to {100 * (exact[:, m].max() - 1):+.1f}",
                ]
            )
    header = [
        "shape",
        "mode",
        "mean deflection of the markers, % (rectangle)",
        "error, over the rectangle's",
        "by the law",
        "range over 32 settings",
        "simulated from the law, %",
    ]
    return table([h.replace("32", str(plate.sizes["setting"])) for h in header], rows)


def convergence(_: Mapping[str, xr.Dataset]) -> str:
    """The rectangle by finite elements beside its closed form, and the order that shows."""
    plate = setups.plate()
    outline = ((0.0, 0.0), (plate.length, 0.0), plate.extent, (0.0, plate.width))
    exact = plate.angular_frequencies(3)
    off = []
    for size in SIZES_MM:
        mesh = triangulated(outline, (), size / 1000)
        edge = mesh.boundary_facets()
        found = plate_modes(mesh, edge[:0], edge, plate.poisson, 3)
        ratio = plate.bending_stiffness / plate.mass_per_area
        off.append(1 - np.sqrt(found.eigenvalues * ratio) / exact)
    rows = [
        [f"{size:g}", *(f"{100 * value:.3f}" for value in values)]
        for size, values in zip(SIZES_MM, off, strict=True)
    ]
    orders = np.polyfit(np.log(SIZES_MM), np.log(np.array(off)), 1)[0]
    rows.append(["order", *(f"{order:.2f}" for order in orders)])
    header = ["element, mm", *(f"mode {m}: too low by, %" for m in (1, 2, 3))]
    return table(header, rows)


PIECES = {
    "shapes-convergence": convergence,
    "shapes-accuracy": accuracies,
    "shapes-symmetry": symmetries,
}
