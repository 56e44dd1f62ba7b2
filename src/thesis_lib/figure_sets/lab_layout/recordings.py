"""Recordings from any place: rendered, tracked at once, and measured again without noise.

Every frame is rendered twice, with the sensor's noise and without. The tracker follows the noisy
ones; each centre that it finds is then fitted once more in the quiet frame. The difference of the
two is the noise of the centre, and what the quiet one is off the truth is its bias.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray as xr

from thesis_lib.arrays import Array
from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.figure_sets.lab_layout.parameters import Layouts
from thesis_lib.laboratory.another import window_of
from thesis_lib.laboratory.direct import brief, times_of, true_view
from thesis_lib.laboratory.recordings import TRACKS
from thesis_lib.laboratory.render import BeamView, Sensor
from thesis_lib.laboratory.rig import Rig, default_rig
from thesis_lib.measure.recordings.markers import Markers, rows_on
from thesis_lib.measure.tracking.centres import refine
from thesis_lib.measure.tracking.homography import TrackingError
from thesis_lib.measure.tracking.tracker import Tracker, sharpen
from thesis_lib.studies.parallel import abreast
from thesis_lib.studies.variables import labelled
from thesis_lib.vibration.beam import Beam
from thesis_lib.vibration.motion import Component

REST, RAMP = 2, 1.0  # frames at rest, periods in which the motion grows
UNEVEN = 1e-5  # of the amplitude, by which few positions may miss the mean over an exposure


def markers_of(beam: Beam, case: str) -> Markers:
    """The markers of a case: three rows, or the middle one and four at the beam's corners.

    Markers on one line do not tell how their plane is tilted; the four do.
    """
    rows = rows_on(beam)
    if case != "middle-row":
        return rows
    low, middle, high = (rows.centres[:, row] for row in rows.rows)
    ends = [0, -1]
    centres = np.concatenate([low[:, ends], middle, high[:, ends]], axis=1)
    return replace(rows, centres=centres, hole=None)


def rig_of(study: Layouts, recording: Setting) -> Rig:
    """What films one recording: cameras like those of chapter 5, for a few periods."""
    omega, exposure = 2 * np.pi * study.frequency_hz, study.exposure_ms / 1000
    # The mean over n positions in an exposure T misses (ωT)² / 24n² of an amplitude.
    samples = int(np.ceil(omega * exposure / np.sqrt(24 * UNEVEN)))
    beam = setups.beam()
    rig = default_rig(
        beam,
        list(recording.directions_deg),
        focal_length=study.focal_length_mm / 1000,
        sensor_width=study.sensor_width_mm / 1000,
        distance=recording.distance_mm / 1000,
        size=recording.resolution_px,
        sensor=Sensor(exposure, samples, shot=study.shot_noise, read=study.read_noise),
        frame_rate=study.frame_rate_hz,
        components=(Component("bending", 1, study.frequency_hz, study.amplitude_mm / 1000),),
        lens_k1=study.lens_k1,
        seed=study.seed,
        markers=markers_of(beam, recording.case),
    )
    return brief(rig, REST, RAMP, study.periods)


def tracks(rig: Rig, index: int, both: bool = True) -> tuple[Array, Array]:
    """Centres that one camera's frames give, with noise and, if `both` are wanted, without.

    The beam's corners and the camera are known, as in :func:`~thesis_lib.laboratory.direct.seen`.

    Returns
    -------
    noisy, quiet : ndarray, shape (frames, 2, markers)
        In px of the whole sensor, lens distortion included; NaN where missing, and throughout if
        the markers are not found in the first frame. While the motion grows, quiet ones are NaN.
    """
    own, corner = window_of(rig, rig.stations[index])
    markers, sensor, motion = rig.markers, own.sensor, rig.motion
    view = true_view(own.camera, markers)
    pictures = BeamView(own.camera, markers, motion, sensor)
    times = times_of(rig, own)
    noisy, quiet = np.full((2, len(times), 2, markers.count), np.nan)
    turn = 2 * np.pi * motion.components[0].frequency / own.frame_rate
    at_rest = pictures.light(0.0)
    for k, time in enumerate(times):
        light = at_rest if time < motion.start else pictures.light(time)
        image = light.recorded(sensor, rig.generator(1, index, k))
        if k == 0:
            try:
                tracker = Tracker(sharpen(image, view), turn)
            except TrackingError:
                break
        noisy[k] = tracker.centres(image)
        if both and (time < motion.start or time >= motion.steady):
            where = tracker.view.to_plane(noisy[k])
            quiet[k], _ = refine(light.recorded(sensor), tracker.view, where)
    return noisy + corner[:, None], quiet + corner[:, None]


def run(study: Layouts) -> xr.Dataset:
    """All recordings of a study, tracked; two cameras at a time.

    Returns
    -------
    xarray.Dataset
        ``tracks`` and ``quiet`` of :data:`.TRACKS`, along ``recording``, too; NaN where there is no
        such camera or marker, or where it was not found.
    """
    rigs = [rig_of(study, recording) for recording in study.filmed_settings()]
    jobs = [(r, c) for r, rig in enumerate(rigs) for c in range(len(rig.stations))]
    done = abreast(lambda job: tracks(rigs[job[0]], job[1]), jobs)
    return dataset(rigs, dict(zip(jobs, done, strict=True)).__getitem__)


def dataset(rigs: list[Rig], of: Callable[[tuple[int, int]], tuple[Array, Array]]) -> xr.Dataset:
    """Tracks of every recording and camera in one dataset, padded with NaN.

    `of` gives those of a pair (recording, camera), noisy and quiet, as :func:`tracks` does.
    """
    frames = {len(times_of(rig, rig.stations[0])) for rig in rigs}
    shape = (
        len(rigs),
        max(len(rig.stations) for rig in rigs),
        max(frames),
        2,
        max(rig.markers.count for rig in rigs),
    )
    both = np.full((2, *shape), np.nan)
    for r, rig in enumerate(rigs):
        for c in range(len(rig.stations)):
            for kind, values in zip(both, of((r, c)), strict=True):
                kind[r, c, : len(values), :, : rig.markers.count] = values
    named = dict(zip(("tracks", "quiet"), both, strict=True))
    return xr.Dataset(labelled(named, TRACKS, ["recording"]))
