"""Tables of equal pixels per second in few or many cameras, from the cube of ``design-law``."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from thesis_lib.figure_sets.design_law.noisy import MISTAKES, OUTLIER_PX
from thesis_lib.figure_sets.design_law.shares import FOLLOWED_PX, MARKER
from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.markdown import table

_MARKED = (
    f"*Marker*: height of the image of one of {1000 * MARKER:g} mm. †: below {FOLLOWED_PX:g} px, "
    "where the laboratory's tracker loses markers."
)
_DRAWN = ("drawn_frame_error", "drawn_fit_error")


def asked(cube: xr.Dataset, name: str) -> Any:
    """A parameter of the run."""
    return json.loads(cube.attrs["parameters"])[name]


def sampling(cube: xr.Dataset, *names: str) -> str:
    """Return a sentence with the largest standard error of drawn variables, relative to them."""
    stds = [(cube[f"{name}_std"] / cube[name].where(cube[name] > 0)).values for name in names]
    largest = np.fmax.reduce(np.concatenate([np.ravel(one) for one in stds]))
    if not np.isfinite(largest):
        return "One draw has no standard error."
    return f"Standard errors of what is drawn: up to {percent_text(100 * float(largest))} %."


def _duration(cube: xr.Dataset) -> str:
    seconds = asked(cube, "duration_s")
    return "one second" if seconds == 1 else f"{seconds:g} seconds"


def _share(cube: xr.Dataset, counts: Iterable[int]) -> str:
    names = [str(name) for name in cube["estimator"].values]
    rows = []
    for rate in cube["rate"].values:
        for count in counts:
            at = cube.sel(rate=rate, count=count)
            drawn, fitted = (
                [percent_text(float(v)) for v in at[name].values]
                for name in ("drawn_frame_error", "drawn_fit_error")
            )
            rows.append(
                [
                    f"{rate:g}",
                    str(count),
                    f"{int(at['width_px'])}×{int(at['height_px'])}",
                    f"{float(at['marker_height']):.1f}{'' if followed(at) else ' †'}",
                    f"{float(at['motion_px']):.1f}",
                    percent_text(float(at["frame_error"])),
                    *drawn,
                    percent_text(float(at["fit_error"])),
                    *fitted,
                    f"{float(at['useful_frames']):.0f}",
                ]
            )
    header = [
        "Hz",
        "cameras",
        "pixels",
        "marker, px",
        "motion, px",
        "frame: law",
        *(f"frame: {name}" for name in names),
        "fit: law",
        *(f"fit: {name}" for name in names),
        "frames that tell",
    ]
    return table(header, rows)


def shares(cube: xr.Dataset) -> str:
    """Equal pixels per second, all numbers of cameras."""
    peak = asked(cube, "amplitude_mm")
    return _share(cube, cube["count"].values) + (
        f"\nAll have {asked(cube, 'pixels_per_second') / 1e6:.0f} million pixels per second "
        f"together, at {asked(cube, 'cone_distance_mm'):g} mm, {asked(cube, 'cone_deg'):g}° "
        "from the normal. *Frame*: rms error of the beam's markers in modes 1 to 3, in % of "
        f"the peak of {peak:g} mm. *Fit*: rms error of an amplitude fitted to "
        f"{_duration(cube)} of a vibration with "
        f"{asked(cube, 'frequency_hz'):g} Hz at the centre. *Frames that tell*: about how many "
        f"frames are worth fitting. {sampling(cube, *_DRAWN)} {_MARKED}\n"
    )


def few_shares(cube: xr.Dataset) -> str:
    """Return that table for few, middle and most cameras, and the claim in numbers."""
    counts = np.sort(cube["count"].values)
    most = [most_followed(cube, float(rate)) for rate in cube["rate"].values]
    some = {int(counts[i]) for i in (0, len(counts) // 2, -1)} | {n for n in most if n}
    return f"{_share(cube, sorted(some))}\n{sampling(cube, *_DRAWN)} {_MARKED}\n\n{claim(cube)}"


def followed(at: xr.Dataset) -> bool:
    """Whether markers are high enough for the laboratory's tracker, in one rig."""
    return bool(at["marker_height"] >= FOLLOWED_PX)


def most_followed(cube: xr.Dataset, rate: float) -> int:
    """The largest number of cameras whose markers the tracker follows; 0 if there is none."""
    here = cube.sel(rate=rate)
    fits = here["count"].values[here["marker_height"].values >= FOLLOWED_PX]
    return int(fits.max(initial=0))


SHOWN = (0.0, 0.05, 0.1, 0.3)  # px of noise
_WITH_STD = "*±*: largest standard error of the cell's drawn values."


