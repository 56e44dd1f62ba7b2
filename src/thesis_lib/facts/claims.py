"""What the thesis states, read from tables of ``data/thesis``: values, trends, reasons, numbers.

A row is a dataclass, whose types say what its fields may be; a malformed one is refused with its
line. The rules for judging values stand in :mod:`thesis_lib.ledger.verdicts`, those for trends in
:mod:`thesis_lib.ledger.trends`.

Numbers outside the thesis's results were computed there, follow from others, or are stated twice.
Each is held against what the library or a line of arithmetic gives. A printed decimal stands for
all that would be rounded to it; a fraction or a product, such as 1/60, for itself.
"""

import csv
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from decimal import Decimal
from functools import cache, partial
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, ValidationError

from thesis_lib.acoustics.radiation import outgoing_wave
from thesis_lib.facts import setups
from thesis_lib.facts.setups import Direction, camera_pairs, data_folder
from thesis_lib.vibration import structure as structures
from thesis_lib.vibration.structure import cantilever_roots
from thesis_lib.vision.optics import angle_of_view, picture_height
from thesis_lib.vision.pinhole import hemisphere_directions, pixelate, project

Row = TypeVar("Row")
Text = Annotated[str, Field(min_length=1)]
Integer = Annotated[int, BeforeValidator(int)]  # of digits alone: pydantic takes 1.0, too
Number = Annotated[float, Field(allow_inf_nan=False)]
Names = Annotated[tuple[str, ...], BeforeValidator(lambda text: [*filter(None, text.split(";"))])]
SomeNames = Annotated[Names, Field(min_length=1)]
SplitTexts = BeforeValidator(lambda text: text.split("; ") if text else [])


def accept_if(allowed: Callable[[str], bool]) -> AfterValidator:
    """Return the check that a text is allowed, by a function that tells."""

    def check(text: str) -> str:
        if not allowed(text):
            raise ValueError(text)
        return text

    return AfterValidator(check)


def read_rows(
    name: str,
    model: type[Row],
    derived: Mapping[str, Callable[[Mapping[str, str]], object]] | None = None,
) -> Iterator[Row]:
    """Read the rows of a table of ``data/thesis``, of which no two share the first field.

    Parameters
    ----------
    name : str
        The file.
    model : type
        Dataclass of a row; its fields are the columns in their order, and their types what is
        allowed.
    derived : mapping, optional
        Fields that are no columns, and how they follow from a row.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    derived = derived or {}
    columns = [COLUMN_NAMES.get(f.name, f.name) for f in fields(model) if f.name not in derived]  # type: ignore[arg-type]
    check = TypeAdapter(model).validate_python
    with (data_folder() / name).open(encoding="utf-8", newline="") as file:
        rows, seen = csv.DictReader(file, restkey="more"), set[str]()
        if rows.fieldnames != columns:
            given = ", ".join(rows.fieldnames or ())
            raise ValueError(f"{name}, line 1: given {given}, allowed: {', '.join(columns)}")
        for line, row in enumerate(rows, 2):
            # A row that is too short has no text for a column; one that is too long has more.
            bad = next((f for f, text in row.items() if not isinstance(text, str)), "")
            try:
                found = None if bad else check(row | {f: of(row) for f, of in derived.items()})
            except ValidationError as error:
                bad = str(error.errors(include_url=False)[0]["loc"][0])
            if found is None or bad:
                raise ValueError(f"{name}, line {line}: {bad}: given {row[bad]!r}")
            key = row[columns[0]]
            if key in seen:
                raise ValueError(f"{name}, line {line}: {columns[0]}: given {key!r} a second time")
            seen.add(key)
            yield found


COLUMN_NAMES = {"values": "value"}  # columns that are not called as their fields
Relation = Literal["about", "range", "max", "less_than", "min"]
Quantity = Literal["mean_error", "max_point_error", "plane_error_xz", "plane_error_yz"]

Values = Annotated[
    tuple[Number, ...],
    BeforeValidator(lambda text: () if text == "all" else text.split(";")),
    Field(alias=COLUMN_NAMES["values"]),
]


@dataclass(frozen=True)
class Claim:
    """One figure that the thesis states."""

    #: Where it stands
    id: Text
    figure_set: Text
    section: Text
    figure: str
    panel: str
    case: str
    mode: Integer  #: Mode it speaks of
    quantity: Quantity  #: Which error
    #: Values of the varied parameter; empty if it speaks of all settings of the case
    values: Values
    relation: Relation  #: How the interval is meant
    #: The stated interval in %; equal for a single value
    low: Number
    high: Number
    excepted: Integer  #: How many markers the text leaves out
    #: Order of adding pairs that it speaks of; empty for the one that the study runs
    pair_order: str = ""
    #: Half a unit of the last printed digit of `low` and of `high`
    rounding: tuple[float, float] = (0.0, 0.0)
    conflicts: Names = ()  #: Ids of claims that cannot be true together with this one
    conflict_why: str = ""  #: Why not

    @property
    def chapter(self) -> int:
        """Return the chapter of the thesis."""
        return int(self.section[0])

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """The stated interval in %, with None at the open end of a bound."""
        upper, lower = self.relation in ("max", "less_than"), self.relation == "min"
        return None if upper else self.low, None if lower else self.high

    def speaks_of(self, case: str, value: float, pair_order: str) -> bool:
        """Return whether a setting with this case, varied value and order of pairs is meant."""
        return (
            case == self.case
            and (not self.values or value in self.values)
            and (not self.pair_order or pair_order == self.pair_order)
        )

    @property
    def stated(self) -> str:
        """The claim in a few characters, such as ``10–15 %`` or ``≤ 40 %``."""
        sign = {"max": "≤ ", "less_than": "< ", "min": "≥ "}.get(self.relation, "")
        interval = f"{self.low:g}" if self.low == self.high else f"{self.low:g}–{self.high:g}"
        return f"{sign}{interval} %"


def read_claims() -> list[Claim]:
    """Read the claimed values, from ``data/thesis/claims.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    rounding = {"rounding": lambda row: [half_digit(row[end]) for end in ("low", "high")]}
    return [*read_rows("claims.csv", Claim, rounding)]


