"""Description of the book as a research object: RO-Crate 1.1 with the profile Process Run Crate."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from thesis_lib import __version__, templates
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.runs.postprocess import DATA_FOLDER
from thesis_lib.studies.request import study_command
from thesis_lib.studies.storage import read_attributes

CRATE_NAME = "ro-crate-metadata.json"
CRATE_PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
LICENSE_ADDRESS = "https://spdx.org/licenses/MIT"
CRATE_FILES = (  # address, format, meaning; the first is what was run
    ("_sources/executed/{}.ipynb", "application/x-ipynb+json", "executed notebook"),
    (f"{DATA_FOLDER}/{{}}.nc", "application/x-netcdf", "results, as netCDF"),
    (f"{DATA_FOLDER}/{{}}.csv", "text/csv", "errors, as a table"),
    ("executed/{}.html", "text/html", "page of the book"),
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
    files = [
        {
            "place": place,
            "format": form,
            "words": words,
            "size": path.stat().st_size,
            "sha256": digest if path.suffix == ".nc" else "",
        }
        for pattern, form, words in CRATE_FILES
        if (path := book / (place := pattern.format(name))).is_file()
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
