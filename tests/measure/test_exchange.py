"""Files that other programs open, each read back by its own reader; and the motion in them."""

from dataclasses import replace
from itertools import pairwise

import av
import meshio
import numpy as np
import pytest
import pyuff
import scipy.io
import xarray as xr
from PIL import Image
from sdypy_sep005 import Sep005Data

from thesis_lib.facts import setups
from thesis_lib.laboratory.recording_files import manifest_of
from thesis_lib.laboratory.rig import default_rig
from thesis_lib.measure.exchange import files
from thesis_lib.measure.exchange.cameras import describe_reused, read_cameras
from thesis_lib.measure.exchange.history import time_histories
from thesis_lib.measure.fitting.result import shape_result
from thesis_lib.measure.pipeline import Inputs, measure_shape
from thesis_lib.measure.recordings import media
from thesis_lib.measure.recordings.board import on_surface
from thesis_lib.measure.report import animation, figures
from thesis_lib.measure.tracking.tracks import Recording
from thesis_lib.vibration.motion import Component
from thesis_lib.vision.pinhole import project_points

BEAM, FREQUENCY = setups.thesis_beam(), 4.25
RIG = default_rig(BEAM, [(15, 30), (-10, 30), (170, 25)], components=(Component(),))
POINTS = RIG.markers.centres
SHAPE = 0.003 * (POINTS[0] / BEAM.length) ** 2
RATES, DELAYS, EXPOSURE, READOUT = (60.0, 50.0, 59.94), (0.0, 0.0131, -0.0712), 0.008, 0.01
REST, BEGIN, END = 0.8, 1.6, 3.6


def height(times, frequency=FREQUENCY):
    """Still, then growing, then steady."""
    growth = np.clip((times - 1.0) / (BEGIN - 1.1), 0, 1)
    growth = growth**3 * (10 - 15 * growth + 6 * growth**2)
    return growth * np.cos(2 * np.pi * frequency * times + 0.4)


def seen(camera, times, frequency):
    """Images (frames, 2, markers) of an exposure about times (frames, markers)."""
    loss = np.sinc(frequency * EXPOSURE)
    world = on_surface(BEAM.extent, POINTS[:, None], loss * SHAPE * height(times, frequency))
    return project_points(camera, world).swapaxes(0, 1)


def recordings(folder, frequency=FREQUENCY, noise=0.0):
    """Cameras of unlike rates and starts that roll; a marker is lost in two of them for a while."""
    rng, made = np.random.default_rng(3), []
    for k, (station, rate, delay) in enumerate(zip(RIG.stations, RATES, DELAYS, strict=True)):
        camera = station.camera
        times = delay + np.arange(int((END + 0.2) * rate)) / rate
        uv = seen(camera, times[:, None], frequency)
        for _ in range(3):
            rows = uv[:, 1] / camera.size[1] - 0.5
            uv = seen(camera, times[:, None] + READOUT * rows, frequency)
        uv += noise * rng.standard_normal(uv.shape)
        if k:
            uv[(times > 2.5) & (times < 2.7), :, 7] = np.nan
        np.save(folder / f"{k}.npy", uv)
        made.append(Recording(camera, rate, delay, EXPOSURE, READOUT, folder / f"{k}.npy"))
    return made


def asked(frequency=FREQUENCY):
    """A manifest that gives the frequency, and what the sound tells."""
    given = manifest_of(RIG)
    changed = {"frequency_hz": frequency, "undersampled": frequency > 20, "rest_duration_s": REST}
    driven = given.excitation.model_copy(update=changed)
    unheard = {"of_sound": np.nan, "of_sound_deviation": np.nan, "force": ("part", [0.0, 0.0])}
    sound = xr.Dataset({"frequency": frequency, "steady": ("end", [BEGIN, END]), **unheard})
    return given.model_copy(update={"excitation": driven}), sound


