"""The parameters of chapter 5: the laboratory, and what is studied on its recordings."""

from __future__ import annotations

from itertools import combinations
from typing import Annotated, Literal

from pydantic import Field

from thesis_lib.facts import setups
from thesis_lib.facts.setups import Setting
from thesis_lib.laboratory.filming import Repeated
from thesis_lib.laboratory.parameters import NAMES, Rig
from thesis_lib.studies.request import Study
from thesis_lib.studies.vocabulary import NoiseSeed, Runs, Several, Width, field

TRIED_PX = 320  # the thesis tried this width, and gave it up
METHODS = ("matched", "literal", "aligned", "harmonic")
Way = tuple[str, str, int]  # method, cameras, width in px
Method = Literal["matched", "literal", "aligned", "harmonic"]
ReducedWidth = Annotated[int, Field(ge=160, le=1920)]


class Laboratory(Rig, Study):
    """One set of recordings, measured once for all studies that use it."""

    name = "laboratory"
    title = "Experiment: the recordings"
    subject = "experiment"
    section = "section 5.2"
    study = "laboratory"
    varied = "width_px"
    varied_label = "resolution"

    widths_px: list[Width]


def ways(request: Laboratory) -> list[Way]:
    """All ways in which a recording is measured: method, cameras, width."""
    widths = [width for width in request.widths_px if width != TRIED_PX]
    every = ["".join(names) for n in (2, 3, 4) for names in combinations(NAMES, n)]
    growing = [NAMES[:n] for n in (2, 3, 4)]
    found = [(method, NAMES, width) for method in METHODS for width in widths]
    for method in METHODS:
        sets = every if method in ("literal", "harmonic") else growing
        found += [(method, names, width) for names in sets for width in widths[-1:]]
    return list(dict.fromkeys(found))


class Experiment(Repeated, Rig, Study):
    """Parameters that the studies of chapter 5 share."""

    subject = "experiment"
    section = "section 5.2"
    first = "the chain's result"
    predicts = "noise of the centres"
    draws = "starts, clocks and noise"

    trials: Runs = field(200, "further runs, with centre noise, clocks and starts drawn at random")
    seed: NoiseSeed = 0

    @property
    def recordings(self) -> Laboratory:
        """What has to be rendered and followed."""
        raise NotImplementedError

    @property
    def others(self) -> Laboratory:
        """What is rendered again."""
        return self.recordings

    @property
    def modes(self) -> list[int]:
        """The one mode that chapter 5 measures."""
        return [1]

    def laboratory(self, widths_px: list[int]) -> Laboratory:
        """The recordings that the study needs, followed at all of these widths."""
        printed = setups.table("experiment", "resolution")["widths_px"]
        widths = sorted({TRIED_PX, *printed, *widths_px})
        fields = {name: getattr(self, name) for name in Rig.model_fields}
        return Laboratory(**fields, seed=self.seed, trials=0, widths_px=widths)

    def _setting(self, case: str, value: float, label: str, names: str, width: int) -> Setting:
        directions = tuple(self.directions_deg[name] for name in names)
        size = (width, round(width * 9 / 16))
        return Setting(case, value, label, self.distance_mm, directions, size)


class ExperimentResolution(Experiment):
    """All four cameras with growing resolution (section 5.2.1)."""

    name = "experiment-resolution"
    title = "Experiment: resolution of the cameras"
    study = "resolution"
    varied = "width_px"
    varied_label = "resolution"

    cases: Several[Method] = field(lambda: list(METHODS), "cases to run")
    widths_px: Several[ReducedWidth] = field(
        setups.table("experiment", "resolution")["widths_px"],
        "widths of the reduced frames; heights are 9/16 of them",
    )

    def settings(self) -> list[Setting]:
        """One setting per method and width."""
        return [
            self._setting(case, width, f"{width}×{round(width * 9 / 16)}", NAMES, width)
            for case in self.cases
            for width in self.widths_px
        ]

    @property
    def recordings(self) -> Laboratory:
        """What has to be rendered and followed."""
        return self.laboratory(self.widths_px)


class ExperimentCameras(Experiment):
    """Two to four cameras (section 5.2.2), and all sets of them (section 5.3)."""

    name = "experiment-cameras"
    title = "Experiment: number of cameras"
    study = "cameras"
    varied = "n_cameras"
    varied_label = "cameras"

    cases: Several[Method | Literal["literal-all", "harmonic-all"]] = field(
        lambda: [*METHODS, "literal-all", "harmonic-all"],
        "cases to run",
        "a list of different ones of matched, literal, aligned, harmonic, literal-all, "
        "harmonic-all",
    )
    width_px: ReducedWidth = field(
        setups.table("experiment", "cameras")["width_px"],
        "width of the frames; the height is 9/16 of it",
    )

    def settings(self) -> list[Setting]:
        """A–B, A–B–C, A–B–C–D, or all eleven sets, for each method."""
        every = ["".join(names) for n in (2, 3, 4) for names in combinations(NAMES, n)]
        growing = [NAMES[:n] for n in (2, 3, 4)]
        return [
            self._setting(case, len(names), "–".join(names), names, self.width_px)
            for case in self.cases
            for names in (every if case.endswith("-all") else growing)
        ]

    @property
    def recordings(self) -> Laboratory:
        """What has to be rendered and followed."""
        return self.laboratory([self.width_px])

    @property
    def others(self) -> Laboratory:
        """What is rendered again: all sets of cameras are at the largest width."""
        whole = self.recordings
        if self.width_px == max(whole.widths_px):
            return whole
        return whole.model_copy(update={"widths_px": [self.width_px]})


def method_of(case: str) -> str:
    """The method of a case: matched, literal, aligned or harmonic.

    Examples
    --------
    >>> method_of("harmonic-all")
    'harmonic'
    """
    return case.removesuffix("-all")
