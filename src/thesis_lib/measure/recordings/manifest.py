"""Manifests, which describe the recordings, the rig and the structure: model, YAML, file checks.

Lengths are in the unit of a field's suffix; properties without a suffix are in SI units.
"""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml
from pydantic import Field, ValidationError, model_validator

from thesis_lib.files import whole_text
from thesis_lib.measure.recordings import manifest_parts as parts, text_files
from thesis_lib.measure.recordings.board import BoardSpec, Place
from thesis_lib.measure.recordings.manifest_parts import Excitation, FileName, StructureSpec
from thesis_lib.studies import fields
from thesis_lib.studies.fields import Fields, Positive, Real, format_given, refuse_value
from thesis_lib.text import RefusedError, print_status

#: Suffixes of image files that are read from folders
IMAGE_SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".heic"}
#: Old to new names of fields, and of kinds of excitation; the old ones are read until version 2.
RENAMED_FIELDS = {"shots": "board_images", "rest_s": "rest_duration_s",
                  "steady_s": "steady_interval_s"}  # fmt: skip
RENAMED_KINDS = {"tone": "sine", "tones": "multisine", "decay": "free_decay"}


class CameraFiles(Fields):
    """One camera and its files."""

    name: fields.Name
    """name of the camera"""
    video: FileName
    """video of the structure's vibration, with audio"""
    width_px: fields.Width = 1920
    """width of the images"""
    height_px: fields.Width = 1080
    """height of the images"""
    frame_rate_hz: Real = Field(60.0, ge=1, le=1e5)
    """frames per second of the video"""
    captured_hz: Real | None = Field(None, ge=1, le=1e5)
    """frames per second at which slow motion was recorded; null is frame_rate_hz"""
    exposure_s: Real = Field(..., gt=0, le=1)
    """exposure time of a frame"""
    readout_s: Real = Field(0.0, ge=-1, le=1)
    """time from the first row's exposure to the last row's; 0 for a global shutter"""
    board_images: FileName | tuple[FileName | None, ...] | None = Field(
        None,
        title="null, a folder of images, a pattern such as board/A-*.png, or a list of 3 to 200 "
        "files with null where there is none, each inside the manifest's folder",
    )
    """images of the calibration board; the k-th of every camera shows the same pose; null if
    calibration has the cameras' poses"""
    corners_px: tuple[Place, Place, Place, Place] | None = None
    """the structure's corners (0, 0), (length, 0), (length, width), (0, width) in the images"""
    focal_length_mm: Positive | None = None
    """focal length of the lens"""
    sensor_width_mm: Positive | None = None
    """width of the sensor"""
    f_number: Positive | None = None
    """focal length over the aperture's diameter"""
    distance_mm: Positive | None = None
    """distance from the structure's centre, which the camera looks at"""
    azimuth_deg: fields.Azimuth | None = None
    """direction of the camera from +Y towards +X"""
    elevation_deg: fields.Elevation | None = None
    """direction of the camera above the structure's plane"""

    @property
    def size(self) -> tuple[int, int]:
        """Return the width and height of the images in px."""
        return self.width_px, self.height_px

    @property
    def rate_hz(self) -> float:
        """Return the rate at which the frames were taken, Hz."""
        return self.captured_hz or self.frame_rate_hz

    @model_validator(mode="after")
    def _check(self) -> Self:
        rate = "frame_rate_hz" if self.captured_hz is None else "captured_hz"
        if self.exposure_s * self.rate_hz > 1 + 1e-9:
            self.refuse("exposure_s", f"allowed: at most 1 / {rate}, in s")
        if abs(self.readout_s) * self.rate_hz > 1 + 1e-9:
            self.refuse("readout_s", f"allowed: from -1 / {rate} to 1 / {rate}, in s")
        if isinstance(self.board_images, tuple) and not 3 <= len(self.board_images) <= 200:
            self.refuse("board_images", "allowed: 3 to 200 files, with null where there is none")
        if self.corners_px is not None:
            sides = np.diff([*self.corners_px, *self.corners_px[:2]], axis=0)
            turns = sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0]
            if not (np.all(turns > 0) or np.all(turns < 0)):
                self.refuse("corners_px", "allowed: null, or [u, v] of a convex quadrilateral")
        return self


