"""Which pages of the book Sphinx writes: those that would become other than they are.

A page is made of what was read of it and of what the book tells it: titles and contents, labels
and numbers, names, citations, styles and scripts. If anything of that has changed, all pages are
written anew, so that a reference that has lost its target is warned of wherever it stands; else
those alone that were read anew, and those that point at what is called otherwise now. The others
stay.
"""

from __future__ import annotations

import hashlib
import pickle
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.builders.html import StandaloneHTMLBuilder
from sphinx.util.parallel import ParallelTasks, SerialTasks, parallel_available

from thesis_lib.book import edition, entries
from thesis_lib.book.polish import polish, tidy
from thesis_lib.files import digest_of

_OWN = {"index entries", "cite bibdata", "cite bibliographies"}  # no other page's
_CALLED = "std labels"  # page, place, and what it is called


def setup(app: Any) -> dict[str, bool]:
    """Have Sphinx write the book so; the module ``extension`` calls it."""
    app.add_builder(Pages, override=True)
    app.connect("doctree-read", _keep_targets)
    app.connect("env-get-updated", _outdated, priority=900)  # when sections are numbered
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _keep_targets(app: Any, tree: nodes.document) -> None:
    """Keep what a page points at."""
    targets = {one["reftarget"].lower() for one in tree.findall(pending_xref)}
    app.env.metadata[app.env.docname]["thesis_targets"] = targets


def _outdated(app: Any, env: Any) -> Iterable[str]:
    """Remove pages that are not as they would be; returns those that Sphinx would not write."""
    if not isinstance(app.builder, Pages):
        return ()
    styles = [Path(app.confdir, entry) for entry in env.config.html_static_path]
    told = _digest([*_told(env), digest_of(styles)])
    pages = {page: _digest([told, _called(env, page)]) for page in env.found_docs}
    old_pages = getattr(env, "thesis_written", {})
    env.thesis_written = pages
    return sorted(page for page, made_from in pages.items() if old_pages.get(page) != made_from)


def _told(env: Any) -> Iterator[Any]:
    """What the book tells its pages."""
    yield [env.titles, env.longtitles, env.tocs, env.toctree_includes]
    yield [env.toc_secnumbers, env.toc_fignumbers]
    for page, about in sorted(env.metadata.items()):
        yield [page, {slug: told[1:] for slug, told in about.get("myst_slugs", {}).items()}]
    for name, domain in sorted(env.domaindata.items()):
        for key, value in sorted(domain.items()):
            if f"{name} {key}" == _CALLED:
                yield {label: place for label, (*place, _called) in value.items()}
            elif f"{name} {key}" not in _OWN:
                yield sorted(map(_text, value)) if isinstance(value, list) else value


def _called(env: Any, page: str) -> dict[str, str]:
    """How that which a page points at is called: captions hold numbers of a run."""
    labels = env.domaindata["std"]["labels"]
    targets = env.metadata[page].get("thesis_targets", ())
    return {label: labels[label][-1] for label in targets if label in labels}


def _digest(value: Any) -> str:
    return hashlib.sha256(_text(value).encode()).hexdigest()


def _text(value: Any) -> str:
    """What is in a value, whatever the order in which it came together."""
    if isinstance(value, nodes.Node):
        return value.pformat()
    if isinstance(value, Mapping):
        return str(sorted((_text(key), _text(each)) for key, each in value.items()))
    if isinstance(value, set | frozenset):
        return str(sorted(map(_text, value)))
    if isinstance(value, list | tuple):
        return str(list(map(_text, value)))
    said = repr(value)
    return said if said != object.__repr__(value) else _text(vars(value))


class Pages(StandaloneHTMLBuilder):
    """Pages of a book in a folder that may hold the book as it was, and polished."""

    search = False  # by entries.js, which a page opened from a folder may read

    def get_outdated_docs(self) -> list[str]:  # type: ignore[override]
        """None by their dates: contents count."""
        return []

    def copy_assets(self) -> None:
        """Copy styles and scripts again, and note what was written before."""
        for copied in ("_static", "_downloads"):
            shutil.rmtree(Path(self.outdir, copied), ignore_errors=True)
        self._before = self._stamps()
        super().copy_assets()

    def finish(self) -> None:
        """Write the rest, and polish all that was written."""
        super().finish()
        book = Path(self.outdir)
        for kind in ("**/*.html", "_sources/**/*.ipynb", "_images/*.svg"):  # drawings of pages, too
            files = sorted(dict(self._stamps(kind).items() - self._before.items()))
            tasks = _tasks(2)
            for half in (files[::2], files[1::2]):
                tasks.add_task(lambda some: polish(book, some), half)
            tasks.join()
        tidy(book)
        found = self._entries({f"{name}.html" for name in self.env.all_docs})
        (book / entries.FILE).write_text(entries.script(found), encoding="utf-8")
        (book / edition.FILE).write_text(edition.script(), encoding="utf-8")

    def _entries(self, pages: set[str]) -> dict[str, list[entries.Entry]]:
        """What pages hold that can be looked for; of one that is as it was, it is known."""
        kept = Path(self.doctreedir, "entries.pickle")  # by digests of pages
        known = pickle.loads(kept.read_bytes()) if kept.is_file() else {}
        texts = {name: Path(self.outdir, name).read_text("utf-8") for name in sorted(pages)}
        digests = {name: hashlib.sha256(text.encode()).digest() for name, text in texts.items()}
        found = {
            name: known[digest] if digest in known else entries.of_page(texts[name])
            for name, digest in digests.items()
        }
        kept.write_bytes(pickle.dumps({digests[name]: of for name, of in found.items()}))
        return found

    def _stamps(self, kind: str = "**/*") -> dict[Path, int]:
        """When files of a kind were written, which cannot be said otherwise than it was."""
        files = Path(self.outdir).glob(kind)
        return {file: file.stat().st_ctime_ns for file in files if file.is_file()}


def _tasks(number: int) -> Any:
    """So many tasks at a time, beside what follows, where processes can be forked."""
    return ParallelTasks(number) if parallel_available else SerialTasks()