def half_digit(text: str) -> float:
    """Return half a unit of the last digit of a number as it is printed.

    Examples
    --------
    >>> half_digit("10"), half_digit("1.2")
    (0.5, 0.05)
    """
    return 0.5 * 10.0 ** -len(text.partition(".")[2])


@cache
def claims_of(name: str) -> tuple[Claim, ...]:
    """Return the claims about a figure set."""
    return tuple(claim for claim in read_claims() if claim.figure_set == name)


_NUMBER_PATTERN = r"\d+(\.\d+)?"
_INTERVALS_PATTERN = (
    rf"{_NUMBER_PATTERN} {_NUMBER_PATTERN}(?: {_NUMBER_PATTERN} {_NUMBER_PATTERN})*"
)
_ONE_SIDED = rf"{_NUMBER_PATTERN}( first| last)?"
RELATION_WORDS = {  # what is stated, and what has to be said with it
    "falls": "", "rises": "", "falls_steadily": "", "falls_irregularly": "",
    "flat": rf"({_INTERVALS_PATTERN})?", "within": _INTERVALS_PATTERN,
    "no_trend": "", "mostly_no_trend": "", "same_pattern": "", "same_trends": "",
    "below": _ONE_SIDED, "at_most": _ONE_SIDED, "above": rf"{_NUMBER_PATTERN} first",
    "peaks": _NUMBER_PATTERN, "highest_last": "", "modes_alike": "",
    "worst_mode": r"\d+", "best_mode": r"\d+", "planes_alike": r"((XZ|YZ) \d \d)?",
    "like_case": r"\S+( last)?", "below_case": r"\S+ (first|common)", "gentler": r"\S+",
    "best_case": r".+", "unrelated": r"\w+",
}  # fmt: skip


Modes = Annotated[tuple[Integer, ...], BeforeValidator(lambda text: text.split(";"))]


def _is_relation(text: str) -> bool:
    name, _, argument = text.partition(" ")
    return name in RELATION_WORDS and bool(re.fullmatch(RELATION_WORDS[name], argument))


@dataclass(frozen=True)
class Trend:
    """One trend that the thesis states."""

    id: Text  #: Its name
    chapter: Integer  #: Chapter of the thesis
    section: Text  #: Section of the thesis
    cases: Names  #: Cases it speaks of; none means all of the source
    modes: Modes  #: Modes it speaks of
    quantities: SomeNames  #: Errors it speaks of
    kind: str  #: How it goes, such as ``increasing_with``
    parameter: str  #: What varies
    words: Text  #: What it says
    source: SomeNames  #: Figure sets, or runs of the ledger's own, that it is judged by
    test: Annotated[str, accept_if(_is_relation)]  #: Relation and its argument


