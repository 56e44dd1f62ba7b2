"""Print all measurements and draw the growth: ``python -m benchmarks``, five minutes at most.

``--peers`` measures beside the peers alone, ``--scale`` a large study in pieces alone;
``--tracking`` follows markers beside other trackers, ``--compression`` as their motion becomes
small in compressed films. ``--publish`` keeps what any of these has
measured as what the book shows.
"""

from __future__ import annotations

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # read when NumPy is first imported

import argparse
import platform
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks import (
    centre,
    compression,
    laboratory,
    limits,
    measure,
    peers,
    publish,
    rayleigh,
    recording,
    scale,
    tracking,
)
from thesis_lib.book.pieces import benchmarks as benchmark_tables
from thesis_lib.studies import times

FIGURE = Path(__file__).parents[1] / "build" / "benchmarks" / "growth.svg"


def print_triangulation(n_points: int = 100_000) -> None:
    """Table of rates beside the reference."""
    print(f"\nTriangulation of {n_points} points, linear start and 3 Gauss-Newton steps")
    print("reference: batched numpy.linalg.svd + solve; thin: with full_matrices=False")
    print("million points/s: medians; ratios: medians over interleaved pairs")
    print(f"{'cameras':>8} {'library':>8} {'svd':>7} {'thin':>7} {'ratio':>7} {'to thin':>8} "
          f"{'apart':>10} {'memory':>9}")  # fmt: skip
    for n_cameras in (2, 4, 12):
        c = measure.compare_triangulation(n_cameras, n_points)
        print(f"{c.n_cameras:>8} {c.rate:>8.2f} {c.rate_svd:>7.3f} {c.rate_thin:>7.3f} "
              f"{c.ratio_svd:>7.1f} {c.ratio_thin:>8.1f} {c.difference:>8.0e} m "
              f"{c.memory:>5.1f} MiB")  # fmt: skip


def print_columns(named: Iterable[Mapping[str, str]]) -> None:
    """Cells in columns: words to the left, numbers to the right."""
    known = list(named)
    header, rows = list(known[0]), [list(row.values()) for row in known]
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    words = [any(c.isalpha() for row in rows for c in row[i][:1]) for i in range(len(header))]
    for cells in (header, *rows):
        aligned = zip(cells, widths, words, strict=True)
        print("  ".join(c.ljust(w) if word else c.rjust(w) for c, w, word in aligned).rstrip())


def print_peers(keep: bool, counts: Sequence[int] = (2, 4, 12)) -> None:
    """The same points by the library and by its peers, and what one core could do."""
    print("\nBeside the peers: the same points and pixels, in turns, processor time, one thread")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what peers have to say is not about these points
        peers.quiet()
        timed = [timed for n in counts for timed in peers.compare(n)]
        fields = rayleigh.compare()
    data = publish.run(limits.measure(), timed, fields)
    told = benchmark_tables.machine(data).items()
    print_columns({"": name, " ": said} for name, said in told)
    for part in ("targets", "comparison", "needs", "rayleigh", "plan"):
        print()
        print_columns(getattr(benchmark_tables, part)(data))
    print()
    if keep:
        publish.keep(data)


def print_scale(keep: bool) -> None:
    """A study that is too large to be held, by one process and by workers."""
    print("\nA study in pieces: case 4a of the plate, written to disk as it is computed")
    data = publish.rounded({"scale": scale.compare()})
    print_columns(benchmark_tables.scale(data))
    if keep:
        publish.keep(data)


def print_tracking(keep: bool) -> None:
    """Trackers on the same frames."""
    print("\nTracking: one camera of 1280×720, processor time, one thread, in turns")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that points are rounded to pixels
        data = publish.rounded(tracking.run())
    print_columns(benchmark_tables.tracking(data))
    if keep:
        publish.keep(data)


