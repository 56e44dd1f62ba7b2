"""Tables of ``lab-equal-pixels``, and its verdict in words."""

from __future__ import annotations

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.arrays import Array
from thesis_lib.plotting.selection import select
from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.markdown import columns, table

ALIKE = 0.10  # by which errors may differ and yet be called as good as each other
LOST = 0.005  # share of lost markers from which a rig cannot follow them


def results(cube: xr.Dataset) -> str:
    """Ratios to the sharp pair, case by case, and what becomes of the claim."""
    cases = _cases(cube)
    counts = np.unique(cube["n_cameras"].values)
    rows = []
    for case, part in cases.items():
        cells = [
            _ratio(part.isel(setting=int(i[0])))
            if len(i := np.flatnonzero(part["n_cameras"].values == n))
            else ""
            for n in counts
        ]
        sharp = float((part["rms_error"] / part["ratio"]).values[0])
        rows.append([_named(case), percent_text(sharp), *cells, _verdict(part)])
    header = ["case", "sharp pair, %", *(f"{n} cameras" for n in counts), "most cameras are"]
    return table(header, rows) + (
        "\nError over that of the sharp pair, rms over markers and "
        f"{cube.sizes['trial']} recordings of each rig (5–95 % over resampled recordings) · by the "
        f"law of edges. *As good* means within {100 * ALIKE:.0f} %. †: more than "
        f"{100 * LOST:.1f} % of the marker images are lost.\n\n{_sentences(cube)}"
    )


def claim_table(cube: xr.Dataset) -> Markdown:
    """The same, to show."""
    return Markdown(results(cube))


def recordings_table(cube: xr.Dataset) -> Markdown:
    """Every rig: markers, centres, errors and what they are made of."""
    rows = []
    for i in range(cube.sizes["setting"]):
        one = cube.isel(setting=i, mode=0)
        low, high = one["rms_band"].values
        rows.append(
            _told(one)
            | {
                "marker, px high": _fixed(one["image_height"], 1),
                "centres, px": _fixed(one["centre_scatter"], 4),
                "by edges, px": _fixed(one["edge_scatter"], 4),
                "lost, %": _fixed(100 * one["lost"], 1),
                "error, %": f"{_percent(one['rms_error'])} ({_text(low)}–{_text(high)})",
                "by edges, %": _percent(one["predicted_error"]),
                "scatter, %": _percent(one["noise_error"]),
                "poses, %": _percent(one["pose_error"]),
                "common, %": _percent(one["common_error"]),
            }
        )
    note = (
        "Errors are rms over markers and recordings, in % of the largest deflection. *Scatter*: "
        "what the scatter of the centres about their harmonics predicts. *Poses*: what changes if "
        "the true cameras are put in place of the calibrated ones. *Common*: what recordings have "
        "in common, less what their scatter leaves of it."
    )
    return Markdown(f"{columns(rows)}\n{note}")


def _told(one: xr.Dataset) -> dict[str, str]:
    """What tells a rig in a row."""
    return {"case": str(one["case"].item()), "cameras": str(one["label"].item())}


def calibration_table(cube: xr.Dataset) -> Markdown:
    """How well the cameras were calibrated, and what that does."""
    rows = []
    for i in range(cube.sizes["setting"]):
        one = cube.isel(setting=i, mode=0)
        rows.append(
            _told(one)
            | {
                "boards found, %": _fixed(100 * one["board_views"], 0),
                "places, mm": _fixed(1000 * one["place_error"], 2),
                "directions, mrad": _fixed(1000 * one["turn_error"], 2),
                "error by poses, %": _percent(one["pose_error"]),
                "of the error's variance, %": _fixed(100 * _pose_share(one), 1),
            }
        )
    note = "Errors of the calibrated cameras, aligned with the true ones as a body, rms."
    return Markdown(f"{columns(rows)}\n{note}")


def pixels_table(cube: xr.Dataset) -> Markdown:
    """The same rigs with whole pixels, by least squares and by the interval estimator."""
    rows = []
    for part in _cases(cube).values():
        for i in range(part.sizes["setting"]):
            one = part.isel(setting=i)
            rows.append(
                _told(one)
                | {
                    "fitted centres, %": _percent(one["rms_error"]),
                    "whole pixels: least squares, %": _percent(one["rounded_error"]),
                    "interval, %": _percent(one["interval_error"]),
                    "centres equally exact, %": _percent(one["equal_noise_error"]),
                }
            )
    note = (
        "Films of the same rigs whose images are rounded, after noise as large as the law of edges "
        "has it, drawn; and errors if all centres were as exact in pixels as the sharp pair's."
    )
    return Markdown(f"{columns(rows)}\n{note}")


