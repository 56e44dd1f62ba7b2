"""Tables of errors and of stated values beside the results."""

from __future__ import annotations

import numpy as np
import xarray as xr
from IPython.display import Markdown

from thesis_lib.facts import claims
from thesis_lib.ledger import verdicts
from thesis_lib.studies import cubes
from thesis_lib.web.markdown import escape, markdown_table


def error_table(cube: xr.Dataset) -> Markdown:
    """Errors by setting and mode: trial 0, median, 5–95 % band, law of rounding."""
    table = cubes.summary(cube).set_index(["error", "mode"])
    columns = {}
    for mode in cube["mode"].values.tolist():
        for error, (_, plane) in cubes.ERRORS.items():
            if (error, mode) not in table.index or error == "max_point_error":
                continue
            law = cubes.predicted(cube, error).sel(mode=mode)
            rows = table.loc[[(error, mode)]].to_dict("records")
            columns[f"mode {mode}" + (f", {plane}" if plane else "")] = [
                _of_larger(cube, number, mode, plane)
                if np.isnan(row["trial_0"])
                else f"{cubes.percent_text(row['trial_0'])} · "
                f"{cubes.band_text(row['median'], row['low'], row['high'])}"
                f" · {cubes.percent_text(value)}"
                for number, (row, value) in enumerate(zip(rows, law.values, strict=True))
            ]
    cases, labels = cube["case"].values.tolist(), cube["label"].values.tolist()
    shares = [f"{share:.0%}" for share in cube["in_view"].values]
    rows_ = [list(row) for row in zip(cases, labels, *columns.values(), shares, strict=True)]
    said = cube.attrs
    reference = "pressure of the plane" if "plane_error" in cube else "deflection"
    notes = [
        f"Each cell: {said['trial_0']} · median (5–95 %) of the {cubes.trials_are(cube)} · "
        f"{said['predicts']}, in % of the largest reference {reference}."
    ]
    if "plane_error" in cube:
        notes.append(
            "*Nodal*: the plane has no reference pressure; in brackets the median of its error in "
            "% of the other plane's."
        )
    cut = [
        escape(f"{row[0]}, {row[1]} ({row[-1]})")
        for row, share in zip(rows_, cube["in_view"].values, strict=True)
        if share < 1
    ]
    if cut:
        notes.append(
            "Markers leave the sensor, and are computed all the same, in: " + "; ".join(cut) + "."
        )
    if "missing" in cube and float(cube["missing"].max()) > 0:
        rare = [
            escape(f"{row[0]}, {row[1]} ({share:.0%})")
            for row, share in zip(rows_, cube["missing"].values[:, 0, 0], strict=True)
            if share > 0
        ]
        notes.append("Markers that no two cameras see are left out, in: " + "; ".join(rare) + ".")
    if "piston_size" in cube and float(cube["piston_size"].max()) > 1:
        notes.append(
            "The pistons are large against the wavelength (wavenumber times size up to "
            f"{float(cube['piston_size'].max()):.2f}): above 1 take a finer grid."
        )
    return markdown_table(["case", "setting", *columns, "in view"], rows_, "\n\n".join(notes))


def _of_larger(cube: xr.Dataset, setting: int, mode: int, plane: str | None) -> str:
    """The error on a nodal plane, of the other plane's pressure, which is not NaN as a rule."""
    values = cube["plane_error_of_larger"].isel(setting=setting).sel(mode=mode, plane=plane)
    drawn = values.values[1:] if values.size > 1 else values.values
    return "nodal" if np.isnan(drawn).any() else f"nodal [{np.median(drawn):.1f}]"


def claims_table(cube: xr.Dataset, only_misses: bool = True) -> Markdown:
    """The thesis's stated values beside the band of the trials."""
    if cube.sizes["trial"] == 1:
        return Markdown("Without trials there is no band to hold the stated values against.")
    checks = verdicts.check(cube, claims.claims_of(cube.attrs["figure_set"]))
    if not checks:
        return Markdown("The thesis states no figure for these settings.")
    counts = []
    for quantity, word in cubes.SHORT.items():
        of_kind = [check for check in checks if check.claim.quantity == quantity]
        if of_kind:
            met = sum(check.inside for check in of_kind)
            counts.append(f"{met} of {len(of_kind)} stated {word} errors")
    shown = [check for check in checks if not (only_misses and check.inside)]
    rows = [
        [
            check.claim.figure,
            check.claim.case,
            str(check.claim.mode),
            ", ".join(f"{value:g}" for value in check.claim.values) or "all",
            cubes.SHORT[check.claim.quantity] + (" but one" if check.claim.excepted else ""),
            check.claim.stated,
            cubes.percent_text(check.literal),
            f"{cubes.percent_text(check.low)}–{cubes.percent_text(check.high)}",
            "yes" if check.inside else "no",
        ]
        for check in shown
    ]
    text = " and ".join(counts) + f" meet the band of the {cubes.trials_are(cube)}."
    header = ["figure", "case", "mode", "setting", "error", "thesis", "literal", "5–95 %", "met"]
    if any(not check.claim.values for check in shown):
        text += (
            " A claim about all settings must hold for each; the row shows the one farthest off."
        )
    if only_misses and rows:
        text += " Those that do not:"
    return markdown_table(header, rows, text, above=True) if rows else Markdown(text)