def noisy(cube: xr.Dataset) -> str:
    """Errors with noise, by each estimator, and what noise leaves half of the gain."""
    counts = np.sort(cube["count"].values)
    return _noisy(cube, counts) + (
        "\nRms errors of deflections in µm by "
        + ", ".join(str(name) for name in cube["approach"].values)
        + f", {asked(cube, 'cone_distance_mm'):g} mm away. *Tolerance*: noise that leaves half of "
        f"what is gained over least squares without noise. {_WITH_STD} {_MARKED}\n"
    )


def few_noisy(cube: xr.Dataset) -> str:
    """Return that table for about half as many numbers of cameras, and the claim in numbers."""
    table_ = _noisy(cube, _doubled(cube))
    return f"{table_}\n{_WITH_STD} {_MARKED}\n\n{noisy_claim(cube)}"


def _doubled(cube: xr.Dataset) -> list[int]:
    """Return the numbers of cameras that are the least times a power of two."""
    counts = np.sort(cube["count"].values)
    return [
        int(n) for n in counts if (n / counts[0]).is_integer() and np.log2(n / counts[0]) % 1 == 0
    ]


def _noisy(cube: xr.Dataset, counts: Iterable[int]) -> str:
    slowest = cube["rate"].values.min()
    rows = []
    for count in counts:
        at = cube.sel(count=count, rate=slowest)
        errors = (_with_std(at, image_noise=noise) for noise in SHOWN)
        bear = at["share_tolerance"].values[1:]
        rows.append(
            [str(count), str(int(at["width_px"])),
             f"{float(at['marker_height']):.1f}{'' if followed(at) else ' †'}",
             *errors,
             " / ".join(f"{noise:.2f}" if np.isfinite(noise) else "–" for noise in bear)]
        )  # fmt: skip
    least = (1e6 * cube["least_share_error"].sel(image_noise=noise).mean() for noise in SHOWN)
    rows.append(["any estimator, at least", "", "", *(f"{float(one):.0f}" for one in least), ""])
    names = [str(name) for name in cube["approach"].values[1:]]
    header = ["cameras", "px across", "marker, px",
              *("no noise" if not noise else f"{noise:g} px" for noise in SHOWN),
              f"tolerance, px: {' / '.join(names)}"]  # fmt: skip
    return table(header, rows)


def _with_std(at: xr.Dataset, name: str = "noisy_share_error", **of: Any) -> str:
    """Return errors in µm by each approach, and their largest standard error."""
    errors, stds = (1e6 * at[one].sel(of).values for one in (name, f"{name}_std"))
    return f"{' / '.join(f'{each:.0f}' for each in errors)} ± {np.max(stds):.0f}"


def mistakes(cube: xr.Dataset) -> str:
    """Return a table of what wrong noise and outliers cost *interval*, and the claim in numbers."""
    names = [str(one) for one in cube["approach"].values]
    errors = (cube["mistaken_error"].sel(approach=name) for name in names)
    squares, centre, interval = errors
    right = 1e6 * cube["noisy_share_error"].sel(approach=names[-1])
    doubled, rows = _doubled(cube), []
    for mistake, (noise, _, _) in MISTAKES.items():
        for count in doubled[1::2] or doubled:
            at = {"mistake": mistake, "count": count}
            share = float(cube["feasible_fraction"].sel(at))
            rows.append(
                [
                    mistake,
                    str(count),
                    f"{float(right.sel(count=count, image_noise=noise)):.0f}",
                    _with_std(cube, "mistaken_error", **at),
                    *(f"×{float((interval / one).sel(at)):.2f}" for one in (squares, centre)),
                    f"{100 * share:.0f}",
                ]
            )
    header = [
        "noise",
        "cameras",
        f"{names[-1]}, told right",
        " / ".join(names),
        *(f"{names[-1]} over {name}" for name in names[:2]),
        "pixels agree, %",
    ]
    (low, (noise, less, _)), (high, (_, more, _)), (spoilt, _) = MISTAKES.items()
    over = (interval / squares).sel(mistake=low)
    worse, worst_count = 100 * float(over.max() - 1), int(over.idxmax("count"))
    slower = float((interval / centre).sel(mistake=high).max())
    spoilt_by = float((interval / squares).sel(mistake=spoilt, count=max(doubled)))
    return table(header, rows) + (
        "\nRms errors of deflections in µm with equal pixels per second. *Outliers*: image "
        f"coordinates that lie {OUTLIER_PX:g} px to one side. *Pixels agree*: points whose pixels "
        "agree within five times the noise that is told; elsewhere *interval* returns the "
        f"least-squares point. {_WITH_STD}\n\n"
        f"Told {less:g} px where there are {noise:g}, *interval* is up to {worse:.0f} % worse than "
        f"least squares ({worst_count} cameras). Told {more:g} px where there is no noise, it has "
        f"up to {slower:.1f} times the error of the analytic centre. With outliers and "
        f"{max(doubled)} cameras it has {spoilt_by:.2f} times the error of least squares.\n"
    )


