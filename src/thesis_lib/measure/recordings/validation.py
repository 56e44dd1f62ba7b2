"""Checks of recordings against the manifest before a measurement, and of repeated frames."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import scipy

from thesis_lib.arrays import Array, Image, IntArray
from thesis_lib.measure.recordings import (
    audio,
    board,
    force_table,
    manifest_parts,
    media,
    media_info,
)
from thesis_lib.measure.recordings.manifest import CameraFiles, Manifest, ManifestError, image_paths
from thesis_lib.measure.recordings.media_info import MediaError
from thesis_lib.studies.fields import format_given, format_limit

MIN_ALIAS_RATIO = 0.02  # least distance from multiples of half the frame rate, over that half
RATE_TOLERANCE = 0.1  # relative difference above which rates disagree; below, the file is right
MAX_END_GAP_S = 0.5  # between the ends of a video's images and of its audio


class ChainError(ValueError):
    """Recordings that do not fit together; the message is one line."""


def markers_of(manifest: Manifest) -> board.Markers:
    """Return the markers on the structure from the manifest, in SI units."""
    given, marks = manifest.structure, manifest.structure.markers
    hole = marks.hole_mm and (marks.hole_mm[0] / 1000, marks.hole_mm[1] / 1000)
    diameter, bright = marks.diameter_mm / 1000, marks.tone == "bright"
    return board.Markers(given.extent, given.marker_points, diameter, hole, bright)


def check_files(manifest: Manifest, folder: Path) -> list[Array]:
    """Refuse recordings that differ from the manifest or are incomplete; return their clocks.

    A clock is the times of a video's frames after the first, (frames,), s, by its own clock. A
    ManifestError or :class:`MediaError` gives the first difference, in one line.
    """
    for problem in check_recordings(manifest, folder):
        raise ManifestError(problem)
    return [clock_of(camera, folder) for camera in manifest.cameras]


def clock_of(camera: CameraFiles, folder: Path) -> Array:
    """Return the capture times of a camera's frames after the first, shape (frames,), s.

    Times of slow motion are rescaled. A :class:`MediaError` is raised if frames are missing.
    """
    path = folder / camera.video
    clock, info = media_info.frame_clock(path), media_info.probe_media(path)
    says, end = info.frames, info.duration
    late = end is not None and clock[-1] + 2.5 / info.frame_rate < end  # missing at the end
    if says is not None and len(clock) < says and (late or end is None):
        raise MediaError(f"{path}: ends before frame {len(clock)}, the file says {says}")
    if camera.captured_hz is None:
        return clock
    plays = media_info.playback_rate(clock, info.frame_rate)
    return np.asarray(clock * (plays / camera.captured_hz))


def check_excitation(manifest: Manifest) -> Iterator[str]:
    """Yield the problems of the excitation for these cameras, one line each.

    A frequency above half of the frame rate is undersampled and refused unless this is declared.
    Near multiples of that half the motion appears still or flips from frame to frame, so that its
    phase cannot be determined.
    """
    rates = [camera.rate_hz for camera in manifest.cameras]
    frequency, rest = manifest.excitation.frequency_hz, manifest.excitation.rest_duration_s
    given = f"excitation.frequency_hz: given {frequency or 0:.6g}"
    if frequency is not None and manifest.excitation.undersampled:
        for i, half in enumerate(rate / 2 for rate in rates):
            multiple = max(1, round(frequency / half)) * half
            if abs(frequency - multiple) < MIN_ALIAS_RATIO * half:
                off = format_limit(MIN_ALIAS_RATIO * half, upper=False)
                why = f"{multiple:.6g} Hz, a multiple of half the frame rate of cameras[{i}]"
                yield f"{given}, allowed: at least {off} Hz from {why}"
    elif frequency is not None and frequency >= min(rates) / 2:
        yield f"{given}, allowed: below half of the frame rate, {min(rates) / 2:g} Hz"
    if rest * min(rates) < 3 - 1e-9 and (rest or manifest.excitation.sound != "none"):
        least = f"at least {format_limit(3 / min(rates), upper=False)} s, three frames"
        yield f"excitation.rest_duration_s: given {rest:.6g}, allowed: {least}"


def check_recordings(manifest: Manifest, folder: Path) -> Iterator[str]:
    """Yield the differences between recordings and manifest, one line each.

    Checks the excitation, the markers' positions, every video's size, frame rate, duration and
    audio, the size of every board image, and the force.
    """
    yield from check_excitation(manifest)
    places, marks = manifest.structure.marker_points, manifest.structure.markers
    if on_one_line(1000 * places, marks.diameter_mm):  # the plane must be known
        name = "points_mm" if marks.points_mm else "rows" if marks.rows == 1 else "columns"
        given = format_given(getattr(marks, name))
        yield f"structure.markers.{name}: given {given}, allowed: markers that are not on one line"
    for i, camera in enumerate(manifest.cameras):
        path = folder / camera.video
        try:
            for problem in _check_video(path, camera, manifest.excitation):
                yield f"cameras[{i}].video: {path}: {problem}"
        except MediaError as error:
            yield f"cameras[{i}].video: {error}"
        for shot in filter(None, image_paths(camera, folder)):
            try:
                for problem in _check_size(media.read_png(shot).shape[::-1], camera):
                    yield f"cameras[{i}].board_images: {shot}: {problem}"
            except MediaError as error:
                yield f"cameras[{i}].board_images: {error}"
    yield from _check_force(manifest, folder)


def _check_force(manifest: Manifest, folder: Path) -> Iterator[str]:
    """Yield the problems of a recorded force."""
    given = manifest.force
    if given is None:
        return
    path = folder / given.file
    try:
        if given.is_table:
            force_table.read_force_table(path)
            return
        other = given.sound_channel if given.offset_s is None else None
        for channel in filter(None, (given.channel, other)):
            if silence := audio.probe_audio(path, channel).silence:
                yield f"force.file: {path}: {silence}"
    except (MediaError, force_table.ForceError, OSError) as error:
        yield f"force.file: {error}"


def is_slowed(path: Path) -> bool:
    """Return whether a video states a capture rate that differs from its playback rate."""
    taken = media_info.probe_media(path).captured_hz
    return taken is not None and abs(taken / _playback_rate(path) - 1) > RATE_TOLERANCE


def _playback_rate(path: Path) -> float:
    nominal = media_info.probe_media(path).frame_rate
    return media_info.playback_rate(media_info.frame_clock(path), nominal)


def _check_video(
    path: Path, camera: CameraFiles, excitation: manifest_parts.Excitation
) -> Iterator[str]:
    """Yield the problems of a video's rate, size, interlacing, duration and audio."""
    info = media_info.probe_media(path)
    heard, rest = excitation.sound != "none", excitation.rest_duration_s
    if abs(info.frame_rate / camera.frame_rate_hz - 1) > RATE_TOLERANCE:
        rate = f"{info.frame_rate:.6g} frames per second, allowed: {camera.frame_rate_hz:.6g}"
        yield f"{rate}, its frame_rate_hz; slow motion has the sensor's rate in captured_hz"
    yield from _check_size(info.size, camera)
    if camera.captured_hz is None and is_slowed(path):
        taken, plays = f"{info.captured_hz:.6g}", f"{_playback_rate(path):.6g}"
        yield (
            f"it says that it was taken at {taken} frames per second, and plays at {plays}; "
            f"allowed: captured_hz: {taken} in the manifest, or {plays} if that is its true speed"
        )
    if camera.rate_hz != camera.frame_rate_hz and heard:
        why = f"slow motion by captured_hz, {camera.captured_hz:.6g}"
        yield f"{why}, whose sound does not go with its frames, allowed: excitation.sound: none"
    if info.interlaced:
        yield "interlaced: odd lines were taken at other times, allowed: progressive (p, not i)"
    if heard and not info.has_audio:
        yield "no audio track, allowed: one, or a steady vibration with excitation.sound: none"
    if info.duration is not None:  # slow motion took less time than it plays for
        slow = camera.captured_hz
        took = info.duration * (_playback_rate(path) / slow if slow else 1)
        if took <= rest:
            yield f"{took:.3f} s of images, allowed: more than rest_duration_s, {rest:g} s"
        if heard and abs((info.sound_end or info.duration) - info.duration) > MAX_END_GAP_S:
            ends = f"its images end at {info.duration:.3f} s, its sound at {info.sound_end:.3f} s"
            yield f"{ends}, allowed: at most {MAX_END_GAP_S:g} s apart"
    if heard and info.has_audio and (silence := audio.probe_audio(path).silence):
        yield silence