def print_compression(keep: bool) -> None:
    """What compressed films leave of small motions."""
    print("\nCompression: rms error of an amplitude, in % of it, by the pixels of motion")
    data = publish.rounded(compression.run())
    print_columns(benchmark_tables.compression(data))
    if keep:
        publish.keep(data)


def print_centres() -> None:
    """Table of times beside the reference."""
    print("\nAnalytic centre of 20000 points; joint: pairs of images with common x and y; interval")
    print("microseconds a point (joint: a pair), medians; ratio: median over interleaved pairs")
    print(f"{'cameras':>8} {'centre':>8} {'joint':>8} {'triangulate':>12} {'svd':>7} "
          f"{'interval':>9} {'to svd':>7} {'to centre':>10} {'memory':>9}")  # fmt: skip
    for n_cameras in (2, 4, 12, 64):
        c = centre.compare(n_cameras)
        print(f"{c.n_cameras:>8} {c.centre:>8.1f} {c.joint:>8.1f} {c.least_squares:>12.2f} "
              f"{c.svd:>7.1f} {c.interval:>9.1f} {c.ratio_svd:>7.2f} {c.ratio_centre:>10.2f} "
              f"{c.memory:>5.1f} MiB")  # fmt: skip


def print_studies(trials: int = 200) -> None:
    """Tables of the studies' times."""
    for subject, what in (("beam", ""), ("plate", ""), ("sound", ", given the plate's cubes")):
        print(f"\n{subject.title()} studies with {trials} trials{what}")
        times = measure.study_seconds(subject, trials)
        for name, time in {**times, "total": sum(times.values())}.items():
            print(f"{name:>18} {time:>7.2f} s")


def print_plane_errors() -> None:
    """All plane errors of a study beside a field for every trial."""
    e = measure.compare_plane_errors()
    print(f"\nAll {e.fields} plane errors of sound-distance with 200 trials")
    print(f"{e.seconds:>9.3f} s   from one factor per plane and mode, factors included")
    print(f"{e.direct_seconds:>9.1f} s   by Rayleigh's integral, field by field: "
          f"{e.direct_seconds / e.seconds:.0f} times as long")  # fmt: skip
    print(f"{e.kernel_seconds:>9.1f} s   from ready operators, field by field: "
          f"{e.kernel_seconds / e.seconds:.0f} times as long")  # fmt: skip
    print(f"the latter two measured on {e.sampled} fields and scaled to all; "
          f"largest difference {e.difference:.0e} of the error")  # fmt: skip


def print_field() -> None:
    """Field on each plane beside the direct expression."""
    print("\nField of one velocity vector on 149 × 99 points, medians of 15, interleaved")
    print("direct: exp(-1j*k*R)/R @ v with the distances R given")
    print(f"{'plane':>6} {'direct':>10} {'operator':>11} {'ratio':>6} {'rayleigh':>11} "
          f"{'ratio':>6} {'apart':>7}")  # fmt: skip
    for name in ("XZ", "YZ"):
        f = measure.compare_field(name)
        print(f"{f.plane:>6} {f.direct:>7.1f} ms {f.operator:>8.1f} ms {f.ratio_operator:>6.1f} "
              f"{f.rayleigh:>8.1f} ms {f.ratio_rayleigh:>6.1f} {f.difference:>7.0e}")  # fmt: skip


def print_laboratory() -> None:
    """Rendering, tracking, adjustment, and chapter 5 from nothing."""
    print("\nLaboratory, 1920×1080, one core")
    f = laboratory.frames()
    print(f"{f.still:>9.1f} frames/s   rendered, frozen")
    print(f"{f.blurred:>9.1f} frames/s   rendered, 8 positions within the exposure")
    print(f"{f.tracking:>9.1f} ms         to track 76 markers in a frame")
    adjustment = 1000 * laboratory.adjustment_seconds()
    print(f"{adjustment:>9.1f} ms         to adjust 4 cameras and 12 boards")
    for codec in ("lossless", "h264"):
        seconds, memory, error = laboratory.chapter(f"codec={codec}")
        print(f"{seconds:>9.1f} s          both notebooks of chapter 5 from nothing, {codec}; "
              f"at most {memory:.0f} MiB in a process; harmonic fit: {error:.3f} %")  # fmt: skip


