"""From the laboratory's tracks to the cubes of chapter 5.

Trial 0 is the chain's own result. The others cannot be filmed again: they are drawn at the level of
markers, from the harmonics that were fitted to the tracks: new starts of the cameras, new errors
of their clocks, new noise of the centres, of the size that the tracks show.

Three methods make a deflection shape from tracks. *Literal* is the thesis's: clocks aligned to
whole frames, and the frame that comes nearest to a maximum, as the force's phase tells it.
*Aligned* puts the clocks right to a fraction of a frame and interpolates to the instant of the
maximum. *Harmonic* fits the harmonics of every image coordinate on its camera's own clock, so that
all frames count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from thesis_lib import setups
from thesis_lib.cameras import on_sensor
from thesis_lib.experiment import lens
from thesis_lib.experiment import reconstruction as rc
from thesis_lib.experiment.chain import cameras_of
from thesis_lib.experiment.delays import delay_deviation
from thesis_lib.experiment.laboratory import LATE, REST, SAMPLE_RATE
from thesis_lib.experiment.lens import Camera
from thesis_lib.experiment.requests import NAMES, Experiment, method_of
from thesis_lib.experiment.scene import Component, Markers
from thesis_lib.studies import add_cameras, coordinates, modal_assurance

Array = NDArray[np.float64]
ORDER = 2  # harmonics that are fitted
NEAR = 6  # frames that are interpolated


@dataclass(frozen=True)
class Tracks:
    """Tracks of the chosen cameras at one width, ready for triangulation.

    Parameters
    ----------
    cameras : list of Camera
        Calibrated, at this width.
    uv : ndarray, shape (cameras, frames, 2, markers)
        Marker centres without distortion, px.
    times : ndarray, shape (cameras, frames)
        On the reference camera's clock, s.
    frames : ndarray of int, shape (cameras,)
        Delays in whole frames.
    harmonics : list of Harmonics
        Of the steady part.
    rest : ndarray, shape (cameras, 2, markers)
        Mean at rest, px.
    rest_frames : int
        Frames that it is the mean of.
    frame : Frame
        The beam's frame.
    """

    cameras: list[Camera]
    uv: Array
    times: Array
    frames: NDArray[np.int64]
    harmonics: list[rc.Harmonics]
    rest: Array
    rest_frames: int
    frame: rc.Frame

    @property
    def P(self) -> Array:
        """Projection matrices, shape (cameras, 3, 4)."""
        return lens.projection_matrices(self.cameras)

    @property
    def sigma(self) -> Array:
        """Scatter of the centres about the harmonics, (cameras, 2, markers), px."""
        return np.array([h.sigma for h in self.harmonics])


def tracks_of(
    data: xr.Dataset, markers: Markers, names: str, width: int, calibration: str
) -> Tracks:
    """The tracks of some cameras at one width, by one of the two calibrations."""
    index = [list(data["camera"].values).index(name) for name in names]
    every = cameras_of(data, calibration, width)
    cameras = [every[i] for i in index]
    raw = data["tracks"].sel(width=width).values[index]
    uv = np.stack(
        [
            lens.undistorted(camera, own.swapaxes(0, 1)).swapaxes(0, 1)
            for camera, own in zip(cameras, raw, strict=True)
        ]
    )
    rates = data["frame_rate"].values[index]
    own_times = np.arange(uv.shape[1]) / rates[:, None]
    times = own_times + data["delay"].values[index][:, None]
    omega = 2 * np.pi * float(data["frequency"])
    begin, end = data["steady"].values
    harmonics, rest = [], []
    for camera_uv, camera_times, own in zip(uv, times, own_times, strict=True):
        steady = (camera_times >= begin) & (camera_times <= end)
        harmonics.append(rc.fit_harmonics(omega, camera_times[steady], camera_uv[steady], ORDER))
        still = camera_uv[own < REST - 1 / rates.min()]
        rest.append(_mean(still))
    still_frames = int(np.count_nonzero(own_times[0] < REST - 1 / rates.min()))
    P = lens.projection_matrices(cameras)
    points, _ = rc.triangulate_seen(P, np.array(rest))
    frame = rc.fit_grid(points, markers.world[:, : markers.count])
    return Tracks(cameras, uv, times, data["delay_frames"].values[index], harmonics,
                  np.array(rest), still_frames, frame)  # fmt: skip


def _mean(values: Array) -> Array:
    """Mean over the first axis of what is known; NaN where less than half is."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count >= len(values) / 2, mean, np.nan)


