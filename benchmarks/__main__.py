"""Print all measurements: ``python -m benchmarks``, five minutes at most.

``--peers`` measures the library and its peers alone; ``--tracking`` follows markers by several
trackers, ``--compression`` as their motion becomes small in compressed films. ``--publish`` keeps
what any of these has measured for the book.
"""

from __future__ import annotations

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # read when NumPy is first imported

import argparse
import platform
import warnings
from typing import Any

import numpy as np

from benchmarks import compression, limits, own, peers, publish, rayleigh, tracking
from thesis_lib.book.pieces import benchmarks as page


def measure_peers() -> dict[str, Any]:
    """The same points by the library and by its peers, and what one core could do."""
    peers.quiet()
    timed = [timed for n in (2, 4, 12) for timed in peers.compare(n)]
    return publish.run(limits.measure(), timed, rayleigh.compare())


MEASUREMENTS = {  # by option: title, what measures, parts of the page
    "peers": (
        "The same points and pixels, in turns, processor time, one thread",
        measure_peers,
        ("machine", "targets", "comparison", "needs", "rayleigh", "plan"),
    ),
    "tracking": (
        "Tracking: one camera of 1280×720, processor time, one thread, in turns",
        lambda: publish.rounded(tracking.run()),
        ("tracking",),
    ),
    "compression": (
        "Compression: relative rms error of an amplitude by the pixels of motion",
        lambda: publish.rounded(compression.run()),
        ("compression",),
    ),
}


def main() -> None:
    """Run what is asked for, by default everything."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    for name, (title, *_) in MEASUREMENTS.items():
        parser.add_argument(f"--{name}", action="store_true", help=title)
    parser.add_argument("--publish", action="store_true", help="keep that for the book")
    asked = vars(parser.parse_args())
    print(f"Python {platform.python_version()}, NumPy {np.__version__}, "
          f"{os.cpu_count()} processors, one BLAS thread (OPENBLAS_NUM_THREADS=1)")  # fmt: skip
    chosen = [name for name in MEASUREMENTS if asked[name]]
    for name in chosen or MEASUREMENTS:
        title, measure, parts = MEASUREMENTS[name]
        print(f"\n{title}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # peers' remarks are not about these points
            data = measure()
        print("\n".join(page.tabulate_benchmarks(part, data) for part in parts))
        if asked["publish"]:
            publish.keep(data)
    if not chosen:
        own.print_all()


if __name__ == "__main__":
    main()