def print_recording() -> None:
    """One's own recordings, by the command."""
    print("\nthesis measure: 3 cameras of 1280×720, 173 frames and 14 boards each")
    for what, (seconds, memory) in recording.example().items():
        print(f"{seconds:>9.1f} s          {what}, at most {memory:.0f} MiB")


def print_growth(growths: list[measure.Growth]) -> None:
    """Times by size, and the fitted exponents."""
    print("\nGrowth: time against points (4 cameras), cameras (10 000 points), trials (case 1)")
    for growth in growths:
        pairs = zip(growth.sizes, growth.seconds, strict=True)
        times = "  ".join(f"{size}: {1000 * time:.3g} ms" for size, time in pairs)
        print(f"{growth.what:>8}^{growth.exponent:.2f}   {times}")


def print_commands() -> None:
    """Table of the commands that compute nothing."""
    print("\nCommands, wall time from start to exit, median of 5")
    for arguments in (["list"], ["run", "beam-distance", "-p", "trials=-1"]):
        time, status = measure.command_seconds(*arguments)
        print(f"{time:>8.2f} s   thesis {' '.join(arguments)} (exit status {status})")


def print_times() -> None:
    """What took longer here, the last time that it ran, than is published."""
    here, published = times.read(times.measured_path()), times.read(times.published_path())
    print("\nSteps of the book and files of tests that take longer than published: loops then, now")
    for what, then, now in times.longer(published, here):
        print(f"{what:<60} {then:>8.0f} {now:>8.0f}")


def draw(growths: list[measure.Growth], path: Path) -> None:
    """Time against size in doubly logarithmic axes."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3), layout="constrained")
    with mpl.rc_context({"svg.fonttype": "none"}):
        for axes, growth in zip(figure.subplots(1, len(growths)), growths, strict=True):
            axes.loglog(growth.sizes, growth.seconds, "o-", color="tab:blue")
            axes.set(xlabel=f"number of {growth.what}", ylabel="time in s",
                     title=f"time ~ {growth.what}$^{{{growth.exponent:.2f}}}$")  # fmt: skip
            axes.grid(which="major", linewidth=0.4)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path)


def main() -> None:
    """Run what is asked for, by default everything."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--peers", action="store_true", help="beside the peers alone")
    parser.add_argument("--tracking", action="store_true", help="trackers of markers alone")
    parser.add_argument("--compression", action="store_true", help="compressed films alone")
    parser.add_argument("--scale", action="store_true", help="a large study in pieces alone")
    parser.add_argument("--publish", action="store_true", help="keep that for the book")
    asked = parser.parse_args()
    print(f"Python {platform.python_version()}, NumPy {np.__version__}, "
          f"{os.cpu_count()} processors, one BLAS thread (OPENBLAS_NUM_THREADS=1)")  # fmt: skip
    everything = not (asked.peers or asked.scale or asked.tracking or asked.compression)
    if asked.peers or everything:
        print_peers(asked.publish)
    if asked.scale or everything:
        print_scale(asked.publish)
    if asked.tracking or everything:
        print_tracking(asked.publish)
    if asked.compression or everything:
        print_compression(asked.publish)
    if everything:
        print_own()


def print_own() -> None:
    """The library alone, and beside its references."""
    print_triangulation()
    print_centres()
    print_studies()
    print_plane_errors()
    print_field()
    print_laboratory()
    print_recording()
    growths = measure.growth()
    print_growth(growths)
    print_commands()
    print_times()
    try:
        draw(growths, FIGURE)
    except ImportError:
        print("\nno figure: matplotlib is not installed")
    else:
        print(f"\nfigure: {FIGURE}")


if __name__ == "__main__":
    main()
