"""Figures of a measurement: shape, cameras, residuals, modes, response; and their data."""

from collections.abc import Sequence
from itertools import compress
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.arrays import Array, Image, Mask, stack_padded
from thesis_lib.measure.feasibility import assess, prediction
from thesis_lib.measure.fitting.frequency import in_step
from thesis_lib.measure.modes.poles import MIN_LINE_POWER_RATIO
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.recordings.manifest import Manifest, ManifestError
from thesis_lib.measure.recordings.validation import markers_of
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.plotting import style
from thesis_lib.plotting.style import HIGHLIGHT_COLOR, REFERENCE_COLOR, cycle_color, in_style
from thesis_lib.studies.cubes import complex_of, iterate_slices
from thesis_lib.studies.schema import label_values, read_variables
from thesis_lib.vision.pinhole import project_points

MAX_FRAMES = 2000  # last frames of a camera in the figure of the motion
VARIABLES = read_variables(__file__, "first_frames")
WIDTH_IN = 7.6
NARROW_WIDTH_IN = 5.6  # legible on a phone
MAX_PHOTOGRAPH_PX = 1000  # width at which photographs are stored
BAR_SIGMAS = 2  # standard errors that bars show
# Relative changes within which a pole is the same from one fit to the next
MAX_POLE_SHIFT, MAX_POLE_DAMPING_CHANGE = 0.01, 0.05


def collect_diagnostics(
    data: xr.Dataset, moved: xr.Dataset, manifest: Manifest, recordings: Sequence[Recording]
) -> xr.Dataset:
    """Collect the data that figures of a report need in addition to the result.

    `data` is what :func:`~thesis_lib.measure.fitting.result.shape_result` returns, with ``steady``,
    `moved` the :func:`~thesis_lib.measure.exchange.history.time_histories`. Clocks are corrected as
    for these. Tracks are padded with NaN where a camera has fewer frames than another.
    """
    marker = int(np.nanargmax(np.abs(data["deflection"].values)))
    begin, end = data["steady"].values
    sides, times, tracks = [], [], []
    for own in in_step(data, recordings):
        t, uv = own.read_tracks(max(begin, end - MAX_FRAMES / own.rate), end)
        seen = uv[:, :, marker]
        side = int(np.nanargmax(np.nan_to_num(np.nanstd(seen, axis=0))))  # u or v, with more motion
        sides.append(side)
        times.append(t)
        tracks.append(seen[:, side] - np.nanmean(seen[:, side]))
    markers = markers_of(manifest)
    R, origin = data["frame_rotation"].values, data["frame_origin"].values
    corners = R.T @ on_surface(markers.extent, markers.corners) + origin[:, None]
    values = {
        "found": [own.centres[0] for own in recordings],
        "outline": [project_points(own.camera, corners) for own in recordings],
        "track_side": sides,
        "track_time": stack_padded(times),
        "track": stack_padded(tracks),
        "residual": moved["residual"].values,
    }
    places = {"camera": data["camera"], "time": moved["time"]}
    return xr.Dataset(label_values(values, VARIABLES), places)


@in_style()
def draw_shape(data: xr.Dataset, manifest: Manifest) -> Figure:
    """Draw the deflection of every marker with its standard error, and the most similar mode."""
    rows = markers_of(manifest).rows
    if len(rows) > 6 or max(row.stop - row.start for row in rows) < 4:
        return _draw_map(data, manifest)
    figure, axes = style.subplots(figsize=(WIDTH_IN, 3.6))
    x, y = 1e3 * data["x"].values, 1e3 * data["y"].values
    w, error = 1e3 * data["deflection"].values, 1e3 * data["standard_error"].values
    reference = 1e3 * data["reference_deflection"].values
    for k, row in enumerate(rows):
        if np.isfinite(reference[row]).any():
            name = data.attrs["most_similar"] if k == 0 else None
            axes.plot(x[row], reference[row], color=REFERENCE_COLOR, linewidth=2.5, label=name)
        bars: Any = {"fmt": ".-", "color": cycle_color(k), "linewidth": 0.9, "capsize": 2}
        label = f"row at y = {y[row][0]:.4g} mm"
        axes.errorbar(x[row], w[row], BAR_SIGMAS * error[row], label=label, **bars)
    title = f"deflection at its maximum; bars are {BAR_SIGMAS} standard errors"
    axes.set(xlabel="x in mm", ylabel="deflection in mm", title=title)
    axes.legend()
    return figure