def fitted(tracks, frequency=FREQUENCY):
    manifest, sound = asked(frequency)
    data = shape_result(manifest, sound, tracks)
    return data.assign(steady=sound["steady"]).assign_attrs(title="a beam", source="a test")


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What exact tracks give, and all files of it."""
    folder = tmp_path_factory.mktemp("exchange")
    tracks = recordings(folder)
    data = fitted(tracks)
    moved = time_histories(data, tracks, REST)
    files.write_formats(folder, data, moved, tracks)
    return folder, data, moved


def test_the_motion_is_the_true_one_on_the_first_cameras_clock(conforms, measured):
    moved = measured[2]
    times = moved["time"].values
    conforms.closed_form(np.diff(times), 1 / RATES[0], rtol=1e-9)
    z = moved["displacement"].sel(axis="z").values
    known = np.isfinite(z)
    true = 1e3 * SHAPE * height(times)[:, None]
    steady = (times >= BEGIN) & (times <= END)
    # The row that a marker is in moves with it by a hundredth of the image: 3 mm · ωT / 200.
    conforms.closed_form(np.abs(z - true)[steady & (times < 2.4)].max(), below=4e-3)
    # Before the steady part the exposure's blur is left in, too: 1 − sinc, of 3 mm.
    blur = 3 * (1 - np.sinc(FREQUENCY * EXPOSURE))
    conforms.closed_form(np.nanmax(np.abs(z - true)), below=blur + 4e-3)
    aside = moved["displacement"].sel(axis=["x", "y"])
    conforms.closed_form(float(np.abs(aside).max()), below=2e-3)
    flag = moved["flag"].values
    assert set(np.unique(flag[steady])) == {0, 2}
    assert set(np.unique(flag[~steady])) == {1}
    gone = flag[:, 7] == 2
    assert [*times[gone][[0, -1]]] == pytest.approx([2.5, 2.7], abs=0.1)
    np.testing.assert_array_equal(known, flag != 2)
    assert np.isnan(moved["standard_error"].values[:, gone, 7]).all()


def test_standard_errors_of_the_motion_are_its_scatter(conforms, tmp_path):
    tracks = recordings(tmp_path, noise=0.1)
    data = fitted(tracks)
    moved = time_histories(data, tracks, REST)
    steady = moved.sel(time=slice(BEGIN, 2.4))
    true = 1e3 * SHAPE * height(steady["time"].values)[:, None]
    off = steady["displacement"].sel(axis="z").values - true
    # Between frames interpolation averages: the second and third camera's noise shrinks a little.
    ratio = np.sqrt(np.mean(off**2)) / float(steady["standard_error"].sel(axis="z").mean())
    conforms.sampled(ratio, 0.95, atol=0.1)
    conforms.sampled(float(moved["residual"].mean()), 0.07, atol=0.03)


def test_no_motion_is_interpolated_across_frames_that_a_camera_dropped(conforms, tmp_path):
    """More than half a second of it, in which the structure swings up."""
    tracks = recordings(tmp_path)
    stamps = np.arange(len(tracks[1].centres)) / tracks[1].rate
    there = (stamps < 0.9) | (stamps > 1.5)
    np.save(tmp_path / "1.npy", tracks[1].centres[there])
    tracks[1] = replace(tracks[1], stamps=stamps[there])
    moved = time_histories(fitted(tracks), tracks, REST).sel(time=slice(0.95, 1.45))
    assert (moved["cameras_seen"] == 2).all()
    true = 1e3 * SHAPE * height(moved["time"].values)[:, None]
    off = np.abs(moved["displacement"].sel(axis="z").values - true)
    conforms.closed_form(off.max(), below=3 * (1 - np.sinc(FREQUENCY * EXPOSURE)) + 4e-3)


def test_a_marker_that_is_hidden_at_rest_moves_by_all_cameras(conforms, tmp_path):
    tracks = recordings(tmp_path)
    for own in tracks[1:]:
        uv = np.load(own.path)
        uv[own.times < REST + 0.1, :, -1] = np.nan
        np.save(own.path, uv)
    moved = time_histories(fitted(tracks), tracks, REST).sel(time=slice(BEGIN, 2.4), marker=75)
    assert (moved["cameras_seen"] == 3).all()
    off = moved["displacement"].sel(axis="z") - 1e3 * SHAPE[-1] * height(moved["time"].values)
    conforms.closed_form(np.abs(off).max(), below=4e-3)


def test_motion_faster_than_the_frames_is_told_where_it_is_fitted_only(conforms, tmp_path):
    tracks = recordings(tmp_path, frequency=26.3)
    moved = time_histories(fitted(tracks, 26.3), tracks, REST)
    times, z = moved["time"].values, moved["displacement"].sel(axis="z").values
    steady = (times >= BEGIN) & (times < 2.4)
    true = 1e3 * SHAPE * height(times, 26.3)[:, None]
    conforms.closed_form(np.abs(z - true)[steady].max(), below=0.02)
    outside = (times < BEGIN) | (times > END)
    assert (moved["flag"].values[outside] == 3).all()
    assert np.isnan(z[outside]).all()


# Each file by its own reader.


def test_netcdf_csv_and_sep_5(conforms, measured):
    folder, _, moved = measured
    written = xr.load_dataset(folder / "motion.nc")
    xr.testing.assert_equal(written, moved)
    assert written["flag"].attrs["flag_meanings"].split()[2] == "fewer_than_two_cameras"
    header, *rows = (folder / "motion.csv").read_text(encoding="utf-8").splitlines()
    assert header.split(",")[:2] == ["time_s", "marker_1_mm"]
    values = np.array([[float(text) for text in row.split(",")] for row in rows])
    conforms.closed_form(values[:, 0], moved["time"], atol=1e-6)
    z = moved["displacement"].sel(axis="z").values
    np.testing.assert_array_equal(np.isnan(values[:, 1:]), np.isnan(z))
    conforms.closed_form(np.nan_to_num(values[:, 1:]), np.nan_to_num(z), rtol=1e-5, atol=1e-9)
    channel, *others = files.sep005_channels(folder / "motion.nc")
    assert len(others) == moved.sizes["marker"] - 1
    checked = Sep005Data.model_validate(channel)
    assert (checked.unit_str, checked.quantity) == ("m", "d")
    conforms.closed_form(checked.fs, RATES[0], rtol=1e-6)
    conforms.closed_form(1e3 * channel["data"], z[:, 0], rtol=1e-12)


def test_universal_files(conforms, measured):
    folder, data, moved = measured
    head, units, nodes, *sets = pyuff.UFF(str(folder / "motion.uff")).read_sets()
    assert [one["type"] for one in (head, units, nodes)] == [151, 164, 15]
    assert {one["type"] for one in sets} == {82, 58}
    assert head["model_name"].strip() == "a beam: motion of every marker"
    conforms.closed_form(nodes["x"], data["rest_position"].sel(axis="x"), atol=1e-5)
    lines = [one for one in sets if one["type"] == 82]
    assert all(one["n_nodes"] <= 125 for one in lines)
    drawn = [(int(a), int(b)) for one in lines for a, b in pairwise([*one["nodes"]]) if a and b]
    assert sorted(drawn) == sorted(map(tuple, files.marker_edges(data["x"], data["y"]) + 1))
    z = moved["displacement"].sel(axis="z").values
    for one in (one for one in sets if one["type"] == 58):
        conforms.closed_form(one["x"], moved["time"], atol=1e-5)
        whole = np.nan_to_num(z[:, int(one["rsp_node"]) - 1])
        conforms.closed_form(1e3 * one["data"], whole, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("unseen", [[], [4, 9]])
def test_nodes_that_were_not_seen_and_the_forces_are_at_their_places(conforms, tmp_path, unseen):
    x, y = (part.ravel() for part in np.meshgrid(0.05 + 0.1 * np.arange(5), [0.01, 0.02]))
    true, place = np.stack([x - 0.25, y - 0.015, 0 * x]), np.array([0.06, 0.015])
    rest, curve = true.copy(), np.ones((1, 10, 8))
    rest[:, unseen] = curve[:, unseen] = np.nan
    along = "estimator", "marker", "frequency"
    data = xr.Dataset({
        "frequency": ("frequency", 1.0 + np.arange(8)), "coherence": (along[1:], curve[0]),
        "receptance_real": (along, curve), "receptance_imag": (along, curve),
        "force_place": ("side", place), "x": ("marker", x), "y": ("marker", y),
        "rest_position": (("axis", "marker"), rest),
    })  # fmt: skip
    files.write_response(tmp_path / "response.uff", data)
    sets = pyuff.UFF(str(tmp_path / "response.uff")).read_sets()
    (nodes,) = (one for one in sets if one["type"] == 15)
    found = [nodes[side] for side in "xyz"]
    conforms.closed_form(found, np.c_[true, [-0.19, 0.0, 0.0]], atol=1e-6)


def test_paraview(conforms, measured):
    folder, data, _ = measured
    amplitude = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    listed = (folder / "vtk" / "period.pvd").read_text(encoding="utf-8")
    assert listed.count("<DataSet ") == 32
    assert 'file="period-05.vtu"' in listed
    grid = meshio.read(folder / "vtk" / "period-05.vtu")
    conforms.closed_form(grid.points, data["rest_position"].values.T, atol=1e-9)
    turned = np.real(amplitude * np.exp(2j * np.pi * 5 / 32))
    conforms.closed_form(grid.point_data["displacement"][:, 2], turned, atol=1e-9)
    conforms.closed_form(grid.point_data["deflection"], turned, atol=1e-9)
    (cells,) = grid.cells
    assert cells.type == "quad"
    np.testing.assert_array_equal(cells.data, files.marker_faces(data["x"], data["y"]))


def test_matlab(conforms, measured):
    folder, data, moved = measured
    read = scipy.io.loadmat(folder / "measured.mat", simplify_cells=True)
    amplitude = data["amplitude_real"].values + 1j * data["amplitude_imag"].values
    conforms.closed_form(read["shape"]["amplitude"], amplitude, rtol=1e-12)
    np.testing.assert_array_equal(read["motion"]["displacement"], moved["displacement"])
    assert read["motion"]["units"]["displacement"] == "mm"
    assert read["shape"]["camera"].tolist() == data["camera"].values.tolist()


@pytest.mark.parametrize("name", ["cameras.yaml", "cameras.toml"])
def test_written_cameras_see_the_markers_where_ours_do(conforms, measured, name):
    folder, data, _ = measured
    points = data["rest_position"].values
    calibrated = data["frame_rotation"].values.T @ points + data["frame_origin"].values[:, None]
    for one, station in zip(read_cameras(folder / name).cameras, RIG.stations, strict=True):
        assert (one.name, one.size) == (station.camera.name, station.camera.size)
        true = project_points(station.camera, calibrated)
        conforms.closed_form(project_points(one, points), true, atol=1e-6)


# The report on a shape.


@pytest.fixture
def reported(tmp_path, monkeypatch):
    """Its page, and what its figures draw, where the sound puts a camera's start 8 ms too late."""
    shown, tracks = [], recordings(tmp_path)
    tracks[1] = replace(tracks[1], delay=tracks[1].delay + 0.008)
    manifest, sound = asked()
    first, *others = manifest.cameras
    rolling = [one.model_copy(update={"readout_s": READOUT}) for one in others]
    manifest = manifest.model_copy(update={"cameras": (first, *rolling)})
    sound = sound.assign(delay=("camera", [own.delay for own in tracks]), ambiguous=0)
    sound.attrs["synchronisation"] = "by a test"
    reused = describe_reused([own.camera for own in tracks], None)
    monkeypatch.setattr(media, "read_frames", lambda *_: iter([np.zeros((720, 1280), np.uint8)]))
    for name in ("draw_tracks", "write_mp4", "write_shape"):
        monkeypatch.setattr(animation, name, lambda *_: None)
    collect = figures.collect_diagnostics
    monkeypatch.setattr(
        figures, "collect_diagnostics", lambda *of: shown.append(collect(*of)) or shown[0]
    )
    inputs = Inputs(sound, reused, tracks)
    page = measure_shape(manifest, tmp_path, inputs, tmp_path / "out", lambda line: None).page
    return page, shown[0]