def noisy_claim(cube: xr.Dataset) -> str:
    """What noise leaves of the central claim, in numbers."""
    few, many = int(cube["count"].min()), int(cube["count"].max())
    errors, least = 1e6 * cube["noisy_share_error"], 1e6 * cube["least_share_error"]
    squares, centre, interval = (errors.sel(approach=name) for name in errors["approach"].values)
    some = {"count": many, "image_noise": SHOWN[1]}
    bear = cube["share_tolerance"].sel(approach="interval")
    bear = bear[np.isfinite(bear.values)]
    worse = float((interval / np.minimum(squares, centre)).max()) - 1
    loud = cube["image_noise"].values >= SHOWN[-1]
    level = (squares.max("count") / squares.min("count"))[loud]
    reached = ((least / interval) ** 2)[:, loud]
    by_interval, by_centre, by_squares, limit = (
        f"{float(one.sel(some)):.0f}" for one in (interval, centre, squares, least)
    )
    text = (
        f"With {SHOWN[1]:g} px of noise {many} coarse cameras measure to {by_interval} µm by "
        f"*interval*, to {by_centre} by the analytic centre and to {by_squares} by least squares; "
        f"no estimator can be below {limit}. {few} sharp ones measure to "
        f"{float(interval.sel(some | {'count': few})):.0f} by *interval*."
    )
    if bear.size:
        text += (
            f" Half of the gain is left at {float(bear.min()):.2f} to {float(bear.max()):.2f} px "
            f"of noise for {int(bear['count'].min())} to {int(bear['count'].max())} cameras."
        )
    stds = cube["noisy_share_error_std"] / cube["noisy_share_error"]
    known = float(stds[:, loud].max())
    below = (least / interval - 1) / stds.sel(approach=interval["approach"].item())
    return text + (
        f" From {SHOWN[-1]:g} px on the errors of least squares differ by at most "
        f"{100 * float(level.max() - 1):.0f} % between numbers of cameras, each known to "
        f"±{100 * known:.1f} %, and *interval* has an efficiency of at least "
        f"{100 * float(reached.min()):.0f} ± {200 * known:.0f} % of the bound. Drawn errors below "
        f"the bound are below it by {max(0.0, float(below.max())):.1f} standard errors at most. "
        "Nowhere is *interval* worse than the better of both others by more than "
        f"{100 * max(0.0, worse):.1f} %, if it is told the noise.\n"
    )


def claim(cube: xr.Dataset) -> str:
    """The thesis's central claim in numbers: the law of least squares, then other estimators."""
    few, many = int(cube["count"].min()), int(cube["count"].max())
    slow, fast = float(cube["rate"].min()), float(cube["rate"].max())
    frames = cube["frame_error"].sel(rate=slow)

    def at(name: str, count: int, rate: float) -> float:
        return float(cube[name].sel(count=count, rate=rate))

    text = (
        f"At {slow:g} frames per second the error of one frame is {float(frames.min()):.1f} to "
        f"{float(frames.max()):.1f} % for {few} to {many} cameras, in no order. At {fast:g} the "
        f"same pixels give {at('frame_error', few, fast):.1f} % to {few} cameras and "
        f"{at('frame_error', many, fast):.1f} % to {many}, whose images move by "
        f"{at('motion_px', many, fast):.2f} px. An amplitude fitted to all frames of "
        f"{_duration(cube)} is wrong by {at('fit_error', few, slow):.2f} % "
        f"with {few} cameras at {slow:g} frames per second, by {at('fit_error', many, slow):.2f} "
        f"% with {many}, and by {at('fit_error', few, fast):.2f} % with {few} cameras at "
        f"{fast:g}, for all its frames. Were frames independent, it would be "
        f"{at('independent_fit_error', few, slow):.2f} % for every one of them."
    )
    for name in cube["estimator"].values[1:]:
        frame, film = (
            [
                percent_text(float(cube[kind].sel(estimator=name, count=count, rate=slow)))
                for count in (few, many)
            ]
            for kind in ("drawn_frame_error", "drawn_fit_error")
        )
        text += (
            f" The *{name}* gives, at {slow:g} frames per second, {frame[0]} % to {few} cameras "
            f"and {frame[1]} % to {many} from one frame, {film[0]} and {film[1]} % from all"
        )
        most = most_followed(cube, slow)
        if few < most < many:
            part = cube.sel(estimator=name, count=most, rate=slow)
            one, every = (percent_text(float(part[f"drawn_{k}_error"])) for k in ("frame", "fit"))
            text += f"; with markers that can be followed, to at most {most}, {one} and {every} %"
        text += "."
    return text + "\n"
