"""Motion over force in the report: curves, what to know before trusting them, lines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from thesis_lib.arrays import ComplexArray
from thesis_lib.measure.modes.report import of_clock
from thesis_lib.measure.recordings.force_fields import Sweep
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.report import html
from thesis_lib.measure.report.meanings import Note
from thesis_lib.measure.report.page import Pictures
from thesis_lib.measure.response.sweep import dwell, settling
from thesis_lib.plotting.style import HIGHLIGHT, POWERS, REFERENCE, color, in_style, saved, subplots

NARROW = 5.6  # inches: letters can be read on a phone, too
MAX_BLUR = 0.15  # share by which a peak is estimated to be lower, up to which that is reliable
UNKNOWN = 0.002  # share of the deflections that are not known, from which on it is told
FEW = 6  # averages below which a coherence tells little
COHERENT = 0.9  # coherence of the drive point below which it is told
NEAR = 0.2  # of the largest distance between markers, within which one counts as the drive point
LATE = 5.0  # degrees of phase that a clock may be off
ALIASED = 0.05  # share of the force's power above half of the frame rate
UNUSED = 0.05  # share of the film without a force that is told
RINGS = 0.05  # of the largest motion, left at the end of a whole recording
FAST = 1e-6  # by which clocks differ before it is told
FILES = (
    "response.nc: receptance, mobility, coherence, errors, motion and force over time (xarray)",
    "response.uff: receptances by H1 and coherences, datasets 15, 82 and 58 (modal software)",
)


def complex_of(data: xr.Dataset, name: str = "receptance") -> ComplexArray:
    """Receptance or mobility, shape (estimators, markers, lines)."""
    return np.asarray(data[f"{name}_real"].values + 1j * data[f"{name}_imag"].values, complex)


def shown(data: xr.Dataset) -> dict[str, int]:
    """Which markers are drawn, by what they are: the drive point, the surest, the least sure."""
    error = np.nanmedian(data["standard_error"].values[0] / np.abs(complex_of(data)[0]), axis=1)
    told = {"drive": int(data["drive"]) - 1}
    if np.isfinite(error).any():
        told |= {"surest": int(np.nanargmin(error)), "least": int(np.nanargmax(error))}
    return told


NAMES = {"drive": "nearest to the force", "surest": "surest", "least": "least sure"}


def figures(data: xr.Dataset) -> Pictures:
    """The pictures of the section, by name."""
    return {
        f"response-{name}": ("svg", saved(curves(data, marker), "svg", POWERS))
        for name, marker in shown(data).items()
    }


def curves(data: xr.Dataset, marker: int) -> Figure:
    """Magnitude and phase of a marker's receptance, and its coherence where there are averages."""
    f, whole = data["frequency"].values, complex_of(data)[:, marker]
    error, averaged = data["standard_error"].values[0, marker], int(data["segments"]) > 1
    heights = [3, 1.3, 1.3] if averaged else [3, 1.3]
    with in_style(POWERS):
        figure, (top, middle, *low) = subplots(
            len(heights),
            1,
            figsize=(NARROW, sum(heights)),
            layout="constrained",
            sharex=True,
            height_ratios=heights,
        )
        size = np.abs(whole[0])
        under = np.maximum(size - 2 * error, size / 10)
        top.fill_between(
            f,
            under,
            size + 2 * error,
            color=REFERENCE,
            alpha=0.4,
            lw=0,
            label="H1 ± 2 standard errors",
        )
        if averaged:
            top.plot(f, np.abs(whole[1]), color=HIGHLIGHT, linewidth=0.7, label="H2")
        top.plot(f, size, color=color(0), linewidth=0.9, label="H1")
        top.set(xscale="log", yscale="log", ylabel="receptance in m/N")
        top.legend(ncols=3)
        middle.plot(f, np.degrees(np.angle(whole[0])), ".", color=color(0), markersize=3)
        middle.set(ylabel="phase in °", ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
        for axes in low:
            axes.plot(f, data["coherence"].values[marker], color=color(0), linewidth=0.8)
            axes.set(ylabel="coherence", ylim=(0, 1.05))
        last = [top, middle, *low][-1]
        last.set(xlabel="frequency in Hz", xlim=(f[0], f[-1]))
        last.set_xticks(_ticks(f[0], f[-1]), minor=False)
        last.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        last.xaxis.set_minor_formatter(lambda value, _: "")
    return figure


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers between two, four or more where there are so many."""
    for digits in ((1, 2, 5), range(1, 10)):
        found = [n * 10.0**k for k in range(-2, 5) for n in digits if low <= n * 10.0**k <= high]
        if len(found) >= 4:
            break
    return found


def peak(data: xr.Dataset) -> tuple[float, float]:
    """Frequency in Hz at which the markers together move most for a force, and that in m/N."""
    size = np.sqrt(np.nanmean(np.abs(complex_of(data)[0]) ** 2, axis=0))
    top = int(np.argmax(size))
    return float(data["frequency"].values[top]), float(size[top])


def summary(data: xr.Dataset) -> list[str]:
    """What was found, in a few lines."""
    f, drive = data["frequency"].values, int(data["drive"]) - 1
    size = np.abs(complex_of(data)[0, drive])
    top = int(np.nanargmax(size))
    error = float(data["standard_error"].values[0, drive, top])
    many = int(data["segments"])
    how = (
        f"{many} segments of {float(data['segment']):.3g} s"
        if many > 1
        else (f"one segment of {float(data['segment']):.3g} s")
    )
    return [
        f"force: {data.attrs['force_source']}",
        f"receptance of {data.sizes['marker']} markers from {f[0]:.4g} to {f[-1]:.4g} Hz, by {how}",
        f"marker {drive + 1}, nearest to the force: at most {size[top]:.3g} ± {error:.1g} m/N, at "
        f"{f[top]:.4g} Hz",
    ]


def warnings(data: xr.Dataset, manifest: Manifest) -> Iterator[Note]:
    """What a reader should know before trusting the curves, one line each."""
    times, (first, last) = data["time"].values, data["filmed"].values
    f, drive, many = data["frequency"].values, int(data["drive"]) - 1, int(data["segments"])
    if times[-1] - times[0] < (1 - UNUSED) * (last - first):
        yield Note(
            "force-short",
            f"The force covers {times[-1] - times[0]:.1f} of the {last - first:.1f} s that all "
            "cameras recorded; the rest was not used.",
        )
    at = np.array([data["x"].values[drive], data["y"].values[drive]])
    apart = 1e3 * float(np.linalg.norm(at - data["force_place"].values))
    if apart > manifest.structure.markers.diameter_mm:
        yield Note(
            "force-apart",
            f"The force acts {apart:.0f} mm from marker {drive + 1}, the nearest: its curve is "
            "that of a point beside the force.",
        )
    if many > 1 and float(data["averages"].max()) < FEW:
        yield Note(
            "few-averages",
            f"The curves rest on {float(data['averages'].max()):.1f} averages, which tell "
            "coherence and errors roughly: record longer, or take a shorter force.segment_s.",
        )
    usual = float(np.nanmedian(data["coherence"].values[drive]))
    if usual < COHERENT:
        yield Note(
            "incoherent",
            f"Half of the lines of marker {drive + 1} have a coherence below {usual:.2f}: drive "
            "harder, film nearer, or look for what else moves the structure.",
        )
    if (share := float(data["unknown"].mean())) > UNKNOWN:
        yield Note(
            "deflections-lost",
            f"In {share:.1%} of the time a marker's deflection is not known; segments that have "
            "such a gap were left out of its curves.",
        )
    names = [str(name) for name in data["camera"].values]
    for k, name in enumerate(names):
        late, pace = float(data["camera_lag"][k]), float(data["camera_pace"][k])
        yield from of_clock(name, names[0], late, pace)
    if (degrees := np.degrees(float(data["phase_deviation"].values[-1]))) > LATE:
        yield Note(
            "force-clock-unsure",
            f"The force's clock is known to {1e3 * float(data['delay_deviation']):.2g} ms, "
            f"{degrees:.0f}° at {f[-1]:.4g} Hz: record a sound that all can hear, as claps.",
        )
    if abs(fast := float(data["pace"])) > FAST:
        yield Note(
            "force-clock-drift",
            f"The force's clock runs {1e6 * abs(fast):.3g} ppm {'fast' if fast > 0 else 'slow'} "
            "against that of the first camera; its times were corrected.",
        )
    if (share := float(data["beyond"])) > ALIASED:
        yield Note(
            "force-too-fast",
            f"{share:.0%} of the force's power lies above half of the lowest frame rate, where "
            "frames show motion at wrong frequencies: filter the force, or film faster.",
        )
    yield from _unsettled(data, manifest)


def _unsettled(data: xr.Dataset, manifest: Manifest) -> Iterator[Note]:
    """Whether what is driven has time to answer."""
    top, _ = peak(data)
    zeta = manifest.structure.damping
    if int(data["segments"]) == 1:
        if (left := float(data["ringing"])) > RINGS and not _noisy(data):
            yield Note(
                "still-ringing",
                f"At the end the structure still moves by {left:.0%} of its most, which one "
                "segment takes for an answer to the force: film until it is at rest, "
                f"{settling(top, zeta):.3g} s after the force at {top:.4g} Hz and a damping of "
                f"{100 * zeta:g} %.",
            )
        return
    yield from _blurred(data)
    begin, end = data["sweep"].values
    if not np.isfinite(begin):
        return
    sweep = Sweep(from_hz=begin, to_hz=end, duration_s=float(data["sweep_duration"]))
    stays, needs = dwell(sweep, top, zeta), settling(top, zeta)
    if stays < needs:
        yield Note(
            "sweep-fast",
            f"The sweep from {begin:.3g} to {end:.3g} Hz in {float(data['sweep_duration']):.3g} s "
            f"stays {stays:.2g} s in the resonance at {top:.4g} Hz, which takes {needs:.2g} s to "
            f"settle: sweep {needs / stays:.2g} times more slowly, or take force.segment_s: whole "
            "and film until all is at rest.",
        )


def _blurred(data: xr.Dataset) -> Iterator[Note]:
    """Report a peak that segments blur by more than it is uncertain by noise."""
    top, size = peak(data)
    own = data.sel(estimator="H1", frequency=top)
    blur, error = (np.sqrt(np.nanmean(own[k].values ** 2)) for k in ("blur", "standard_error"))
    noise = np.sqrt(error**2 - blur**2)
    if blur > noise:
        seconds, share = float(data["segment"]), blur / (size + blur)
        how = "much" if share > MAX_BLUR else f"by about {share:.1%}"
        longer = seconds * (blur / max(noise, 1e-3 * size)) ** 0.4  # as T⁻² and, of noise, √T
        yield Note(
            "segment-short",
            f"Segments of {seconds:.3g} s lower the peak at {top:.4g} Hz {how}, and noise makes it "
            f"uncertain by {noise / size:.1%}: take force.segment_s of {longer:.3g} or more, or "
            "record from rest to rest and take it whole.",
        )


def _noisy(data: xr.Dataset) -> bool:
    """Whether the last eighth of the motion is no more than noise."""
    last = data["displacement"].values[-(data.sizes["time"] // 8) :]
    return bool(np.nanstd(last) < 2 * np.sqrt(np.nanmean(data["noise"].values ** 2)))


def section(data: xr.Dataset, manifest: Manifest, pictures: Pictures) -> str:
    """A part of the report."""
    told = (
        "Receptance, phase and coherence" if int(data["segments"]) > 1 else "Receptance and phase"
    )
    what = f"{told} of marker {{}}, {{}}. The shaded band is two standard errors to either side."
    parts = [html.items(summary(data)), html.warned([*warnings(data, manifest)])]
    parts += [
        html.figure(pictures, f"response-{name}", what.format(marker + 1, NAMES[name]))
        for name, marker in shown(data).items()
    ]
    parts.append(html.details("What the curves rest on", html.items(_assumed(data))))
    return "\n".join(part for part in parts if part)


def _assumed(data: xr.Dataset) -> Iterator[str]:
    """What nothing in the recordings can prove."""
    yield "The force acts along the structure's normal, and its calibration is right."
    yield (
        f"The force's file begins at {float(data['delay']):.4f} ± "
        f"{float(data['delay_deviation']):.1g} s on the first camera's clock. Picture and sound "
        "of a camera are taken to begin together: if they do not, all phases turn with frequency."
    )
    yield "Nothing moves faster than half of the lowest frame rate."
    if int(data["segments"]) > 1:
        yield (
            "H1 is right where noise is in the motion, and too small where it is in the force; H2 "
            "is right where noise is in the force, and too large where it is in the motion. "
            "Standard errors come from coherence and averages, and from how segments blur narrow "
            "peaks: they do not hold by how much noise makes H1 too small or H2 too large."
        )
    else:
        yield (
            "The recording begins and ends at rest. One segment has a coherence of 1 whatever the "
            "noise: standard errors come from the noise of the markers at rest. Where centres are "
            "missing, they also contain what interpolation errs by, estimated from the same gaps "
            "made again some frames later; that holds for up to a tenth of the centres, missing "
            "at random."
        )