def on_one_line(points: Array, diameter: float) -> bool:
    """Return whether markers at points (2, n) are collinear, to within their position errors.

    They then leave the rotation about their line undetermined, and which way is up. Their rms
    distance from the line must exceed a quarter of the diameter, more than their position errors.
    """
    off = points - points.mean(axis=1, keepdims=True)
    across = np.linalg.eigvalsh(off @ off.T / points.shape[1])[0]
    return bool(across < (diameter / 4) ** 2)


def _check_size(size: Sequence[int], camera: CameraFiles) -> Iterator[str]:
    (width, height), wanted = size, camera.size
    if (width, height) != wanted:
        yield f"{width} × {height} px, allowed: {wanted[0]} × {wanted[1]} px as the manifest says"


SAMPLING_PX = 4  # distance between the pixels that are compared
#: Largest change of a repeated frame from the one before, over that of the frames around.
#: Compression and its noise caused less than 0.01 (H.264, crf 17 and 26).
MAX_RELATIVE_CHANGE = 0.02
NEIGHBOUR_FRAMES = 12  # frames before and after, both of which must contain motion
MIN_MOTION = 0.25  # their change over the 90 % quantile of all, below which the structure rests
MIN_SHARE, MIN_REPEATS = 0.03, 4  # least share and number of repeats that are reported


