"""``pytest --javascript 95``: which share of our JavaScript the tests executed, as Chromium counts.

Each window that :mod:`browser` opens is watched; a share below what is asked fails the run.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thesis_lib.web import fragment

if TYPE_CHECKING:
    from playwright.sync_api import Page

ROOT = Path(__file__).parents[1]
FILES = sorted([*fragment.ASSETS.glob("*.js"), *(ROOT / "book" / "assets").glob("*.js")])
SHOWN = 60  # characters of what was not executed


@cache
def pieces(file: Path) -> tuple[str, ...]:
    """The text of a file as it stands in pages: in one piece, or cut where its export is named."""
    text = file.read_text(encoding="utf-8")
    if file.parent == fragment.ASSETS:
        text = re.sub(r"^export (?!default )", "", fragment._IMPORT.sub("", text), flags=re.M)
        text = fragment._INDENT.sub("", text)
    return tuple(re.split(r"^export default ", text.strip(), flags=re.M))


@cache
def places(source: str) -> tuple[tuple[Path, int, int, int], ...]:
    """Which files stand in a script: each piece's place there, in its file, and its length."""
    found = []
    for file in FILES:
        ours, at = 0, 0
        for piece in pieces(file):
            at = source.find(piece, at)
            if at < 0:
                break
            found.append((file, at, ours, len(piece)))
            ours, at = ours + len(piece), at + len(piece)
    return tuple(found)


@dataclass
class Watcher:
    """What was executed so far, by file: one element per character of its pieces."""

    ran: dict[Path, NDArray[np.bool_]] = field(
        default_factory=lambda: {
            file: np.zeros(sum(map(len, pieces(file))), dtype=bool) for file in FILES
        }
    )
    known: dict[str, tuple[tuple[Path, int, int, int], ...]] = field(default_factory=dict)

    def watch(self, page: Page) -> None:
        """Count from now on what a page executes, also before it goes elsewhere."""
        session, hashes = page.context.new_cdp_session(page), {}
        session.on(
            "Debugger.scriptParsed", lambda one: hashes.update({one["scriptId"]: one["hash"]})
        )
        for method in ("Profiler.enable", "Debugger.enable"):
            session.send(method)
        session.send("Debugger.setSkipAllPauses", {"skip": True})
        session.send("Profiler.startPreciseCoverage", {"callCount": True, "detailed": True})

        def take() -> None:
            for script in session.send("Profiler.takePreciseCoverage")["result"]:
                self._note(session, script, hashes.get(script["scriptId"], ""))

        def taking_before(act: Any) -> Any:
            def done(*arguments: Any, **named: Any) -> Any:
                take()
                return act(*arguments, **named)

            return done

        for name in ("goto", "reload", "go_back", "go_forward", "set_content", "close"):
            setattr(page, name, taking_before(getattr(page, name)))
        page.context.close = taking_before(page.context.close)  # type: ignore[method-assign]

    def _note(self, session: Any, script: Any, digest: str) -> None:
        if not digest:
            return
        if digest not in self.known:
            told = session.send("Debugger.getScriptSource", {"scriptId": script["scriptId"]})
            self.known[digest] = places(told["scriptSource"])
        if not self.known[digest]:
            return
        ranges = [one for function in script["functions"] for one in function["ranges"]]
        ranges.sort(key=lambda one: one["startOffset"] - one["endOffset"])  # parts after wholes
        counted = np.zeros(max(one["endOffset"] for one in ranges), dtype=bool)
        for one in ranges:
            counted[one["startOffset"] : one["endOffset"]] = one["count"] > 0
        for file, at, ours, length in self.known[digest]:
            here = counted[at : at + length]
            self.ran[file][ours : ours + len(here)] |= here

    def add(self, others: dict[str, str]) -> None:
        """Take in what another process has seen."""
        for file, told in others.items():
            self.ran[ROOT / file] |= np.frombuffer(bytes.fromhex(told), dtype=bool)

    def told(self) -> dict[str, str]:
        """What was executed, for another process."""
        return {
            file.relative_to(ROOT).as_posix(): ran.tobytes().hex() for file, ran in self.ran.items()
        }

    def report(self) -> tuple[float, list[str]]:
        """The share in percent, and for each file its own and where it was not executed."""
        total, done, lines = 0, 0, []
        for file, ran in self.ran.items():
            text = "".join(pieces(file))
            written = np.array([not one.isspace() for one in text])
            total, done = total + int(written.sum()), done + int(ran[written].sum())
            lines.append(f"{100 * ran[written].mean():5.1f} %  {file.relative_to(ROOT)}")
            missed = "".join(
                one if not did else "\0" for one, did in zip(text, ran, strict=True)
            ).split("\0")
            parts = [" ".join(one.split()) for one in missed]
            lines += [f"         {one[:SHOWN]}" for one in parts if len(one) > 3]
        return 100 * done / total, lines


WATCHER: list[Watcher] = []  # the one of this process, if pages are watched


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--javascript", type=float, help="least share of our JavaScript to be executed, in percent"
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--javascript") is not None:
        WATCHER.append(Watcher())


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    if WATCHER and "javascript" in getattr(node, "workeroutput", {}):
        WATCHER[0].add(node.workeroutput["javascript"])


def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    if not WATCHER:
        return
    if hasattr(config, "workeroutput"):
        config.workeroutput["javascript"] = WATCHER[0].told()
    elif WATCHER[0].report()[0] < config.getoption("--javascript"):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    if WATCHER:
        share, lines = WATCHER[0].report()
        least = config.getoption("--javascript")
        terminalreporter.section(f"JavaScript executed: {share:.1f} %, at least {least:g} %")
        terminalreporter.write("\n".join([*lines, ""]))
