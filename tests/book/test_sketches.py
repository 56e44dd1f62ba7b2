"""The drawings of the setups: every case, the same bytes each time, nothing cut off."""

from __future__ import annotations

from pathlib import Path

from thesis_lib.book.pieces import sketches
from thesis_lib.figure_sets.parametric.parameters import CAMERA_STUDIES
from thesis_lib.plotting.style import in_style


def test_every_case_of_the_beam_is_drawn_with_all_its_cameras() -> None:
    studies = [one() for one in CAMERA_STUDIES.values() if one.subject == "beam"]
    places: dict[str, set[tuple[float, ...]]] = {}
    for study in studies:
        for setting in study.settings():
            at = {(*direction, setting.distance_mm) for direction in setting.directions_deg}
            places.setdefault(setting.case, set()).update(at)
    with in_style():
        figure = sketches.cases()
    drawn = {axes.get_title("left").partition(":")[0]: axes for axes in figure.axes}
    assert set(drawn) == set(places)
    for case, axes in drawn.items():
        dots = [line for line in axes.lines if line.get_marker() == "o"]
        assert len(dots) == len(places[case]), case
        for dot in dots:
            assert float(dot.get_xdata()[0]) ** 2 + float(dot.get_ydata()[0]) ** 2 <= 1 + 1e-9


def test_words_of_one_drawing_do_not_meet_those_of_another() -> None:
    with in_style():
        figure = sketches.cases()
        figure.draw_without_rendering()
        boxes = [axes._left_title.get_window_extent() for axes in figure.axes]
    assert all(not a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    assert all(box.x0 >= 0 and box.x1 <= figure.bbox.width for box in boxes)


def test_written_twice_they_are_the_same(tmp_path: Path) -> None:
    made = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        sketches.write(folder)
        made.append([(folder / name).read_bytes() for name in sketches.NAMES])
    assert made[0] == made[1]
