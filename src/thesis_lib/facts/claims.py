"""Claims of the thesis, read from tables of ``data/thesis``: values, trends, reasons, numbers.

A row is a dataclass whose types define the allowed values; a malformed row is refused with its
line number. The rules for judging values are in :mod:`thesis_lib.ledger.verdicts`, those for trends
in :mod:`thesis_lib.ledger.trends`.

Numbers outside the thesis's results were computed there, follow from others, or are stated twice.
Each is compared with a value from the library or from simple arithmetic. A printed decimal stands
for all values that are rounded to it; a fraction or a product, such as 1/60, for its exact value.
"""

import csv
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError

from thesis_lib.acoustics.radiation import outgoing_wave
from thesis_lib.facts import setups
from thesis_lib.facts.setups import Direction, camera_pairs, data_folder
from thesis_lib.vibration import structure
from thesis_lib.vision.optics import angle_of_view, picture_height
from thesis_lib.vision.pinhole import hemisphere_directions, pixelate, project

Row = TypeVar("Row")
Text = Annotated[str, Field(min_length=1)]
Integer = Annotated[int, BeforeValidator(int)]  # digits alone: pydantic accepts 1.0, too
Number = Annotated[float, Field(allow_inf_nan=False)]
Names = Annotated[tuple[str, ...], BeforeValidator(lambda text: [*filter(None, text.split(";"))])]
SomeNames = Annotated[Names, Field(min_length=1)]
Texts = Annotated[tuple[str, ...], BeforeValidator(lambda text: [*filter(None, text.split("; "))])]
COLUMN_NAMES = {"values": "value"}  # columns whose names differ from their fields


def read_rows(
    name: str, model: type[Row], derived: Mapping[str, Callable[[Mapping[str, str]], object]] = {}
) -> list[Row]:
    """Read the rows of a table of ``data/thesis``; their first fields must differ.

    Parameters
    ----------
    name : str
        File name.
    model : type
        Dataclass of a row; its fields are the columns in their order, and their types define the
        allowed values.
    derived : mapping, optional
        Fields that are not columns, and functions that compute them from a row.

    Raises
    ------
    ValueError
        With the line and the field of a malformed row.
    """
    columns = [COLUMN_NAMES.get(f.name, f.name) for f in fields(model) if f.name not in derived]  # type: ignore[arg-type]
    check, found = TypeAdapter(model).validate_python, dict[str, Row]()
    with (data_folder() / name).open(encoding="utf-8", newline="") as file:
        lines = [(line, given) for line, given in enumerate(csv.reader(file), 1) if given]
        for line, given in lines or [(1, [])]:
            if (line == 1 and given != columns) or len(given) != len(columns):
                raise ValueError(f"{name}, line {line}: given {given}, allowed: {columns}")
            if given[0] in found:
                raise ValueError(f"{name}, line {line}: given {given[0]!r} a second time")
            row = dict(zip(columns, given, strict=True))
            try:
                if line > 1:
                    found[given[0]] = check(row | {field: of(row) for field, of in derived.items()})
            except ValidationError as error:
                bad = str(error.errors(include_url=False)[0]["loc"][0])
                raise ValueError(f"{name}, line {line}: {bad}: given {row[bad]!r}") from None
    return list(found.values())


Relation = Literal["about", "range", "max", "less_than", "min"]
Quantity = Literal["mean_error", "max_point_error", "plane_error_xz", "plane_error_yz"]

Values = Annotated[
    tuple[Number, ...],
    BeforeValidator(lambda text: () if text == "all" else text.split(";")),
    Field(alias=COLUMN_NAMES["values"]),
]


