"""Files of a rendered recording: videos, audio, calibration images, manifest; an example."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from pydantic import ValidationError

from thesis_lib.arrays import Array, Image
from thesis_lib.facts import setups
from thesis_lib.files import staging
from thesis_lib.laboratory.render import BeamView, Sensor, render_board
from thesis_lib.laboratory.rig import REST_S, Rig, default_rig
from thesis_lib.measure.recordings import manifest_parts, media
from thesis_lib.measure.recordings.board import BoardSpec, Markers, MarkersSpec
from thesis_lib.measure.recordings.manifest import CameraFiles, Manifest, write_manifest
from thesis_lib.studies.workers import map_in_two_threads
from thesis_lib.vibration.motion import Component
from thesis_lib.vibration.structure import Beam, Plate, Structure

SAMPLE_RATE_HZ = 48000
Codec = Literal["ffv1", "h264"]


def render_frames(rig: Rig, index: int) -> Iterator[Image]:
    """Render the frames of one camera, one after the other."""
    station = rig.stations[index]
    view = BeamView(station.camera, rig.markers, rig.motion, station.sensor)
    for k in range(int(rig.duration * station.frame_rate)):
        yield view.frame(station.start + k / station.frame_rate, rig.generator(1, index, k))


def render_sound(rig: Rig, index: int) -> Array:
    """Return the audio track of one camera: the force over full scale, with noise."""
    station = rig.stations[index]
    times = station.start + np.arange(int(rig.duration * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    signal = rig.motion.force(times) / rig.full_scale
    tone = signal[times > rig.motion.steady]
    spread = np.std(tone) * 10 ** (-rig.audio_noise_db / 20)
    return signal + spread * rig.generator(2, index, 0).standard_normal(len(signal))


def render_board_images(rig: Rig, index: int) -> Iterator[Image]:
    """Render the calibration images of one camera."""
    station = rig.stations[index]
    for k, (R, t) in enumerate(zip(rig.rotations, rig.translations, strict=True)):
        rng = rig.generator(3, index, k)
        yield render_board(station.camera, rig.board, R, t, station.sensor, rng)


def write_recording(
    rig: Rig, folder: Path, codec: Codec = "ffv1", filmed: Rig | None = None
) -> Path:
    """Write videos and board images of all cameras in parallel; return the manifest's path.

    Camera A's are ``A.mkv``, with its audio, and ``A/00.png`` and so on. `filmed` replaces the rig
    for the videos; its cameras may read parts of their sensors.
    """

    def write_camera(index: int) -> None:
        own = filmed or rig
        station = own.stations[index]
        video, frames = folder / f"{station.camera.name}.mkv", render_frames(own, index)
        sound = render_sound(own, index)
        media.write_video(video, frames, station.frame_rate, sound, SAMPLE_RATE_HZ, codec)
        for k, image in enumerate(render_board_images(rig, index)):
            media.write_png(video.with_suffix("") / f"{k:02d}.png", image)

    map_in_two_threads(write_camera, range(len(rig.stations)))
    path = folder / "manifest.yaml"
    write_manifest(manifest_of(rig), path)
    return path


def manifest_of(rig: Rig) -> Manifest:
    """Describe the files of a rendered rig."""
    board = rig.board
    return Manifest(
        structure=_describe_structure(rig.motion.structure, rig.markers),
        cameras=tuple(
            CameraFiles(
                name=station.camera.name,
                video=f"{station.camera.name}.mkv",
                width_px=station.camera.size[0],
                height_px=station.camera.size[1],
                frame_rate_hz=station.frame_rate,
                exposure_s=station.sensor.exposure,
                board_images=station.camera.name,
            )
            for station in rig.stations
        ),
        board=BoardSpec(
            columns=board.columns,
            rows=board.rows,
            tile_mm=_mm(board.tile),
            margin_mm=_mm(board.margin),
        ),
        excitation=manifest_parts.Excitation(
            frequency_hz=rig.motion.components[0].frequency,
            rest_duration_s=REST_S,
            force_per_full_scale_n=rig.full_scale,
        ),
    )


def _describe_structure(structure: Structure, markers: Markers) -> manifest_parts.StructureSpec:
    """Describe the structure, with markers by rows if they form rows, else by points."""
    x, y = structure.force_point[:, 0]
    own: dict[str, Any] = {"kind": "beam"}
    if isinstance(structure, Plate):
        own = {"kind": "plate", "poissons_ratio": structure.poisson, "force_across_mm": _mm(y)}
    elif not isinstance(structure, Beam):
        raise TypeError(f"{type(structure).__name__}: neither a beam nor a plate")
    own |= {
        "length_mm": _mm(structure.length),
        "width_mm": _mm(structure.width),
        "thickness_mm": _mm(structure.thickness),
        "density_kg_m3": structure.density,
        "youngs_modulus_pa": structure.youngs_modulus,
        "damping": structure.damping,
        "force_position_mm": _mm(x),
    }
    given: dict[str, Any] = {
        "diameter_mm": _mm(markers.diameter),
        "tone": "bright" if markers.bright else "dark",
        "hole_mm": markers.hole and (_mm(markers.hole[0]), _mm(markers.hole[1])),
    }
    rows = {
        "rows": len(markers.rows),
        "columns": markers.columns,
        "spacing_mm": _mm(float(np.diff(markers.centres[0, :2])[0])),
        "row_spacing_mm": _mm(markers.row_spacing) if len(markers.rows) > 1 else 10.0,
    }

    points = {"points_mm": tuple((_mm(u), _mm(v)) for u, v in markers.centres.T)}
    by_points = manifest_parts.StructureSpec(**own, markers=MarkersSpec(**given, **points))
    try:
        by_rows = manifest_parts.StructureSpec(**own, markers=MarkersSpec(**given, **rows))
    except ValidationError:  # the markers form no rows
        return by_points
    one, other = by_rows.marker_points, by_points.marker_points
    near = one.shape == other.shape and np.allclose(one, other, atol=1e-8)
    return by_rows if near else by_points


def _mm(metres: float) -> float:
    return round(1000 * metres, 9)


EXAMPLE_DIRECTIONS_DEG = ((12.0, 26.0), (-10.0, 25.0), (175.0, 27.0))  # azimuth and elevation, °
EXAMPLE_AMPLITUDE_M = 0.003  # m at the tip
EXAMPLE_SIZE_PX = (1280, 720)
EXAMPLE_CRF = 18  # of H.264
JPEG_QUALITY = 92  # of the board images
FOCAL_MM, SENSOR_MM = 24.0, 36.0


def example_rig() -> Rig:
    """Return the rig of the example."""
    return default_rig(
        setups.thesis_beam(),
        EXAMPLE_DIRECTIONS_DEG,
        focal_length=FOCAL_MM / 1000,
        sensor_width=SENSOR_MM / 1000,
        size=EXAMPLE_SIZE_PX,
        sensor=Sensor(exposure=1 / 500, samples=4, shot=0.02, read=0.7),
        seed=11,
        components=(Component(amplitude=EXAMPLE_AMPLITUDE_M),),
    )


def example_manifest(rig: Rig) -> Manifest:
    """Return the manifest of the example, with the fields that the feasibility check needs."""
    manifest, cameras = manifest_of(rig), []
    lens = {"focal_length_mm": FOCAL_MM, "sensor_width_mm": SENSOR_MM, "f_number": 11.0}
    pairs = zip(manifest.cameras, EXAMPLE_DIRECTIONS_DEG, strict=True)
    for camera, (azimuth, elevation) in pairs:
        place = {"distance_mm": 570.0, "azimuth_deg": azimuth, "elevation_deg": elevation}
        images = {"board_images": f"board/{camera.name}-*.jpg"}
        cameras.append(camera.model_copy(update=lens | place | images))
    excitation = manifest.excitation.model_copy(update={"amplitude_mm": 1000 * EXAMPLE_AMPLITUDE_M})
    return manifest.model_copy(update={"cameras": tuple(cameras), "excitation": excitation})


def write_example(folder: Path, say: Callable[[str], object] = print) -> Path:
    """Render the example into a new or empty folder; return the path of its manifest.

    The folder is never partial. Raise FileExistsError if it is a file, or not empty.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FileExistsError(f"{folder}: is there already, allowed: a new or empty folder")
    rig, stop = example_rig(), threading.Event()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with staging(folder.parent) as part:
        (part / "board").mkdir()

        def until_stopped(pictures: Iterator[Image]) -> Iterator[Image]:
            for picture in pictures:
                if stop.is_set():
                    raise KeyboardInterrupt
                yield picture

        def render_camera(index: int) -> None:
            station = rig.stations[index]
            name = station.camera.name
            say(f"rendering camera {name}, {index + 1} of {len(rig.stations)}")
            frames, sound = until_stopped(render_frames(rig, index)), render_sound(rig, index)
            how: Any = SAMPLE_RATE_HZ, "h264", EXAMPLE_CRF
            media.write_video(part / f"{name}.mkv", frames, station.frame_rate, sound, *how)
            for k, shot in enumerate(until_stopped(render_board_images(rig, index))):
                _, data = cv2.imencode(".jpg", shot, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
                (part / "board" / f"{name}-{k:02d}.jpg").write_bytes(data.tobytes())

        map_in_two_threads(render_camera, range(len(rig.stations)), stop.set)
        write_manifest(example_manifest(rig), part / "manifest.yaml")
        if folder.exists():
            folder.rmdir()
        part.rename(folder)
    return folder / "manifest.yaml"
