"""What a manifest says of the calibration board."""

from __future__ import annotations

from thesis_lib.measure.recordings.board import Board
from thesis_lib.studies.refusals import Refusing
from thesis_lib.studies.vocabulary import Positive, field


class BoardSpec(Refusing):
    """The calibration board: a checkerboard."""

    columns: int = field(9, "tiles along x", ge=4, le=100)
    rows: int = field(9, "tiles along y", ge=4, le=100)
    tile_mm: Positive = field(45.0, "side of a tile")
    margin_mm: float = field(45.0, "width of the white margin", ge=0, le=1e5)
    two_sided: bool = field(True, "whether it is printed on both sides")
    thickness_mm: float = field(0.0, "distance of the two printed sides", ge=0, le=100)

    @property
    def board(self) -> Board:
        """The board in SI units."""
        lengths = (self.tile_mm, self.margin_mm, self.thickness_mm)
        return Board(self.columns, self.rows, *(length / 1000 for length in lengths))
