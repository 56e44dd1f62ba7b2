"""What a manifest says of how the structure is driven, and of a force that was recorded."""

from __future__ import annotations

from pathlib import PurePath
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.arrays import Array
from thesis_lib.measure.recordings.radiation_fields import Place
from thesis_lib.measure.recordings.sought import Sought
from thesis_lib.studies.refusals import Refusing, permitted, refuse
from thesis_lib.studies.vocabulary import Positive, field

FORCED = ("decay", "sweep", "random")
"""Kinds of excitation that a recorded force goes with; without one, the first alone is allowed."""

TABLES = frozenset([".csv", ".txt", ".tsv", ".tab", ".dat", ".asc", ".lvm"])
"""Endings of files that are read as a table of a force."""

FileName = Annotated[str, Field(min_length=1, max_length=500)]
Channel = Annotated[int, Field(ge=1, le=64)]


class Sweep(Refusing):
    """A force whose frequency goes from one to another."""

    from_hz: Positive | None = field(None, "frequency at its begin; null looks in the force")
    to_hz: Positive | None = field(
        None,
        "frequency at its end; null looks in the force",
        "null, or a number above 0 that is not from_hz, at most 100000",
    )
    duration_s: Positive | None = field(None, "how long it takes; null looks in the force")

    @model_validator(mode="after")
    def _check(self) -> Sweep:
        if self.to_hz is not None and self.to_hz == self.from_hz:
            self.refuse("to_hz")
        return self


class Force(Refusing):
    """A force, and where it acts."""

    file: FileName = field(
        ...,
        "its recording: a sound file, a video whose sound track carries it, or a table (.csv, "
        ".txt, .tsv, .dat, .lvm) of time and force",
        "a path inside the manifest's folder",
    )
    full_scale_n: Positive | None = field(
        None,
        "force in N at full scale of a sound file",
        "a number above 0, at most 100000; null with a table",
    )
    channel: Channel = field(1, "which channel of a sound file carries it")
    sound_channel: Channel | None = field(
        None,
        "which channel has a sound that the first camera recorded, too, by which the clocks are "
        "compared; null takes that of the force",
        "null, or a whole number from 1 to 64",
    )
    offset_s: Annotated[float, Field(ge=-1e5, le=1e5)] | None = field(
        None,
        "when the file begins on the first camera's clock; null finds it by sound",
        "null, or a number from -100000 to 100000; a number with a table",
    )
    at_mm: Place | None = field(
        None,
        "where it acts, from the clamped corner; null is the structure's force_position_mm and "
        "force_across_mm",
        "null, or [x, y] on the structure",
    )
    segment_s: Positive | Literal["whole"] | None = field(
        None,
        "length of the parts that are averaged; whole is for what begins and ends at rest; null "
        "takes whole for a decay or a sweep, and an eighth of the recording for random",
        'null, "whole", or a number above 0, at most 100000',
    )

    @property
    def is_table(self) -> bool:
        """Whether it is in N already."""
        return PurePath(self.file).suffix.lower() in TABLES

    def place(self, usual: Array) -> Array:
        """Where it acts in m, shape (2,); `usual` if it is not given."""
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
            self._refuse("at_mm")

    def _refuse(self, name: str, why: str = "") -> None:
        refuse(f"force.{name}", getattr(self, name), why or permitted(type(self), name))


class Excitation(Refusing):
    """How the structure is driven, and what the sound tracks carry."""

    kind: Literal["tone", "tones", "decay", "sweep", "random"] = field(
        "tone",
        "what is filmed after rest_s: a steady tone, several, the free decay after a tap or a "
        "release, or what a force does that sweeps through frequencies or is noise",
    )
    modes: Sought = field(Sought, "which modes, where kind is tones or decay", "an object")
    sweep: Sweep = field(Sweep, "the sweep, where kind is sweep", "an object")
    frequency_hz: Positive | None = field(
        lambda data: 4.25 if data.get("kind", "tone") == "tone" else None,
        "frequency of the vibration; null looks for it",
        "a number above 0, or null; null where kind is not tone",
    )
    undersampled: bool = field(
        False,
        "whether frequency_hz is so well known that it may exceed half of the frame rate",
    )
    amplitude_mm: Positive | None = field(
        None, "largest deflection that is expected, for the warnings before measuring"
    )
    sound: Literal["force", "room", "none"] = field(
        "force",
        "what the sound tracks carry: the force's signal, what microphones hear, or none that is "
        "needed, since the vibration is steady and the pictures tell its phase",
    )
    steady_s: tuple[float, float] | None = field(
        None,
        "from when to when the vibration is steady, on the first camera's clock; null looks for it "
        "in the force's signal, or takes all after rest_s",
        "null, or [begin, end] in this order, from 0 to 100000",
    )
    rest_s: float = field(
        1.0, "time at rest at the start; 0 without sound if there is none", ge=0, le=3600
    )
    force_per_full_scale_n: Positive | None = field(None, "force at the sound's full scale")

    @model_validator(mode="after")
    def _check(self) -> Excitation:
        if self.kind != "tone" and self.frequency_hz is not None:
            self.refuse("frequency_hz")
        if self.kind != "tone" and self.sound == "none":
            self.refuse("sound", 'allowed for several modes: "force" or "room"')
        if self.undersampled and self.frequency_hz is None:
            self.refuse("undersampled", "allowed with a given frequency_hz: true or false")
        if self.steady_s is not None and not 0 <= self.steady_s[0] < self.steady_s[1] <= 1e5:
            self.refuse("steady_s")
        return self
