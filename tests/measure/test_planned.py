"""``thesis measure --new FOLDER -p cameras=4``: a manifest to ask by, before anything is filmed."""

import numpy as np
import pytest
from command import refusal, thesis

from thesis_lib.measure.feasibility import prediction
from thesis_lib.measure.feasibility.assess import assess_manifest
from thesis_lib.measure.recordings.manifest import read_manifest

PLATE = {
    "cameras": 4, "structure.kind": "plate", "structure.length_mm": 600, "structure.width_mm": 400,
    "structure.thickness_mm": 3, "excitation.frequency_hz": 50, "excitation.amplitude_mm": 0.2,
}  # fmt: skip


def options(given):
    return [part for name, one in given.items() for part in ("-p", f"{name}={one}")]


def test_one_command_in_an_empty_place_makes_what_the_check_reads(tmp_path):
    done = thesis("measure", "--new", "plate", *options(PLATE), cwd=tmp_path)
    assert (done.status, done.err) == (0, "")
    first, *assumed, last = done.out.splitlines()
    assert first.startswith("4 cameras, ")
    assert "not given, so assumed: -p cameras.focal_length_mm=26.0" in assumed
    assert not any("length_mm=600" in line or "amplitude_mm" in line for line in assumed)
    assert last.endswith("thesis measure --check plate/planned.yaml")
    made = read_manifest(tmp_path / "plate" / "planned.yaml", check_files=False)
    assert made == prediction.draft_manifest(PLATE)
    checked = thesis("measure", "--check", "plate/planned.yaml", cwd=tmp_path)
    assert (checked.status, checked.err) == (0, "")
    for code in ("undersampled", "small-motion"):
        assert f"[{code}]" in checked.out.replace("\n  ", " ")
    again = thesis("measure", "--new", "plate", *options(PLATE), cwd=tmp_path)
    assert "planned.yaml: is there already" in refusal(again)
    drawn = thesis("measure", "--check", "plate/planned.yaml", "--out", "drawn", cwd=tmp_path)
    assert (drawn.status, drawn.err) == (0, "")


def test_phones_stand_around_and_as_near_as_the_structure_fits_into_their_pictures():
    manifest = prediction.draft_manifest(PLATE)
    azimuths = np.array([c.azimuth_deg for c in manifest.cameras])
    around = prediction.FIRST_AZIMUTH_DEG + 90 * np.arange(4)
    np.testing.assert_allclose(azimuths % 360, around, atol=0.1)
    (distance,) = {c.distance_mm for c in manifest.cameras}

    for of, lost in ((distance, False), (0.92 * distance, True)):
        assessment = assess_manifest(prediction.draft_manifest(PLATE | {"cameras.distance_mm": of}))
        assert ("out-of-view" in {one.code for one in assessment.warnings}) == lost


def test_a_slender_structure_is_seen_from_its_two_sides():
    for camera in prediction.draft_manifest({"cameras": 4}).cameras:  # the thesis's beam, along x
        assert abs(np.cos(np.radians(camera.azimuth_deg))) > 0.9


def test_what_is_given_stands_and_the_rest_is_a_phones():
    given = PLATE | {"cameras.width_px": 3840, "cameras.height_px": 2160, "cameras": 2,
                     "structure.markers.rows": 3, "structure.markers.columns": 5,
                     "excitation.steady_interval_s": [1, 3]}  # fmt: skip
    manifest = prediction.draft_manifest(given)
    assert [c.size for c in manifest.cameras] == [(3840, 2160)] * 2
    assert {c.frame_rate_hz for c in manifest.cameras} == {prediction.PHONE_CAMERA["frame_rate_hz"]}
    assert (manifest.structure.markers.rows, manifest.structure.markers.columns) == (3, 5)
    assert manifest.excitation.steady_interval_s == (1, 3)
    assert abs(manifest.cameras[0].azimuth_deg - manifest.cameras[1].azimuth_deg) == 180


@pytest.mark.parametrize("cameras", ["17", "true", "2.5"])
def test_a_number_of_cameras_that_is_not_allowed_is_refused(tmp_path, cameras):
    said = refusal(thesis("measure", "--new", tmp_path / "new", "-p", f"cameras={cameras}"))
    assert "cameras: given" in said
    assert "allowed: a whole number from 2 to 16" in said
    assert not (tmp_path / "new").exists()
