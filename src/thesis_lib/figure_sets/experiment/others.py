"""Other recordings of chapter 5: rendered, calibrated, heard and followed, and what comes out.

Only what the beam reaches of each sensor is rendered, and the widths at which markers are lost are
left out; all else is as in the first recording, pictures of the board and sound included.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from thesis_lib.facts import setups
from thesis_lib.figure_sets.experiment import chain
from thesis_lib.figure_sets.experiment.methods import deflection, instant_of, predicted, tracks_of
from thesis_lib.figure_sets.experiment.parameters import TRIED_PX, Laboratory, ways
from thesis_lib.figure_sets.experiment.recordings import codec_of, rig_of
from thesis_lib.files import staging, workplace
from thesis_lib.laboratory import film as filming
from thesis_lib.laboratory.another import again, of_every_setting, put_up_again, window_of
from thesis_lib.laboratory.parameters import NAMES
from thesis_lib.laboratory.rig import Rig
from thesis_lib.measure.calibration.rig import alike
from thesis_lib.measure.recordings.manifest_model import Manifest
from thesis_lib.measure.recordings.markers import rows_on
from thesis_lib.measure.steps import calibrated, heard
from thesis_lib.measure.steps import tracked as tracked_in

WHOLE = 12  # px: sides of a window at all widths that the thesis reduces frames to are whole


def film(request: Laboratory, number: int) -> xr.Dataset:
    """Recording `number`, measured in all :func:`.ways`, see :func:`.another.of_every_setting`."""
    data, beam = tracked(request, number), setups.beam()
    markers, instant = rows_on(beam), instant_of(data, beam.damping)
    results = []
    for method, names, width in ways(request):
        calibration = "full" if method == "harmonic" else "literal"
        tracks = tracks_of(
            data, markers, names, width, calibration, method == "matched", beam.damping
        )
        exposures = data["exposure"].values[[NAMES.index(name) for name in names]]
        shape = deflection(tracks, instant, method, exposures)
        noise = predicted(tracks, method, instant, exposures)
        row = markers.middle_row
        results.append((shape[None, row], noise[None, row]))
    return of_every_setting(results)


def tracked(request: Laboratory, number: int) -> xr.Dataset:
    """What :func:`.chain.measure` makes of recording `number`."""
    rig = put_up_again(rig_of(again(request, number)))
    with staging(workplace() / "build" / "cache") as folder, alike():
        return _measured(rig, request, filming.manifest_of(rig), folder)


def _measured(rig: Rig, request: Laboratory, manifest: Manifest, folder: Path) -> xr.Dataset:
    windows = [window_of(rig, station, WHOLE) for station in rig.stations]
    seen = replace(rig, stations=tuple(station for station, _ in windows))
    for index in range(len(windows)):
        filming.write_video(seen, index, folder, codec_of(request))
        filming.write_shots(rig, index, folder)
    steps = folder / "steps"
    calibration, sound = calibrated(manifest, folder, steps), heard(manifest, folder, steps)
    full = rig.cameras[0].size[0]
    widths = [width for width in request.widths_px if width != TRIED_PX]
    shares = np.array(widths) / full
    corners = np.array([corner for _, corner in windows])
    K, sizes = calibration["K"].values.copy(), [station.camera.size for station, _ in windows]
    K[:, :2, 2] -= corners
    part = calibration.assign(  # the cameras with these parts of their sensors
        K=calibration["K"].copy(data=K), size=calibration["size"].copy(data=sizes)
    )
    count = int(rig.duration * request.frame_rate_hz)
    clocks = [np.arange(count) / request.frame_rate_hz] * len(windows)
    followed = tracked_in(manifest, folder, steps, part, sound, clocks, shares.tolist())
    data = chain.dataset_of(manifest, widths, calibration, sound, followed, corners)
    chain.check_grid(data, rig.markers)
    return data
