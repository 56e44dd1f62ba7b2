"""Files that the rendered book offers: tables, one zip file, and an RO-Crate description.

The crate has version 1.1, with the profile Process Run Crate.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from thesis_lib import __version__, templates
from thesis_lib.book.pieces.shown import SETS_IN_CHAPTERS
from thesis_lib.figure_sets import cube_file
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.files import staging, whole_file, whole_text
from thesis_lib.plotting import selection as plotted
from thesis_lib.runs.postprocess import DATA_FOLDER
from thesis_lib.studies.request import study_command
from thesis_lib.studies.storage import read_attributes

ARCHIVE_NAME = "vibration-by-many-cameras"
SAMPLE_REPORT = "sample-report.html"
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file can hold
_COMPRESSED_SUFFIXES = {".nc", ".png", ".webp", ".woff2", ".gz"}


def write_tables(folder: Path, cubes: Iterable[Path]) -> None:
    """Write the numbers of cubes, and of their figures in a folder of each, as CSV files."""
    for path in cubes:
        cube = cube_file.read_cube(path)
        errors = plotted.errors_table(cube)
        whole_text(folder / f"{path.stem}.csv", plotted.as_csv(errors))
        with staging(folder) as work:
            new = work / path.stem
            for (case, mode), name in plotted.figure_names(cube).items():
                table = plotted.figure_table(cube, errors, case, mode)
                whole_text(new / f"{name}.csv", plotted.as_csv(table))
            if new.is_dir():
                replace_folder(new, folder / path.stem)


def add_downloads(root: Path, book: Path, made: Sequence[tuple[Path, Path]]) -> None:
    """Put cubes, their tables, the sample report and a description into a rendered book."""
    tables, report = root / "build" / "tables", root / "book" / "executed" / SAMPLE_REPORT
    (book / DATA_FOLDER).mkdir(exist_ok=True)
    for _, cube in made:
        if (tables / cube.stem).is_dir():  # its figures have tables of their own
            shutil.copytree(tables / cube.stem, book / DATA_FOLDER / cube.stem)
        for file in (tables / f"{cube.stem}.csv", cube):
            shutil.copyfile(file, book / DATA_FOLDER / file.name)
    describe_book(book, made)
    if report.is_file():
        shutil.copyfile(report, book / SAMPLE_REPORT)


def pack_book(book: Path, place: Path) -> None:
    """Pack a rendered book into one zip file; the same book gives the same bytes."""

    def write_archive(part: Path) -> None:
        with zipfile.ZipFile(part, "w") as packed:
            inside = {p.relative_to(book).as_posix(): p for p in book.rglob("*") if p.is_file()}
            for name, path in sorted(inside.items()):
                entry = zipfile.ZipInfo(f"{ARCHIVE_NAME}/{name}", _ZIP_DATE)
                entry.create_system, entry.external_attr = 3, 0o100644 << 16  # everywhere alike
                stored = path.suffix in _COMPRESSED_SUFFIXES
                entry.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
                packed.writestr(entry, path.read_bytes(), compresslevel=6)

    whole_file(place, write_archive)


def replace_folder(new: Path, target: Path) -> None:
    """Put the folder `new` in the place of `target`, by renaming within one file system."""
    old = new.with_name("old")
    if target.exists():
        target.rename(old)
    try:
        new.rename(target)
    except OSError:
        if old.exists():
            old.rename(target)
        raise


CRATE_NAME = "ro-crate-metadata.json"
CRATE_PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
LICENSE_ADDRESS = "https://spdx.org/licenses/MIT"
CRATE_FILES = (  # address, format, meaning; the first is what was run
    ("_sources/executed/{name}.ipynb", "application/x-ipynb+json", "executed notebook"),
    (f"{DATA_FOLDER}/{{name}}.nc", "application/x-netcdf", "results, as netCDF"),
    (f"{DATA_FOLDER}/{{name}}.csv", "text/csv", "errors, as a table"),
    ("{page}.html", "text/html", "page of the book"),
)


def describe_book(book: Path, made: Iterable[tuple[Path, Path]]) -> None:
    """Describe a rendered book by its runs: executed notebook and cube of each figure set."""
    runs = [_describe_run(book, notebook, cube) for notebook, cube in made]
    text = templates.render(
        __file__, "ro-crate.json", runs=runs, profile=CRATE_PROFILE, license=LICENSE_ADDRESS
    )
    crate = json.dumps(json.loads(text), indent=1, ensure_ascii=False)
    (book / CRATE_NAME).write_text(crate + "\n", encoding="utf-8")


def _describe_run(book: Path, notebook: Path, cube: Path) -> dict[str, Any]:
    """Return what the template says of one figure set's run, software, parameters and files."""
    metadata = json.loads(notebook.read_text(encoding="utf-8"))["metadata"]
    about, digest = read_attributes(cube), metadata.get("thesis_lib", {}).get("cube_sha256")
    name = str(about["figure_set"])
    study = validate_request(name, json.loads(about["parameters"]))
    page = SETS_IN_CHAPTERS.get(name, f"executed/{name}")
    files = [
        {
            "place": place,
            "format": form,
            "words": words,
            "size": path.stat().st_size,
            "sha256": digest if path.suffix == ".nc" else "",
        }
        for pattern, form, words in CRATE_FILES
        if (path := book / (place := pattern.format(name=name, page=page))).is_file()
    ]
    commit, versions = str(about["commit"]).strip(), json.loads(about["versions"])
    packages = ", ".join(f"{package} {version}" for package, version in versions.items())
    tool = {"id": f"#thesis_lib-{commit}", "version": f"{__version__}, commit {commit}"}
    return {
        "id": f"#run-{name}",
        "study": study,
        "description": f"`{study_command(study)}`; parameters' hash {study.digest}",
        "start": str(metadata["papermill"]["start_time"]),
        "end": str(metadata["papermill"]["end_time"]),
        "tool": {**tool, "packages": packages, "digest": about["library_sha256"]},
        "files": files,
        "inputs": [files[0]["place"], *(f"#{name}/{key}" for key in study.request)],
        "results": [file["place"] for file in files[1:]],
    }
