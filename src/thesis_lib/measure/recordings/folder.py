"""Videos in a folder: which are films of cameras, and what the others are."""

from __future__ import annotations

import re
import shlex
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.measure.recordings.manifest import PICTURES, ManifestError
from thesis_lib.measure.recordings.media_info import MediaError, frame_times
from thesis_lib.text import hidden

#: Endings of videos, which must be readable
VIDEO_ENDINGS = {
    ".3g2", ".3gp", ".avi", ".cine", ".flv", ".insv", ".m2ts", ".m4v", ".mkv", ".mov", ".mp4",
    ".mpeg", ".mpg", ".mts", ".mxf", ".ogv", ".ts", ".webm", ".wmv",
}  # fmt: skip
#: Endings of what `thesis pack` makes a video of
RAW_ENDINGS = {".264", ".265", ".cih", ".cihx", ".h264", ".h265", ".hevc"}
#: Endings of what lies beside videos and is none
OTHER_ENDINGS = PICTURES | {
    ".aac", ".csv", ".flac", ".gif", ".html", ".ini", ".json", ".m4a", ".md", ".mp3", ".mraw",
    ".nc", ".ogg", ".opus", ".pdf", ".py", ".srt", ".thm", ".toml", ".txt", ".wav", ".xml",
    ".yaml", ".yml", ".zip",
}  # fmt: skip
MAX_NAME_CHARACTERS = 40  # characters of a camera's name
_CHAPTER = re.compile(r"(?:G[HXLS](?P<part>\d\d)|GOPR|GP(?P<old>\d\d))(?P<film>\d{4})", re.I)


def find_videos(folder: Path) -> tuple[list[Path], list[str]]:
    """Return the videos in a folder, in the order of their names, and a line on each other file.

    Hidden files, such as macOS puts beside those that it copies, are none. A file with an unknown
    ending is a video if it can be read as one.

    Raises
    ------
    ManifestError
        If two videos have one name but for the ending, or are chapters of one recording, or a
        name holds a character that cannot be seen.
    """
    videos, lines = [], []
    for file in sorted(folder.iterdir()):
        ending = file.suffix.lower()
        if file.name.startswith(".") or ending in OTHER_ENDINGS or not file.is_file():
            continue
        if ending in RAW_ENDINGS:
            lines.append(
                f"passed over: {file.name}, raw frames; to make a video of them: "
                f"thesis pack {shlex.quote(str(file))} --rate-hz RATE"
            )
        elif ending in VIDEO_ENDINGS or _is_film(file):
            videos.append(file)
        else:
            lines.append(f"passed over: {file.name}, which is no video that can be read")
    _check_names(folder, videos)
    return videos, lines


def name_cameras(videos: Sequence[Path]) -> list[str]:
    """Return a name for the camera of each video, from the video's own."""
    names: list[str] = []
    for k, video in enumerate(videos):
        name = video.stem.strip()[:MAX_NAME_CHARACTERS].strip() or f"camera {k + 1}"
        if name in names:
            name = f"{name[: MAX_NAME_CHARACTERS - 3].strip()} {k + 1}"
        names.append(name)
    return names


def _is_film(file: Path) -> bool:
    """Whether a file is a video of two frames or more."""
    try:
        return len(frame_times(file)) > 1
    except MediaError:
        return False


def _check_names(folder: Path, videos: Sequence[Path]) -> None:
    """Refuse videos whose names say that they are not of one camera each."""
    stems: defaultdict[str, list[str]] = defaultdict(list)
    films: defaultdict[str, list[str]] = defaultdict(list)
    for video in videos:
        if found := hidden(video.name):
            raise ManifestError(
                f"{folder}: the name {video.name!r} has {found}, allowed: characters that can be "
                "seen; rename it"
            )
        stems[video.stem.casefold()].append(video.name)
        if match := _CHAPTER.fullmatch(video.stem):
            films[match["film"]].append(video.name)
    for names in stems.values():
        if len(names) > 1:
            raise ManifestError(
                f"{folder}: {' and '.join(names)} have one name, as one recording in two files "
                "has, allowed: one video of each camera; move one of them to another folder, or "
                "rename it if it is another camera's"
            )
    for names in films.values():
        if len(names) > 1:
            raise ManifestError(
                f"{folder}: {', '.join(names)} are chapters of one recording of an action camera, "
                "allowed: one video of each camera; join them, or move all but the one with rest "
                "and vibration to another folder"
            )