def read_trends() -> list[Trend]:
    """Read the stated trends, from ``data/thesis/trends.csv``, refused line by line."""
    return [*read_rows("trends.csv", Trend)]


_PAGE_PATTERN = r"[\w/-]+(#[\w-]+)?"  # a document of the book, perhaps with an anchor


@dataclass(frozen=True)
class Reason:
    """Why the book gets something else than a claim of the thesis."""

    id: Text  #: Name of the claim
    reason: Annotated[str, Field(pattern=r"^\S.*\.$")]  #: One sentence
    #: Document of the book that tells more, such as ``errata#errata-a6``
    page: Annotated[str, Field(pattern=rf"^{_PAGE_PATTERN}$")]


def read_reasons() -> dict[str, Reason]:
    """Read the reasons by the names of their claims, from ``data/thesis/reasons.csv``.

    Raises
    ------
    ValueError
        Naming the line and the field of a malformed row.
    """
    return {one.id: one for one in read_rows("reasons.csv", Reason)}


FunctionName = Annotated[str, Field(pattern=r"^thesis_lib(\.\w+)+$")]
CubeVariables = Annotated[str, Field(pattern=r"^[\w-]+: \w+(, \w+)*$")]
TestName = Annotated[str, Field(pattern=r"^tests/(\w+/)*test_\w+\.py::test_\w+$")]
ErratumPage = Annotated[str, Field(pattern=r"^errata#errata-[a-e]\d+$")]


@dataclass(frozen=True)
class IndexEntry:
    """One figure, table or equation of the thesis: its place here, or why it has none."""

    #: Name in the thesis, such as ``figure 3.4``
    item: Annotated[str, Field(pattern=r"^(figure|table|equation) \w\.\d+[ab]?$")]
    what: Annotated[str, Field(pattern=r"^\S.*$")]  #: Subject, in our words
    #: Document of the book, such as ``beam#eq-modal``
    page: Annotated[str, Field(pattern=rf"^({_PAGE_PATTERN})?$")]
    function: Annotated[tuple[FunctionName, ...], SplitTexts]  #: Names in the library
    #: Variables of figure sets, such as ``beam-distance: mean_error``
    cube: Annotated[tuple[CubeVariables, ...], SplitTexts]
    test: Annotated[tuple[TestName, ...], SplitTexts]  #: Names of tests
    reason: Annotated[str, Field(pattern=r"^(\S.*)?$")]  #: Why nothing here is about it
    errata: Annotated[tuple[ErratumPage, ...], SplitTexts]  #: Errata on it


def read_index() -> list[IndexEntry]:
    """Read the index, from ``data/thesis/index.csv``, refused line by line."""
    entries = [*read_rows("index.csv", IndexEntry)]
    for one in entries:
        if bool(one.reason) == any((one.page, one.function, one.cube, one.test)):
            given = f"index.csv, {one.item}: reason: given {one.reason!r}"
            allowed = "one if there is no page, function, cube or test, else none"
            raise ValueError(f"{given}, allowed: {allowed}")
    return entries


EXACT_TOLERANCE = 1e-9  # relative half-width of a fraction or a product
THESIS_BEAM, THESIS_PLATE = setups.thesis_beam(), setups.thesis_plate()
THESIS_RIG = setups.setup_table("experiment", "rig")


def _is_finite(text: str) -> bool:
    try:
        return all(map(math.isfinite, _interval(text)))
    except ArithmeticError:
        return False


@dataclass(frozen=True)
class StatedNumber:
    """One number that the thesis prints and that can be computed."""

    id: Text  #: Its name
    #: Chapter of the thesis; an appendix counts as the chapter that refers to it
    chapter: Annotated[Integer, Field(ge=1, le=7)]
    place: Text  #: Where it stands
    words: Text  #: What it is
    #: As printed: a decimal such as ``39.6`` or ``16e6``, or an exact ``1/60`` or ``12×4``
    stated: Annotated[str, accept_if(_is_finite)]
    unit: str  #: Its unit, empty if it has none
    #: Key of :data:`CORRECT_VALUES`
    value_of: Annotated[str, accept_if(lambda name: name in CORRECT_VALUES)]

    @property
    def low(self) -> float:
        """Return the least value that would be printed like this."""
        return _interval(self.stated)[0]

    @property
    def high(self) -> float:
        """Return the largest value that would be printed like this."""
        return _interval(self.stated)[1]

    @property
    def is_bookkeeping(self) -> bool:
        """Return whether the number only adds up or counts printed numbers."""
        return self.value_of in ARITHMETIC_RESULTS or self.value_of in COUNTED_NUMBERS

    @property
    def value(self) -> float:
        """Compute the correct value, in its unit."""
        return float(CORRECT_VALUES[self.value_of]())


