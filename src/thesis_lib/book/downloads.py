"""What the rendered book offers to download, and the book itself as one file."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterable
from pathlib import Path

from thesis_lib.book.site import swap
from thesis_lib.figure_sets import cube_file
from thesis_lib.files import staging, whole_file, whole_text
from thesis_lib.plotting import selection as plotted
from thesis_lib.runs.postprocess import FOLDER

ARCHIVE = "vibration-by-many-cameras"
_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can hold
_PACKED = {".nc", ".png", ".webp", ".woff2", ".gz"}  # compressed already


def tables(folder: Path, made: Iterable[Path]) -> None:
    """Write the numbers of cubes, and of their figures in a folder of each, as tables."""
    for path in made:
        cube = cube_file.read(path)
        errors = plotted.errors_table(cube)
        whole_text(folder / f"{path.stem}.csv", plotted.as_csv(errors))
        with staging(folder) as work:
            new = work / path.stem
            for (case, mode), name in plotted.figure_names(cube).items():
                table = plotted.figure_table(cube, errors, case, mode)
                whole_text(new / f"{name}.csv", plotted.as_csv(table))
            if new.is_dir():
                swap(new, folder / path.stem)


def fill(book: Path, made: Iterable[Path], numbers: Path) -> None:
    """Put cubes, and their numbers as :func:`tables` wrote them, into a rendered book."""
    (book / FOLDER).mkdir(exist_ok=True)
    for path in made:
        if (numbers / path.stem).is_dir():  # its figures have tables of their own
            shutil.copytree(numbers / path.stem, book / FOLDER / path.stem)
        for file in (numbers / f"{path.stem}.csv", path):
            shutil.copyfile(file, book / FOLDER / file.name)


def archive(book: Path, place: Path) -> Path:
    """Pack a rendered book into one zip file `place`; the same book gives the same bytes."""

    def pack(part: Path) -> None:
        with zipfile.ZipFile(part, "w") as packed:
            inside = {p.relative_to(book).as_posix(): p for p in book.rglob("*") if p.is_file()}
            for name, path in sorted(inside.items()):
                entry = zipfile.ZipInfo(f"{ARCHIVE}/{name}", _DATE)
                entry.create_system, entry.external_attr = 3, 0o100644 << 16  # everywhere alike
                kept = path.suffix in _PACKED
                entry.compress_type = zipfile.ZIP_STORED if kept else zipfile.ZIP_DEFLATED
                packed.writestr(entry, path.read_bytes(), compresslevel=6)

    whole_file(place, pack)
    return place
