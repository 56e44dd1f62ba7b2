"""The rendered laboratory: what the cameras of chapter 5 would have filmed, with known truth.

World time counts from before the first camera starts. Every camera starts when it likes, its clock
counts from there, and frame k is exposed around k / frame rate on that clock.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from thesis_lib.abreast import abreast
from thesis_lib.cameras import hemisphere_directions, hemisphere_rotations, intrinsics
from thesis_lib.experiment import media
from thesis_lib.experiment.board import Board
from thesis_lib.experiment.lens import Camera
from thesis_lib.experiment.manifest import (
    BoardSpec,
    CameraFiles,
    Excitation,
    Manifest,
    write_manifest,
)
from thesis_lib.experiment.manifest import Markers as MarkerSpec
from thesis_lib.experiment.manifest import Structure as StructureSpec
from thesis_lib.experiment.poses import default_poses
from thesis_lib.experiment.render import BeamView, Image, Sensor, board_image
from thesis_lib.experiment.scene import Component, Markers, Motion, rows_on
from thesis_lib.structures import Beam, Plate, Structure

Array = NDArray[np.float64]

REST = 1.0  # s at rest at the start of every recording
LATE = 0.25  # s within which the cameras start
SAMPLE_RATE = 48000  # Hz
HEADROOM = 0.5  # largest force on the audio track over full scale


@dataclass(frozen=True)
class Station:
    """A camera, what its sensor does, how fast it films, and when it starts.

    Parameters
    ----------
    camera : Camera
        Optics and pose.
    sensor : Sensor
        Exposure, spread, noise, grey levels.
    frame_rate : float
        Frames per second.
    start : float
        World time of its first frame, s.
    """

    camera: Camera
    sensor: Sensor
    frame_rate: float
    start: float


@dataclass(frozen=True)
class Rig:
    """All that is filmed and heard.

    Parameters
    ----------
    stations : tuple of Station
        The cameras.
    markers : Markers
        The beam and what is printed on it.
    motion : Motion
        How it moves, in world time.
    duration : float
        Length of each recording, s.
    audio_noise_db : float
        Power of the force over that of the noise on the audio tracks, dB.
    seed : int
        Seed of all noise.
    board : Board
        The calibration board.
    rotations, translations : ndarray, shapes (shots, 3, 3) and (shots, 3)
        Poses of the board in the world.
    """

    stations: tuple[Station, ...]
    markers: Markers
    motion: Motion
    duration: float
    audio_noise_db: float = 20.0
    seed: int = 0
    board: Board = field(default_factory=Board)
    rotations: Array = field(default_factory=lambda: default_poses()[0])
    translations: Array = field(default_factory=lambda: default_poses()[1])

    @property
    def cameras(self) -> list[Camera]:
        """The cameras alone."""
        return [station.camera for station in self.stations]

    @property
    def full_scale(self) -> float:
        """Force in N at full scale of the audio tracks."""
        times = np.linspace(self.motion.start, self.motion.steady + 1, 4000)
        return float(np.abs(self.motion.force(times)).max()) / HEADROOM

    def generator(self, what: int, camera: int, item: int) -> np.random.Generator:
        """Noise of one frame, shot or track: the same whatever else is made."""
        return np.random.default_rng([self.seed, what, camera, item])


def default_rig(
    structure: Beam | Plate,
    directions_deg: Sequence[tuple[float, float]],
    *,
    focal_length: float = 0.024,
    sensor_width: float = 0.036,
    distance: float = 0.57,
    size: tuple[int, int] = (1920, 1080),
    sensor: Sensor | None = None,
    frame_rate: float = 60.0,
    components: tuple[Component, ...] = (Component(),),
    lens_k1: float = -0.08,
    audio_noise_db: float = 20.0,
    seed: int = 0,
    markers: Markers | None = None,
) -> Rig:
    """The rig of section 5.1: similar, but not identical cameras that look at the structure.

    Focal lengths, principal points and distortions differ by what cameras of one kind differ by.
    The motion is at rest for a second, grows over two periods, and is filmed in its steady state
    for a second and at least five periods.

    Parameters
    ----------
    structure : Beam or Plate
        What is filmed.
    directions_deg : sequence of tuple
        Azimuth and elevation of each camera.
    focal_length, sensor_width : float
        In m; the pixels are square and fill the width.
    distance : float
        Of all cameras from the structure's centre, m.
    size : tuple of int
        Width and height of the sensors in px.
    sensor : Sensor, optional
        Exposure, spread, noise and grey levels.
    frame_rate : float
        Frames per second.
    components : tuple of Component
        The steady vibration.
    lens_k1 : float
        First coefficient of the lens distortion.
    audio_noise_db : float
        Power of the force over that of the noise on the audio tracks, dB.
    seed : int
        Seed of all noise and of the cameras' starts.
    markers : Markers, optional
        Those of the thesis's beam if not given, or in the plate's cells with a fifth of their side
        as diameter.
    """
    angles = np.radians(directions_deg)
    rotations = hemisphere_rotations(angles[:, 0], angles[:, 1])
    centres = distance * hemisphere_directions(angles[:, 0], angles[:, 1])
    starts = np.random.default_rng([seed, 0]).uniform(0, LATE, len(angles))
    focal = focal_length / sensor_width * size[0]
    stations = []
    for i, (R, centre, start) in enumerate(zip(rotations, centres, starts, strict=True)):
        differs = np.sin([1.0 + 7 * i, 2.0 + 5 * i, 3.0 + 3 * i, 4.0 + 2 * i])  # in −1…1
        K = intrinsics(focal * (1 + 0.005 * differs[0]), size)
        K[:2, 2] += 0.004 * size[0] * differs[1:3]
        distortion = lens_k1 * (1 + 0.2 * differs[3]) * np.array([1, -0.15, 0.005, -0.004, 0])
        camera = Camera(chr(ord("A") + i), K, distortion, R, centre, size)
        stations.append(Station(camera, sensor or Sensor(), frame_rate, float(start)))
    period = 1 / min(part.frequency for part in components)
    motion = Motion(structure, components, REST + LATE, 2 * period)
    return Rig(
        tuple(stations), markers or _default_markers(structure), motion,
        duration=motion.steady + max(1.0, 5 * period),
        audio_noise_db=audio_noise_db, seed=seed,
    )  # fmt: skip


def _default_markers(structure: Beam | Plate) -> Markers:
    if isinstance(structure, Beam):
        return rows_on(structure)
    cells = Markers(structure.extent, structure.markers, 0.0)
    return replace(cells, diameter=float(cells.nearest.min()) / 5)


def frames(rig: Rig, index: int, noise: bool = True) -> Iterator[Image]:
    """The frames of one camera, one after the other."""
    station = rig.stations[index]
    view = BeamView(station.camera, rig.markers, rig.motion, station.sensor)
    for k in range(int(rig.duration * station.frame_rate)):
        rng = rig.generator(1, index, k) if noise else None
        yield view.frame(station.start + k / station.frame_rate, rng)


def sound(rig: Rig, index: int) -> Array:
    """The audio track of one camera: the force over full scale, with noise."""
    station = rig.stations[index]
    times = station.start + np.arange(int(rig.duration * SAMPLE_RATE)) / SAMPLE_RATE
    signal = rig.motion.force(times) / rig.full_scale
    tone = signal[times > rig.motion.steady]
    spread = np.std(tone) * 10 ** (-rig.audio_noise_db / 20)
    return signal + spread * rig.generator(2, index, 0).standard_normal(len(signal))


def shots(rig: Rig, index: int) -> Iterator[Image]:
    """The pictures that one camera takes of the board."""
    station = rig.stations[index]
    for k, (R, t) in enumerate(zip(rig.rotations, rig.translations, strict=True)):
        rng = rig.generator(3, index, k)
        yield board_image(station.camera, rig.board, R, t, station.sensor, rng)


def film(rig: Rig, folder: Path, codec: Literal["ffv1", "h264"] = "ffv1", crf: int = 23) -> Path:
    """Write a video and the board shots of every camera; the cameras film side by side.

    Returns
    -------
    Path
        The manifest. Camera A's files are ``A.mkv`` and ``A/00.png`` and so on.
    """

    def one(index: int) -> Path:
        station = rig.stations[index]
        video = folder / f"{station.camera.name}.mkv"
        media.write_video(video, frames(rig, index), station.frame_rate, sound(rig, index),
                          SAMPLE_RATE, codec, crf)  # fmt: skip
        for k, image in enumerate(shots(rig, index)):
            media.write_png(folder / station.camera.name / f"{k:02d}.png", image)
        return video

    abreast(one, range(len(rig.stations)))
    path = folder / "manifest.yaml"
    write_manifest(manifest_of(rig), path)
    return path


def manifest_of(rig: Rig) -> Manifest:
    """What the files of a filmed rig are."""
    board = rig.board
    return Manifest(
        structure=_structure(rig.motion.structure, rig.markers),
        cameras=tuple(
            CameraFiles(
                name=station.camera.name, video=f"{station.camera.name}.mkv",
                width_px=station.camera.size[0], height_px=station.camera.size[1],
                frame_rate_hz=station.frame_rate, exposure_s=station.sensor.exposure,
                shots=station.camera.name,
            )
            for station in rig.stations
        ),
        board=BoardSpec(
            columns=board.columns, rows=board.rows, tile_mm=_mm(board.tile),
            margin_mm=_mm(board.margin),
        ),
        excitation=Excitation(
            frequency_hz=rig.motion.components[0].frequency, rest_s=REST,
            force_per_full_scale_n=rig.full_scale,
        ),
    )  # fmt: skip


def _structure(structure: Structure, markers: Markers) -> StructureSpec:
    """What is filmed: its markers by rows where they stand in such, else one by one."""
    x, y = structure.force_point[:, 0]
    if isinstance(structure, Plate):
        own: dict[str, Any] = {
            "kind": "plate",
            "poissons_ratio": structure.poisson,
            "force_across_mm": _mm(y),
        }
    elif isinstance(structure, Beam):
        own = {"kind": "beam"}
    else:
        raise TypeError(f"{type(structure).__name__}: neither a beam nor a plate")
    given: dict[str, Any] = {
        "diameter_mm": _mm(markers.diameter),
        "tone": "bright" if markers.bright else "dark",
        "hole_mm": markers.hole and (_mm(markers.hole[0]), _mm(markers.hole[1])),
    }
    rows = {
        "rows": len(markers.rows), "columns": markers.columns,
        "spacing_mm": _mm(float(np.diff(markers.centres[0, :2])[0])),
        "row_spacing_mm": _mm(markers.row_spacing) if len(markers.rows) > 1 else 10.0,
    }  # fmt: skip
    points = tuple((_mm(u), _mm(v)) for u, v in markers.centres.T)

    def spec(layout: dict[str, Any]) -> StructureSpec:
        return StructureSpec(
            length_mm=_mm(structure.length), width_mm=_mm(structure.width),
            thickness_mm=_mm(structure.thickness), density_kg_m3=structure.density,
            youngs_modulus_pa=structure.youngs_modulus, damping=structure.damping,
            force_position_mm=_mm(x), markers=MarkerSpec(**given, **layout), **own,
        )  # fmt: skip

    by_points = spec({"points_mm": points})
    try:
        by_rows = spec(rows)
    except ValidationError:  # they are no rows
        return by_points
    near = by_rows.marker_points.shape == by_points.marker_points.shape and np.allclose(
        by_rows.marker_points, by_points.marker_points, atol=1e-8
    )
    return by_rows if near else by_points


def _mm(metres: float) -> float:
    return round(1000 * metres, 9)
