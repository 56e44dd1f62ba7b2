"""Estimate receptance from tracks and a force: H1, H2, Hv, coherence, standard errors.

With ⟨⟩ the mean over segments of force F and motion X, H1 = ⟨XF*⟩ / ⟨FF*⟩ is unbiased by noise in
the motion and biased low by noise in the force. H2 = ⟨XX*⟩ / ⟨FX*⟩ is unbiased by noise in the
force and biased high by noise in the motion. Hv, between them, has the magnitude
√(⟨XX*⟩ / ⟨FF*⟩). The coherence γ² = H1 / H2 is the share of the motion that the force explains
(Bendat and Piersol, Random Data, chapters 6 and 9).

Over n independent segments, H1 is a regression: the variance of its real or imaginary part,
relative to |H1|², is v = (1 − γ²) / (2 (n − 1) γ²). H2 is the inverse of the regression of the
force on the motion; its variance is v relative to |H2|², which is larger. Hv has the phase of both,
and its magnitude varies by γ² v only: the mean over both parts is (1 + γ²) v / 2. All variances are
about the expectation of each estimator, its bias by noise included.

The spectrum of a Hann window adds a sixth of each line's power to either neighbour, which blurs
narrow resonances. A rough and noisy deconvolution serves to estimate the size of this bias. It
fails for a resonance narrower than about 1.5 lines, where the error of each estimator is close to
the largest of its differences from the two others. A whole recording lacks the motion after its
end, which is extrapolated to estimate the size of this bias.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import xarray as xr

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.measure.fitting.harmonics import rest_of
from thesis_lib.measure.fitting.marker_size import fit_correction
from thesis_lib.measure.recordings.force_table import ForceError
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.response import signals
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.studies.schema import label_values, read_variables, split_complex
from thesis_lib.vision.pinhole import projection_matrices

ESTIMATORS = ("H1", "H2", "Hv")
HANN_SHARE = 1 / 6  # share of a line's power that a Hann window adds to each neighbour
#: Square of the blur estimated from noise alone, over the variance of either part of the
#: receptance: twice the mean of (1 − 1/k)² S over all θ, with k = 2/3 + cos θ / 3 of the window
#: and S = 1 + 8/9 cos θ + cos 2θ / 18 of the noise of overlapping lines
BLUR_BY_NOISE = 0.62
MAX_BLUR = 0.15  # largest share by which a peak is lowered that is reliably estimated
MAX_NOISE_SHARE = 0.1  # of the power, up to which estimators differ by blur and not by noise
RECORDING_PARTS = 8  # default segment lengths in a random recording, and parts to check ringing
END_PARTS = 32  # parts of a recording whose last two are compared if its force never ends
FREE_FORCE_RATIO = 0.05  # of the largest force, below which motion counts as free
MIN_TAIL_POWER_RATIO = 2.0  # power at the end over the noise: few markers reach 2 by chance
MAX_FORCE_RATE_RATIO = 8  # largest sample rate of the force over that of the motion
REPEATED_AFTER = 5  # frames after which gaps are inserted again: by then, most gaps have ended
GAP_LINES = 25  # lines over which a power is averaged, for a relative error of a fifth
MIN_PERIODS = 8  # fewest periods of the lowest frequency in a recording
VARIABLES = read_variables(__file__, "response")


@dataclass(frozen=True)
class Cut:
    """Division of a recording into segments."""

    rate: float  #: Samples per second of the motion, Hz
    length: int  #: Samples of it in a segment, even
    count: int  #: Segments; more than one overlap by half, and have a Hann window

    @property
    def window(self) -> str:
        """Name of the window: a whole recording begins and ends at rest, and needs none."""
        return "hann" if self.count > 1 else "boxcar"

    @property
    def averages(self) -> float:
        """Return the equivalent number of independent segments (Welch 1967)."""
        w = scipy.signal.get_window(self.window, self.length)
        like = float(np.sum(w[self.length // 2 :] * w[: self.length // 2]) / np.sum(w**2)) ** 2
        return self.count / (1 + 2 * (1 - 1 / self.count) * like)

    @property
    def frequency(self) -> Array:
        """Return the frequencies of the spectral lines in Hz, shape (lines,)."""
        return np.arange(self.length // 2 + 1) * self.rate / self.length


def cut_of(samples: int, rate: float, seconds: float | None) -> Cut:
    """Divide a recording into segments of at most `seconds`; None: one segment."""
    whole = samples // 2 * 2
    length = whole if seconds is None else max(min(round(seconds * rate / 2) * 2, whole), 4)
    return Cut(rate, length, 1 + (samples - length) // (length // 2) if length < whole else 1)


def segment_spectra(values: Array, cut: Cut, finer: int = 1) -> ComplexArray:
    """Compute spectra of segments of (samples · finer, series): (lines, segments, series).

    There are `finer` samples for each one of the motion, and the lines of the motion are returned.
    A mean of squared amplitudes is a power density in units²/Hz.
    """
    length = cut.length * finer
    window = scipy.signal.get_window(cut.window, length)
    made = scipy.signal.ShortTimeFFT(window, length // 2, cut.rate * finer, scale_to="psd")
    first = -(-length // 2 // made.hop)  # the first slice that is entirely inside
    found = made.stft_detrend(values, "constant", p0=first, p1=first + cut.count, axis=0)
    lines = cut.length // 2 + 1
    one_sided = np.sqrt(2)
    return np.asarray(one_sided * np.moveaxis(found[:lines], -1, 1), complex)


def receptance_of_segments(
    force: ComplexArray, moved: ComplexArray, cut: Cut, noise: Array, tail: Array | float = 0.0
) -> dict[str, Array]:
    """Estimate receptance and mobility from spectra of segments, under names of :data:`VARIABLES`.

    Spectra of the force are (lines, segments) in N/√Hz; those of the motion (lines, segments,
    markers) in m/√Hz, NaN in segments in which a marker is lost. `noise`, (markers,) or (lines,
    markers), is the noise power of the motion in m²/Hz, which determines the standard error if
    there is only one segment, with `tail` of :func:`estimate_tail`. The coherence of one is 1.
    """
    known = np.isfinite(moved).all(axis=0)  # (segments, markers)
    X = np.where(known, moved, 0.0)
    count = known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ff = (np.abs(force) ** 2) @ (known / count)
        xx = np.sum(np.abs(X) ** 2, axis=1) / count
        xf = np.sum(X * force.conj()[:, :, None], axis=1) / count
        coherence = np.minimum(np.abs(xf) ** 2 / (ff * xx), 1.0)
        first = xf / ff
        whole = np.array([first, xx / xf.conj(), first / np.sqrt(coherence)])
        averages = cut.averages * count / cut.count
        relative = np.tile((1 - coherence) / (2 * (averages - 1) * coherence), (3, 1, 1))
        relative[2] *= (1 + coherence) / 2
        alone = noise / (2 * ff * averages)
        scatter = np.where(count > 1, relative * np.abs(whole) ** 2, alone)
        blur = np.tile(tail / np.sqrt(ff), (3, 1, 1))
    if cut.count > 1:
        squares = np.abs(estimate_blur(first)) ** 2 - BLUR_BY_NOISE * scatter
        blur = np.sqrt(np.maximum(squares, 0))
        narrow = (blur.max(axis=0) > MAX_BLUR * np.abs(first)) & (noise < MAX_NOISE_SHARE * xx)
        spread = np.abs(whole[:, None] - whole).max(axis=0)
        blur = np.maximum(blur, np.where(narrow, spread, 0))
    error = np.hypot(np.sqrt(scatter), blur)
    receptance = whole.transpose(0, 2, 1)
    mobility = 2j * np.pi * cut.frequency * receptance
    return {
        **split_complex("receptance", receptance),
        **split_complex("mobility", mobility),
        "standard_error": error.transpose(0, 2, 1),
        "blur": blur.transpose(0, 2, 1),
        "coherence": coherence.T,
        "force_power": np.mean(np.abs(force) ** 2, axis=1),
        "averages": averages,
    }


def estimate_blur(receptance: ComplexArray) -> ComplexArray:
    """Estimate the bias of H1, H2 and Hv by a Hann window, (3, lines, markers).

    H1, (lines, markers), is deconvolved. Each estimator is then computed with the window from the
    result, for a force of constant power over frequency.
    """
    bands = np.tile([[HANN_SHARE], [1 - 2 * HANN_SHARE], [HANN_SHARE]], len(receptance))
    bands[1, [0, -1]] += HANN_SHARE
    blur = scipy.sparse.diags_array([bands[0, 1:], bands[1], bands[2, 1:]], offsets=[-1, 0, 1])
    sharp = scipy.linalg.solve_banded((1, 1), bands, receptance, check_finite=False)
    power = blur @ np.abs(sharp) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        second = power / receptance.conj()
    middle = np.sqrt(power) * np.exp(1j * np.angle(receptance))
    return np.array([receptance, second, middle]) - sharp


def estimate_tail(moved: Array, cut: Cut, noise: Array, free: int) -> Array:
    """Estimate magnitudes of the spectra of the motion after a whole recording, (lines, markers).

    `moved` is (samples, markers) in m, `free` samples of it after the force. Over a time τ free
    motion changes by r = exp(λτ − iωτ) at every line. Two equal parts at the end yield r, by least
    squares over the markers; all later ones sum to r / (1 − r) of the last, and to no more than if
    it lasted for the recording again. Lines that noise of the power `noise`, m²/Hz, explains are 0.
    """
    length = int(np.clip(free // 2, cut.length // END_PARTS, cut.length // RECORDING_PARTS))
    part = np.arange(cut.length)[::-1, None] // max(length, 1)
    first, last = (
        segment_spectra(np.where(part == k, moved[: cut.length], 0.0), cut)[:, 0] for k in (1, 0)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        r = np.nansum(last * first.conj(), axis=1) / np.nansum(np.abs(first) ** 2, axis=1)
    share, size = length / cut.length, np.abs(last)
    loud = np.nansum(size**2, axis=1) > MIN_TAIL_POWER_RATIO * share * np.nansum(noise, axis=-1)
    return size * np.where(loud, np.abs(r) / np.maximum(np.abs(1 - r), share), 0.0)[:, None]


def estimate_response(
    manifest: Manifest, recordings: Sequence[Recording], folder: Path
) -> xr.Dataset:
    """Estimate receptance and mobility of every marker, with the time histories.

    Raises
    ------
    ForceError
        If the force cannot be used; the one-line message names a remedy.
    ChainError
        If the markers at rest do not fit their nominal positions.
    """
    given, excitation = manifest.force, manifest.excitation
    assert given is not None
    rest = rest_of(manifest, recordings, excitation.rest_duration_s)
    rate, slowest = (float(pick(own.rate for own in recordings)) for pick in (max, min))
    sought = excitation.modes
    most = min(sought.to_hz or np.inf, signals.MAX_REPORTED_RATIO * slowest)
    recordings, lag, pace = signals.in_step(recordings, rest, (sought.from_hz, most))
    delays = np.array([own.delay for own in recordings]) - lag  # audio-based: without image lags
    force = signals.read_force(manifest, folder, delays, [own.pace for own in recordings])
    filmed = signals.span_of(recordings)
    low, high = _band(manifest, force, slowest)
    begin, end = _common(manifest, force, filmed, low)
    times = begin + np.arange(int((end - begin) * rate + 1e-6)) / rate
    finer = min(MAX_FORCE_RATE_RATIO, int(np.ceil(force.rate / rate)))
    fine = begin + np.arange(finer * len(times)) / (finer * rate)
    mean = float(force.newtons.mean())
    newtons = signals.interpolate_band(
        force.times, force.newtons[:, None] - mean, force.rate, fine
    )[:, 0]
    pushed = np.nan_to_num(newtons)
    sweep = None
    if excitation.behaviour.sweeps:
        sweep = signals.find_sweep(pushed, finer * rate, excitation.sweep)
        ends = sorted([float(sweep.from_hz or low), float(sweep.to_hz or high)])
        low, high = max(low, ends[0]), min(high, ends[1])
    moved = signals.estimate_deflections(recordings, rest, times)
    still = np.arange(filmed[0], filmed[0] + excitation.rest_duration_s, 1 / rate)
    at_rest = signals.estimate_deflections(recordings, rest, still)
    still_noise = signals.noise_of(at_rest, rate, (low, high))
    noise = still_noise
    length = None if given.segment_s == "whole" else given.segment_s
    if given.segment_s is None and excitation.behaviour.is_noise:
        length = len(times) / rate / RECORDING_PARTS
    cut = cut_of(len(times), rate, length)
    spectra = segment_spectra(pushed[:, None], cut, finer)[:, :, 0]
    checked = moved
    if cut.count == 1 and any(np.isnan(own.centres).any() for own in recordings):
        again = signals.estimate_deflections(recordings, rest, times, REPEATED_AFTER)
        checked = np.where(np.isnan(again), np.nan, moved)
        # The error by gaps is the change when the same gaps are inserted some frames later.
        power = np.abs(segment_spectra(again - moved, cut)[:, 0]) ** 2
        noise = noise + scipy.ndimage.uniform_filter1d(power, GAP_LINES, axis=0, mode="nearest")
    unknown = np.isnan(checked).mean(axis=0)
    driven = np.flatnonzero(np.abs(pushed) >= FREE_FORCE_RATIO * np.abs(pushed).max())
    free = len(times) - int(driven[-1]) // finer
    tail = 0.0 if cut.count > 1 else estimate_tail(moved, cut, noise, free)
    found = receptance_of_segments(spectra, segment_spectra(checked, cut), cut, noise, tail)
    if not found["averages"].any():
        raise ForceError(
            f"force.segment_s: in each of {cut.count} segments of {cut.length / rate:.3g} s every "
            f"marker is lost for a while, {unknown.mean():.0%} of the time; give shorter ones, or "
            "drive so gently that no marker is taken for its neighbour"
        )
    P = projection_matrices([own.camera for own in recordings])
    edges = fit_correction(P, rest, moved)
    whole = (found["receptance_real"] + 1j * found["receptance_imag"]).swapaxes(1, 2)
    by_size = edges.estimate_error(whole).swapaxes(1, 2)
    found["standard_error"] = np.hypot(found["standard_error"], by_size)
    usual = manifest.structure.force_place
    place = usual if given.at_mm is None else np.array(given.at_mm) / 1000
    apart = np.linalg.norm(rest.places - place[:, None], axis=0)
    parts = [np.nanstd(part) for part in np.array_split(moved, RECORDING_PARTS)]
    f, power = scipy.signal.welch(pushed, finer * rate, nperseg=min(len(pushed), 4096))
    values: dict[str, Any] = found | {
        "phase_deviation": 2 * np.pi * cut.frequency * force.delay_deviation,
        "displacement": moved,
        "force": pushed,
        "x": rest.places[0],
        "y": rest.places[1],
        "rest_position": rest.frame.to_beam(rest.points),
        "force_place": place,
        "drive": int(np.argmin(np.where(found["averages"] > 0, apart, np.inf))) + 1,
        "segment": cut.length / rate,
        "segments": cut.count,
        "delay": force.delay,
        "delay_deviation": force.delay_deviation,
        "pace": 1 / force.pace - 1,
        "unknown": unknown,
        "camera_lag": lag,
        "camera_pace": pace,
        "beyond": float(power[f > slowest / 2].sum() / power.sum()),  # power that is aliased
        "ringing": parts[-1] / max(parts),
        "noise": np.sqrt(still_noise * rate / 2),
        "filmed": filmed,
        "sweep": [sweep.from_hz, sweep.to_hz] if sweep else [np.nan, np.nan],
        "sweep_duration": sweep.duration_s if sweep else np.nan,
        "camera": [own.camera.name for own in recordings],
        "estimator": list(ESTIMATORS),
        "frequency": cut.frequency,
        "time": times,
        "force_time": fine,
        "marker": np.arange(1, len(apart) + 1),
        "axis": list("xyz"),
    }
    attrs = {"force_source": force.source}
    data = xr.Dataset(label_values(values, VARIABLES), attrs=attrs)
    data = data[[*VARIABLES]]  # sets the order in files
    return data.sel(frequency=slice(low, high))


def _band(manifest: Manifest, force: signals.RecordedForce, slowest: float) -> tuple[float, float]:
    """Return the reported frequency band, Hz; refuse one that frames or force do not resolve."""
    excitation, path = manifest.excitation, manifest.force and manifest.force.file
    sought, sweep = excitation.modes, excitation.sweep
    lowest, most = sought.from_hz, signals.MAX_REPORTED_RATIO * slowest
    if excitation.behaviour.sweeps:
        lowest = max(lowest, min(sweep.from_hz or 0, sweep.to_hz or 0))
    if lowest >= most:
        raise ForceError(
            f"excitation.modes.from_hz or sweep: given {lowest:g} Hz, allowed: below {most:.4g} "
            f"Hz, {signals.MAX_REPORTED_RATIO} of the lowest frame rate; film faster"
        )
    high = min(sought.to_hz or most, most)
    if signals.MAX_REPORTED_RATIO * force.rate < high * (1 - 1e-6):
        raise ForceError(
            f"force.file: {path}: {force.rate:.4g} samples a second, allowed: at least "
            f"{high / signals.MAX_REPORTED_RATIO:.4g} for {high:.4g} Hz; or a lower "
            "excitation.modes.to_hz"
        )
    return sought.from_hz, high


def wanted_interval(manifest: Manifest, filmed: tuple[float, float]) -> tuple[float, float]:
    """Return begin and end of the interval for the response, s: the steady-state one, or all.

    For a free decay it is the whole recording, since the steady-state interval, where the modes
    are fitted, does not contain the impact.
    """
    excitation = manifest.excitation
    return filmed if excitation.behaviour.decays else excitation.steady_interval_s or filmed


def _common(
    manifest: Manifest, force: signals.RecordedForce, filmed: tuple[float, float], low: float
) -> tuple[float, float]:
    """Return begin and end of the wanted interval that cameras and force have in common, s."""
    first, last = wanted = wanted_interval(manifest, filmed)
    told = "the cameras recorded" if wanted == filmed else "excitation.steady_interval_s is"
    begin = max(first, filmed[0], float(force.times[0]))
    end = min(last, filmed[1], float(force.times[-1]))
    if not end - begin > MIN_PERIODS / low:
        raise ForceError(
            f"force.file: {manifest.force and manifest.force.file}: from {force.times[0]:.3f} to "
            f"{force.times[-1]:.3f} s on the first camera's clock, and {told} from "
            f"{first:.3f} to {last:.3f} s, allowed: {MIN_PERIODS / low:.3g} s or more in common, "
            f"{MIN_PERIODS} periods of {low:g} Hz"
        )
    return begin, end
