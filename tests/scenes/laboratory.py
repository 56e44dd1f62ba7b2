"""A laboratory without rendering: the dataset that measuring without any error would give."""

import numpy as np
import xarray as xr

from thesis_lib.figure_sets.experiment.compute import estimate_deflections, rig_of, true_tracks
from thesis_lib.laboratory.experiment import join_replicates
from thesis_lib.laboratory.parameters import CAMERA_NAMES
from thesis_lib.laboratory.rig import REST_S

MATCH = 0.5  # px to which matched centres are rounded


def recordings(request, sigma=0.0, seed=0, starts=None):
    """The dataset that measuring without any error would give, with noise of the centres."""
    rig = rig_of(request)
    if starts is not None:
        for station, start in zip(rig.stations, starts, strict=True):
            object.__setattr__(station, "start", start)
    first = rig.stations[0].start
    rng = np.random.default_rng(seed)
    frames = int(rig.duration * request.frame_rate_hz)
    tracks = np.stack([true_tracks(rig, frames, width) for width in request.widths_px], axis=1)
    tracks += sigma * rng.standard_normal(tracks.shape)
    delays = np.array([station.start - first for station in rig.stations])
    begin, end = rig.motion.steady - first, rig.duration + delays.min()
    period = first + begin + np.arange(4096) / 4096 / request.frequency_hz
    angle = 2 * np.pi * request.frequency_hz * (period - first)
    force = 2 * np.mean(rig.motion.force(period) * np.exp(-1j * angle)) / rig.full_scale
    both, each = ("calibration", "camera"), ("camera", "width", "frame", "axis", "marker")
    text = {"units": "1", "long_name": "for the cube"}
    return xr.Dataset(
        {
            "tracks": (each, tracks),
            "matches": (each, np.rint(tracks / MATCH) * MATCH),
            "rest": ((), REST_S),
            "frame_rate": ("camera", [request.frame_rate_hz] * 4),
            "delay": ("camera", delays),
            "delay_frames": ("camera", np.rint(delays * request.frame_rate_hz).astype(int)),
            "frequency": ((), request.frequency_hz),
            "force": ("part", [force.real, force.imag]),
            "steady": ("end", [begin, end]),
            "K": ((*both, "i", "j"), [[c.K for c in rig.cameras]] * 2),
            "distortion": ((*both, "k"), [[c.distortion for c in rig.cameras]] * 2),
            "R_camera_world": ((*both, "i", "j"), [[c.R_camera_world for c in rig.cameras]] * 2),
            "centre": ((*both, "i"), [[c.centre for c in rig.cameras]] * 2),
            "size": (("camera", "axis"), [c.size for c in rig.cameras]),
            "full_scale": ((), rig.full_scale),
            "exposure": ("camera", np.zeros(4)),
            "missing_share": ("width", np.zeros(len(request.widths_px)), text),
            "wrong_share": ("width", np.zeros(len(request.widths_px)), text),
            "centre_error": ("width", np.full(len(request.widths_px), sigma), text),
        },
        coords={"camera": list(CAMERA_NAMES), "width": request.widths_px,
                "calibration": ["literal", "full"]},
    )  # fmt: skip


def replicates(request, count, sigma=0.0):
    """Return recordings that differ by starts and noise alone, with their estimates."""
    starts = [np.random.default_rng(n).uniform(0, 0.25, len(CAMERA_NAMES)) for n in range(count)]
    return estimated(request, [recordings(request, sigma, n, own) for n, own in enumerate(starts)])


def estimated(request, every):
    """Return recordings as replicates, with their estimates."""
    whole = [data.merge(estimate_deflections(request, data)) for data in every]
    return join_replicates(whole, [str(name) for name in every[0].data_vars])