def _sentences(cube: xr.Dataset) -> str:
    """The verdict in numbers, a bullet each."""
    cases, said = _cases(cube), []
    for case in [case for case in cases if case not in ("light", "frames")]:
        last = _most(cases[case])
        text = f"Markers of {case} are {float(last['image_height']):.1f} px high to {_rig(last)}"
        if float(last["lost"]) > LOST:
            text += f", which lose {100 * float(last['lost']):.0f} % of their images"
        text += f"; the error is ×{_band(last)}, by the law of edges"
        said.append(f"{text} ×{float(last['predicted_ratio']):.2f}.")
    if "light" in cases:
        last = _most(cases["light"])
        said.append(
            f"If coarse pixels share a sensor of one size and get the more light, {_rig(last)} err "
            f"×{_band(last)}."
        )
    if "frames" in cases:
        few, many = _fewest(cases["frames"]), _most(cases["frames"])
        said.append(
            f"Among coarse cameras {_rig(few)} err ×{_band(few)}, {_rig(many)} ×{_band(many)}; "
            f"calibrated poses make {100 * _pose_share(few):.0f} % of the variance of the first, "
            f"{100 * _pose_share(many):.0f} % of the second."
        )
    first = next(iter(cases.values()))
    few, many = _fewest(first), _most(first)
    squares, by_interval = (
        float(many[name]) / float(few[name]) for name in ("rounded_error", "interval_error")
    )
    times = float(many["interval_error"]) / float(many["rms_error"])
    said.append(
        f"With whole pixels {_rig(many)} would err ×{squares:.2f} of what {_rig(few)} do by least "
        f"squares and ×{by_interval:.2f} by *interval*: {_percent(many['interval_error'])} %, "
        f"{times:.0f} times what fitted centres leave."
    )
    shares = [
        _pose_share(part.isel(setting=i))
        for case, part in cases.items()
        for i in range(part.sizes["setting"])
        if case != "frames"
    ]
    if shares:
        said.append(
            "Where cameras share the pixels of a frame, calibrated poses make at most "
            f"{100 * max(shares):.0f} % of the variance of an error."
        )
    return "".join(f"* {one}\n" for one in said)


def _cases(cube: xr.Dataset) -> dict[str, xr.Dataset]:
    mode = int(cube["mode"].values[0])
    return {case: select(cube, case, mode) for case in dict.fromkeys(cube["case"].values.tolist())}


def _fewest(part: xr.Dataset) -> xr.Dataset:
    return part.isel(setting=int(np.argmin(part["n_cameras"].values)))


def _most(part: xr.Dataset) -> xr.Dataset:
    return part.isel(setting=int(np.argmax(part["n_cameras"].values)))


def _rig(one: xr.Dataset) -> str:
    """A rig in words."""
    count, each = str(one["label"].item()).split(" with ")
    size = f"{int(one['width_px'])}×{int(one['height_px'])}"
    return f"{count} cameras with {size}" + ("" if each == size else f" at {each}")


def _named(case: str) -> str:
    names = {"light": "larger pixels, more light", "frames": "coarse cameras, more frames"}
    return names.get(case, f"markers of {case}")


def _pose_share(one: xr.Dataset) -> float:
    """Share of the variance of a rig's error that the calibration makes."""
    return float((one["pose_error"] / one["rms_error"]) ** 2)


def _band(one: xr.Dataset) -> str:
    """Error over that of the sharp pair, with its band if it has one."""
    low, high = one["ratio_band"].values
    return f"{float(one['ratio']):.2f}" + (f" ({low:.2f}–{high:.2f})" if low < high else "")


def _ratio(one: xr.Dataset) -> str:
    lost = " †" if float(one["lost"]) > LOST else ""
    return f"{_band(one)} · {float(one['predicted_ratio']):.2f}{lost}"


def _verdict(part: xr.Dataset) -> str:
    """What the most cameras are, against the sharp pair, if its bands tell."""
    low, high = _most(part)["ratio_band"].values
    if low > 1 + ALIKE:
        return "worse"
    if high < 1 / (1 + ALIKE):
        return "better"
    return "as good" if low >= 1 / (1 + ALIKE) and high <= 1 + ALIKE else "not told apart"


def _percent(value: xr.DataArray) -> str:
    return _text(float(value))


def _fixed(value: xr.DataArray | float, digits: int) -> str:
    return f"{float(value):.{digits}f}".replace("nan", "—")


def _text(value: float | Array) -> str:
    return percent_text(float(value)) if np.isfinite(value) else "—"