@dataclass(frozen=True)
class Instant:
    """The maxima of the deflection, as the force's phase tells them.

    Parameters
    ----------
    omega : float
        Angular frequency in rad/s.
    phase : float
        Phase of the deflection on the reference camera's clock, rad.
    times : ndarray, shape (maxima,)
        The maxima of the steady part, s.
    """

    omega: float
    phase: float
    times: Array

    def nearest(self, rate: float, offset: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Of the maxima, the one that a frame comes nearest to, and that frame's time.

        Frames are at (k + offset) / rate; `offset` may have any shape.
        """
        first = np.asarray(offset, float)[..., None]
        frames = (np.rint(self.times * rate - first) + first) / rate
        best = np.argmin(np.abs(frames - self.times), axis=-1)[..., None]
        chosen = np.take_along_axis(frames, best, axis=-1)[..., 0]
        return self.times[best[..., 0]], chosen


def instant_of(data: xr.Dataset, damping: float) -> Instant:
    """The maxima: at the displacement resonance they lag the force by a quarter period, less ξ."""
    omega = 2 * np.pi * float(data["frequency"])
    real, imaginary = data["force"].values
    phase = float(np.arctan2(imaginary, real) - (np.pi / 2 - damping))
    margin = NEAR / float(data["frame_rate"].min())
    begin, end = data["steady"].values + np.array([margin, -margin])
    first, last = np.ceil((omega * begin + phase) / (2 * np.pi)), (omega * end + phase) / 2 / np.pi
    turns = np.arange(first, max(last, first + 0.5))
    return Instant(omega, phase, (2 * np.pi * turns - phase) / omega)


# The chain's own result: trial 0.


def deflection(tracks: Tracks, instant: Instant, method: str, exposures: Array) -> Array:
    """Deflection of all markers at its maximum, shape (markers,), m."""
    P = tracks.P
    if method == "harmonic":
        amplitude = rc.harmonic_deflection(
            P, tracks.frame, instant.omega, _unblurred(tracks, instant, exposures)
        )
        return rc.real_shape(amplitude, instant.phase)
    if method == "literal":
        first = tracks.times[0, 0] * _rate(tracks)
        number = round(float(instant.nearest(_rate(tracks), first)[1]) * _rate(tracks) - first)
        chosen = number - (tracks.frames - tracks.frames[0])
        uv = tracks.uv[np.arange(len(P)), np.clip(chosen, 0, tracks.uv.shape[1] - 1)]
    else:
        uv = np.stack(
            [
                rc.interpolate(times, own, instant.times[0], NEAR)
                for times, own in zip(tracks.times, tracks.uv, strict=True)
            ]
        )
    return rc.deflection_at(P, tracks.frame, tracks.rest, uv)


def _unblurred(tracks: Tracks, instant: Instant, exposures: Array) -> list[rc.Harmonics]:
    return [
        own.unblurred(instant.omega * float(exposure))
        for own, exposure in zip(tracks.harmonics, exposures, strict=True)
    ]


def _rate(tracks: Tracks) -> float:
    return float(1 / (tracks.times[0, 1] - tracks.times[0, 0]))


# The other trials.


@dataclass(frozen=True)
class Draws:
    """What differs from trial to trial, for all four cameras.

    Parameters
    ----------
    starts : ndarray, shape (trials, cameras)
        True starts, s.
    clocks : ndarray, shape (trials, cameras)
        Errors of the aligned clocks, s.
    seeds : list of SeedSequence
        For the noise of each trial.
    """

    starts: Array
    clocks: Array
    seeds: list[np.random.SeedSequence]


def draw(study: Experiment, data: xr.Dataset) -> Draws:
    """Starts and clock errors of all trials."""
    root = np.random.SeedSequence([study.seed, 5])
    own, *seeds = root.spawn(study.trials + 1)
    rng = np.random.default_rng(own)
    seconds = float(data["steady"][1] - data["steady"][0])
    sigma = delay_deviation(
        study.frequency_hz, 10 ** (study.audio_noise_db / 10), int(seconds * SAMPLE_RATE)
    )
    shape = (study.trials, len(NAMES))
    clocks = sigma * rng.standard_normal(shape)
    return Draws(rng.uniform(0, LATE, shape), clocks, seeds)


def trials(
    tracks: Tracks, instant: Instant, method: str, draws: Draws, index: Sequence[int],
    exposures: Array,
) -> Array:  # fmt: skip
    """Deflections of all markers in trials 1 …, shape (trials, markers), m."""
    n = len(draws.starts)
    P, rate, sigma = tracks.P, _rate(tracks), tracks.sigma
    starts, clocks = draws.starts[:, index], draws.clocks[:, index]
    clocks = clocks - clocks[:, :1]  # errors are those against the reference
    noise = np.stack(
        [np.random.default_rng(seed).standard_normal((2, len(NAMES), *sigma.shape[1:]))
         for seed in draws.seeds]
    )[:, :, index] if n else np.zeros((0, 2, *sigma.shape))  # fmt: skip
    rest = tracks.rest + sigma / np.sqrt(tracks.rest_frames) * noise[:, 0]
    if method == "harmonic":
        return _harmonic_trials(tracks, instant, clocks, noise[:, 1], exposures)
    delay = starts - starts[:, :1]
    if method == "literal":
        # The reference's frames fall as they like; the others follow in whole frames.
        _, chosen = instant.nearest(rate, starts[:, :1] * rate)
        left = (delay + clocks) * rate
        at = chosen + (left - np.rint(left)) / rate
        scale = np.ones_like(at)
    else:
        at = instant.times[0] + clocks
        scale = np.array([_lagrange_norm(f) for f in ((starts * rate) % 1).ravel()])
        scale = scale.reshape(at.shape)
    images = np.stack(
        [own.at(instant.omega, at[:, i]) for i, own in enumerate(tracks.harmonics)], axis=1
    )
    images = images + scale[:, :, None, None] * sigma * noise[:, 1]
    pair = np.stack([rest, images])  # (2, trials, cameras, 2, markers)
    both = np.isfinite(pair).all(axis=0)
    pair = np.where(both, pair, np.nan).transpose(2, 3, 0, 1, 4)
    points, _ = rc.triangulate_seen(P, pair)
    height = tracks.frame.to_beam(points)[2]
    return np.asarray(height[1] - height[0])


def _lagrange_norm(fraction: float) -> float:
    """Root of the summed squares of the interpolation's weights: what it makes of white noise."""
    nodes = np.arange(NEAR)
    weights = rc.interpolate(nodes, np.eye(NEAR), NEAR / 2 - 1 + fraction, NEAR)
    return float(np.linalg.norm(weights))


def _harmonic_trials(
    tracks: Tracks, instant: Instant, clocks: Array, noise: Array, exposures: Array
) -> Array:
    """Trials of the harmonic fit: its first harmonic with noise, the clocks in error.

    The phase is free in the fit, so of the noise of the two coefficients only the part in phase
    with the motion counts; the mean and the second harmonic carry none of the deflection.
    """
    fitted = _unblurred(tracks, instant, exposures)
    amplitude = rc.harmonic_deflection(tracks.P, tracks.frame, instant.omega, fitted)
    base = rc.real_shape(amplitude, instant.phase)
    seen = np.asarray(np.isfinite(tracks.sigma).all(axis=1))
    gains = rc.normal_gain(tracks.P, tracks.frame, _rest_points(tracks), seen)
    spread = np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in fitted])
    by_noise = np.einsum("cim,tcim->tm", gains, np.nan_to_num(spread * tracks.sigma) * noise)
    # A clock that is wrong by e turns the camera's image by ωe: cos(ωe) − 1 of it is lost.
    image = np.array([h.coefficients[1] - 1j * h.coefficients[2] for h in fitted])
    image = np.nan_to_num(np.real(image * np.exp(-1j * instant.phase)))
    by_clock = np.einsum("cim,tc,cim->tm", gains, np.cos(instant.omega * clocks) - 1, image)
    return np.asarray(base + by_noise + by_clock)