def _draw_map(data: xr.Dataset, manifest: Manifest) -> Figure:
    panels = {
        "deflection in mm": 1e3 * data["deflection"].values,
        "standard error in mm": 1e3 * data["standard_error"].values,
    }
    if np.isfinite(data["reference_deflection"].values).any():
        panels[f"{data.attrs['most_similar']} in mm"] = 1e3 * data["reference_deflection"].values
    side = WIDTH_IN / len(panels)
    height = side * manifest.structure.width_mm / manifest.structure.length_mm + 0.9
    figure, axes = style.subplots(1, len(panels), figsize=(WIDTH_IN, min(height, 6)), squeeze=False)
    most = float(np.nanmax(np.abs(panels["deflection in mm"])))
    for panel, (title, values) in zip(axes[0], panels.items(), strict=True):
        signed = {"cmap": "PuOr", "vmin": -most, "vmax": most}
        look = {"cmap": "viridis"} if "error" in title else signed
        drawn = _scatter_markers(panel, manifest, values, **look)
        panel.set(title=title)
        figure.colorbar(drawn, ax=panel, orientation="horizontal", fraction=0.08)
    axes[0, 0].set_ylabel("y in mm")
    return figure


def _scatter_markers(axes: Axes, manifest: Manifest, values: Array, **look: Any) -> Any:
    """Draw values of the markers at their places on the structure."""
    structure = manifest.structure
    limits = {"xlim": (0, structure.length_mm), "ylim": (0, structure.width_mm)}
    axes.set(aspect="equal", xlabel="x in mm", **limits)
    x, y = 1e3 * structure.marker_points
    return axes.scatter(x, y, c=values, s=24, **look)


@in_style()
def draw_cameras(data: xr.Dataset, manifest: Manifest) -> Figure:
    """Draw the positions of the cameras from above and from the side."""
    figure, axes = style.subplots(1, 2, figsize=(WIDTH_IN, 3.4))
    length, width = manifest.structure.length_mm, manifest.structure.width_mm
    centre = 1e3 * data["camera_centre"].values
    rest = 1e3 * data["rest_position"].values
    x = length / 2 * np.array([-1, 1, 1, -1, -1])
    views = {"(a) from above": (1, width / 2), "(b) from the side": (2, 0.0)}
    for panel, (title, (up, half)) in zip(axes, views.items(), strict=True):
        panel.plot(x, half * np.array([-1, -1, 1, 1, -1]), color=REFERENCE_COLOR)
        panel.plot(rest[0], rest[up], ".", color=REFERENCE_COLOR, markersize=2)
        for k, name in enumerate(style.drawable_names(data["camera"].values, "camera")):
            place, ink = centre[k, [0, up]], cycle_color(k)
            panel.plot([place[0], 0], [place[1], 0], color=ink, linewidth=0.6)
            panel.plot(*place, "s", color=ink)
            panel.annotate(name, place, xytext=(5, 5), textcoords="offset points")
        panel.set(aspect="equal", xlabel="x in mm", ylabel=f"{'xyz'[up]} in mm", title=title)
        panel.margins(0.12, 0.12 if up == 1 else 0.35)  # room for names of cameras at one height
    return figure


@in_style()
def draw_corners(data: xr.Dataset) -> Figure:
    """Draw the residuals of the board's corners after the adjustment, camera by camera."""
    residuals = data["residuals"].values
    figure, axes = style.subplots(figsize=(4.2, 3.8))
    for k, name in enumerate(style.drawable_names(data["camera"].values, "camera")):
        u, v = residuals[k].swapaxes(0, 1).reshape(2, -1)
        axes.plot(u, v, ".", color=cycle_color(k), markersize=2, alpha=0.5, label=name)
    most = 1.05 * float(np.nanmax(np.abs(residuals)))
    axes.set(aspect="equal", xlim=(-most, most), ylim=(-most, most))
    axes.set(xlabel="u in px", ylabel="v in px", title="corners seen minus computed")
    axes.legend(markerscale=4, ncols=2)
    return figure


@in_style()
def draw_motion(data: xr.Dataset, seen: xr.Dataset) -> Figure:
    """Draw the tracks of the marker with the largest deflection, folded into one period."""
    period = 1 / float(data["frequency"])
    names = style.drawable_names([f"camera {name}" for name in seen["camera"].values], "camera")
    figure, panels = style.panel_grid(len(names), WIDTH_IN, 1.75, sharex=True)
    for k, one in enumerate(iterate_slices(seen, "camera")):
        turns = (one["track_time"].values % period) / period
        panels[k].plot(turns, one["track"], ".", color=cycle_color(k), markersize=3)
        panels[k].set(title=f"{names[k]}, {'uv'[int(one['track_side'])]} in px")
    for panel in panels[-2:]:
        panel.set_xlabel("time in periods")
    return figure