@dataclass(frozen=True)
class Claim:
    """One claimed value of the thesis."""

    #: Identifier, made of the position in the thesis
    id: Text
    figure_set: Text
    section: Text
    figure: Text
    panel: str
    case: str
    mode: Integer  #: Mode to which it refers
    quantity: Quantity  #: Kind of error
    #: Values of the varied parameter; empty for all settings of the case
    values: Values
    relation: Relation  #: Relation of the error to the interval
    #: Claimed interval in %; equal for a single value
    low: Number
    high: Number
    excepted: Integer  #: Number of markers that the text excludes
    #: Order of adding pairs to which it refers; empty for the one that the study runs
    pair_order: str = ""
    #: Half a unit of the last printed digit of `low` and of `high`
    rounding: tuple[float, float] = (0.0, 0.0)
    conflicts: Names = ()  #: Ids of claims that cannot be true together with this one
    conflict_why: str = ""  #: Reason of the conflict

    @property
    def chapter(self) -> int:
        """Return the chapter of the thesis."""
        return int(self.section[0])

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """Return the claimed interval in %, with None at the open end of a bound."""
        upper, lower = self.relation in ("max", "less_than"), self.relation == "min"
        return None if upper else self.low, None if lower else self.high

    def applies_to(self, case: str, value: float, pair_order: str) -> bool:
        """Return whether the claim refers to a setting's case, varied value and order of pairs."""
        return (
            case == self.case
            and (not self.values or value in self.values)
            and (not self.pair_order or pair_order == self.pair_order)
        )

    @property
    def stated(self) -> str:
        """Return the claim as short text, such as ``10–15 %`` or ``≤ 40 %``."""
        sign = {"max": "≤ ", "less_than": "< ", "min": "≥ "}.get(self.relation, "")
        interval = f"{self.low:g}" if self.low == self.high else f"{self.low:g}–{self.high:g}"
        return f"{sign}{interval} %"


def read_claims() -> list[Claim]:
    """Read the claimed values, from ``data/thesis/claims.csv``.

    Raises
    ------
    ValueError
        With the line and the field of a malformed row.
    """
    rounding = {"rounding": lambda row: [half_digit(row[end]) for end in ("low", "high")]}
    return read_rows("claims.csv", Claim, rounding)


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


Modes = Annotated[tuple[Integer, ...], BeforeValidator(lambda text: text.split(";"))]


@dataclass(frozen=True)
class Trend:
    """One claimed trend of the thesis."""

    id: Text  #: Name
    chapter: Integer  #: Chapter of the thesis
    section: Text  #: Section of the thesis
    cases: Names  #: Cases to which it refers; empty for all of the source
    modes: Modes  #: Modes to which it refers
    quantities: SomeNames  #: Errors to which it refers
    kind: str  #: Kind of trend, such as ``increasing_with``
    parameter: str  #: Varied parameter
    words: Text  #: Statement in words
    source: SomeNames  #: Figure sets, or the ledger's own runs, by which it is judged
    test: Text  #: Relation, as :mod:`thesis_lib.ledger.trends` names it, and its argument


def read_trends() -> list[Trend]:
    """Read the claimed trends, from ``data/thesis/trends.csv``, with the checks of `read_rows`."""
    return read_rows("trends.csv", Trend)


@dataclass(frozen=True)
class Reason:
    """Reason why the book's result differs from a claim of the thesis."""

    id: Text  #: Name of the claim
    reason: Annotated[str, Field(pattern=r"^\S.*\.$")]  #: One sentence
    page: Text  #: Document of the book that explains more, such as ``errata#errata-a6``


def read_reasons() -> dict[str, Reason]:
    """Read the reasons by the names of their claims, with the checks of :func:`read_rows`."""
    return {one.id: one for one in read_rows("reasons.csv", Reason)}


@dataclass(frozen=True)
class IndexEntry:
    """One figure, table or equation of the thesis: where it is covered here, or why it is not."""

    item: Text  #: Name in the thesis, such as ``figure 3.4``
    what: Text  #: Subject, in words of this project
    page: str  #: Document of the book, such as ``beam#eq-modal``
    function: Texts  #: Names in the library
    cube: Texts  #: Variables of figure sets, such as ``beam-distance: mean_error``
    test: Texts  #: Names of tests
    reason: str  #: Why it is not covered here; empty if it is
    errata: Texts  #: Errata on it, such as ``errata#errata-a6``