def note_changes(frames: Iterable[Image], steps: Array, across: Array) -> Iterator[Image]:
    """Yield frames; fill in `steps` and `across` of :func:`find_repeats`, shape (frames,)."""
    last: deque[Array] = deque(maxlen=4)
    for k, image in enumerate(frames):
        last.append(image[::SAMPLING_PX, ::SAMPLING_PX].astype(float))
        if k >= 1:
            steps[k] = np.mean(np.abs(last[-1] - last[-2]))
        if k >= 3:
            across[k - 1] = np.mean(np.abs(last[-1] - last[0]))
        yield image


def find_repeats(steps: Array, across: Array) -> IntArray:
    """Return the indices of frames that repeat the one before, while frames around them do not.

    Parameters
    ----------
    steps : ndarray, shape (frames,)
        Mean change of grey levels from the frame before.
    across : ndarray, shape (frames,)
        Mean change from two frames before to the frame after. It is small if a motion reverses
        between two frames, which are therefore alike.
    """
    if len(steps) < 2 * NEIGHBOUR_FRAMES:
        return np.zeros(0, int)
    # The largest change up to each frame, and from each frame on.
    window, half = NEIGHBOUR_FRAMES + 1, NEIGHBOUR_FRAMES // 2
    largest = partial(scipy.ndimage.maximum_filter1d, steps, window, mode="constant")
    around = np.minimum(largest(origin=half), largest(origin=-half))
    moving = around > max(MIN_MOTION * float(np.quantile(steps, 0.9)), 1e-9)
    same = moving & (steps <= MAX_RELATIVE_CHANGE * around)
    alone = ~np.roll(same, 1) & ~np.roll(same, -1)
    turns = same & alone & (across <= 4 * MAX_RELATIVE_CHANGE * around)  # at most 3 times the step
    repeats = np.flatnonzero(same & ~turns)
    few = len(repeats) < max(MIN_REPEATS, MIN_SHARE * np.count_nonzero(moving))
    return np.zeros(0, int) if few else repeats


def describe_repeats(name: str, repeats: IntArray) -> str:
    """Return a message on repeated frames, empty if there are none."""
    if not len(repeats):
        return ""
    share = len(repeats) / (repeats[-1] - repeats[0] + 1)
    return f"{share:.0%} of the frames of camera {name} repeat the one before."
