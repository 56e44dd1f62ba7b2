"""Tracks of a beam that moves in several modes: projected markers, no pictures."""

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts import setups
from thesis_lib.laboratory.recording_files import manifest_of
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.calibration import uncertainty
from thesis_lib.measure.exchange.cameras import Found, as_calibrated
from thesis_lib.measure.fitting.reconstruction import check_frame, triangulate_seen
from thesis_lib.measure.modes.shapes import Rest, Track
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.recordings.manifest_parts import Excitation, Sought
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vibration.motion import Component
from thesis_lib.vision import pinhole

BEAM = setups.thesis_beam()
DIRECTIONS = [(-60.0, 25.0), (-20.0, 35.0), (25.0, 30.0), (65.0, 40.0)]
RATES = (60.0, 50.0, 29.97, 60.0)  # frames per second


@dataclass(frozen=True)
class Truth:
    """A sum of modes that decay from time 0."""

    frequency: Array  #: Hz
    damping: Array
    shape: ComplexArray  #: m, (modes, markers)

    @property
    def poles(self):
        """1/s."""
        turn = 1j * np.sqrt(1 - self.damping**2)
        return np.asarray(2 * np.pi * self.frequency * (turn - self.damping), complex)

    def at(self, times):
        """Deflection at times (..., markers), m."""
        parts = zip(self.poles, self.shape, strict=True)
        return np.asarray(sum(np.real(own * np.exp(pole * times)) for pole, own in parts), float)

    def shape_at(self, zero):
        """The shapes as they are at a time."""
        return np.asarray(self.shape * np.exp(self.poles * zero)[:, None], complex)


def rig(cameras=4):
    """Cameras of 1280 × 720 px around the thesis's beam."""
    return default_rig(BEAM, DIRECTIONS[:cameras], size=(1280, 720))


def beam_modes(damping=(0.01, 0.006, 0.004), amplitude=(2e-3, 1e-3j, -8e-4)):
    """The beam's first modes at the markers, amplitudes at the tip in m."""
    count = len(damping)
    points = rig().markers.centres
    form = np.array([Component("bending", n + 1).shape(BEAM, points) for n in range(count)])
    omega = BEAM.angular_frequencies(count)
    return Truth(omega / (2 * np.pi), np.array(damping), form * np.array(amplitude)[:, None])


def tracks(
    own,
    truth,
    seconds=4.0,
    rates=RATES,
    readout=0.012,
    exposure=1 / 500,
    noise=0.02,
    lost=0.0,
    seed=0,
    off=(0.0, 0.0, 0.0, 0.0),
):
    """What the cameras see: each at its rate from its own start, rows and exposure as they are.

    Camera c's clock says `off[c]` seconds too much.
    """
    rng = np.random.default_rng(seed)
    points, found = own.markers.centres, []
    parts = ((np.arange(4) + 0.5) / 4 - 0.5) * exposure / np.sqrt(1 - 1 / 16)
    for camera, rate, wrong in zip(own.cameras, rates, off, strict=False):
        times = rng.uniform(0, 1 / rate) + np.arange(int(seconds * rate)) / rate
        row = pinhole.project_points(camera, on_surface(own.markers.extent, points))[1]
        for _ in range(3):  # the row tells when it is seen, and that where it is
            at = times[:, None] + readout * (row / camera.size[1] - 0.5)
            shown = [
                pinhole.project_points(
                    camera, on_surface(own.markers.extent, points[:, None], truth.at(at + part))
                )
                for part in parts
            ]
            row = np.mean(shown, axis=0)[1]
        uv = np.mean(shown, axis=0).swapaxes(0, 1)
        uv = uv + noise * rng.standard_normal(uv.shape)
        uv[np.broadcast_to(rng.random((len(uv), 1, uv.shape[2])) < lost, uv.shape)] = np.nan
        plain = pinhole.undistort_tracks(camera, uv)
        found.append(Track(camera, times + wrong, plain, exposure, readout, uv[:, 1]))
    return found


def rest(own):
    """The markers at rest."""
    world = on_surface(own.markers.extent, own.markers.centres)
    images = np.array(
        [pinhole.undistort_pixels(c, pinhole.project_points(c, world)) for c in own.cameras]
    )
    points, _ = triangulate_seen(pinhole.projection_matrices(own.cameras), images)
    frame = check_frame(own.cameras, images, own.markers)
    return Rest(images, frame, points, own.markers.centres, BEAM.thickness)


def recorded(folder, own, truth, seconds=3, rates=RATES, noise=0.02, seed=0):
    """The same as `measure` leaves it: half a second of rest, then the motion, tracks on disk."""
    found = []
    for k, (track, station) in enumerate(
        zip(tracks(own, truth, seconds, rates, noise=noise, seed=seed), own.stations, strict=True)
    ):
        rate = rates[k]
        start = float(track.times[0])
        before = np.arange(-round(0.5 * rate), 0) / rate + start
        world = on_surface(own.markers.extent, own.markers.centres)
        still = pinhole.project_points(station.camera, world)
        own_noise = noise * np.random.default_rng(k).standard_normal((len(before), *still.shape))
        seen = pinhole.distort_pixels(station.camera, track.uv.swapaxes(0, 1)).swapaxes(0, 1)
        centres = np.concatenate([still + own_noise, seen])
        np.save(folder / f"{k}.npy", centres)
        found.append(
            Recording(
                station.camera,
                rate,
                float(before[0]) + 0.5,
                track.exposure,
                track.readout,
                folder / f"{k}.npy",
            )
        )
    manifest = manifest_of(own)
    excitation = Excitation(
        kind="free_decay", rest_duration_s=0.45, sound="room", modes=Sought(to_hz=60.0, count=2)
    )
    return found, manifest.model_copy(update={"excitation": excitation})


def calibration_of(recordings):
    """These cameras as a calibration that does not tell how exact it is."""
    found = Found([own.camera for own in recordings], placed=True)
    return uncertainty.read_deviations(as_calibrated(found), found.covariance)
