"""A tapped structure against its equation of motion, rolling shutters, and modes found in it."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scenes.modes import BEAM, DIRECTIONS
from scenes.rendered import beam_rig, force_heard, written
from scipy.integrate import quad, solve_ivp

from thesis_lib.laboratory.render import Sensor
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.laboratory.tracking import tap_structure
from thesis_lib.measure.modes.identify import modal_assurance
from thesis_lib.measure.pipeline import measure_recordings
from thesis_lib.measure.recordings.board import rows_on

POINT = (0.3 * BEAM.length, BEAM.width / 2)
MARKERS = rows_on(replace(BEAM, n_markers=12, marker_spacing=0.05), diameter=0.008, hole=None)
DAMPING = (0.012, 0.006, 0.002)


def small(**given):
    sensor = Sensor(exposure=1 / 1000, samples=3, shot=0.02, read=0.7)
    own = default_rig(BEAM, DIRECTIONS[:3], size=(1280, 720), sensor=sensor, markers=MARKERS)
    return tap_structure(own, DAMPING, POINT, **given)


def test_a_tap_against_its_equation_of_motion():
    motion = small(impulse=0.02, pulse=0.004).motion
    shapes = BEAM.mode_shapes([1, 2, 3], np.array(POINT)[:, None])[:, 0]
    omega = BEAM.angular_frequencies(3)
    times = motion.start + np.linspace(0, 0.2, 50)

    def moves(t, y):
        force = float(motion.force(np.array(t)))
        pull = shapes * force / BEAM.mass - 2 * np.array(DAMPING) * omega * y[3:]
        return np.concatenate([y[3:], pull - omega**2 * y[:3]])

    found = solve_ivp(moves, (times[0], times[-1]), np.zeros(6), t_eval=times, max_step=5e-4,
                      rtol=1e-9, atol=1e-14)  # fmt: skip
    points = np.array([[0.2, BEAM.length], [0.01, 0.02]])
    expected = found.y[:3].T @ BEAM.mode_shapes([1, 2, 3], points)
    most = 1e-6 * np.abs(expected).max()
    np.testing.assert_allclose(motion.deflection(points, times), expected, atol=most)
    force, _ = quad(lambda t: float(motion.force(np.array(t))), motion.start, motion.steady)
    assert force == pytest.approx(0.02, rel=1e-6)
    assert np.all(motion.coordinates(motion.start - np.array([1.0, 0.01])) == 0)


@pytest.mark.nightly
def test_three_modes_of_a_rendered_beam_from_video_files(tmp_path):
    """By the whole chain: the thesis's markers, whose rows lie 5 px apart, move 2 px a frame."""
    rates, readout = (60.0, 50.0, 29.97), 0.008
    given = {"rates": rates, "impulse": 0.02, "seconds": 2.6, "rest": 0.6}
    own = tap_structure(beam_rig(), DAMPING, POINT, **given)
    sought = {"from_hz": 4.0, "to_hz": 130.0, "count": 3}
    excitation = {"kind": "free_decay", "sound": "room", "rest_duration_s": 0.55, "modes": sought}
    force = force_heard(own, tmp_path, POINT)
    manifest = written(own, tmp_path, readout, excitation=excitation, force=force)
    measure_recordings(manifest, tmp_path / "out", str)
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h2>Mode 3: 110.76 Hz</h2>" in text
    assert "<h2>Motion over force</h2>" in text
    assert "still-ringing" in text  # two seconds are no answer to the tap as a whole
    found = xr.load_dataset(tmp_path / "out" / "modes.nc")
    motion = own.motion
    hertz = [part.frequency for part in motion.components]
    np.testing.assert_allclose(found["frequency"], hertz, rtol=1e-4)
    np.testing.assert_allclose(found["damping"], DAMPING, rtol=0.01)
    shapes = found["amplitude_real"].values + 1j * found["amplitude_imag"].values
    true = motion.amplitudes(own.markers.centres, float(found["zero"]) + own.stations[0].start)
    for measured, expected in zip(shapes, true, strict=True):
        assert modal_assurance([measured, expected])[0, 1] > 0.9995
        assert np.nanmax(np.abs(measured - expected)) < 0.02 * np.abs(expected).max()
    assert found["missing"].max() < 0.05
