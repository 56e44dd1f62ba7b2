"""Tables of ``lab-radiation``, from its cube, and its sentences of result."""

from __future__ import annotations

import numpy as np
import xarray as xr
from IPython.display import Markdown
from scipy.stats import binom

from thesis_lib.studies.cubes import percent_text
from thesis_lib.web.markdown import columns

CHANCE = 0.95449973610364  # of two standard errors
RARE = 0.01  # chance of as few recordings within, below which stated errors are called too small
SEEN = 3.0  # standard errors of a mean, from which on it is an error of all recordings


def results(cube: xr.Dataset) -> str:
    """Power, efficiency and field of every structure, held against their stated errors."""
    rows = []
    for case in cube["structure"].values.tolist():
        own, power = cube.sel(structure=case), cube.sel(group=case, quantity_of="power")
        level = 10 * np.log10(float(own["true_power"]) / 1e-12)
        rows.append(
            {
                "structure": str(own["name"].item()),
                "tone, Hz": f"{float(own['tone']):.1f}",
                "power in a wall, dB": f"{level:.1f}",
                "stated error, %": percent_text(stated(own)),
                "within two": f"{int(power['within'])} of {int(power['count'])}",
                "error over stated": _ratio(power),
                "field, %": f"{percent_text(_rms(own['field_error']))} · "
                f"{percent_text(_rms(own['field_stated']))}",
            }
        )
    power = cube.sel(group="all", quantity_of="power")
    last = dict.fromkeys(rows[0], "")
    last |= {
        "structure": "all",
        "within two": f"{int(power['within'])} of {int(power['count'])}",
        "error over stated": _ratio(power),
    }
    note = (
        "Level of the true power of one side in a rigid wall re 1 pW, the standard error that a "
        "recording states of it in the mean, recordings within two of these, and rms error over "
        "the stated one (5–95 %). "
        "*Field*: rms error of the pressure over the plane, in % of its largest, · as stated."
    )
    return f"{columns([*rows, last])}\n{note}{_off_in_the_mean(cube)}\n"


def _off_in_the_mean(cube: xr.Dataset) -> str:
    """Structures whose power errs in the mean by more than scatter explains."""
    found = []
    for case in cube["structure"].values.tolist():
        of, own = cube.sel(group=case, quantity_of="power"), cube.sel(structure=case)
        if abs(float(of["bias"])) > SEEN * float(of["bias_error"]):
            mean, error = float(of["bias"]), float(of["bias_error"])
            found.append(
                f"{own['name'].item()}, {mean:+.2f} % ± {error:.2f}, of which "
                f"{float(own['interpolation']):+.2f} without noise"
            )
    said = "by more than their scatter explains the power errs in the mean of"
    return f" Recordings share an error, too: {said} the {'; '.join(found)}." if found else ""


def stated(own: xr.Dataset, name: str = "power") -> float:
    """Mean stated standard error of one structure in %."""
    return 100 * float((own[f"{name}_error"] / own[f"true_{name}"]).mean())


def results_table(cube: xr.Dataset) -> Markdown:
    """The same, to show."""
    return Markdown(results(cube))


def efficiency_table(cube: xr.Dataset) -> Markdown:
    """Radiation efficiency, held against its stated errors."""
    rows = []
    for case in cube["structure"].values.tolist():
        own, of = cube.sel(structure=case), cube.sel(group=case, quantity_of="efficiency")
        rows.append(
            {
                "structure": str(own["name"].item()),
                "efficiency": f"{float(own['true_efficiency']):.3g}",
                "stated error, %": percent_text(stated(own, "efficiency")),
                "within two": f"{int(of['within'])} of {int(of['count'])}",
                "error over stated": _ratio(of),
                "mean error, %": _mean(of),
            }
        )
    return Markdown(columns(rows))


def parts_table(cube: xr.Dataset) -> Markdown:
    """What is behind the errors: markers, modes, the calibration, what markers do not tell."""
    rows = []
    for case in cube["structure"].values.tolist():
        own, of = cube.sel(structure=case), cube.sel(group=case, quantity_of="power")
        rows.append(
            {
                "structure": str(own["name"].item()),
                "markers": f"{int(own['markers'])}",
                "spacing, mm": f"{1000 * float(own['spacing']):.0f}",
                "modes fitted": f"{int(own['modes'])}",
                "lost, %": f"{100 * float(own['missing'].mean()):.1f}",
                "centres, px": f"{float(own['centre_scatter'].mean()):.4f}",
                "shape, %": percent_text(_rms(own["shape_error"])),
                "mean error of the power, %": _mean(of),
                "without noise, %": f"{float(own['interpolation']):+.3f}",
                "calibration, % of the variance": f"{float(own['by_calibration']):.1f}",
            }
        )
    note = (
        "*Shape*: rms error of what markers show, in % of the largest deflection. *Without noise*: "
        "what markers and modes alone put into the power."
    )
    return Markdown(f"{columns(rows)}\n{note}")