@in_style()
def draw_residuals(seen: xr.Dataset) -> Figure:
    """Draw the rms residual of a coordinate of each camera's centres, frame by frame."""
    figure, axes = style.subplots(figsize=(WIDTH_IN, 2.8))
    for k, name in enumerate(style.drawable_names(seen["camera"].values, "camera")):
        axes.plot(seen["time"], seen["residual"][k], color=cycle_color(k), label=name)
    axes.set(xlabel="time in s", ylabel="rms residual in px", ylim=(0, None))
    axes.legend(ncols=4)
    return figure


@in_style()
def draw_photograph(image: Image, found: Array, outline: Array) -> Figure:
    """Draw the first frame of a camera, with the markers found and the structure's outline."""
    height, width = image.shape
    around = np.column_stack([found[:, np.isfinite(found[0])], outline])
    margin = 0.04 * width
    left, top = np.clip(np.min(around, axis=1) - margin, 0, None)
    right, bottom = np.minimum(np.max(around, axis=1) + margin, (width, height))
    step = max(int(right - left) // MAX_PHOTOGRAPH_PX, 1)
    figure = Figure(figsize=(WIDTH_IN, WIDTH_IN * (bottom - top) / (right - left)))
    axes: Axes = figure.add_axes((0, 0, 1, 1))
    extent = (0, width, height, 0)
    axes.imshow(image[::step, ::step], cmap="gray", vmin=0, vmax=255, extent=extent)
    axes.plot(*found, "+", color=HIGHLIGHT_COLOR, markersize=5, markeredgewidth=0.8)
    closed = np.column_stack([outline, outline[:, :1]])
    axes.plot(*closed, color=style.CYCLE_COLORS[5], linewidth=0.8)
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.set_axis_off()
    return figure


def _stable_poles(data: xr.Dataset) -> Mask:
    """Return which poles agree with one of the fit with one mode less, (orders, poles)."""
    f, zeta = data["order_frequency"].values, data["order_damping"].values
    stable = np.zeros(f.shape, bool)
    for n in range(1, len(f)):
        most = MAX_POLE_DAMPING_CHANGE * np.abs(zeta[n - 1])
        with np.errstate(invalid="ignore", divide="ignore"):
            near = np.abs(f[n][:, None] / f[n - 1] - 1) < MAX_POLE_SHIFT
            near &= np.abs(zeta[n][:, None] - zeta[n - 1]) <= most
        stable[n] = near.any(axis=1)
    return stable


@in_style()
def draw_stabilisation(data: xr.Dataset) -> Figure:
    """Draw the spectrum, and the poles of the fits with one mode, two modes and so on."""
    figure, (top, low) = style.subplots(2, 1, figsize=(WIDTH_IN, 5.0), sharex=True)
    top.semilogy(data["line"], data["before"], color=cycle_color(0), linewidth=0.8, label="tracks")
    label = "residual of the modes"
    top.semilogy(data["line"], data["after"], color=REFERENCE_COLOR, linewidth=0.8, label=label)
    top.axhline(
        MIN_LINE_POWER_RATIO, color=HIGHLIGHT_COLOR, linewidth=0.6, label="threshold of a mode"
    )
    top.set(ylabel="power over noise")
    top.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    top.legend(ncols=3)
    f, kept = data["order_frequency"].values, _stable_poles(data)
    orders = np.broadcast_to(np.arange(1, len(f) + 1)[:, None], f.shape)
    new = np.isfinite(f) & ~kept
    low.plot(f[kept], orders[kept], "o", color=cycle_color(0), label="stable")
    low.plot(f[new], orders[new], "x", color=HIGHLIGHT_COLOR, label="new, or moved")
    for value in data["frequency"].values:
        low.axvline(value, color=REFERENCE_COLOR, linewidth=0.6, zorder=0)
    low.set(xlabel="frequency in Hz", ylabel="modes fitted", yticks=np.arange(1, len(f) + 1))
    low.legend()
    return figure


@in_style()
def draw_assurance(data: xr.Dataset) -> Figure:
    """Draw the MAC matrix of the modes among each other."""
    mac = data["assurance"].values
    names = [f"{f:.4g}" for f in data["frequency"].values]
    figure, axes = style.subplots(figsize=(4.2, 3.6))
    drawn = axes.imshow(mac, cmap="viridis", vmin=0, vmax=1)
    for (i, j), value in np.ndenumerate(mac):
        ink = "black" if value > 0.6 else "white"
        axes.text(j, i, f"{value:.3f}", ha="center", va="center", color=ink, fontsize=7)
    axes.set_xticks(range(len(names)), names)
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="frequency in Hz", ylabel="frequency in Hz")
    axes.grid(visible=False)
    figure.colorbar(drawn, ax=axes, label="MAC")
    return figure