def _rest_points(tracks: Tracks) -> Array:
    points, _ = rc.triangulate_seen(tracks.P, tracks.rest)
    return points


def predicted(tracks: Tracks, method: str, at: Instant, exposures: Array) -> Array:
    """Standard deviation of the deflection of each marker by the noise of the centres alone, m."""
    sigma = tracks.sigma
    if method == "harmonic":
        fitted = _unblurred(tracks, at, exposures)
        each = sigma * np.sqrt([0.5 * (h.covariance[1, 1] + h.covariance[2, 2]) for h in fitted])
    else:
        mean = 1.0 if method == "literal" else np.mean(
            [_lagrange_norm(f) ** 2 for f in np.linspace(0, 1, 21)]
        )  # fmt: skip
        each = sigma * np.sqrt(mean + 1 / tracks.rest_frames)
    return rc.height_deviation(tracks.P, tracks.frame, _rest_points(tracks), each)


# The cube.


def run(study: Experiment, data: xr.Dataset) -> xr.Dataset:
    """The cube of a study of chapter 5, from the measured recordings."""
    beam = setups.beam()
    markers = Markers(beam)
    row = markers.middle_row
    part = Component("bending", 1, study.frequency_hz, study.amplitude_mm / 1000)
    reference = part.amplitude * part.shape(beam, beam.markers)
    instant, draws = instant_of(data, beam.damping), draw(study, data)
    settings = study.settings()
    results: list[dict[str, Any]] = []
    for setting in settings:
        names = "".join(n for n, d in study.directions_deg.items() if d in setting.directions_deg)
        index = [NAMES.index(name) for name in names]
        method = method_of(setting.case)
        tracks = tracks_of(data, markers, names, setting.resolution_px[0],
                           "full" if method == "harmonic" else "literal")  # fmt: skip
        exposures = data["exposure"].values[index]
        first = deflection(tracks, instant, method, exposures)
        drawn = trials(tracks, instant, method, draws, index, exposures)
        measured = np.concatenate([first[None], drawn])[None, :, row]
        noise = predicted(tracks, method, instant, exposures)
        scale = 100 / np.abs(reference).max()
        error = np.abs(measured - reference) * scale
        results.append(
            {
                "measured_deflection": measured,
                "point_error": error[:, 0],
                "mean_error": np.sqrt(np.nanmean(error**2, axis=-1)),
                "max_point_error": np.nanmax(error, axis=-1),
                "predicted_error": [scale * _rms(noise[row])],
                "mac": modal_assurance(np.nan_to_num(measured), reference[None]),
                "missing": np.mean(np.isnan(measured), axis=-1),
                "in_view": _in_view(tracks, markers),
                "ground_sample_distance": np.mean(
                    [study.distance_mm / 1000 / c.K[0, 0] for c in tracks.cameras]
                ),
                "centre_scatter": _rms(tracks.sigma),
                "grid_residual": tracks.frame.rms,
                "grid_scale": tracks.frame.scale,
                "grid_tilt": np.degrees(tracks.frame.tilt),
                **_harmonic_results(tracks, instant, data, exposures, markers),
            }
        )
    return _cube(study, settings, reference, results, data)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _in_view(tracks: Tracks, markers: Markers) -> float:
    """Share of the markers at rest, camera by camera, that lie on the sensor, found or not."""
    frame, grid = tracks.frame, markers.world[:, : markers.count]
    world = frame.R.T @ grid + frame.origin[:, None]
    return float(np.mean([on_sensor(lens.project(c, world)[None], c.size) for c in tracks.cameras]))


