"""Fields of a manifest that tell how the structure is driven, and of a recorded force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.arrays import Array
from thesis_lib.studies.fields import Fields, Flag, Positive, Real, Whole, refuse_value


class Sought(Fields):
    """Which modes or tones are looked for, where there are several."""

    from_hz: Positive = Field(2.0, description="lowest frequency")
    to_hz: Positive | None = Field(
        None,
        description="highest frequency; null is half of the lowest frame rate, above which "
        "cameras must differ in rate or start",
    )
    count: Whole | None = Field(
        None, ge=1, le=20, description="how many; null takes all that stand out of the noise"
    )
    near_hz: tuple[Positive, ...] | None = Field(
        None,
        min_length=1,
        max_length=20,
        description="frequencies near which they are; replaces count",
    )

    @model_validator(mode="after")
    def _check(self) -> Sought:
        if self.to_hz is not None and self.to_hz <= self.from_hz:
            self.refuse("to_hz", "allowed: null, or a number above from_hz, in Hz")
        high = self.to_hz or np.inf
        if self.near_hz and not all(self.from_hz <= f <= high for f in self.near_hz):
            self.refuse("near_hz", "allowed: null, or frequencies between from_hz and to_hz")
        return self


Kind = Literal["sine", "multisine", "free_decay", "sweep", "random"]


@dataclass(frozen=True)
class Behaviour:
    """What follows from a kind of excitation: what may be given, and how it is measured."""

    #: First result: one deflection shape, several modes or tones, or motion over a recorded force
    result: Literal["shape", "modes", "response"]
    title: str  #: What is measured, as reports name it
    force: Literal["none", "optional", "required"] = "none"  #: Whether a force is recorded
    has_one_frequency: bool = False  #: Sound and phase follow from one steady sine
    decays: bool = False  #: The modes lose their energy, fitted from the largest motion on
    sweeps: bool = False  #: The force goes from one frequency to another
    is_noise: bool = False  #: Segments are averaged, for the force neither begins nor ends at rest
    assumption: str = ""  #: What the fit assumes and cannot prove


EXCITATION_KINDS: dict[Kind, Behaviour] = {
    "sine": Behaviour("shape", "Deflection", has_one_frequency=True),
    "multisine": Behaviour(
        "modes",
        "Tones",
        assumption="Each tone is steady. Its shape is that of the motion, which may hold several "
        "modes.",
    ),
    "free_decay": Behaviour(
        "modes",
        "Modes",
        force="optional",
        decays=True,
        assumption="Nothing drives the structure in the interval that is fitted: each mode decays "
        "freely.",
    ),
    "sweep": Behaviour("response", "Receptance", force="required", sweeps=True),
    "random": Behaviour("response", "Receptance", force="required", is_noise=True),
}
"""Every kind of excitation; nothing else depends on its name."""


def list_kinds(wanted: Callable[[Behaviour], bool]) -> str:
    """Return the kinds that behave so, as a refusal lists them."""
    *others, last = (f'"{name}"' for name, one in EXCITATION_KINDS.items() if wanted(one))
    return f"{', '.join(others)} or {last}" if others else last


Place = tuple[Real, Real]
TABLE_SUFFIXES = frozenset([".csv", ".txt", ".tsv", ".tab", ".dat", ".asc", ".lvm"])
"""Endings of files that are read as a table of a force."""

FileName = Annotated[
    str, Field(min_length=1, max_length=500, title="a path inside the manifest's folder")
]
Channel = Annotated[Whole, Field(ge=1, le=64)]


class Sweep(Fields):
    """A force whose frequency goes from one to another."""

    from_hz: Positive | None = Field(
        None, description="frequency at its begin; null looks in the force"
    )
    to_hz: Positive | None = Field(
        None, description="frequency at its end; null looks in the force"
    )
    duration_s: Positive | None = Field(
        None, description="how long it takes; null looks in the force"
    )

    @model_validator(mode="after")
    def _check(self) -> Sweep:
        if self.to_hz is not None and self.to_hz == self.from_hz:
            self.refuse("to_hz", "allowed: null, or a number that is not from_hz, in Hz")
        return self


class Force(Fields):
    """A force, and where it acts."""

    file: FileName = Field(
        ...,
        description="its recording: a sound file, a video whose sound track carries it, or a "
        "table (.csv, .txt, .tsv, .dat, .lvm) of time and force",
    )
    full_scale_n: Positive | None = Field(
        None, description="force in N at full scale of a sound file"
    )
    channel: Channel = Field(1, description="which channel of a sound file carries it")
    sound_channel: Channel | None = Field(
        None,
        description="which channel has a sound that the first camera recorded, too, by which the "
        "clocks are compared; null takes that of the force",
    )
    offset_s: Annotated[Real, Field(ge=-1e5, le=1e5)] | None = Field(
        None, description="when the file begins on the first camera's clock; null finds it by sound"
    )
    at_mm: Place | None = Field(
        None,
        description="where it acts, from the clamped corner; null is the structure's "
        "force_position_mm and force_across_mm",
    )
    segment_s: Positive | Literal["whole"] | None = Field(
        None,
        description="length of the parts that are averaged; whole is for what begins and ends at "
        "rest; null takes whole for a decay or a sweep, and an eighth of the recording for "
        "random",
    )

    @property
    def is_table(self) -> bool:
        """Return whether the force is given in N already."""
        return PurePath(self.file).suffix.lower() in TABLE_SUFFIXES

    def place(self, usual: Array) -> Array:
        """Return the force's point in m, shape (2,); `usual` if it is not given."""
        return usual if self.at_mm is None else np.array(self.at_mm) / 1000

    def check(self, size: tuple[float, float]) -> None:
        """Refuse what does not go with the file, or with a structure of a size in mm."""
        if self.is_table and self.full_scale_n is not None:
            self._refuse("full_scale_n", "allowed with a table, which is in N: null")
        if not self.is_table and self.full_scale_n is None:
            self._refuse("full_scale_n", "allowed with a sound file: a number above 0, in N")
        if self.is_table and self.offset_s is None:
            self._refuse("offset_s", "allowed with a table, which has no sound: a number")
        at = self.at_mm or (0.0, 0.0)
        if not all(0 <= x <= most for x, most in zip(at, size, strict=True)):
            self._refuse("at_mm", "allowed: null, or [x, y] on the structure")

    def _refuse(self, name: str, why: str) -> None:
        refuse_value(f"force.{name}", getattr(self, name), why)