class Manifest(Fields):
    """Recordings of one structure by 2 to 16 cameras."""

    structure: StructureSpec = Field(default_factory=StructureSpec)
    """the structure"""
    cameras: tuple[CameraFiles, ...] = Field(..., min_length=2, max_length=16)
    """the cameras"""
    board: BoardSpec = Field(default_factory=BoardSpec)
    """the calibration board"""
    excitation: Excitation = Field(default_factory=Excitation)
    """the excitation"""
    calibration: parts.ReusedRig | None = Field(None, title="null, a path, or an object")
    """a calibration that is reused; null calibrates from the board images"""
    force: parts.Force | None = None
    """a force that was recorded with the videos, for motion over force"""
    radiation: parts.Radiation | None = None
    """the sound radiation to compute"""
    truth: FileName | None = None
    """true values of a rendered recording"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        kind, own, behaviour = self.excitation.kind, self.structure, self.excitation.behaviour
        if self.force is None and behaviour.force == "required":
            refuse_value("force", None, f"allowed where excitation.kind is {kind}: an object")
        if self.force is not None:
            if behaviour.force == "none":
                forced = parts.list_kinds(lambda one: one.force != "none")
                refuse_value("excitation.kind", kind, f"allowed with a force: {forced}")
            x, y = at = self.force.at_mm or (0.0, 0.0)
            if not (0 <= x <= own.length_mm and 0 <= y <= own.width_mm):
                refuse_value("force.at_mm", at, "allowed: null, or [x, y] on the structure")
            if self.excitation.sound == "none" and self.force.offset_s is None:
                refuse_value("force.offset_s", None, "allowed without sound: a number")
        if self.radiation is not None and behaviour.result == "response":
            shaped = parts.list_kinds(lambda one: one.result != "response")
            refuse_value("excitation.kind", kind, f"allowed where radiation is given: {shaped}")
        if self.calibration is None or self.calibration.poses == "anew":
            for i, camera in enumerate(self.cameras):
                if camera.board_images is None:
                    why = "allowed without calibration: board images"
                    refuse_value(f"cameras[{i}].board_images", None, why)
        names = [camera.name for camera in self.cameras]
        for i, name in enumerate(names):
            if (first := names.index(name)) < i:
                why = f"the same as cameras[{first}].name, allowed: another one"
                refuse_value(f"cameras[{i}].name", name, why)
        if self.radiation is not None:
            self.radiation.check(own)
        return self


class ManifestError(RefusedError):
    """A manifest that cannot be used; the message is one line."""


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]
    """YAML dumper whose output :func:`~.text_files.parse_yaml` reads back unchanged."""


_Dumper.add_implicit_resolver(*text_files.POWER_RESOLVER)


def read_manifest(path: Path, check_files: bool = True) -> Manifest:
    """Read a manifest from a YAML file.

    Parameters
    ----------
    path : Path
        The file; paths in it are relative to its folder.
    check_files : bool
        Whether the files that it names must exist.

    Raises
    ------
    ManifestError
        With the file, the line or field, the given and the allowed value in one line.
    """
    if not path.is_file():
        why = "a folder, give the YAML file in it" if path.is_dir() else "no such file"
        raise ManifestError(f"{path}: {why}")
    try:
        values = text_files.parse_yaml(text_files.read_text(path))
    except text_files.TextFileError as error:
        raise ManifestError(f"{path}: {error}") from None
    if not isinstance(values, dict):
        raise ManifestError(f"{path}: given {format_given(values)}, allowed: fields with values")
    cameras = values.get("cameras")
    several = cameras if isinstance(cameras, list) else []
    _rename_fields([values.get("excitation"), *several], str(path))
    manifest = validate_manifest(values, str(path))
    for problem in _file_problems(manifest, path.parent, check_files):
        raise ManifestError(f"{path}: {problem}")
    return manifest


def validate_manifest(values: dict[str, Any], where: str = "-p") -> Manifest:
    """Return the manifest with `values`; a :class:`ManifestError` is raised if they are invalid."""
    try:
        return Manifest.model_validate(values)
    except ValidationError as error:
        raise ManifestError(f"{where}: {fields.first_problem(Manifest, values, error)}") from None


def rename_options(given: dict[str, Any]) -> dict[str, Any]:
    """Return fields by path, as from ``-p excitation.rest_s=2``, with current names."""
    places = [place.rpartition(".") for place in given]
    named = [{name: value} for (*_, name), value in zip(places, given.values(), strict=True)]
    _rename_fields(named, "-p")
    parts = zip(places, named, strict=True)
    return {f"{where}{dot}{n}": v for (where, dot, _), part in parts for n, v in part.items()}


def _rename_fields(several: Iterable[Any], where: str) -> None:
    """Replace old names in parts of a manifest by the current ones; report the replacements."""
    found: dict[str, str] = {}
    for part in (one for one in several if isinstance(one, dict)):
        for old, new in RENAMED_FIELDS.items():
            if old in part and new not in part:
                part[new] = part.pop(old)
                found[old] = new
        kind = part.get("kind")
        if isinstance(kind, str) and kind in RENAMED_KINDS:
            part["kind"] = RENAMED_KINDS[kind]
            found[f"kind: {kind}"] = f"kind: {part['kind']}"
    if found:
        words = ", ".join(f"{old} is now {new}" for old, new in found.items())
        print_status(f"{where}: old names are read until version 2: {words}")


def write_manifest(manifest: Manifest, path: Path) -> None:
    """Write a manifest as YAML, whole or not at all."""
    how: Any = {"sort_keys": False, "allow_unicode": True, "default_flow_style": None}
    whole_text(path, yaml.dump(manifest.model_dump(mode="json"), Dumper=_Dumper, **how))


def image_paths(camera: CameraFiles, folder: Path) -> list[Path | None]:
    """List a camera's board images in the order of poses, None where there is none.

    Files of a folder or a pattern are ordered by name, with numbers by value.
    """
    if camera.board_images is None:
        return []
    if not isinstance(camera.board_images, str):
        return [None if shot is None else folder / shot for shot in camera.board_images]
    place = folder / camera.board_images
    try:
        if place.is_dir():
            return [*find_images(place.iterdir())]
        files = [file for file in folder.glob(camera.board_images) if not is_hidden(file)]
    except (ValueError, NotImplementedError, OSError):  # not a pattern for pathlib
        return []
    return [*sorted(files, key=lambda file: natural_sort_key(file.name))]


def is_hidden(path: Path) -> bool:
    """Return whether a file is hidden, such as those that macOS puts next to copied files."""
    return path.name.startswith(".")


def find_images(files: Iterable[Path]) -> list[Path]:
    """Return the images among files, ordered by name with numbers by value."""
    found = [one for one in files if one.suffix.lower() in IMAGE_SUFFIXES and not is_hidden(one)]
    return sorted(found, key=lambda file: natural_sort_key(file.name))


def natural_sort_key(name: str) -> list[tuple[int, str]]:
    """Return a sort key that puts 2.png before 10.png."""
    groups = "".join(c if c.isdigit() and c.isascii() else f" {c} " for c in name).split()
    return [(int(group), "") if group.isdecimal() else (-1, group) for group in groups]


def _file_problems(manifest: Manifest, folder: Path, exist: bool) -> Iterator[str]:
    """Yield the problems of the paths in a manifest, one line each."""
    root = folder.resolve()

    def outside(text: str) -> bool:
        try:
            return Path(text).is_absolute() or not (root / text).resolve().is_relative_to(root)
        except (ValueError, OSError, RuntimeError):  # null characters, loops of links
            return True

    named: dict[str, str | None] = {"truth": manifest.truth}
    counts = []
    for i, camera in enumerate(manifest.cameras):
        named[f"cameras[{i}].video"] = camera.video
        where, given = f"cameras[{i}].board_images", camera.board_images
        if given is None:
            continue
        if isinstance(given, str) and outside(given):
            yield f"{where}: given {format_given(given)}, allowed: {parts.INSIDE_TEXT}"
            continue
        shots = image_paths(camera, folder)
        counts.append(len(shots))
        files = [shot for shot in shots if shot is not None]
        if exist and len(files) < 3:
            least = f"allowed: at least 3 of {', '.join(sorted(IMAGE_SUFFIXES))}"
            yield f"{where}: given {format_given(given)}, which is {len(files)} images, {least}"
        if isinstance(given, str):
            given = tuple(str(shot.relative_to(folder)) for shot in files)
        named |= {f"{where}[{k}]": text for k, text in enumerate(given)}  # which may be links
    if manifest.force is not None:
        named["force.file"] = manifest.force.file  # last, since it may be one of the videos
    videos: dict[Path, str] = {}
    for where, text in named.items():
        if text is None:
            continue
        if outside(text):
            yield f"{where}: given {format_given(text)}, allowed: {parts.INSIDE_TEXT}"
        elif exist and not os.path.isfile(folder / text):  # noqa: PTH113
            yield f"{where}: given {format_given(text)}, no such file in {folder}"
        else:
            first = videos.setdefault((root / text).resolve(), where)
            if where.endswith(".video") and first != where:
                yield f"{where}: given {format_given(text)}, the same as {first}"
    if exist and len(set(counts)) > 1:
        several = ", ".join(map(str, counts))
        yield f"cameras: given {several} board images, allowed: as many for every camera"