def _harmonic_results(
    tracks: Tracks, instant: Instant, data: xr.Dataset, exposures: Array, markers: Markers
) -> dict[str, Any]:
    """Amplitude, phase to the force and standard error of every marker; drive-point mobility."""
    fitted = _unblurred(tracks, instant, exposures)
    amplitude = rc.harmonic_deflection(tracks.P, tracks.frame, instant.omega, fitted)
    real, imaginary = data["force"].values
    force = complex(real, imaginary) * float(data["full_scale"])
    beam = markers.beam
    shape = Component().shape(beam, markers.positions[:, : markers.count])
    known = np.isfinite(amplitude)
    modal = np.vdot(shape[known], amplitude[known]) / np.vdot(shape[known], shape[known])
    drive = Component().shape(beam, beam.force_point)[0]
    mobility = 1j * instant.omega * modal * drive / force
    row = markers.middle_row
    return {
        "amplitude": np.abs(amplitude)[None, row],
        "phase": np.degrees(np.angle(amplitude / force))[None, row],
        "standard_error": predicted(tracks, "harmonic", instant, exposures)[None, row],
        "mobility_real": mobility.real,
        "mobility_imag": mobility.imag,
    }


_VARIABLES: dict[str, tuple[tuple[str, ...], str, str, str]] = {
    "measured_deflection": (
        ("mode", "trial", "point"), "float32", "m", "measured deflection of the markers"),
    "mean_error": (
        ("mode", "trial"), "float64", "percent", "rms error over the markers"),
    "max_point_error": (
        ("mode", "trial"), "float64", "percent", "largest error of a marker"),
    "point_error": (
        ("mode", "point"), "float64", "percent", "error of each marker in trial 0"),
    "predicted_error": (
        ("mode",), "float64", "percent", "rms error by the noise of the centres alone"),
    "mac": (("mode", "trial"), "float64", "1", "modal assurance criterion with the reference"),
    "missing": (("mode", "trial"), "float64", "1", "share of markers that no two cameras see"),
    "in_view": ((), "float64", "1", "share of camera x marker images on the sensor"),
    "ground_sample_distance": ((), "float64", "m/px", "length of a pixel at the origin"),
    "centre_scatter": ((), "float64", "px", "scatter of the centres about their harmonics"),
    "grid_residual": ((), "float64", "m", "rms distance of the markers at rest from their grid"),
    "grid_scale": ((), "float64", "1", "size of the measured grid over the nominal one"),
    "grid_tilt": ((), "float64", "degree", "angle of the measured plane to the fitted grid"),
    "amplitude": (("mode", "point"), "float64", "m", "amplitude by the harmonic fit"),
    "phase": (("mode", "point"), "float64", "degree", "phase to the force by the harmonic fit"),
    "standard_error": (
        ("mode", "point"), "float64", "m", "standard error of the amplitude by the harmonic fit"),
    "mobility_real": ((), "float64", "m s-1 N-1", "drive-point mobility, real part"),
    "mobility_imag": ((), "float64", "m s-1 N-1", "drive-point mobility, imaginary part"),
}  # fmt: skip


