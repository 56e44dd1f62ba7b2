"""Tracks of a beam that moves in several modes: projected markers, no pictures."""

from dataclasses import dataclass

import numpy as np

from thesis_lib.arrays import Array, ComplexArray
from thesis_lib.facts import setups
from thesis_lib.laboratory.recording_files import manifest_of
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.exchange.cameras import describe_reused
from thesis_lib.measure.fitting.reconstruction import check_rest
from thesis_lib.measure.modes.shapes import Track
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.recordings.manifest_parts import Excitation, ModeSearch
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vibration.motion import Component
from thesis_lib.vision import pinhole

BEAM = setups.thesis_beam()
DIRECTIONS = [(-60.0, 25.0), (-20.0, 35.0), (25.0, 30.0), (65.0, 40.0)]
RATES = (60.0, 50.0, 29.97, 60.0)  # frames per second
READOUT, EXPOSURE = 0.012, 1 / 500  # s


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
        return 2 * np.pi * self.frequency * (turn - self.damping)

    def at(self, times):
        """Deflection at times (..., markers), m."""
        parts = zip(self.poles, self.shape, strict=True)
        return sum(np.real(own * np.exp(pole * times)) for pole, own in parts)

    def shape_at(self, zero):
        """The shapes as they are at a time."""
        return self.shape * np.exp(self.poles * zero)[:, None]


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


def tracks(own, truth, seconds=4.0, rates=RATES, noise=0.02, lost=0.0, seed=0, off=(0.0,) * 4):
    """What the cameras see: each at its rate from its own start, rows and exposure as they are.

    Camera c's clock says `off[c]` seconds too much.
    """
    rng, extent = np.random.default_rng(seed), own.markers.extent
    points, found = own.markers.centres, []
    parts = ((np.arange(4) + 0.5) / 4 - 0.5) * EXPOSURE / np.sqrt(1 - 1 / 16)
    for camera, rate, wrong in zip(own.cameras, rates, off, strict=False):
        times = rng.uniform(0, 1 / rate) + np.arange(int(seconds * rate)) / rate
        row = pinhole.project_points(camera, on_surface(extent, points))[1]
        for _ in range(3):  # the row tells when it is seen, and that where it is
            at = times[:, None] + READOUT * (row / camera.size[1] - 0.5)
            worlds = (on_surface(extent, points[:, None], truth.at(at + part)) for part in parts)
            shown = np.mean([pinhole.project_points(camera, world) for world in worlds], axis=0)
            row = shown[1]
        uv = shown.swapaxes(0, 1)
        uv = uv + noise * rng.standard_normal(uv.shape)
        uv[np.broadcast_to(rng.random((len(uv), 1, uv.shape[2])) < lost, uv.shape)] = np.nan
        plain = pinhole.undistort_tracks(camera, uv)
        found.append(Track(camera, times + wrong, plain, EXPOSURE, READOUT, uv[:, 1]))
    return found


def rest(own):
    world = on_surface(own.markers.extent, own.markers.centres)
    seen = [pinhole.project_points(camera, world) for camera in own.cameras]
    pairs = zip(own.cameras, seen, strict=True)
    images = np.array([pinhole.undistort_pixels(camera, uv) for camera, uv in pairs])
    return check_rest(own.cameras, images, own.markers, BEAM.thickness)


def recorded(folder, own, truth, seconds=3, rates=RATES, noise=0.02):
    """The same as `measure` leaves it: half a second of rest, then the motion, tracks on disk."""
    found, world = [], on_surface(own.markers.extent, own.markers.centres)
    for k, track in enumerate(tracks(own, truth, seconds, rates, noise)):
        before = np.arange(-round(0.5 * rates[k]), 0) / rates[k] + track.times[0]
        still = pinhole.project_points(track.camera, world)
        drawn = np.random.default_rng(k).standard_normal((len(before), *still.shape))
        moving = pinhole.distort_pixels(track.camera, track.uv.swapaxes(0, 1)).swapaxes(0, 1)
        path, delay = folder / f"{k}.npy", float(before[0]) + 0.5
        np.save(path, np.concatenate([still + noise * drawn, moving]))
        found.append(Recording(track.camera, rates[k], delay, EXPOSURE, READOUT, path))
    sought = ModeSearch(to_hz=60.0, count=2)
    driven = Excitation(kind="free_decay", rest_duration_s=0.45, sound="room", modes=sought)
    return found, manifest_of(own).model_copy(update={"excitation": driven})


def calibration_of(recordings):
    """These cameras as a calibration that does not tell how exact it is."""
    return describe_reused([own.camera for own in recordings], None)