def read_index() -> list[IndexEntry]:
    """Read the index, from ``data/thesis/index.csv``, with the checks of :func:`read_rows`."""
    return read_rows("index.csv", IndexEntry)


EXACT_TOLERANCE = 1e-9  # relative half-width of a fraction or a product
THESIS_BEAM, THESIS_PLATE = setups.thesis_beam(), setups.thesis_plate()
THESIS_RIG = setups.setup_table("experiment", "rig")


@dataclass(frozen=True)
class PrintedNumber:
    """One number that the thesis prints and that can be computed."""

    id: Text  #: Name
    #: Chapter of the thesis; an appendix counts as the chapter that refers to it
    chapter: Annotated[Integer, Field(ge=1, le=7)]
    place: Text  #: Position in the thesis
    words: Text  #: Meaning
    #: As printed: a decimal such as ``39.6`` or ``16e6``, or an exact ``1/60`` or ``12×4``
    stated: Text
    unit: str  #: Unit, empty if it has none
    #: How it is computed: a key of :data:`CORRECT_VALUES`, and arguments of that function
    value_of: Annotated[
        tuple[Annotated[Number | Text, Field(union_mode="left_to_right")], ...],
        BeforeValidator(lambda text: text.split()),
        Field(min_length=1),
    ]

    @property
    def ends(self) -> tuple[float, float]:
        """Return the least and the largest value that is rounded to the printed one."""
        for sign in "/×":
            first, found, second = self.stated.partition(sign)
            if found:
                value = int(first) / int(second) if sign == "/" else float(int(first) * int(second))
                return value * (1 - EXACT_TOLERANCE), value * (1 + EXACT_TOLERANCE)
        number = Decimal(self.stated)
        half = Decimal(5).scaleb(int(number.as_tuple().exponent) - 1)
        return float(number - half), float(number + half)

    @property
    def is_bookkeeping(self) -> bool:
        """Return whether the number only adds up or counts printed numbers."""
        return self.value_of[0] in BOOKKEEPING

    @property
    def value(self) -> float:
        """Compute the correct value, in its unit."""
        name, *given = self.value_of
        return float(CORRECT_VALUES[str(name)](*given))


def read_numbers() -> list[PrintedNumber]:
    """Read the printed numbers, from ``data/thesis/numbers.csv``, with checks of `read_rows`."""
    return read_rows("numbers.csv", PrintedNumber)


def _axes_angle(*directions: float) -> float:
    axes = hemisphere_directions(*np.radians(np.reshape(directions, (2, 2))).T)
    return math.degrees(math.acos(axes[0] @ axes[1]))


def _equations(n_cameras: float) -> int:
    """Return the number of independent rows of eq. 3.18 for one point in rounded images."""
    (pair,) = setups.distance_settings([500], 30, 25, (320, 180))
    P = pair.cameras(24, 36).P[: int(n_cameras)]
    u, v = pixelate(project(P, [[0.1], [0.004], [0.003]]))[:, :, 0].T
    rows = np.cross(np.stack([u, v, u * 0 + 1], axis=1)[:, :, None], P, axis=1)
    return int(np.linalg.matrix_rank(rows.reshape(-1, 4)))


def _sine_factor() -> float:
    """Return the factor c of sin(kx) in eq. 3.4 from the derivatives at the clamp."""
    k = structure.cantilever_roots(1)[0] / THESIS_BEAM.length
    slope, third = (THESIS_BEAM.mode_shapes([1], [[0.0], [0.0]], n)[0, 0] for n in (1, 3))
    return float((slope * k**2 - third) / (slope * k**2 + third))  # slope k²/third = (1+c)/(1-c)


