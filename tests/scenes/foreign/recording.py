"""A small laboratory filmed by the ray caster and written by PyAV.

The truth is OpenCV's: `cv2.projectPoints` says where everything is in the pictures.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from scenes.foreign.rays import Eye, Film, Strip, grey, looking
from scenes.sounds import write_film

from thesis_lib.measure.exchange.cameras import write_cameras
from thesis_lib.measure.recordings.manifest import CameraFiles, Manifest
from thesis_lib.measure.recordings.manifest_parts import Excitation, ReusedRig
from thesis_lib.vision.pinhole import Camera

RATE, SOUND_RATE = 60, 48000  # frames and samples a second
FREQUENCY, TIP = 11.3, 0.004  # Hz, m
EXPOSURE = 1 / 250  # s
REST, START, RAMP, LENGTH = 0.2, 0.25, 0.1, 0.8  # s
STAMPS = np.arange(int(LENGTH * RATE)) / RATE  # of every camera's frames by its own clock, s


def envelope(t):
    """From 0 at START to 1, without a jump of the second derivative."""
    s = np.clip((t - START) / RAMP, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s * s)


def tip(t):
    """Deflection of the beam's tip in m."""
    return TIP * envelope(t) * np.sin(2 * np.pi * FREQUENCY * (t - START))


def force(t):
    """What the cameras hear: in phase with the tip's velocity."""
    return 0.4 * envelope(t) * np.cos(2 * np.pi * FREQUENCY * (t - START))


def eyes():
    """Three cameras above the beam that are alike, but not the same."""
    size = (960, 540)
    return [
        looking("A", (0.05, -0.60, 0.68), 2.0, size, (1150, 1152), (6, -4),
                (-0.120, 0.05, 0.0008, -0.0005, 0)),
        looking("B", (0.42, 0.42, 0.66), -13.0, size, (1141, 1140), (-5, 3),
                (-0.105, 0.03, -0.0006, 0.0007, 0)),
        looking("C", (-0.45, -0.15, 0.76), -8.0, size, (1163, 1161), (3, 7),
                (-0.135, 0.06, 0.0004, 0.0003, 0)),
    ]  # fmt: skip


@dataclass(frozen=True)
class Scene:
    eyes: Sequence[Eye] = field(default_factory=eyes)
    row_time: float = 0.0  # s from row to row: a rolling shutter
    strip: Strip = field(default_factory=Strip)
    starts: Sequence[float] = (0.0, 0.0137, 0.0291)
    noise_db: float = 25.0  # power of the force over that of the noise in the sound

    @property
    def shape(self):
        """The largest deflection of every marker, m."""
        return TIP * self.strip.shape(self.strip.points[0])

    def tracks(self, camera):
        """Where the markers are, (frames, 2, markers), from the sensor's corner in px."""
        times = self.starts[camera] + STAMPS
        return np.array([self.eyes[camera].project(self.strip.world(tip(t))) for t in times])

    def film(self, folder):
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(lambda i: self._film(i, folder), range(len(self.eyes))))
        # OpenCV counts pixels from the first one's centre, the library from its corner.
        corner = np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
        cameras = [Camera(eye.name, eye.K + corner, eye.distortion, eye.R, eye.centre, eye.size)
                   for eye in self.eyes]  # fmt: skip
        write_cameras(folder / "cameras.yaml", cameras)

    def _film(self, index, folder):
        eye, start = self.eyes[index], self.starts[index]
        rng = np.random.default_rng([0, index, 0])
        clean = force(start + np.arange(int(LENGTH * SOUND_RATE)) / SOUND_RATE)
        spread = 0.4 / np.sqrt(2) * 10 ** (-self.noise_db / 20)
        noise = np.random.default_rng([0, index, 99]).standard_normal(len(clean))
        view = Film(eye, self.strip, tip, 1.3 * TIP, EXPOSURE, self.row_time)
        frames = (grey(view.picture(start + stamp), rng) for stamp in STAMPS)
        write_film(folder / f"{eye.name}.mkv", [clean + spread * noise], SOUND_RATE, frames=frames,
                   frame_rate=RATE, pictures="ffv1", pix_fmt="gray", codec="pcm_s16le")  # fmt: skip

    def manifest(self):
        """What the files are; the structure is the thesis's beam."""
        return Manifest(
            cameras=tuple(
                CameraFiles(
                    name=eye.name, video=f"{eye.name}.mkv", width_px=eye.size[0],
                    height_px=eye.size[1], frame_rate_hz=RATE, exposure_s=EXPOSURE,
                    readout_s=(eye.size[1] - 1) * self.row_time,
                )
                for eye in self.eyes
            ),
            calibration=ReusedRig(file="cameras.yaml"),
            excitation=Excitation(frequency_hz=FREQUENCY, rest_duration_s=REST),
        )  # fmt: skip
