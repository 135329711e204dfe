"""Options of `plan` and `mpc`, and which of them a kind of job does not know."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from maneuver_automaton.cli.inputs import Parts
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.plotting.look import Look, size_of


@dataclass(frozen=True, slots=True, kw_only=True)
class LookOptions:
    """What the command line says of pictures."""

    title: str | None = None  # None: the name of the scenario, and none in a paper
    size: str | None = None  # WIDTH or WIDTHxHEIGHT [in]
    style: str = "screen"

    def __post_init__(self) -> None:
        if self.is_stated:
            self.look()  # Matplotlib is needed anyway, and a wrong size is told before planning

    @property
    def is_stated(self) -> bool:
        """Whether pictures are to have another size or style than they have of themselves."""
        return self.size is not None or self.style != "screen"

    def look(self, name: str = "") -> Look:
        """The look of a picture of the scenario `name`; raises InvalidScenario."""
        title = self.title if self.title is not None else name
        if self.title is None and self.style == "paper":
            title = ""  # the caption has it
        try:
            size = None if self.size is None else size_of(self.size)
            return Look(title=title, size=size, style=self.style)
        except ValueError as error:
            raise InvalidScenario(f"--{error}") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Budgets:
    """How long, how well and how often is searched."""

    time_limit: float | None = None  # [s] of a plan or a step; None: that of the scenario
    gap: float | None = None  # share of the cost, None: nothing is proven beside the search
    alternatives: int = 0
    steps: int | None = None  # of a loop; None: those of the scenario

    def __post_init__(self) -> None:
        if self.time_limit is not None and not 0.0 < self.time_limit < math.inf:
            raise InvalidScenario(
                f"--time-limit: got {self.time_limit}, need a positive number of seconds"
            )
        if self.gap is not None and not 0.0 <= self.gap < 1.0:
            raise InvalidScenario(
                f"--gap: got {self.gap}, need a share of the cost from 0 to below 1, such as 0.05"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of `plan` and `mpc`, the same for every file of a folder."""

    budgets: Budgets = field(default_factory=Budgets)
    plot: bool = True
    animate: bool = False
    html: bool = False
    look: LookOptions = field(default_factory=LookOptions)
    quiet: bool = False
    leave: bool = False  # a start in contact is left first
    seed: int | None = None
    seeds: int | None = None  # how many seeds in a row, for statistics
    resume: Path | None = None
    jobs: int = 1  # processes: for the files of a folder, for seeds, or for one fleet
    scheduler: str | None = None  # of Dask, for the same


ONE = "is for one vehicle, but {path} states several; leave it out"
NO_ROADS = "drives on roads have no such option; leave it out"
NO_MODEL = "is for scenarios and libraries, not for drives on roads"
OF_SEVERAL = "is not for several vehicles on roads; leave it out, or pick one with --case"
LEAVE = "is for one vehicle off the road, but {path} is no such; omit it"
DASK = "{path} is planned in one process, need a folder, or several vehicles"
UNKNOWN: Mapping[tuple[str, str], Mapping[str, str]] = {  # options that a kind of job refuses
    ("plan", "one"): {"--dask": DASK},
    ("plan", "fleet"): {"--leave": LEAVE, "--alternatives": ONE, "--gap": ONE},
    ("plan", "road"): {"--leave": LEAVE, "--dask": DASK, "--model": NO_MODEL},
    ("plan", "roads"): {"--leave": LEAVE, "--dask": DASK, "--model": OF_SEVERAL},
    ("mpc", "one"): {},
    ("mpc", "fleet"): {"--seeds": ONE, "--gap": ONE},
    ("mpc", "road"): {"--seeds": NO_ROADS, "--resume": NO_ROADS, "--model": NO_MODEL},
    ("mpc", "roads"): {"--model": OF_SEVERAL, "--seeds": OF_SEVERAL, "--resume": OF_SEVERAL},
}


def refuse_unknown(path: Path, command: str, kind: str, options: Options, parts: Parts) -> None:
    """Raise where an option is given that a kind of job does not know."""
    given = {
        "--dask": options.scheduler is not None,
        "--leave": options.leave,
        "--alternatives": options.budgets.alternatives > 0,
        "--gap": options.budgets.gap is not None,
        "--seeds": options.seeds is not None,
        "--resume": options.resume is not None,
        "--model": parts.model is not None,
    }
    for option, said in UNKNOWN[command, kind].items():
        if given[option]:
            raise InvalidScenario(f"{option}: {said.format(path=path)}")
    if given["--seeds"] and given["--resume"]:
        raise InvalidScenario("--resume: goes on with one loop, and --seeds runs many; need one")