def test_figures_of_a_report_are_on_the_first_cameras_clock(conforms, reported):
    """Each frame of the second camera is a whole number of its periods after its true start."""
    page, seen = reported
    count = (seen["track_time"][1].dropna("frame") - DELAYS[1]) * RATES[1]
    conforms.closed_form(count, np.round(count), atol=0.01)
    assert "leaving one out" not in page  # the calibration is of unknown errors
    assert "all rows at once in A, for which it is not given" in page


# Neighbours.


def test_a_grid_has_rectangles_whatever_its_order():
    x, y = (part.ravel() for part in np.meshgrid([0.0, 0.1, 0.3], [0.0, 0.2]))
    order = np.random.default_rng(0).permutation(6)
    faces = files.marker_faces(x[order], y[order])
    assert faces.shape == (2, 4)
    for face in faces:
        u, v = x[order][face], y[order][face]
        area = 0.5 * np.sum(u * np.roll(v, -1) - np.roll(u, -1) * v)
        assert area == pytest.approx(np.ptp(u) * np.ptp(v))  # one sense of rotation
    assert len(files.marker_edges(x[order], y[order])) == 7


def test_scattered_markers_have_triangles_but_none_across_a_gap():
    rng = np.random.default_rng(1)
    left, right = rng.uniform(0, 1, (2, 40)), rng.uniform(0, 1, (2, 40)) + [[4.0], [0.0]]
    faces = files.marker_faces(*np.column_stack([left, right]))
    assert faces.shape[1] == 3
    assert set((faces < 40).sum(axis=1)) == {0, 3}
    assert files.marker_faces([0.0, 0.2, 0.1], [0.0, 0.0, 0.0]).shape == (0, 3)
    assert files.marker_edges([0.0, 0.2, 0.1], [0.0, 0.0, 0.0]).tolist() == [[0, 2], [2, 1]]


