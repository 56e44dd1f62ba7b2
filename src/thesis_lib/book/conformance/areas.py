"""The areas of the checks, and their kinds."""

from __future__ import annotations

from pathlib import Path

AREAS = {
    "Beam and plate": "structures plate",
    "Vision": "cameras triangulation optics compiled explorer recompute",
    "Acoustics": "radiation planes quadrature radiating estimates sound sound_sum sound_turn "
    "lab_radiation surfaces unbaffled",
    "The studies": "studies readings stated_numbers conclusions ledger ledger_power trends",
    "The experiment": "scene lens render media pack corners calibration adjustment jackknife "
    "synchronisation listening tracking reconstruction laboratory tapped experiment_study "
    "lab_layouts lab_motions",
    "Own recordings": "feasibility modes measuring measure result calibration_error "
    "own_recordings foreign exchange reuse paper povray sync own_sound response force_table "
    "audio_tracks",
    "Beyond the thesis": "rounding design_law dither polytope interval "
    "pixel_noise estimators planner planner_machines planner_sound finite_elements shapes",
}
KINDS = {
    "closed form": "closed forms",
    "order": "orders",
    "invariance": "invariances",
    "independent": "independent evaluations",
    "sampled": "predictions against samples",
}


def module(test: str) -> str:
    """The name of a test's module: ``plate`` of tests/vibration/test_plate.py."""
    return Path(test.partition("::")[0]).stem.removeprefix("test_")


def area(test: str) -> str:
    """The area that a test is about."""
    return next((name for name, of in AREAS.items() if module(test) in of.split()), "Other")
