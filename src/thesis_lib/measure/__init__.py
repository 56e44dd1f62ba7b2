"""Measurement of deflection shapes: calibrate, synchronise, track, fit, report.

Start with a manifest (:func:`.read_manifest`; :func:`.assess_manifest` checks it before filming)
and run all steps (:func:`.measure_recordings`), or call single steps:
:func:`.find_corners`, :func:`.calibrate_camera` and :func:`.adjust_bundle`,
:func:`.synchronise_videos`, :func:`.find_view` and :class:`.Tracker`, :func:`.fit_harmonics`,
:func:`.triangulate_seen`. Each name is loaded when it is first used.
"""

from typing import Any

from thesis_lib import PUBLIC_NAMES, load_name

_MODULES = {
    "pipeline": "measure_recordings",
    "recordings.manifest": "Manifest read_manifest write_manifest",
    "recordings.board": "Board Markers",
    "recordings.media": "read_frames write_video",
    "feasibility.assess": "assess_manifest",
    "calibration.corners": "find_corners",
    "calibration.rig": "calibrate_camera",
    "calibration.bundle_adjustment": "adjust_bundle align_cameras",
    "exchange.cameras": "read_cameras write_cameras",
    "synchronisation.alone": "synchronise_videos",
    "tracking.homography": "View find_view",
    "tracking.tracker": "Tracker",
    "fitting.harmonics": "Harmonics fit_harmonics",
    "fitting.reconstruction": "triangulate_seen",
    "modes.identify": "modal_assurance",
}


def __getattr__(name: str) -> Any:
    return load_name(__name__, _MODULES, name)


__all__ = PUBLIC_NAMES["measure"].split()