# Moving images.


@pytest.mark.slow
def test_the_shape_is_a_film_of_one_period(measured, tmp_path):
    _, data, _ = measured
    frames = animation.draw_period(data)
    assert len(frames) == animation.FRAMES_A_PERIOD
    assert not np.array_equal(frames[0], frames[len(frames) // 2])
    animation.write_gif(tmp_path / "shape.gif", frames, 12)
    with Image.open(tmp_path / "shape.gif") as picture:
        assert (picture.n_frames, picture.info["loop"]) == (animation.FRAMES_A_PERIOD, 0)
        assert picture.size == animation.SHAPE_SIZE_PX
    animation.write_mp4(tmp_path / "shape.mp4", frames, 12)
    with av.open(str(tmp_path / "shape.mp4")) as file:
        (stream,) = file.streams.video
        assert stream.codec_context.name == "h264"
        found = [frame.to_ndarray(format="rgb24") for frame in file.decode(stream)]
    assert len(found) == animation.FRAMES_A_PERIOD
    assert np.abs(found[3].astype(int) - frames[3]).mean() < 3


def test_rings_are_drawn_where_the_markers_are_and_crosses_where_they_were(tmp_path):
    count = 30
    places = np.array([[100.0, 300.0], [60.0, 200.0]])  # u, v of two markers
    tracks = np.repeat(places[None], count, axis=0)
    tracks[10:, :, 1] = np.nan
    np.save(tmp_path / "0.npy", tracks)
    frames = np.full((count, 240, 400), 90, np.uint8)
    media.write_video(tmp_path / "a.mkv", frames, 30.0, np.zeros(48000))
    camera = replace(RIG.stations[0].camera, size=(400, 240))
    own = Recording(camera, 30.0, 0.0, 1e-6, 0.0, tmp_path / "0.npy")
    shown = list(animation.draw_tracks(own, tmp_path / "a.mkv", 0.2))
    assert len(shown) == count - 6
    coloured = [np.argwhere(np.ptp(frame.astype(int), axis=2) > 60) for frame in shown]
    for k, found in enumerate(coloured):
        near = np.linalg.norm(found[:, None] - places[::-1].T, axis=2)
        assert near.min(axis=1).max() < 9
        ring = found[near[:, 0] < 20]
        np.testing.assert_allclose(ring.mean(axis=0), [59.5, 99.5], atol=0.6)
        assert (near[:, 1] < 20).any()
        lost = shown[k][tuple(found[near[:, 1] < 20].T)].mean(axis=0)
        assert (lost[2] > 120) == (k + 6 >= 10)  # the colour of what was lost has much blue
