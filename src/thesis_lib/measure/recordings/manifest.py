"""Manifests on disk: read and written, and the files that they name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from thesis_lib.measure.recordings.manifest_model import INSIDE_TEXT, CameraFiles, Manifest
from thesis_lib.measure.recordings.text_files import (
    POWER_PATTERN,
    TextFileError,
    parse_yaml,
    read_text,
)
from thesis_lib.outputs import aside
from thesis_lib.studies.fields import first_problem, format_given

#: Endings of images that are sought in folders
IMAGE_SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".heic"}
#: Old to new names of fields, and of kinds of excitation; read until version 2.
RENAMED_FIELDS = {"shots": "board_images", "rest_s": "rest_duration_s",
                  "steady_s": "steady_interval_s"}  # fmt: skip
RENAMED_KINDS = {"tone": "sine", "tones": "multisine", "decay": "free_decay"}


class ManifestError(ValueError):
    """A manifest that cannot be used; the message is one line."""


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]
    """Write so that :func:`~.text_files.parse_yaml` reads the same."""


_Dumper.add_implicit_resolver("tag:yaml.org,2002:float", POWER_PATTERN, list("-+0123456789"))


def read_manifest(path: Path, check_files: bool = True) -> Manifest:
    """Return the manifest in a YAML file.

    Parameters
    ----------
    path : Path
        The file; what it names is sought from its folder.
    check_files : bool
        Whether the files it names must exist.

    Raises
    ------
    ManifestError
        In one line: the file, the line or field, what was given and what is allowed.
    """
    if not path.is_file():
        raise ManifestError(
            f"{path}: {'a folder, give the YAML file in it' if path.is_dir() else 'no such file'}"
        )
    try:
        values = parse_yaml(read_text(path))
    except TextFileError as error:
        raise ManifestError(f"{path}: {error}") from None
    if not isinstance(values, dict):
        raise ManifestError(
            f"{path}: given {format_given(values)}, allowed: fields and their values"
        )
    values = _rename_fields(values, path)
    try:
        manifest = Manifest.model_validate(values)
    except ValidationError as error:
        raise ManifestError(f"{path}: {first_problem(Manifest, values, error)}") from None
    for problem in _file_problems(manifest, path.parent, check_files):
        raise ManifestError(f"{path}: {problem}")
    return manifest


def _rename_fields(values: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the values of a manifest under today's names, and report old names in one line."""
    found: dict[str, str] = {}
    values = dict(values)
    if isinstance(excitation := values.get("excitation"), dict):
        values["excitation"] = _rename(excitation, found)
    if isinstance(cameras := values.get("cameras"), list):
        values["cameras"] = [
            _rename(camera, found) if isinstance(camera, dict) else camera for camera in cameras
        ]
    _report_renamed(str(path), found)
    return values


def rename_options(given: dict[str, Any]) -> dict[str, Any]:
    """Return fields by path, as of ``-p excitation.rest_s=2``, under today's names."""
    found: dict[str, str] = {}
    named = {}
    for place, value in given.items():
        where, dot, name = place.rpartition(".")
        ((new, renamed),) = _rename({name: value}, found).items()
        named[f"{where}{dot}{new}"] = renamed
    _report_renamed("-p", found)
    return named


def _rename(part: dict[str, Any], found: dict[str, str]) -> dict[str, Any]:
    """Return a part of a manifest under today's names; note in ``found`` which were old."""
    old = {one: new for one, new in RENAMED_FIELDS.items() if one in part and new not in part}
    found.update(old)
    part = {old.get(name, name): value for name, value in part.items()}
    kind = part.get("kind")
    if isinstance(kind, str) and kind in RENAMED_KINDS:
        part["kind"] = RENAMED_KINDS[kind]
        found[f"kind: {kind}"] = f"kind: {part['kind']}"
    return part


def _report_renamed(where: str, found: dict[str, str]) -> None:
    if found:
        words = ", ".join(f"{old} is now {new}" for old, new in found.items())
        aside(f"{where}: old names are read until version 2: {words}")


def write_manifest(manifest: Manifest, path: Path) -> None:
    """Write a manifest as YAML, whole or not at all."""
    from thesis_lib.files import whole_text

    values = manifest.model_dump(mode="json")
    text = yaml.dump(
        values, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None
    )
    whole_text(path, text)


