"""The command ``thesis measure`` as a stranger runs it, and recordings broken on purpose."""

import shutil
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import pytest
import yaml
from command import Done, hears_signals

from thesis_lib.files import RECORD_NAME

RESULTS = {
    RECORD_NAME, "calibration.nc", "cameras.toml", "cameras.yaml", "figures", "measured.mat",
    "measured.nc", "motion.csv", "motion.nc", "motion.uff", "report.html", "shape.gif", "shape.mp4",
    "shapes.csv", "shapes.uff", "tracked.mp4", "vtk",
}  # fmt: skip


class Running:
    """The command under way in a process of its own."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "thesis_lib", *map(str, arguments)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            encoding="utf-8", start_new_session=True, preexec_fn=hears_signals,
        )  # fmt: skip

    def wait_for(self, condition):
        """Wait until a condition holds while the command is still running."""
        for _ in range(30_000):
            if condition():
                return
            if self.process.poll() is not None:
                pytest.fail(f"ended too early: {self.process.communicate()}")
            time.sleep(0.01)
        pytest.fail("nothing came of it within five minutes")

    def end(self, how=None):
        """Wait for the end, after a signal if there is one; also how long that took, in s."""
        start = time.monotonic()
        if how is not None:
            self.process.send_signal(how)
        try:
            out, err = self.process.communicate(timeout=300)
        finally:
            self.process.kill()
        return Done(self.process.returncode, out, err), time.monotonic() - start


def copied(folder, to, results=False):
    """A copy of a recording that a test may break; times of change stay, so that steps count.

    With `results` the folder ``measured`` comes along, without its results but with its steps.
    """
    unwanted = RESULTS if results else {"measured"}

    def ignored(place, names):  # a step may be named like a result
        return set() if Path(place).name == ".steps" else unwanted & set(names)

    shutil.copytree(folder, to, ignore=ignored)
    return to


def change_manifest(folder, change):
    path = folder / "manifest.yaml"
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    change(values)
    path.write_text(yaml.safe_dump(values, sort_keys=False, allow_unicode=True), encoding="utf-8")


class Page(HTMLParser):
    """What a page loads, its pictures' descriptions, its text."""

    def __init__(self, path):
        super().__init__()
        self.loaded: list[str] = []
        self.pictures: list[str | None] = []
        self.text = self.styles = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.loaded += [value for name, value in attrs
                        if name in {"src", "srcset", "data", "poster", "action"}
                        or (name == "href" and tag != "a")]  # fmt: skip
        if tag == "img":
            self.pictures.append(dict(attrs).get("alt"))

    def handle_data(self, data):
        self.text += data
        self.styles += data if self.lasttag == "style" else ""
