"""Manifest template for a folder of recordings: detected, given and assumed values."""

import base64
import glob
import json
import re
import shlex
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import yaml
from pydantic import BaseModel

from thesis_lib.files import put_files, staging
from thesis_lib.measure.messages import template_line
from thesis_lib.measure.recordings import manifest as manifests, media, media_info, validation
from thesis_lib.measure.recordings.manifest import Manifest, ManifestError, find_images, is_hidden
from thesis_lib.measure.recordings.media_info import MediaError, probe_media, rate_of
from thesis_lib.studies.fields import describe_field
from thesis_lib.templates import join_words
from thesis_lib.web.html import join_modules, read_asset, render_html, static_html

MIN_BOARD_IMAGES, WANTED_BOARD_IMAGES = 3, 12  # per camera
_LISTS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
GUIDE_VALUES: dict[str, Any] = _LISTS["guide_values"]
ASKED_FIELDS: tuple[str, ...] = tuple(_LISTS["asked_fields"])
ASKED_OF_MARKS: tuple[str, ...] = tuple(_LISTS["asked_of_marks"])
# Assumed exposure time over the shortest frame interval, if none is given
ASSUMED_EXPOSURE_RATIO = 0.25


def new_manifest(folder: Path, given: Mapping[str, Any]) -> tuple[Path, list[str]]:
    """Write ``manifest.yaml`` and ``corners.html`` into a folder, from its files and given values.

    Parameters
    ----------
    folder : Path
        Folder with 2 to 16 videos. Board images are in folders that are named like the videos, or
        their names begin with those of the videos.
    given : mapping
        Fields by path, as ``{"board.tile_mm": 30}``; ``cameras.exposure_s`` is for all cameras.

    Returns
    -------
    Path
        The manifest.
    list of str
        Messages on detected, missing and assumed values.
    """
    path = folder / "manifest.yaml"
    if not folder.is_dir():
        raise ManifestError(f"{folder}: no such folder")
    if path.exists():
        raise ManifestError(f"{path}: is there already, allowed: a folder without one")
    videos, passed = _find_videos(folder)
    if not 2 <= len(videos) <= 16:
        allowed = "; ".join(["2 to 16", *passed, "to plan before recording: -p cameras=4"])
        raise ManifestError(f"{folder}: {len(videos)} videos, allowed: {allowed}")
    manifest = manifests.validate_manifest(_values(folder, videos, given), str(folder))
    asked = ASKED_FIELDS
    if not any(validation.is_slowed(video) for video in videos):
        asked = (*asked, "cameras.captured_hz")
    assumed = find_assumed(manifest, given, asked)
    told = [*_describe_found(manifest, folder), *passed]
    lacking = [camera.name for camera in manifest.cameras if camera.corners_px is None]
    if manifest.structure.markers.hole_mm is None and lacking:  # the ends look alike
        told.append(template_line("corners", names=join_words(lacking), page=folder / PAGE_NAME))
    with staging(folder) as part:
        (part / PAGE_NAME).write_text(corners_page(manifest, folder), encoding="utf-8")
        (part / path.name).write_text(format_manifest(manifest, assumed), encoding="utf-8")
        put_files(part, folder)
    return path, [*told, *list_assumed(manifest, assumed)]


def find_assumed(manifest: Manifest, given: Mapping[str, Any], among: Sequence[str]) -> list[str]:
    """Return the fields in `among`, and those of marks on a ChArUco board, that are not given."""
    asked = (*among, *ASKED_OF_MARKS * (manifest.board.kind == "charuco"))
    return [name for name in asked if not _is_given(name, given)]