def tap(cube: xr.Dataset) -> str:
    """What the modes of a tap radiate, held against their stated errors."""
    if not np.isfinite(cube["tap_all"]):
        return "The modes of the tap do not stand out of what these cameras' centres scatter by.\n"
    rows = []
    for k in range(cube.sizes["ringing"]):
        own = cube.isel(ringing=k)
        power, energy = (
            float(own[f"tap_{of}"]) / float(own[f"tap_true_{of}"]) for of in ("power", "energy")
        )
        rows.append(
            {
                "mode, Hz": f"{float(own['tap_frequency']):.4g}",
                "power in a wall, dB": f"{_level(own['tap_true_power']):.1f}",
                "power is off, %": f"{100 * (power - 1):+.2f} ± {_share(own, 'power'):.2f}",
                "energy, J": f"{float(own['tap_true_energy']):.3g}",
                "energy is off, %": f"{100 * (energy - 1):+.2f} ± {_share(own, 'energy'):.2f}",
            }
        )
    whole, error = (float(cube[name]) for name in ("tap_all", "tap_all_error"))
    level = f"{_level(cube['tap_all']):.1f} ± {10 / np.log(10) * error / whole:.2f} dB"
    note = (
        "Level of the true power of one side in a rigid wall re 1 pW as the decay begins, the true "
        "energy from then on, and what is measured of both. All modes together are measured as "
        f"{level}."
    )
    return f"{columns(rows)}\n{note}\n"


def tap_table(cube: xr.Dataset) -> Markdown:
    """The same, to show."""
    return Markdown(tap(cube))


def _level(power: xr.DataArray) -> float:
    return float(10 * np.log10(float(power) / 1e-12))


def _share(own: xr.Dataset, of: str) -> float:
    """Stated standard error of a power or an energy in %."""
    return 100 * float(own[f"tap_{of}_error"] / own[f"tap_true_{of}"])


def sentences(cube: xr.Dataset) -> str:
    """What comes out, in a few sentences."""
    of = cube.sel(group="all", quantity_of="power")
    within, count = int(of["within"]), int(of["count"])
    rare = binom.cdf(within, count, CHANCE) < RARE
    verdict = (
        "which is fewer than chance explains"
        if rare
        else f"where right standard errors hold {CHANCE * count:.0f} in the mean"
    )
    each = [
        f"{cube['name'].sel(structure=case).item()} {_ratio(one)}{_verdict(one)}"
        for case in cube["structure"].values.tolist()
        for one in [cube.sel(group=case, quantity_of="power")]
    ]
    fields = [
        (_rms(one["field_error"]), _rms(one["field_stated"]))
        for one in (cube.sel(structure=case) for case in cube["structure"].values)
    ]
    least, most = min(e for e, _ in fields), max(e for e, _ in fields)
    coarse = int(np.argmax(np.abs(cube["grid_interpolation"].values)))
    wrong = float(cube["grid_interpolation"].values[coarse])
    return (
        f"From rendered video to sound, {within} of {count} recordings have the power of the true "
        f"motion in a rigid wall within two of the standard errors that they state, {verdict}; "
        f"over the stated ones their errors are (rms, 5–95 %): {'; '.join(each)}.\n\n"
        f"The pressure on the plane above is right to {percent_text(least)} to "
        f"{percent_text(most)} % of its largest.\n\n"
        "What stated errors do not hold is what markers do not tell: between two modes "
        f"{int(cube['grid_markers'].values[coarse])} markers put {abs(wrong):.1f} % into the power "
        "without any noise.\n"
    )


def _verdict(of: xr.Dataset) -> str:
    """Return what a structure's stated errors are, if chance does not explain the difference."""
    low, high = of["ratio_band"].values
    return ", stated too small" if low > 1 else ", stated too large" if high < 1 else ""


def _mean(of: xr.Dataset) -> str:
    return f"{float(of['bias']):+.3f} ± {float(of['bias_error']):.3f}"


def _ratio(of: xr.Dataset) -> str:
    low, high = of["ratio_band"].values
    return f"{float(of['ratio']):.2f} ({low:.2f}–{high:.2f})"


def _rms(values: xr.DataArray) -> float:
    return float(np.sqrt((values**2).mean()))