@in_style(style.MATH_STYLE)
def draw_response(data: xr.Dataset, marker: int) -> Figure:
    """Draw a marker's receptance, and its coherence where there are averages."""
    f, whole = data["frequency"].values, complex_of(data, "receptance")[:, marker]
    error, averaged = data["standard_error"].values[0, marker], int(data["segments"]) > 1
    heights = [3, 1.3, 1.3] if averaged else [3, 1.3]
    shape: Any = {"figsize": (NARROW_WIDTH_IN, sum(heights)), "height_ratios": heights}
    figure, (top, middle, *low) = style.subplots(len(heights), 1, sharex=True, **shape)
    size = np.abs(whole[0])
    under = np.maximum(size - 2 * error, size / 10)
    shade: Any = {"color": REFERENCE_COLOR, "alpha": 0.4, "lw": 0}
    top.fill_between(f, under, size + 2 * error, label="H1 ± 2 standard errors", **shade)
    if averaged:
        top.plot(f, np.abs(whole[1]), color=HIGHLIGHT_COLOR, linewidth=0.7, label="H2")
    top.plot(f, size, color=cycle_color(0), linewidth=0.9, label="H1")
    top.set(xscale="log", yscale="log", ylabel="receptance in m/N")
    top.legend(ncols=3)
    middle.plot(f, np.degrees(np.angle(whole[0])), ".", color=cycle_color(0), markersize=3)
    middle.set(ylabel="phase in °", ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
    for axes in low:
        axes.plot(f, data["coherence"].values[marker], color=cycle_color(0), linewidth=0.8)
        axes.set(ylabel="coherence", ylim=(0, 1.05))
    last = [top, middle, *low][-1]
    last.set(xlabel="frequency in Hz", xlim=(f[0], f[-1]))
    last.set_xticks(_round_ticks(f[0], f[-1]), minor=False)
    last.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    last.xaxis.set_minor_formatter(lambda value, _: "")
    return figure


def _round_ticks(low: float, high: float) -> list[float]:
    """Return round numbers from `low` to `high`, at least four where possible."""
    for digits in ((1, 2, 5), range(1, 10)):
        found = [n * 10.0**k for k in range(-2, 5) for n in digits if low <= n * 10.0**k <= high]
        if len(found) >= 4:
            break
    return found


@in_style()
def draw_prediction(manifest: Manifest) -> dict[str, Figure]:
    """Draw the cameras of a manifest, and a map of predicted standard errors; figures by name.

    Raise ManifestError if fewer than two cameras have a lens and a position.
    """
    with np.errstate(all="ignore"):  # missing values are NaN
        view = prediction.view_markers(manifest, 0.0)
        _, fit, _ = prediction.predict_errors(manifest, view, np.nan, assess.CENTRE_NOISE_PX)
    there = view.located
    if there.sum() < 2:
        raise ManifestError(
            f"--out: given {int(there.sum())} cameras with focal_length_mm, sensor_width_mm, "
            "distance_mm, azimuth_deg and elevation_deg, allowed: two or more, to draw them"
        )
    centres = view.optics[there, 2:3] / 1000 * view.directions[there]
    placed = xr.Dataset(
        {
            "camera_centre": (("camera", "axis"), centres),
            "rest_position": (("axis", "marker"), view.points),
        },
        {"camera": [c.name for c in compress(manifest.cameras, there)]},
    )
    height = WIDTH_IN * manifest.structure.width_mm / manifest.structure.length_mm + 1.5
    figure, axes = style.subplots(figsize=(WIDTH_IN, min(height, 6)))
    drawn = _scatter_markers(axes, manifest, fit, cmap="viridis")
    axes.set(ylabel="y in mm", title="standard error of the deflection by the harmonic fit")
    figure.colorbar(drawn, ax=axes, label="mm", orientation="horizontal", fraction=0.1)
    return {"cameras": draw_cameras(placed, manifest), "errors": figure}