def read_numbers() -> list[StatedNumber]:
    """Read the stated numbers, from ``data/thesis/numbers.csv``, refused line by line."""
    return [*read_rows("numbers.csv", StatedNumber)]


def _interval(text: str) -> tuple[float, float]:
    for sign in "/×":
        first, found, second = text.partition(sign)
        if found:
            value = int(first) / int(second) if sign == "/" else float(int(first) * int(second))
            return value * (1 - EXACT_TOLERANCE), value * (1 + EXACT_TOLERANCE)
    number = Decimal(text)
    half = Decimal(5).scaleb(int(number.as_tuple().exponent) - 1)
    return float(number - half), float(number + half)


def _angle_of_view(size: float, focal_length: float) -> float:
    return math.degrees(angle_of_view(size, focal_length))


def _axes_angle(one: Direction, other: Direction) -> float:
    axes = hemisphere_directions(*np.radians([one, other]).T)
    return math.degrees(math.acos(axes[0] @ axes[1]))


def _equations(n_cameras: int) -> int:
    """Return independent rows of eq. 3.18 that cameras with rounded images give for one point."""
    (pair,) = setups.distance_settings([500], 30, 25, (320, 180))
    P = pair.cameras(24, 36).P[:n_cameras]
    u, v = pixelate(project(P, [[0.1], [0.004], [0.003]]))[:, :, 0].T
    rows = np.cross(np.stack([u, v, u * 0 + 1], axis=1)[:, :, None], P, axis=1)
    return int(np.linalg.matrix_rank(rows.reshape(-1, 4)))


def _sine_factor() -> float:
    """Return the factor c of sin(kx) in eq. 3.4 from the derivatives at the clamp."""
    k = cantilever_roots(1)[0] / THESIS_BEAM.length
    slope, third = (THESIS_BEAM.mode_shapes([1], [[0.0], [0.0]], n)[0, 0] for n in (1, 3))
    return float((slope * k**2 - third) / (slope * k**2 + third))  # slope k²/third = (1+c)/(1-c)


def _factor_of_mixed_term() -> float:
    """Return the factor of the mixed derivative in eq. 4.1 from the frequencies of eq. 4.6."""
    a2, b2 = ((math.pi / side) ** 2 for side in THESIS_PLATE.extent)
    omega = THESIS_PLATE.angular_frequencies(1)[0]
    waves = omega**2 * THESIS_PLATE.mass_per_area / THESIS_PLATE.bending_stiffness
    return float((waves - a2**2 - b2**2) / (a2 * b2))


def _at_resonance() -> complex:
    omega = structures.resonance_frequency(THESIS_BEAM, 1)
    return complex(structures.modal_coordinates(THESIS_BEAM, omega, 1)[0])


def _cameras(case: str) -> set[Direction]:
    return {
        (azimuth % 360, elevation) for pair in camera_pairs()[case] for azimuth, elevation in pair
    }


ARITHMETIC_RESULTS: dict[str, float] = {
    "chapters": 6 + 1, "battery_voltage": 2 * 1.5, "sensor_cells": 4000 * 4000,
    **{f"height_{w}_{a}_{b}": picture_height(w, a, b)
       for w in (800, 1024, 1280, 1600) for a, b in ((4, 3), (36, 24))},
    **{f"aperture_2a_{half}": half - -half for half in (8, 30, 55, 80)},
    "film_diagonal": math.hypot(36, 24), "lens_of_view": 18 / math.tan(math.radians(39.6 / 2)),
    "zero_column": 3, "apart_pair": 30 - -30, "caption_2c": 2 * abs(-90 + 8),
    "rig_places": len({10, -10} | {10, -10}), "board_tiles": 5 * 7, "pictures": 12 * 4,
    "least_pictures": math.ceil(5 / 2), "markers": 3 * 25, "grid": 3 * 25 + 1,
    "frames_at_4": 60 / 4, "parameters": len(("distance", "aperture", "pixels", "cameras")),
}  # fmt: skip
COUNTED_NUMBERS = ("array_sizes", "last_figure", "cameras_4a", "pairs_4a", "cameras_4b", "pairs_4b",
          "plate_markers")  # fmt: skip