def _cube(
    study: Experiment,
    settings: list[setups.Setting],
    reference: Array,
    results: list[dict[str, Any]],
    data: xr.Dataset,
) -> xr.Dataset:
    cube = xr.Dataset(coords=coordinates(study, study.modes, setups.beam(), settings))
    cube["frequency"] = ("mode", [study.frequency_hz],
                         {"long_name": "frequency of the force", "units": "Hz"})  # fmt: skip
    cube["trial"].attrs["long_name"] = "draw of starts, clocks and noise, 0 for the chain's result"
    cube["reference_deflection"] = (
        ("mode", "point"), reference[None],
        {"units": "m", "long_name": "reference deflection of the markers"},
    )  # fmt: skip
    for name, (dims, dtype, units, long_name) in _VARIABLES.items():
        values = np.array([result[name] for result in results]).astype(dtype)
        cube[name] = (("setting", *dims), values, {"units": units, "long_name": long_name})
    add_cameras(cube, settings)
    beam = setups.beam()
    natural = 2 * np.pi * study.frequency_hz / np.sqrt(1 - 2 * beam.damping**2)
    omega = 2 * np.pi * study.frequency_hz
    drive = Component().shape(beam, beam.force_point)[0]
    stiffness = natural**2 - omega**2 + 2j * beam.damping * natural * omega
    mobility = 1j * omega * drive**2 / (beam.mass / 4 * stiffness)
    cube["mobility_reference"] = (
        "part", [mobility.real, mobility.imag],
        {"units": "m s-1 N-1", "long_name": "drive-point mobility of the model"},
    )  # fmt: skip
    kept = {"missing_share": "tracking_missing", "wrong_share": "tracking_wrong",
            "centre_error": "tracking_error"}  # fmt: skip
    for name, new in kept.items():
        cube[new] = ("tracked_width", data[name].values, data[name].attrs)
    text = {"long_name": "width at which frames were tracked", "units": "1"}
    cube["tracked_width"] = ("tracked_width", data["width"].values, text)
    return cube
