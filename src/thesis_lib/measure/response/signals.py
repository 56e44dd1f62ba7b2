"""Compute force and deflections over time, on the first camera's clock.

The recorded force is read and checked.

Deflections of all markers are estimated at common times: each camera's centres are interpolated
from its time stamps, with corrections for rolling shutter and exposure, then triangulated, instant
by instant.

Cameras take frames at separate, sometimes uneven times, each as a mean over its exposure. For a
signal of constant power up to a frequency limit, the best linear estimate at a time t from samples
y at tᵢ is sᵀ S⁻¹ y, where S is the covariance matrix of the samples and s their covariance with the
value at t (Wiener): the mean of cos 2πf(tᵢ − tⱼ) over the band, times sinc fT for every exposure T
involved. This also corrects the loss by exposure.

All cameras see the same motion along the normal. If the times of one camera are wrong by δ, its
cross-spectrum with the first camera has the phase ωδ. This yields δ in each of several windows, and
a line through these yields the clock's rate.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy

from thesis_lib.arrays import Array, ComplexArray, Mask
from thesis_lib.measure.fitting import frequency as clocks, harmonics, reconstruction
from thesis_lib.measure.fitting.marker_size import fit_correction
from thesis_lib.measure.fitting.reconstruction import Rest
from thesis_lib.measure.recordings.force_table import ForceError, read_force_table
from thesis_lib.measure.recordings.manifest import Manifest
from thesis_lib.measure.recordings.manifest_parts import Force, Sweep
from thesis_lib.measure.synchronisation import audio, drift
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vision import pinhole, triangulation

# Of the power of the strongest segment; weaker segments are before or after the sweep
MIN_SEGMENT_POWER_RATIO = 0.03
SWEEP_SEGMENTS = 100  # segments of a recording in which the frequency is estimated
FORCE_RATE_RATIO = 10  # sample rate to which a fast force recording is reduced, over the frame rate
MIN_CLIPPED_SAMPLES = 3  # samples at full scale from which on a force counts as clipped
NEAR_SAMPLES = 24  # samples used for one estimate
MAX_SIGNAL_RATIO = 0.45  # assumed highest frequency of the signal, over the sample rate
# Highest frequency of accurate estimates over the rate: error 1 % of the amplitude, mostly less
MAX_REPORTED_RATIO = 0.4
OUT_OF_BAND_POWER_RATIO = 1e-6  # assumed power outside the band over that in it
QUADRATURE_NODES = 28  # of the quadrature over the band
CHUNK_TIMES = 512  # times per step
SAME_TIME_S = 1e-9  # difference in s up to which two times are the same
# Largest apparent motion of a marker along the surface over the distance of its neighbour
MAX_SURFACE_SHIFT_RATIO = 0.25
MAX_WINDOWS = 8  # largest number of windows in a recording
MIN_WINDOW_S, MAX_WINDOW_S = 2.0, 16.0  # shortest and longest window in s
MAX_TIME_OFFSET_S = 0.1  # largest error of a camera's times in s
HANN_LINES = 1.5  # equivalent noise bandwidth of a Hann window in lines
TRIALS_PER_PERIOD = 8  # trial delays per period of the highest frequency


def find_sweep(newtons: Array, rate: float, given: Sweep) -> Sweep:
    """Complete the missing fields of a sweep from the force's strongest line over time."""
    length = max(len(newtons) // SWEEP_SEGMENTS * 2, 16)
    made = scipy.signal.ShortTimeFFT(np.hanning(length), length // 2, rate, mfft=8 * length)
    power = np.abs(made.stft_detrend(newtons, "constant")) ** 2
    loud = power.max(axis=0)
    on = np.flatnonzero(loud > MIN_SEGMENT_POWER_RATIO * loud.max())
    line = made.f[np.argmax(power[:, on], axis=0)]
    return Sweep(
        from_hz=given.from_hz or max(float(line[0]), 1e-3),
        to_hz=given.to_hz or max(float(line[-1]), 2e-3),
        duration_s=given.duration_s or max(float(made.delta_t * (on[-1] - on[0])), 1e-3),
    )


@dataclass(frozen=True)
class RecordedForce:
    """A force over time."""

    times: Array  #: On the first camera's clock, s, shape (samples,)
    newtons: Array  #: N, shape (samples,)
    delay: float  #: Start of the file, s
    delay_deviation: float  #: Its standard error, s; 0 if given or if the file is a camera's video
    pace: float  #: Seconds of the first camera's clock per second of the file's
    source: str  #: File, and columns of its table or its channel

    @property
    def rate(self) -> float:
        """Return the samples per second."""
        return (len(self.times) - 1) / float(self.times[-1] - self.times[0])


def read_force(
    manifest: Manifest, folder: Path, delays: Array, paces: Sequence[float] = ()
) -> RecordedForce:
    """Read the force file of a manifest, and place it on the first camera's clock.

    `delays` are the starts of the cameras on the first one's clock, s; `paces` are seconds of the
    first camera's clock per second of each camera's, by default 1.

    Raises
    ------
    ForceError
        If it is silent, clipped, no table of numbers, or its start cannot be found by sound.
    MediaError
        If the file cannot be read.
    """
    given = manifest.force
    assert given is not None
    path = folder / given.file
    wanted = FORCE_RATE_RATIO * max(camera.frame_rate_hz for camera in manifest.cameras)
    if given.is_table:
        own, newtons, source = read_force_table(path)
        own, newtons = _reduce_table(own, newtons, wanted)
    else:
        own, newtons = _sound(path, given, wanted)
        source = f"channel {given.channel}, {given.full_scale_n:g} N at full scale"
    if not np.ptp(newtons) > 0:
        raise ForceError(f"{path}: silent, allowed: a force that changes")
    clock = _find_clock(manifest, given, folder, delays, paces or np.ones(len(delays)))
    delay, deviation, pace = clock
    times = own * pace + delay
    return RecordedForce(times, newtons, delay, deviation, pace, f"{path.name}: {source}")


def _reduce_table(times: Array, newtons: Array, wanted: float) -> tuple[Array, Array]:
    """Low-pass a table's forces in N to the lowest rate above `wanted` in Hz.

    They are extended by constants at both ends, so that an impact at the start is not lost.
    """
    rate = (len(times) - 1) / float(times[-1] - times[0])
    low = audio.common_rate([rate], wanted)
    if low.rate == rate:
        return times, newtons
    even = np.interp(times[0] + np.arange(len(times)) / rate, times, newtons)
    held = np.pad(even, round(low.cut * rate), mode="edge")
    values = np.concatenate([np.empty(0), *low.reduce([held], rate)])
    return times[0] + np.arange(len(values)) / low.rate, values


def _sound(path: Path, given: Force, wanted: float) -> tuple[Array, Array]:
    """Read times in s and forces in N of a sound file, at the lowest rate above `wanted` in Hz."""
    assert given.full_scale_n is not None
    track = audio.AudioSource("the force", path, given.channel).probe()
    if track.clipped >= MIN_CLIPPED_SAMPLES:
        raise ForceError(
            f"{path}: channel {given.channel} is clipped ({track.clipped} samples at full "
            "scale), allowed: none; turn its gain down"
        )
    low = audio.common_rate([track.rate], wanted)
    values = np.concatenate([np.empty(0), *low.reduce(track.blocks(), track.rate)])
    times = track.start + low.cut + np.arange(len(values)) / low.rate
    return times, values * given.full_scale_n


def _find_clock(
    manifest: Manifest, given: Force, folder: Path, delays: Array, paces: Iterable[float]
) -> tuple[float, float, float]:
    """Return delay, standard error and pace: as given, of a camera's own file, or by sound."""
    if given.offset_s is not None:
        return given.offset_s, 0.0, 1.0
    path, first = folder / given.file, manifest.cameras[0]
    for camera, delay, pace in zip(manifest.cameras, delays, paces, strict=True):
        if (folder / camera.video).resolve() == path.resolve():
            return float(delay), 0.0, pace
    one = audio.AudioSource(first.name, folder / first.video)
    other = audio.AudioSource("the force", path, given.sound_channel or given.channel)
    try:
        found = drift.estimate_drifts((one, other), {1: None})[1]
    except audio.SynchronisationError:
        raise ForceError(
            f"{path}: no sound in channel {other.channel} matches that of camera {first.name} "
            "beyond doubt; record a microphone beside the force and name its channel as "
            "force.sound_channel, or give force.offset_s"
        ) from None
    if not np.isfinite(found.delay_deviation):
        return found.delay, 1 / drift.COMPARED_RATE_HZ, 1.0
    pace = 1 - found.drift if abs(found.drift) > 2 * found.drift_deviation else 1.0
    middle = float(found.times.mean())  # where the line is most precise
    return found.delay + (1 - found.drift - pace) * middle, found.delay_deviation, pace


def interpolate_band(
    times: Array,
    values: Array,
    rate: float,
    wanted: Array,
    late: Array | float = 0.0,
    exposure: float = 0.0,
) -> Array:
    """Interpolate band-limited series at wanted times in s, shape (times, series).

    The samples `values` (samples, series), at increasing `times` in s, have a mean of zero and are
    NaN where missing; `rate` is their mean rate in Hz. Each series was sampled by `late`, in s,
    later than `times`; a sample is the mean over an exposure in s. A value is NaN where fewer than
    half of the near samples are known, or none on one side.
    """
    few, weights = np.polynomial.legendre.leggauss(QUADRATURE_NODES)
    f, w = MAX_SIGNAL_RATIO * rate * (few + 1) / 2, weights / 2
    blur = np.sinc(f * exposure)
    shift = np.broadcast_to(np.asarray(late, float), values.shape[1:])
    found = np.full((len(wanted), values.shape[1]), np.nan)
    near = min(NEAR_SAMPLES, len(times))
    for start in range(0, len(wanted), CHUNK_TIMES):
        t = wanted[start : start + CHUNK_TIMES]
        first = np.clip(np.searchsorted(times, t) - near // 2, 0, len(times) - near)
        index = first[:, None] + np.arange(near)
        apart = times[index] - t[:, None]
        turn = 2 * np.pi * f * apart[:, :, None]  # (times, near, nodes)
        A = np.concatenate([np.cos(turn), np.sin(turn)], axis=2) * np.tile(blur, 2)
        S = (A * np.tile(w, 2)) @ A.swapaxes(1, 2) + OUT_OF_BAND_POWER_RATIO * np.eye(near)
        own = 2 * np.pi * f * -shift[:, None]
        a = np.concatenate([np.cos(own), np.sin(own)], axis=1) * np.tile(w, 2)  # (series, nodes)
        s = A @ a.T  # (times, near, series)
        taken = values[index]
        known = np.isfinite(taken)
        part = np.einsum("tns,tns->ts", np.linalg.solve(S, s), np.where(known, taken, 0.0))
        found[start : start + CHUNK_TIMES] = _fit_gaps(part, S, s, taken, known, apart, shift)
    inside = (wanted[:, None] >= times[0] + shift) & (wanted[:, None] <= times[-1] + shift)
    return np.where(inside, found, np.nan)


def _fit_gaps(
    part: Array, S: Array, s: Array, taken: Array, known: Mask, apart: Array, shift: Array
) -> Array:
    """Estimate values again from the known samples where samples are missing.

    Samples are `apart` (times, near) plus `shift` (series,) in s after the time of the estimate.
    """
    near, found = known.shape[1], part.copy()
    t, k = np.nonzero(~known.all(axis=1))
    if not len(t):
        return found
    there = known[t, :, k]
    both = there[:, :, None] & there[:, None]
    matrix = np.where(both, S[t], np.eye(near))
    right = np.where(there, s[t, :, k], 0.0)
    weights = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    value = np.sum(weights * np.where(there, taken[t, :, k], 0.0), axis=1)
    side = apart[t] + shift[k, None]
    before, after = (there & (side <= SAME_TIME_S)).any(1), (there & (side >= -SAME_TIME_S)).any(1)
    enough = (2 * there.sum(axis=1) >= near) & before & after
    found[t, k] = np.where(enough, value, np.nan)
    return found


def span_of(recordings: Sequence[Recording]) -> tuple[float, float]:
    """Return begin and end of the interval in which all cameras have all rows, s."""
    pads = [1 / own.rate + abs(own.readout) / 2 for own in recordings]
    ends = [
        (own.times[0] + pad, own.times[-1] - pad) for own, pad in zip(recordings, pads, strict=True)
    ]
    return max(first for first, _ in ends), min(last for _, last in ends)


def estimate_deflections(
    recordings: Sequence[Recording], rest: Rest, times: Array, repeated: int = 0
) -> Array:
    """Compute the deflections along the structure's normal at `times`, m, shape (times, markers).

    NaN where fewer than two cameras see a marker, and where it seems to move along the surface: a
    camera then mistook it for its neighbour. `repeated` is that of :func:`undistorted_images`.
    """
    P = pinhole.projection_matrices([own.camera for own in recordings])
    off = rest.images - pinhole.project(P, rest.points)  # reprojection errors at rest
    still = rest.frame.to_beam(rest.points)
    nearest, _ = scipy.spatial.KDTree(rest.places.T).query(rest.places.T, k=2)
    aside = MAX_SURFACE_SHIFT_RATIO * nearest[:, 1]
    found = []
    for start in range(0, len(times), CHUNK_TIMES):
        at = times[start : start + CHUNK_TIMES]
        seen = [
            undistorted_images(own, rest.images[k], at, repeated)
            for k, own in enumerate(recordings)
        ]
        points, _ = reconstruction.triangulate_seen(P, np.array(seen) - off[:, :, None])
        along, across, normal = rest.frame.to_beam(points) - still[:, None]
        with np.errstate(invalid="ignore"):
            found.append(np.where(np.hypot(along, across) > aside, np.nan, normal))
    moved = np.concatenate(found)
    return fit_correction(P, rest, moved).correct_deflections(moved)


def undistorted_images(own: Recording, still: Array, at: Array, repeated: int = 0) -> Array:
    """Interpolate a camera's undistorted centres at given times, px, shape (2, times, markers).

    If `repeated`, gaps are filled, and the same gaps are inserted so many frames later.
    """
    pad = (NEAR_SAMPLES + 1) / own.rate + abs(own.readout)
    first, last = own.between(at[0] - pad, at[-1] + pad)
    seen, height = np.array(own.centres[first:last], float), own.camera.size[1]
    uv, times = pinhole.undistort_tracks(own.camera, seen) - still, own.times[first:last]
    series = uv.reshape(len(uv), -1)
    gaps = np.isnan(series).any(axis=0)
    filled = series.copy()  # short gaps are filled
    if gaps.any():
        found = interpolate_band(times, series[:, gaps], own.rate, times)
        filled[:, gaps] = np.where(np.isnan(series[:, gaps]), found, series[:, gaps])
    full = filled.reshape(uv.shape)
    if repeated:
        lost = np.zeros(uv.shape, bool)
        lost[repeated:] = np.isnan(uv)[:-repeated]
        uv = np.where(lost, np.nan, full)
    late = np.nan_to_num(harmonics.row_delays(own, still))
    later = own.readout * full[:, 1] / height  # delay by motion of the marker across rows
    uv = uv - np.nan_to_num(np.gradient(full, times, axis=0) * later[:, None])
    both = uv.reshape(len(uv), -1)
    found = interpolate_band(times, both, own.rate, at, np.tile(late, 2), own.exposure)
    return np.asarray(still[:, None] + np.moveaxis(found.reshape(-1, *still.shape), 1, 0), float)


def noise_of(still: Array, rate: float, band: tuple[float, float]) -> Array:
    """Estimate the noise power in a band in Hz, m²/Hz, (markers,), from deflections at rest.

    `still` is (times, markers). NaN if the rest interval is too short or a marker is lost in it.
    """
    f, power = scipy.signal.welch(np.nan_to_num(still), rate, axis=0, nperseg=len(still))
    inside = (f >= band[0]) & (f <= band[1])
    if np.count_nonzero(inside) < 4:
        return np.full(still.shape[1], np.nan)
    found = power[inside].mean(axis=0)
    return np.asarray(np.where(np.isfinite(still).all(axis=0), found, np.nan), float)


def in_step(
    recordings: Sequence[Recording], rest: Rest, band: tuple[float, float]
) -> tuple[list[Recording], Array, Array]:
    """Convert the recordings to the first camera's clock; return them and the corrections.

    The corrections (cameras,) are how much later than assumed each camera started, s, and the
    relative excess of its clock rate over the first camera's, 0 if not significant. They are
    estimated from frequencies in the band in Hz.
    """
    span = span_of(recordings)
    rate, seconds = max(own.rate for own in recordings), span[1] - span[0]
    count = int(np.clip(seconds / MIN_WINDOW_S, 1, MAX_WINDOWS))
    length = min(seconds / count, MAX_WINDOW_S)
    middles = span[0] + (np.arange(count) + 0.5) * seconds / count
    late, error, when = np.zeros((3, len(recordings), count))
    P = pinhole.projection_matrices([own.camera for own in recordings])
    slopes = np.einsum("cikn,k->cin", triangulation.image_jacobian(P, rest.points), rest.frame.R[2])
    for k, middle in enumerate(middles):
        at = middle + np.arange(-int(length * rate / 2), int(length * rate / 2)) / rate
        seen = []  # deflections along the normal from each camera alone, m, (times, markers)
        for own, still, slope in zip(recordings, rest.images, slopes, strict=True):
            moved = undistorted_images(own, still, at) - still[:, None]
            seen.append(np.einsum("itn,in->tn", moved, slope / np.sum(slope**2, axis=0)))
        for c in range(1, len(seen)):
            late[c, k], error[c, k], where = _estimate_lag(seen[0], seen[c], rate, band)
            when[c, k] = at[0] + where
    centre, found = 0.5 * (span[0] + span[1]), [recordings[0]]
    lag, pace = np.zeros((2, len(recordings)))
    for c, own in enumerate(recordings[1:], 1):
        lag[c], slope = _line(when[c] - centre, late[c], error[c], seconds, band[1])
        moved = own.scale_clock(1 + slope, centre)
        found.append(replace(moved, delay=moved.delay + lag[c]))
        pace[c] = 1 / (1 + slope) - 1
    return found, lag, pace


def _estimate_lag(
    one: Array, other: Array, rate: float, band: tuple[float, float]
) -> tuple[float, float, float]:
    """Return how much too early another camera's times are, the standard error, and when, s."""
    known = np.isfinite(one).all(axis=0) & np.isfinite(other).all(axis=0)
    window = np.hanning(len(one))[:, None]
    parts = [window * (own - own.mean(axis=0))[:, known] for own in (one, other)]
    spectra = [np.fft.rfft(part, axis=0) for part in parts]
    omega = 2 * np.pi * np.fft.rfftfreq(len(one), 1 / rate)
    inside = (omega >= 2 * np.pi * band[0]) & (omega <= 2 * np.pi * band[1])
    cross = np.sum(spectra[0].conj() * spectra[1], axis=1)[inside]
    omega = omega[inside]
    if not known.any() or len(omega) < 2:
        return 0.0, np.inf, 0.0
    trials = np.arange(-MAX_TIME_OFFSET_S, MAX_TIME_OFFSET_S, 1 / (TRIALS_PER_PERIOD * band[1]))
    found = float(trials[np.argmax(np.real(np.exp(-1j * np.outer(trials, omega)) @ cross))])
    for _ in range(3):
        turned: ComplexArray = cross * np.exp(-1j * omega * found)
        weight = float(np.sum(omega**2 * turned.real))
        found += float(np.sum(omega * turned.imag)) / weight
    left = cross * np.exp(-1j * omega * found)
    error = np.sqrt(HANN_LINES * np.sum(omega**2 * left.imag**2)) / weight
    power = np.sum(parts[0] ** 2, axis=1)
    when = float(np.sum(power * np.arange(len(one))) / np.sum(power)) / rate
    return found, float(error) if weight > 0 else np.inf, when


def _line(
    times: Array, late: Array, error: Array, seconds: float, highest: float
) -> tuple[float, float]:
    """Fit a line to delays; return its value at 0 s and its slope, each 0 if not significant."""
    there = np.isfinite(error) & (error > 0)
    fit, found = times[there], (0.0, 0.0)
    for order in (0, 1):
        if len(fit) < 2 * order + 1:
            break
        A = np.vander(fit, order + 1, increasing=True) / error[there][:, None]
        values, squares, *_ = np.linalg.lstsq(A, late[there] / error[there], rcond=None)
        spread = max(float(np.sum(squares)) / max(len(fit) - order - 1, 1), 1.0)
        deviation = np.sqrt(spread * np.diag(np.linalg.inv(A.T @ A)))
        least = (
            clocks.MIN_PHASE_RAD / (2 * np.pi * highest) / np.array([1, seconds / 2])[: order + 1]
        )
        certain = np.abs(values) > np.maximum(clocks.MIN_CLOCK_SIGMAS * deviation, least)
        if order == 0 or certain[1]:
            sure = np.where(certain, values, 0.0)
            found = float(sure[0]), float(sure[1]) if order else 0.0
    return found