class Excitation(Fields):
    """How the structure is driven, and what the sound tracks carry."""

    kind: Kind = Field(
        "sine",
        description="what is filmed after rest_duration_s: a steady sine, several, the free decay "
        "after a tap or a release, or the motion that a force causes as a sweep or as noise",
    )
    modes: Sought = Field(
        default_factory=Sought, description="which modes, where kind is multisine or free_decay"
    )
    sweep: Sweep = Field(default_factory=Sweep, description="the sweep, where kind is sweep")
    frequency_hz: Positive | None = Field(
        default_factory=lambda data: (
            4.25 if EXCITATION_KINDS[data.get("kind", "sine")].has_one_frequency else None
        ),
        description="frequency of the vibration; null looks for it",
    )
    undersampled: Flag = Field(
        False,
        description="whether frequency_hz is so well known that it may exceed half of the frame "
        "rate",
    )
    amplitude_mm: Positive | None = Field(
        None, description="largest deflection that is expected, for the warnings before measuring"
    )
    sound: Literal["force", "room", "none"] = Field(
        "force",
        description="what the sound tracks carry: the force's signal, what microphones hear, or "
        "none that is needed, since the vibration is steady and the images tell its phase",
    )
    steady_interval_s: tuple[Real, Real] | None = Field(
        None,
        description="from when to when the vibration is steady, on the first camera's clock; "
        "null looks for it in the force's signal, or takes all after rest_duration_s",
    )
    rest_duration_s: Real = Field(
        1.0,
        ge=0,
        le=3600,
        description="time at rest at the start; 0 without sound if there is none",
    )
    force_per_full_scale_n: Positive | None = Field(
        None, description="force at the sound's full scale"
    )

    @property
    def behaviour(self) -> Behaviour:
        """Return the behaviour that follows from the kind."""
        return EXCITATION_KINDS[self.kind]

    @model_validator(mode="after")
    def _check(self) -> Excitation:
        one = self.behaviour.has_one_frequency
        if not one and self.frequency_hz is not None:
            self.refuse("frequency_hz", f"allowed where kind is {self.kind}: null")
        if not one and self.sound == "none":
            self.refuse("sound", 'allowed for several modes: "force" or "room"')
        if self.undersampled and self.frequency_hz is None:
            self.refuse("undersampled", "allowed with a given frequency_hz: true or false")
        if (
            self.steady_interval_s is not None
            and not 0 <= self.steady_interval_s[0] < self.steady_interval_s[1] <= 1e5
        ):
            self.refuse(
                "steady_interval_s", "allowed: [begin, end] in this order, from 0 to 100000, in s"
            )
        return self