def _factor_of_mixed_term() -> float:
    """Return the factor of the mixed derivative in eq. 4.1 from the frequencies of eq. 4.6."""
    a2, b2 = ((math.pi / side) ** 2 for side in THESIS_PLATE.extent)
    omega = THESIS_PLATE.angular_frequencies(1)[0]
    waves = omega**2 * THESIS_PLATE.mass_per_area / THESIS_PLATE.bending_stiffness
    return float((waves - a2**2 - b2**2) / (a2 * b2))


def _at_resonance() -> complex:
    omega = structure.resonance_frequency(THESIS_BEAM, 1)
    return complex(structure.modal_coordinates(THESIS_BEAM, omega, 1)[0])


def _cameras(case: str) -> set[Direction]:
    return {
        (azimuth % 360, elevation) for pair in camera_pairs()[case] for azimuth, elevation in pair
    }


STRUCTURES: dict[str, Any] = {"beam": THESIS_BEAM, "plate": THESIS_PLATE}
BOOKKEEPING: dict[str, Callable[..., float]] = {  # these combine or count printed numbers
    "sum": operator.add,
    "difference": operator.sub,
    "product": operator.mul,
    "quotient": operator.truediv,
    "whole_quotient": lambda total, each: math.ceil(total / each),
    "different": lambda *items: len(set(items)),
    "diagonal": math.hypot,
    "height": picture_height,
    "lens": lambda width, angle: width / 2 / math.tan(math.radians(angle / 2)),
    "cameras": lambda case: len(_cameras(case)),
    "pairs": lambda case: len(camera_pairs()[case]),
    "last_figure": lambda case: float(setups.figure_number("beam", "arrays", case, 3)),
    "plate_markers": lambda: len(THESIS_PLATE.markers.T),
}
CORRECT_VALUES: dict[str, Callable[..., float]] = {
    **BOOKKEEPING,
    "view": lambda focal, *sides: math.degrees(angle_of_view(math.hypot(*sides), focal)),
    "axes": _axes_angle,
    "root": lambda n: structure.cantilever_roots(n)[-1],
    "sine_factor": _sine_factor,
    "mixed_term": _factor_of_mixed_term,
    "instant": lambda: abs(math.cos(np.angle(_at_resonance()))),
    "overlap": lambda of: math.log2(np.divide(*structure.modal_overlap(STRUCTURES[of], [2, 1]))),
    "equations": _equations,
    "shared": lambda case, other: len(_cameras(case) & _cameras(other)),
    "mirrored": lambda case: sum((a[0] + b[0]) % 180 == 0 for a, b in camera_pairs()[case]),
    "array_width": lambda: setups.setup_table("beam", "arrays")["resolution_px"][0],
    "spacing": lambda of, axis, count: STRUCTURES[of].extent["xy".index(axis)] / (count * 1e-3),
    "beam": lambda name: getattr(THESIS_BEAM, name),
    "rank": lambda *mode: THESIS_PLATE.mode_indices(50).tolist().index(list(mode)) + 1,
    "resonance": lambda: structure.resonance_frequency(THESIS_BEAM, 1) / (2 * math.pi),
    "tip": lambda: structure.peak_deflection(THESIS_BEAM, 1) * 1e3,
    "rig": lambda name: THESIS_RIG[name],
    "rig_aperture": lambda: 2 * THESIS_RIG["azimuth_deg"],
    "frame_period": lambda: 1 / THESIS_RIG["frame_rate_hz"],
    "frames_at_resonance": lambda: THESIS_RIG["frame_rate_hz"] / THESIS_RIG["frequency_hz"],
    "plane_columns": lambda: 99 * THESIS_PLATE.length / THESIS_PLATE.width,
    "wave_sign": lambda: -math.copysign(1, math.atan2(*outgoing_wave(1.0, np.array(0.1)))),
}
"""Functions that compute a number from its arguments, by the library or by simple arithmetic."""
