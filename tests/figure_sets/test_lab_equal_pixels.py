"""Equal pixels per second: the rigs, the laws by brute force, and recordings rendered again."""

import numpy as np
import pytest
import xarray as xr

from thesis_lib.figure_sets import display
from thesis_lib.figure_sets.lab_equal_pixels import compute
from thesis_lib.figure_sets.registry import validate_request
from thesis_lib.laboratory import tracking
from thesis_lib.measure.calibration.bundle_adjustment import CalibrationError
from thesis_lib.studies.schema import label_values, with_provenance
from thesis_lib.vibration.structure import deflection_shape
from thesis_lib.vision.pinhole import project


def study(**values):
    return validate_request("lab-equal-pixels", values)


def _shape(request):
    return deflection_shape(
        request.structure, 1, request.structure.markers, request.amplitude_mm / 1000
    )


def equal_pixels(request, common=0.0, seed=0):
    """What filming would give: white noise of 1 µm times the cameras, and a common error in m."""
    kinds, trials, shape = request.rendered_kinds, request.trials + 1, _shape(request)
    sizes = {"part": 2, "point": len(shape)}
    values = {
        name: np.full((len(kinds), trials, *(sizes[dim] for dim in one.dims)), 0.01)
        for name, one in compute.RECORDING_VARIABLES.items()
    }
    for i, kind in enumerate(kinds):
        sigma = 1e-6 * kind.count
        noise = np.random.default_rng([seed, i]).standard_normal((trials, 2, len(shape)))
        truth = np.stack([shape * (1 - compute.marker_loss(request, kind)) + common, 0 * shape])
        values["deflection"][i] = truth + sigma * noise
        values["known_deflection"][i] = values["deflection"][i] + sigma / 10
        values["deviation"][i] = sigma
    values["missing"][:] = 0
    return xr.Dataset(label_values(values, compute.RECORDING_VARIABLES, over=("rig", "replicate")))


def made(request, **scene):
    cube = compute.run(request, equal_pixels(request, **scene))
    return with_provenance(cube, request, 0.0)


def of(cube, case):
    return cube.isel(setting=np.flatnonzero(cube["case"].values == case), mode=0)


def test_all_rigs_have_as_many_pixels_per_second():
    kinds = study().kinds
    rates = [kind.count * np.prod(kind.size) * kind.frame_rate for kind in kinds.values()]
    np.testing.assert_allclose(rates, study().kinds["30 mm", 16].frame_rate * 16 * 320 * 180)
    assert len(study().rendered_kinds) == len(kinds) - 2  # shared by light and frames
    light = [kinds["light", n] for n in (2, 4, 8, 16)]
    gathered = [kind.shot_noise / kind.size[0] ** 2 for kind in light]
    np.testing.assert_allclose(gathered, gathered[0])


# The laws.


def test_by_the_law_of_edges_equal_pixels_cost_the_fourth_root_of_their_number():
    cube = made(study(trials=2, diameters_mm=[30.0], counts=[2, 4, 8, 16], cases=["pixels"]))
    part = of(cube, "30 mm")
    n = part["n_cameras"].values
    np.testing.assert_allclose(part["predicted_ratio"], (n / 2) ** 0.25, rtol=0.03)
    np.testing.assert_allclose(part["equal_noise_error"], part["equal_noise_error"][0], rtol=0.03)
    values = {"read_noise": 0, "shot_noise": 40, "cases": ["light"]}  # which turns it round
    part = of(made(study(trials=2, **values)), "light")
    n = part["n_cameras"].values
    np.testing.assert_allclose(part["predicted_ratio"], (n / 2) ** -0.25, rtol=0.03)


