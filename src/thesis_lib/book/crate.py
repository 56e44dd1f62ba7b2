"""The book as a research object: what was run, by what, with which parameters, and what came of it.

``ro-crate-metadata.json`` follows RO-Crate 1.1 and the profile Process Run Crate 0.5.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rocrate.model.contextentity import ContextEntity
from rocrate.rocrate import ROCrate

from thesis_lib import __version__
from thesis_lib.figure_sets.registry import validate
from thesis_lib.runs.postprocess import FOLDER
from thesis_lib.studies.commands import command
from thesis_lib.studies.storage import attributes

PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
NAME = "ro-crate-metadata.json"
TITLE = "Vibration by many cameras: an executable companion to a thesis"
ABOUT = (
    "How well several cameras measure the bending vibration of thin structures: pages, results "
    "and what made them."
)
LICENSE = "https://spdx.org/licenses/MIT"


def write(book: Path, made: Iterable[tuple[Path, Path]]) -> Path:
    """Describe a rendered book, with its downloads, in a file that depends on the runs alone.

    `made` are executed notebook and cube of each figure set that ran.
    """
    crate = ROCrate(version="1.1")
    crate.name, crate.description = TITLE, ABOUT
    crate.license = _entity(crate, LICENSE, "CreativeWork", name="MIT License")
    crate.root_dataset["conformsTo"] = _entity(
        crate, PROFILE, "CreativeWork", name="Process Run Crate", version="0.5"
    )
    crate.add_file(
        book / "index.html",
        "index.html",
        properties={"name": "The book", "encodingFormat": "text/html"},
    )
    actions, last = [], ""
    for notebook, cube in made:
        action = _action(crate, book, notebook, cube)
        last = max(last, str(action["endTime"]))
        actions.append(action)
    crate.root_dataset["mentions"] = actions
    crate.root_dataset["datePublished"] = last or "1970-01-01"
    path = book / NAME
    text = json.dumps(crate.metadata.generate(), indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")
    return path


def _entity(crate: ROCrate, id_: str, kind: str, **said: Any) -> Any:
    """An entity of the crate, made once."""
    there = crate.dereference(id_)
    if there is not None:
        return there
    return crate.add(ContextEntity(crate, id_, properties={"@type": kind, **said}))


def _action(crate: ROCrate, book: Path, notebook: Path, file: Path) -> Any:
    """The run of one figure set."""
    about = attributes(file)
    ran = json.loads(notebook.read_text(encoding="utf-8"))["metadata"]
    name = str(about["figure_set"])
    study = validate(name, json.loads(about["parameters"]))
    files = {
        f"{FOLDER}/{name}.nc": ("application/x-netcdf", "results, as netCDF"),
        f"{FOLDER}/{name}.csv": ("text/csv", "errors, as a table"),
        f"executed/{name}.html": ("text/html", "page of the book"),
        f"_sources/executed/{name}.ipynb": ("application/x-ipynb+json", "executed notebook"),
    }
    parts = {
        place: crate.add_file(
            book / place,
            place,
            properties={
                "name": f"{study.title}: {words}",
                "encodingFormat": kind,
                "contentSize": str((book / place).stat().st_size),
            },
        )
        for place, (kind, words) in files.items()
        if (book / place).is_file()
    }
    source = parts.pop(f"_sources/executed/{name}.ipynb", None)
    digest = ran.get("thesis_lib", {}).get("cube_sha256")
    if digest and f"{FOLDER}/{name}.nc" in parts:
        parts[f"{FOLDER}/{name}.nc"]["sha256"] = digest
    values = [
        _entity(
            crate,
            f"#{name}/{key}",
            "PropertyValue",
            name=key,
            value=value if isinstance(value, str) else json.dumps(value),
        )
        for key, value in study.request.items()
    ]
    papermill = ran["papermill"]
    return crate.add(
        ContextEntity(
            crate,
            f"#run-{name}",
            properties={
                "@type": "CreateAction",
                "name": study.title,
                "description": f"`{command(study)}`; parameters' hash {study.digest}",
                "startTime": str(papermill["start_time"]),
                "endTime": str(papermill["end_time"]),
                "instrument": {"@id": _library(crate, about).id},
                "object": [{"@id": one.id} for one in (*filter(None, [source]), *values)],
                "result": [{"@id": one.id} for one in parts.values()],
                "actionStatus": "http://schema.org/CompletedActionStatus",
            },
        )
    )


def _library(crate: ROCrate, about: dict[str, Any]) -> Any:
    """The software that made a cube."""
    commit, versions = str(about["commit"]).strip(), json.loads(about["versions"])
    packages = ", ".join(f"{name} {version}" for name, version in versions.items())
    return _entity(
        crate,
        f"#thesis_lib-{commit}",
        "SoftwareApplication",
        name="thesis_lib",
        softwareVersion=f"{__version__}, commit {commit}",
        softwareRequirements=packages,
        description=f"SHA-256 of the library: {about['library_sha256']}",
    )
