"""The whole book: run what is stale, compute the numbers of its prose, render, publish."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib import book, claims, cubes, figures, runs, setups
from thesis_lib.cubes import project_root
from thesis_lib.parameters import CHAPTERS, STUDIES, describe
from thesis_lib.structures import modal_overlap, peak_deflection, resonance, single_mode_distance


def build(publish: bool = False) -> Path:
    """Bring the book up to date.

    Parameters
    ----------
    publish : bool
        Also make these results the published ones: ``data/published`` and the outputs that the
        notebooks carry.

    Returns
    -------
    Path
        The page to open.
    """
    root = project_root()
    executed, results = root / "book" / "executed", root / "data" / "results"
    jobs = [
        runs.Job(study(), executed / f"{name}.ipynb", results / f"{name}.nc")
        for name, study in STUDIES.items()
    ]
    made = [job.cube for job in jobs]
    numbers = [executed / name for name in ("beam-model.md", "beam-results.md", "parameters.md")]
    pages = [p for p in (root / "book").rglob("*") if p.is_file() and p.parent != executed]
    pages = list({*pages, root / "book" / "assets" / "overview.svg"})
    pages += [root / "_config.yml", root / "package-lock.json"]
    sources = [*pages, *(job.notebook for job in jobs), *numbers, *runs.inputs()]
    index = root / "build" / "html" / "index.html"
    tasks = [
        *(runs.job_task(job) for job in jobs),
        runs.task(
            "numbers", lambda: _write_numbers(made, numbers), [*made, *runs.inputs()], numbers
        ),
        runs.task("pages", lambda: book.render(root, index.parent), sources, [index]),
    ]
    if publish:
        picture = root / "book" / "assets" / "overview.svg"
        tasks.insert(
            -1, runs.task("published run", lambda: _publish(jobs, picture), made, [picture])
        )
        tasks[-2]["uptodate"] = [False]  # asked for, so done
    runs.run(tasks, root / "build" / "state.sqlite")
    return index


def _publish(jobs: Sequence[runs.Job], picture: Path) -> None:
    for job in jobs:
        cubes.publish(cubes.read(job.cube))
        keep_outputs(runs.source(job.study.name), job.notebook)
    arrays = next(job for job in jobs if job.study.name == "beam-arrays")
    text = figures.as_svg(cubes.read(arrays.cube), "4a", 3)
    cubes.whole_file(picture, partial(Path.write_text, data=text, encoding="utf-8"))


def keep_outputs(notebook: Path, executed: Path) -> None:
    """Give a notebook the text outputs of its executed copy; pictures and widgets stay out."""
    import nbformat

    document = nbformat.read(notebook, as_version=4)
    ran = {cell["id"]: cell for cell in nbformat.read(executed, as_version=4).cells}
    for cell in document.cells:
        if cell.cell_type != "code":
            continue
        ignored = "nbval-ignore-output" in cell.metadata.get("tags", [])
        cell.execution_count = None
        cell.outputs = [] if ignored else [_text_only(out) for out in ran[cell["id"]].outputs]
    cubes.whole_file(notebook, lambda part: nbformat.write(document, part))


def _text_only(output: dict[str, object]) -> dict[str, object]:
    if "execution_count" in output:
        output["execution_count"] = None
    data = output.get("data")
    if isinstance(data, dict):
        output["data"] = {kind: text for kind, text in data.items() if kind.startswith("text/")}
    return output


def _write_numbers(made: Sequence[Path], places: Sequence[Path]) -> None:
    opened = [cubes.read(path) for path in made]
    texts = [_model_table(), _results(opened), _parameter_tables()]
    for path, text in zip(places, texts, strict=True):
        cubes.whole_file(path, partial(Path.write_text, data=text, encoding="utf-8"))


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def _model_table() -> str:
    """What section 3.1 assumes of the beam, mode by mode."""
    beam = setups.beam()
    rows = []
    for mode in (1, 2, 3):
        omega = resonance(beam, mode)
        rows.append(
            [
                str(mode),
                f"{beam.angular_frequencies(mode)[-1] / (2 * np.pi):.4g}",
                f"{1000 * peak_deflection(beam, mode):.3g}",
                f"{float(modal_overlap(beam, omega)):.3f}",
                f"{100 * single_mode_distance(beam, mode):.2g}",
            ]
        )
    return _table(
        ["mode", "natural frequency, Hz", "tip for 1 N, mm", "modal overlap",
         "one mode against all, %"], rows,
    )  # fmt: skip


def _results(opened: Sequence[xr.Dataset]) -> str:
    """What comes out of chapter 3, and whether it agrees with the thesis."""
    return "\n".join([_change_table(opened), _agreement(opened), _law(opened)])


def _change_table(opened: Sequence[xr.Dataset]) -> str:
    rows = []
    for cube in opened:
        for case in dict.fromkeys(cube["case"].values.tolist()):
            modes = cube["mode"].values.tolist()
            parts = [figures.select(cube, case, mode) for mode in modes]
            labels = parts[0]["label"].values
            medians = [figures.band(part)[1] for part in parts]
            varied = STUDIES[cube.attrs["figure_set"]].varied_label
            changes = [f"{m[0]:.1f} → {m[-1]:.1f} (×{m[-1] / m[0]:.2f})" for m in medians]
            rows.append([case, varied, f"{labels[0]} → {labels[-1]}", *changes])
    header = ["case", "varied", "from → to", "mode 1", "mode 2", "mode 3"]
    return _table(header, rows) + (
        "\nMedian over the trials of the mean error, in % of the largest reference deflection.\n"
    )


def _agreement(opened: Sequence[xr.Dataset]) -> str:
    names = {"mean_error": "mean errors", "max_point_error": "peak errors"}
    rows, total = [], dict.fromkeys(names, (0, 0))
    for cube in opened:
        name = cube.attrs["figure_set"]
        checks = claims.check(cube, claims.claims_of(name))
        row = [f"[{STUDIES[name].title}](executed/{name}.ipynb)"]
        for quantity in names:
            of_kind = [check.inside for check in checks if check.claim.quantity == quantity]
            total[quantity] = (total[quantity][0] + sum(of_kind), total[quantity][1] + len(of_kind))
            row.append(f"{sum(of_kind)} of {len(of_kind)}")
        rows.append(row)
    rows.append(["**chapter 3**", *(f"**{a} of {b}** ({a / b:.0%})" for a, b in total.values())])
    return _table(["figure set", *names.values()], rows)


def _law(opened: Sequence[xr.Dataset]) -> str:
    ratios = []
    for cube in opened:
        drawn = cube["mean_error"].isel(trial=slice(1, None))
        ratios.append((cube["predicted_error"] / np.sqrt((drawn**2).mean("trial"))).values)
    flat = np.concatenate([ratio.ravel() for ratio in ratios])
    trials = opened[0].sizes["trial"] - 1
    return (
        f"\nOver the {flat.size} settings and modes the law's prediction divided by the rms over "
        f"{trials} trials lies between {flat.min():.3f} and {flat.max():.3f}.\n"
    )


def _parameter_tables() -> str:
    parts = []
    for name in CHAPTERS["ch3"]:
        rows = [
            [f"`{row['name']}`", f"`{row['default']}`", row["unit"], row["meaning"], row["allowed"]]
            for row in describe(STUDIES[name])
        ]
        header = ["parameter", "default", "unit", "meaning", "allowed"]
        parts.append(f":::{{dropdown}} `{name}`\n{_table(header, rows)}:::\n")
    return "\n".join(parts)
