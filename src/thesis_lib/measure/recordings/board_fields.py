"""What a manifest says of the calibration board."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from thesis_lib.measure.recordings.board import DICTIONARY, MARK, Board
from thesis_lib.studies.refusals import Refusing, permitted, refuse
from thesis_lib.studies.vocabulary import Positive, field


class BoardSpec(Refusing):
    """The calibration board."""

    kind: Literal["checkerboard", "charuco"] = field(
        "checkerboard",
        "whether its light tiles are empty, or carry ArUco marks as OpenCV's CharucoBoard has them",
    )
    columns: int = field(9, "tiles along x", ge=4, le=100)
    rows: int = field(9, "tiles along y", ge=4, le=100)
    tile_mm: Positive = field(45.0, "side of a tile")
    margin_mm: float = field(45.0, "width of the white margin", ge=0, le=1e5)
    mark_mm: Positive | None = field(
        lambda data: round(MARK * data.get("tile_mm", 0), 9) if _marked(data) else None,
        "side of a mark",
        "null of a checkerboard, or a number above 0, below tile_mm",
    )
    dictionary: str | None = field(
        lambda data: DICTIONARY if _marked(data) else None,
        "OpenCV's name of the dictionary that the marks are of",
        "null of a checkerboard, or DICT_4X4_50 to DICT_7X7_1000 with enough marks",
        pattern=r"^DICT_(4X4|5X5|6X6|7X7)_(50|100|250|1000)$",
    )
    two_sided: bool = field(
        lambda data: not _marked(data),
        "whether it is printed on both sides",
        "true or false, of a charuco board false",
    )
    thickness_mm: float = field(0.0, "distance of the two printed sides", ge=0, le=100)

    @model_validator(mode="after")
    def _check(self) -> BoardSpec:
        if self.kind == "checkerboard":
            for name in ("mark_mm", "dictionary"):
                if (given := getattr(self, name)) is not None:
                    refuse(name, given, "allowed where kind is checkerboard: null")
            return self
        if self.mark_mm is None or self.mark_mm >= self.tile_mm:
            self.refuse("mark_mm")
        marks = self.columns * self.rows // 2
        if self.dictionary is None or int(self.dictionary.rpartition("_")[2]) < marks:
            allowed = permitted(BoardSpec, "dictionary")
            refuse("dictionary", self.dictionary, f"{allowed}, here {marks}")
        if self.two_sided:
            self.refuse("two_sided")
        return self

    @property
    def board(self) -> Board:
        """The board in SI units."""
        return Board(
            self.columns,
            self.rows,
            self.tile_mm / 1000,
            self.margin_mm / 1000,
            self.thickness_mm / 1000,
            (self.mark_mm or 0) / 1000,
            self.dictionary or DICTIONARY,
        )


def _marked(given: dict[str, object]) -> bool:
    return given.get("kind") == "charuco"