def _values(folder: Path, videos: Sequence[Path], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the manifest's values, given or detected."""
    infos = [probe_media(video) for video in videos]
    fastest = max(max(info.frame_rate, info.captured_hz or 0) for info in infos)
    exposure = float(f"{ASSUMED_EXPOSURE_RATIO / fastest:.3g}")
    cameras: list[dict[str, Any]] = []
    for k, (video, info) in enumerate(zip(videos, infos, strict=True)):
        name = video.stem.strip()[:MAX_NAME_CHARACTERS].strip() or f"camera {k + 1}"
        if any(name == camera["name"] for camera in cameras):
            name = f"{name[: MAX_NAME_CHARACTERS - 3].strip()} {k + 1}"
        rate = float(f"{rate_of(media_info.frame_clock(video), info.frame_rate):.8g}")
        size = {"width_px": info.size[0], "height_px": info.size[1]}
        times: dict[str, Any] = {"frame_rate_hz": rate, "exposure_s": exposure}
        if validation.is_slowed(video):
            times["captured_hz"] = info.captured_hz
        images = _shots(folder, video.stem, [one.stem for one in videos])
        cameras.append({"name": name, "video": video.name, "board_images": images} | size | times)
    values = merge_given(cameras, given)
    reused = values.get("calibration")
    placed = reused and (isinstance(reused, str) or reused.get("poses", "kept") == "kept")
    for camera in cameras:
        if camera["board_images"] is None and "cameras.board_images" not in given and not placed:
            camera["board_images"] = f"board/{Path(camera['video']).stem}"
    return values


def merge_given(cameras: list[dict[str, Any]], given: Mapping[str, Any]) -> dict[str, Any]:
    """Merge cameras (changed in place), the guide's values and given values into a manifest's."""
    values: dict[str, Any] = {"cameras": cameras}
    guide = {name: one for name, one in GUIDE_VALUES.items() if not _is_given(name, given)}
    for name, value in (dict(given) | guide).items():
        *parts, last = name.split(".")
        if parts[:1] == ["cameras"]:
            for camera in cameras:
                camera[last] = value
            continue
        inside = values
        for part in parts:
            inside = inside.setdefault(part, {})
            if not isinstance(inside, dict):
                raise ManifestError(f"-p: {name} is inside what is given; allowed: one of them")
        inside[last] = value
    markers = values.get("structure", {}).get("markers", {})
    if isinstance(markers, dict) and "spacing_mm" in markers:  # equal on the printed sheet
        markers.setdefault("row_spacing_mm", markers["spacing_mm"])
    return values


def _shots(folder: Path, name: str, names: Sequence[str]) -> str | list[str] | None:
    """Return the folder or pattern of a camera's calibration images; None if there are none.

    A list is returned if a pattern would match another camera's images, such as `cam-2` for `cam`.
    """
    others = tuple(f"{one}-" for one in names if one.startswith(f"{name}-"))
    inside = sorted(one for one in folder.rglob("*") if one.is_dir() and not is_hidden(one))
    for place in inside:
        if place.name.lower() == name.lower() and find_images(place.iterdir()):
            return place.relative_to(folder).as_posix()
    for place in [folder, *inside]:
        named = find_images(file for file in place.iterdir() if file.name.startswith(f"{name}-"))
        own = [file for file in named if not file.name.startswith(others)]
        kinds = {file.suffix for file in own}
        if len(kinds) == 1 and own == named:
            start = glob.escape((place.relative_to(folder) / f"{name}-").as_posix())
            return f"{start}*{kinds.pop()}"
        once = len({file.stem for file in own}) == len(own)  # not JPEG and HEIC of one pose
        if once and len(own) >= MIN_BOARD_IMAGES:
            return [file.relative_to(folder).as_posix() for file in own]
    return None


def _describe_found(manifest: Manifest, folder: Path) -> Iterator[str]:
    """Yield messages on the files found and missing for each camera."""
    counts = []
    for camera in manifest.cameras:
        info = probe_media(folder / camera.video)
        shots = [shot for shot in manifests.image_paths(camera, folder) if shot]
        counts.append(len(shots))
        found = f"{camera.video}: {info.size[0]} × {info.size[1]} px, "
        found += f"{camera.frame_rate_hz:.8g} frames per second"
        if info.duration is not None:
            found += f", {info.duration:.1f} s"
        if shots:
            found += f"; {len(shots)} board images in {shots[0].parent}"
        yield found
        if validation.is_slowed(folder / camera.video):
            rates = {"rate": camera.frame_rate_hz, "taken": info.captured_hz}
            yield template_line("slow-motion", video=camera.video, **rates)
        if not info.has_audio and manifest.excitation.sound != "none":
            yield template_line("sound", video=camera.video)
        if camera.board_images and len(shots) < MIN_BOARD_IMAGES:
            many = {"least": MIN_BOARD_IMAGES, "wanted": WANTED_BOARD_IMAGES}
            yield template_line("board", name=camera.name, place=camera.board_images, **many)
    if len(set(counts)) > 1:
        yield template_line("equal-shots", counts=counts)
    for part in (manifest.calibration, manifest.force, manifest.truth):
        file = part if part is None or isinstance(part, str) else part.file
        if file and not (folder / file).exists():
            yield f"{template_line('file', file=file)} {folder}"


def list_assumed(manifest: Manifest, assumed: Sequence[str]) -> Iterator[str]:
    """Yield a message on each assumed field and its value."""
    for name in assumed:
        value: Any = manifest
        for part in name.split("."):
            value = getattr(value, part)
            value = value[0] if part == "cameras" else value
        text = value if isinstance(value, str) else json.dumps(value)
        yield template_line("assumed", name=name, value=shlex.quote(text))


def _is_given(name: str, given: Mapping[str, Any]) -> bool:
    """Return whether a field, or an object that contains it, is given."""
    return any(name == one or name.startswith(f"{one}.") for one in given)


def format_manifest(manifest: Manifest, assumed: Sequence[str]) -> str:
    """Return the manifest as commented YAML, with assumed fields marked."""
    if manifest.structure.markers.hole_mm is None and manifest.cameras[0].corners_px is None:
        assumed = (*assumed, "cameras.corners_px")
    lines = [
        "# Recordings for `thesis measure`. Lines marked CHECK are assumed: no file shows them.",
        *_fields(manifest, "", -2, assumed),
        "cameras:",
    ]
    for camera in manifest.cameras:
        first, *more = _fields(camera, "cameras", 2, assumed)
        lines += [f"  - {first.lstrip()}", *more]
    return "\n".join(lines) + "\n"


def _fields(part: BaseModel, path: str, indent: int, assumed: Sequence[str]) -> Iterator[str]:
    """Yield a line for each field, with its meaning; omit optional fields that are not set."""
    space = " " * (indent + 2)
    for name in type(part).model_fields:
        value, place = getattr(part, name), f"{path}.{name}".lstrip(".")
        if place == "cameras":  # written last, one by one
            continue
        if isinstance(value, BaseModel):
            if lines := [*_fields(value, place, indent + 2, assumed)]:
                yield f"{space}{name}:"
                yield from lines
        elif value is not None or place in assumed or name in part.model_fields_set:
            check = "CHECK: " if place in assumed else ""
            text = json.dumps(part.model_dump(mode="json")[name], ensure_ascii=False)
            if isinstance(value, float):  # JSON's 5e-05 is text in YAML
                text = yaml.safe_dump(value).splitlines()[0]
            yield f"{space}{name}: {text}  # {check}{describe_field(type(part), name)}"


OTHER_ENDINGS = manifests.IMAGE_SUFFIXES | {*_LISTS["other_endings"]}
MAX_NAME_CHARACTERS = 40  # of a camera's name
_CHAPTER_PATTERN = re.compile(r"(?:G[HXLS]\d\d|GOPR|GP\d\d)(\d{4})", re.I)  # recording's number


def _find_videos(folder: Path) -> tuple[list[Path], list[str]]:
    """Return the videos in a folder, ordered by name, and messages on files that are passed over.

    Hidden files are ignored. A file with an unknown suffix is a video if it can be read as one.
    """
    videos, lines = [], []
    for file in sorted(folder.iterdir()):
        ending = file.suffix.lower()
        if is_hidden(file) or ending in OTHER_ENDINGS or not file.is_file():
            continue
        if ending in _LISTS["raw_endings"]:
            lines.append(template_line("raw", name=file.name, path=shlex.quote(str(file))))
        elif ending in _LISTS["video_endings"] or _is_film(file):
            videos.append(file)
        else:
            lines.append(template_line("no-video", name=file.name))
    packed = {media_info.source_of_packed(file): file.name for file in videos}
    for source in [video for video in videos if video.name in packed]:
        videos.remove(source)
        lines.append(f"passed over: {source.name}, since {packed[source.name]} was packed from it")
    _check_names(folder, videos)
    return videos, lines


def _is_film(file: Path) -> bool:
    """Return whether a file is a video of two frames or more."""
    with suppress(MediaError):
        return len(media_info.frame_clock(file)) > 1
    return False


def _check_names(folder: Path, videos: Sequence[Path]) -> None:
    """Refuse videos whose names indicate several files of one camera."""
    groups: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for video in videos:
        why = "have one name, as one recording in two files has"
        groups[why, video.stem.casefold()].append(video.name)
        if match := _CHAPTER_PATTERN.fullmatch(video.stem):
            groups["are chapters of one recording", match[1]].append(video.name)
    for (why, _), names in groups.items():
        if len(names) > 1:
            allowed = "one video of each camera; move the others, or rename another camera's"
            raise ManifestError(f"{folder}: {', '.join(names)} {why}, allowed: {allowed}")


PAGE_NAME = "corners.html"
JPEG_QUALITY = 92  # does not shift edges, and keeps a page of 16 cameras below 10 MB
NO_SCRIPT_TEXT = "This page needs JavaScript to read corners."


def corners_page(manifest: Manifest, folder: Path) -> str:
    """Return a self-contained HTML page to click corners, which it shows as lines of YAML.

    Corners in the manifest are shown for correction. A :class:`MediaError` is raised if the first
    frame of a video cannot be read.
    """
    cameras = []
    for camera in manifest.cameras:
        image = next(media.read_frames(folder / camera.video, 0, 1))
        _, code = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        url = f"data:image/jpeg;base64,{base64.b64encode(code.tobytes()).decode()}"
        shown = {"name": camera.name, "size": image.shape[::-1], "image": url}
        cameras.append(shown | {"corners": camera.corners_px})
    state = {"cameras": cameras}
    form = static_html(join_modules("corners"), read_asset("corners.css"), state, NO_SCRIPT_TEXT)
    page = "measure/recordings/templates/corners.html.j2"
    return render_html(page, title="Corners of the structure", form=form)