CORRECT_VALUES: dict[str, Callable[[], float]] = {
    **{name: partial(float, value) for name, value in ARITHMETIC_RESULTS.items()},
    "view_across": partial(_angle_of_view, 36, 50), "view_up": partial(_angle_of_view, 24, 50),
    "view_diagonal_43": partial(_angle_of_view, 43, 50),
    "view_diagonal": partial(_angle_of_view, math.hypot(36, 24), 50),
    **{f"root_{n}": partial(lambda n: cantilever_roots(n)[-1], n) for n in range(1, 7)},
    "sine_factor": _sine_factor, "mixed_term": _factor_of_mixed_term,
    "instant": lambda: abs(math.cos(np.angle(_at_resonance()))),
    "overlap_beam": lambda: math.log2(np.divide(*structures.modal_overlap(THESIS_BEAM, [2, 1]))),
    "overlap_plate": lambda: math.log2(np.divide(*structures.modal_overlap(THESIS_PLATE, [2, 1]))),
    "equations_1": partial(_equations, 1), "equations_2": partial(_equations, 2),
    "last_figure": lambda: float(setups.figure_number("beam", "arrays", "4e", 3)),
    **{f"aperture_2b_{p}": partial(_axes_angle, (90, p), (-90, p)) for p in (5, 20, 40, 60)},
    "axes_pair": partial(_axes_angle, (30, 25), (-30, 25)),
    "axes_2a_80": partial(_axes_angle, (80, 10), (-80, 10)),
    "cameras_4a": lambda: len(_cameras("4a")), "pairs_4a": lambda: len(camera_pairs()["4a"]),
    "cameras_4b": lambda: len(_cameras("4b")), "pairs_4b": lambda: len(camera_pairs()["4b"]),
    "array_sizes": lambda: len(camera_pairs()["4a"]),  # one more with each pair
    "shared_4a": lambda: len(_cameras("4a") & _cameras("4a'")),
    "mirrored_4e": lambda: sum(
        (one[0] + other[0]) % 180 == 0 for one, other in camera_pairs()["4e"]
    ),
    "array_width": lambda: setups.setup_table("beam", "arrays")["resolution_px"][0],
    "beam_spacing": lambda: THESIS_BEAM.length / 25e-3, "beam_density": lambda: THESIS_BEAM.density,
    "beam_modulus": lambda: THESIS_BEAM.youngs_modulus,
    "plate_markers": lambda: len(THESIS_PLATE.markers.T),
    "plate_spacing_x": lambda: THESIS_PLATE.length / 15e-3,
    "plate_spacing_y": lambda: THESIS_PLATE.width / 10e-3,
    **{f"rank_{a}_{b}": partial(
        lambda m: THESIS_PLATE.mode_indices(50).tolist().index(m) + 1, [a, b]
       ) for a, b in ((2, 1), (1, 2), (2, 2), (1, 4))},
    "resonance": lambda: structures.resonance_frequency(THESIS_BEAM, 1) / (2 * math.pi),
    "tip": lambda: structures.peak_deflection(THESIS_BEAM, 1) * 1e3,
    "rig_frequency": lambda: THESIS_RIG["frequency_hz"],
    "rig_distance": lambda: THESIS_RIG["distance_mm"],
    "rig_apart": lambda: 2 * THESIS_RIG["azimuth_deg"],
    "frame_period": lambda: 1 / THESIS_RIG["frame_rate_hz"],
    "rig_axes": partial(_axes_angle, (10, 22), (-10, 22)),
    "frames_at_resonance": lambda: THESIS_RIG["frame_rate_hz"] / THESIS_RIG["frequency_hz"],
    "plane_columns": lambda: 99 * THESIS_PLATE.length / THESIS_PLATE.width,
    "wave_sign": lambda: -math.copysign(1, math.atan2(*outgoing_wave(1.0, np.array(0.1)))),
}  # fmt: skip
