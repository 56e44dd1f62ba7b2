"""Flexural vibration measured by several cameras: the library of an executable thesis companion.

Start with the names that :mod:`~thesis_lib.vibration`, :mod:`~thesis_lib.vision`,
:mod:`~thesis_lib.acoustics` and :mod:`~thesis_lib.measure` export, as in
``from thesis_lib import Beam, hemisphere_cameras, triangulate``. Each name is loaded at its first
use, so commands start quickly and the physics needs NumPy alone.
:mod:`~thesis_lib.facts.setups` holds the thesis's camera setups,
:mod:`~thesis_lib.figure_sets.parametric.compute` turns them into labelled cubes, and
:mod:`~thesis_lib.ledger.verdicts` compares those with the thesis.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

__version__ = "1.0.0"

PUBLIC_NAMES = {
    "vibration": "Beam Component Motion Panel Plate Structure deflection_shape full_response "
    "peak_deflection resonance_frequency single_mode_response world_points",
    "vision": "Camera CameraArray deflection_covariance deflection_variance estimate_noise "
    "grid_shifts ground_sample_distance hemisphere_cameras interval_estimate intrinsics "
    "measure_deflections on_sensor percent_errors pixelate point_covariance project project_points "
    "triangulate triangulation_gain undistort_pixels",
    "acoustics": "AIR Medium Pistons Plane PlateSound Screen Surface plane_operator plate_pistons "
    "power_level pressure_level radiation_modes rayleigh_pressure sound_power",
    "measure": "Board Harmonics Manifest Markers Tracker View adjust_bundle align_cameras "
    "assess_manifest calibrate_camera find_corners find_view fit_harmonics measure_recordings "
    "modal_assurance read_cameras read_frames read_manifest synchronise_videos triangulate_seen "
    "write_cameras write_manifest write_video",
}  #: By package


def load_name(package: str, modules: Mapping[str, str], name: str) -> Any:
    """Load a name from the module of a package that defines it (PEP 562).

    `modules` maps each module, relative to the package, to its names, separated by spaces.
    """
    for module, names in modules.items():
        if name in names.split():
            return getattr(import_module(f"{package}.{module}"), name)
    raise AttributeError(f"module {package!r} has no attribute {name!r}")


def __getattr__(name: str) -> Any:
    return load_name(__name__, PUBLIC_NAMES, name)


__all__ = sorted(" ".join(PUBLIC_NAMES.values()).split())