def test_a_marker_that_bends_shows_less_by_what_its_edge_shows():
    """Edges projected at rest and deflected, and the shift that fits them by least squares."""
    request = study(grid=[7, 5], diameters_mm=[40.0], cases=["pixels"])
    plate, turn = request.structure, np.linspace(0, 2 * np.pi, 400, endpoint=False)
    edge = 0.02 * np.stack([np.cos(turn), np.sin(turn)])
    beside = np.concatenate([np.zeros((2, 1)), edge], axis=1)  # the centre first
    shape = deflection_shape(plate, 1, beside + np.array(plate.extent)[:, None] / 2, 1e-4)
    rest, lift = np.stack([*beside, 0 * shape]), np.stack([0 * shape, 0 * shape, shape])
    for setting, kind in zip(request.settings(), request.kinds.values(), strict=True):
        P = setting.cameras(request.focal_length_mm, request.sensor_width_mm).P
        still = project(P, rest)
        shown = []
        for at, move in zip(still, project(P, rest + lift) - still, strict=True):
            du, dv = np.roll(at[:, 1:], -1, axis=1) - np.roll(at[:, 1:], 1, axis=1)
            normal = np.stack([-dv, du]) / np.sqrt(np.hypot(du, dv))  # times the root of dl
            seen = np.sum(normal * move[:, 1:], axis=0)
            shown.append(np.linalg.lstsq(normal.T, seen, rcond=None)[0][1] / move[1, 0])
        assert 1 - np.mean(shown) == pytest.approx(compute.marker_loss(request, kind), rel=0.02)


def test_errors_of_known_size_come_out():
    request = study(trials=400, cases=["pixels"], diameters_mm=[12.0])
    part = of(made(request, common=3e-6), "12 mm")
    n, percent = part["n_cameras"].values, 100 / part["reference_deflection"].values.max()
    np.testing.assert_allclose(part["noise_error"], percent * 1e-6 * n, rtol=1e-4)
    np.testing.assert_allclose(part["common_error"], percent * 3e-6, rtol=0.1)
    truth = percent * 1e-6 * np.sqrt(n**2 + 9.0)
    np.testing.assert_allclose(part["rms_error"], truth, rtol=0.03)
    np.testing.assert_allclose(part["pose_error"], part["noise_error"] / 10, rtol=1e-3)
    low, high = part["rms_band"].values.T
    assert (low < part["rms_error"]).all()
    assert (high > part["rms_error"]).all()


def test_bands_of_ratios_hold_the_truth_as_often_as_they_say():
    inside = []
    for seed in range(40):
        request = study(trials=20, cases=["pixels"], diameters_mm=[12.0], counts=[2, 16])
        data = equal_pixels(request, seed=seed)
        errors = {
            kind: compute._deflection_errors(request, kind, data.isel(rig=i), _shape(request))
            for i, kind in enumerate(request.rendered_kinds)
        }
        few, many = (compute._resample_errors(each, k) for k, each in enumerate(errors.values()))
        low, high = np.quantile(many / few, compute.BAND_QUANTILES)
        inside.append(low < 8 < high)
    assert 0.72 < np.mean(inside) <= 1


# Recordings.


@pytest.mark.slow
def test_a_recording_is_measured_as_well_as_its_scatter_says():
    request = study(trials=0, counts=[2], width_px=480, cases=["pixels"], diameters_mm=[30.0])
    data = compute.measure_replicate(request, 0).isel(rig=0)
    kind, one = request.rendered_kinds[0], data.expand_dims("replicate")
    error = compute._deflection_errors(request, kind, one, _shape(request))[0]
    scatter = 100 * data["deviation"].values / _shape(request).max()
    assert 0.5 < np.sqrt(np.mean(error**2) / np.mean(scatter**2)) < 2
    assert data["missing"] == 0
    assert data["place_error"] < 1e-3
    assert data["board_views"] > 0.8


def test_cameras_that_find_no_board_have_no_result(monkeypatch):
    def none(_):
        raise CalibrationError("no board")

    monkeypatch.setattr(tracking, "calibrate_rig", none)
    request = study(trials=0, counts=[2], cases=["pixels"], diameters_mm=[30.0])
    assert compute.measure_kind(request, request.rendered_kinds[0], 0) == {}
    data = equal_pixels(request)
    data = data.map(lambda values: np.nan * values)
    cube = compute.run(request, data)
    assert cube["failed"] == 1
    assert "nan" not in display.fill_text(with_provenance(cube, request, 0.0), "recordings")