def shot_paths(camera: CameraFiles, folder: Path) -> list[Path | None]:
    """List a camera's board images in the order of poses, None where there is none.

    Those of a folder or pattern are in the order of their names, numbers by value.
    """
    if camera.board_images is None:
        return []
    if not isinstance(camera.board_images, str):
        return [None if shot is None else folder / shot for shot in camera.board_images]
    place = folder / camera.board_images
    inside = place.is_dir()
    try:
        if inside:
            return [*find_images(place.iterdir())]
        files = [file for file in folder.glob(camera.board_images) if not is_hidden(file)]
        return [*sorted(files, key=lambda file: by_number(file.name))]
    except (ValueError, NotImplementedError):  # no pattern that pathlib knows
        return []


def is_hidden(path: Path) -> bool:
    """Return whether a file is hidden, such as macOS puts next to those that it copies."""
    return path.name.startswith(".")


def find_images(files: Iterable[Path]) -> list[Path]:
    """Return the images among files in the order of their names, numbers by value."""
    found = [one for one in files if one.suffix.lower() in IMAGE_SUFFIXES and not is_hidden(one)]
    return sorted(found, key=lambda file: by_number(file.name))


def by_number(name: str) -> list[tuple[int, str]]:
    """Return a key that puts 2.png before 10.png."""
    groups = "".join(c if c.isdigit() and c.isascii() else f" {c} " for c in name).split()
    return [(int(group), "") if group.isdecimal() else (-1, group) for group in groups]


def _file_problems(manifest: Manifest, folder: Path, exist: bool) -> Iterator[str]:
    """Yield what is wrong with the paths of a manifest, one line each."""
    root = folder.resolve()

    def outside(text: str) -> bool:
        try:
            return Path(text).is_absolute() or not (root / text).resolve().is_relative_to(root)
        except (ValueError, OSError, RuntimeError):  # null characters, loops of links
            return True

    named = [("truth", manifest.truth)] if manifest.truth else []
    numbers = {}
    for i, camera in enumerate(manifest.cameras):
        named.append((f"cameras[{i}].video", camera.video))
        where = f"cameras[{i}].board_images"
        if camera.board_images is None:
            continue
        if isinstance(camera.board_images, str):
            if outside(camera.board_images):
                yield f"{where}: given {format_given(camera.board_images)}, allowed: {INSIDE_TEXT}"
                continue
        else:
            named += [
                (f"{where}[{k}]", s) for k, s in enumerate(camera.board_images) if s is not None
            ]
        shots = shot_paths(camera, folder)
        numbers[where] = len(shots)
        files = [shot for shot in shots if shot is not None]
        if exist and len(files) < 3:
            yield (
                f"{where}: given {format_given(camera.board_images)}, which is "
                f"{len(files)} images, allowed: at least 3{_unread(camera, folder)}"
            )
        if isinstance(camera.board_images, str):
            for shot in files:  # which may be links
                if outside(str(shot.relative_to(folder))):
                    name = format_given(shot.name)
                    yield f"{where}: {name} leads outside, allowed: {INSIDE_TEXT}"
    named += [("force.file", manifest.force.file)] if manifest.force else []  # or a video named
    videos: dict[Path, str] = {}
    for where, text in named:
        if outside(text):
            yield f"{where}: given {format_given(text)}, allowed: {INSIDE_TEXT}"
        elif exist and not _is_file(folder / text):
            yield f"{where}: given {format_given(text)}, no such file in {folder}"
        else:
            first = videos.setdefault((root / text).resolve(), where)
            if where.endswith(".video") and first != where:
                yield f"{where}: given {format_given(text)}, the same as {first}"
    if exist and len(set(numbers.values())) > 1:
        counts = ", ".join(map(str, numbers.values()))
        allowed = "as many for every camera, in the same order"
        yield f"cameras: given {counts} board images, allowed: {allowed}"


def _unread(camera: CameraFiles, folder: Path) -> str:
    """List the files of a camera's folder of images that cannot be read."""
    if (
        not isinstance(camera.board_images, str)
        or not (place := folder / camera.board_images).is_dir()
    ):
        return ""
    endings = sorted(file.suffix.lower() for file in place.iterdir() if file.is_file())
    others = {ending: endings.count(ending) for ending in endings if ending not in IMAGE_SUFFIXES}
    told = " and ".join(f"{count} of {format_given(ending)}" for ending, count in others.items())
    read = f" of {', '.join(sorted(IMAGE_SUFFIXES))}"
    return f"{read} (there are {told}, which are not read: export JPEG)" if told else read


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that is too long, a folder that may not be entered
        return False
