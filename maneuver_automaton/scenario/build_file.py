"""The build file: a vehicle, a grid of trims and how to join them; a library comes of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge
from pydantic import AllowInfNan, BeforeValidator, Field, Strict

from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.building import (
    LibraryBuild,
    Pair,
    all_pairs,
    build_library,
    nearest_pairs,
    neighbour_pairs,
)
from maneuver_automaton.automaton.library import model_of as model_of_entry
from maneuver_automaton.automaton.library import save_library
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import Document, parse
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control.maneuvers import ManeuverObjective, TransferSettings
from maneuver_automaton.primitives.closed_form import has_limited_rates
from maneuver_automaton.primitives.equilibrium import MissingTrim, trims_of
from maneuver_automaton.primitives.primitive import Trim
from maneuver_automaton.scenario.automata import MAX_STEADY_TRIMS
from maneuver_automaton.scenario.parts import (
    Count,
    FilePart,
    Name,
    Need,
    NotNegative,
    Number,
    Pose2D,
    Positive,
    Several,
    Text,
    Truth,
    at,
    checked,
    exactly,
    holding,
    made,
    need,
    optional,
)
from maneuver_automaton.scenario.schema import CostPart
from maneuver_automaton.scenario.vehicles import VehiclePart, model_of

BUILD_KEY = "library"  # what only a build file has
PAIRS = "all, neighbours, or a whole number of the nearest trims"


def _grid(value: Any) -> Any:
    good = isinstance(value, dict) and value and all(isinstance(v, list) for v in value.values())
    if not good:
        raise need("a mapping of names to lists of values, such as {speed: [0, 1], ...}")
    return value


Mapped = Annotated[
    dict[str, Any], Need("a mapping with the key kind, and the parameters of this kind")
]
_Once = holding(
    lambda values: len(set(values)) == len(values), "a list of numbers, each of them once"
)
Grid = Annotated[
    dict[str, Annotated[tuple[Number, ...], Several("a list of numbers", at_least=1), _Once]],
    BeforeValidator(_grid),
]
Numbers = Annotated[tuple[Number, ...], Several("a list of numbers"), _Once]


class JoiningPart(FilePart):
    """How trims are joined: at once where rates are limited, else by optimal control."""

    pairs: Annotated[
        Literal["all", "neighbours"] | Annotated[int, Strict(), Ge(1)], Need(PAIRS)
    ] = Field("all", description=PAIRS)
    late: Truth = Field(False, description="limited rates: also maneuvers that wait first")
    strokes_m: Numbers = Field((), description="limited rates: lengths from rest to rest")
    turns_rad: Numbers = Field((), description="limited rates: turns on the spot")
    time: NotNegative = Field(1.0, description="optimal control: price of a second")
    effort: NotNegative = Field(
        0.0, description="optimal control: price of a second of full control, squared"
    )
    smoothness: NotNegative = Field(1e-3, description="optimal control: price of changing it")
    intervals: Count = Field(20, description="optimal control: intervals of constant control")
    steps: Count = Field(2, description="optimal control: steps of integration in each")
    max_duration_s: Annotated[float, Strict(), AllowInfNan(False), Ge(0.1)] = Field(
        60.0, description="optimal control: longest maneuver"
    )
    keep_sign: Annotated[tuple[Name, ...], Several("a list of controls")] = Field(
        (), description="optimal control: controls that stay on one side of zero"
    )


Factor = Annotated[float, Strict(), AllowInfNan(False), Ge(1), Need("a factor of at least 1")]
_Task = Annotated[tuple[Pose2D, Pose2D], exactly(2, "a task [start, goal], two poses")]


class DesignPart(FilePart):
    """How the trims of a library are chosen from the candidates; see `design_library`."""

    cost: CostPart = Field(
        default_factory=lambda: CostPart(length=1.0), description="as in a scenario; its length"
    )
    within: Factor = Field(1.05, description="how much costlier words may be than all candidates'")
    most: Count = Field(24, description="trims that the library may have")
    max_trims: Count | None = optional("of a word, at least 3; left out: any number")
    radius_m: Positive | None = optional("of the disc of goals; with max_trims")
    tasks: (
        Annotated[tuple[_Task, ...], Several("a list of tasks [start, goal]", at_least=1)] | None
    ) = optional("starts and goals that are to be among them")
    least_m: Positive | None = optional("goals whose shortest path is shorter do not count")
    tolerance: Positive = Field(0.01, description="between what is proven and what is met")


class LibraryFile(FilePart):
    """A library to be built: vehicle, trims, maneuvers."""

    one_of: ClassVar = ("vehicle", "model")

    schema_version: Literal[1] = Field(alias="schema", description="1")
    library: Text = Field(description="what the library is called")
    vehicle: VehiclePart | None = optional("as in a scenario: {model, ...}")
    model: Mapped | None = optional("as in a library file: {kind, ...}, SI units")
    trims: Grid = Field(description="a grid of trims, a mapping of names to lists of values")
    max_lateral_acceleration_m_s2: Positive | None = optional(
        "what the tyres hold; left out: no limit"
    )
    maneuvers: JoiningPart = Field(
        default_factory=lambda: JoiningPart(), description="how trims are joined"
    )
    design: DesignPart | None = optional("how trims are chosen by automaton design")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BuildFile:
    """What a build file asks for; trims that the vehicle does not have are left out, and named."""

    file: LibraryFile
    model: Model
    trims: tuple[Trim, ...]
    missing: tuple[MissingTrim, ...]

    __repr__ = brief

    @property
    def at_once(self) -> bool:
        """Whether the maneuvers come in closed form, without a solver and in no time."""
        part = self.file.maneuvers
        closed = has_limited_rates(self.model) and part.effort == 0.0
        return closed and not isinstance(part.pairs, int)

    def pairs(self) -> list[Pair]:
        """Trims to join by optimal control; none where maneuvers come at once."""
        if self.at_once or not self.model.reduced_names:
            return []
        nodes, part = Automaton(self.model, self.trims), self.file.maneuvers
        if isinstance(part.pairs, int):
            return nearest_pairs(nodes, part.pairs, keep_sign=part.keep_sign)
        chosen = neighbour_pairs if part.pairs == "neighbours" else all_pairs
        return chosen(nodes, keep_sign=part.keep_sign)


def is_build_file(path: Path) -> bool:
    """Whether a YAML file is a build file and no scenario."""
    if path.suffix not in (".yaml", ".yml"):
        return False
    value = parse(read_text(path), name=str(path)).value
    return isinstance(value, dict) and BUILD_KEY in value


def load_build_file(path: Path | str) -> BuildFile:
    """Vehicle and trims of a build file."""
    return build_file_of_text(read_text(Path(path)), name=str(path))


def build_file_of_text(text: str, *, name: str) -> BuildFile:
    """What the text of a build file asks for; see `load_build_file`."""
    document = parse(text, name=name, what="a build file")
    file = checked(document, LibraryFile)
    if file.vehicle is not None:
        with at(document, ("vehicle",)):
            model = model_of(file.vehicle)
    else:
        with at(document, ("model",)):
            model = model_of_entry(file.model, own=None)
    count = math.prod(len(values) for values in file.trims.values())
    if count > MAX_STEADY_TRIMS:
        raise document.error(("trims",), f"got {count:g} trims, need at most {MAX_STEADY_TRIMS}")
    with at(document, ("trims",)):
        found = trims_of(
            model, file.trims, max_lateral_acceleration=file.max_lateral_acceleration_m_s2
        )
    if not found.trims:
        reason = found.missing[0].reason
        raise document.error(("trims",), f"the {model.name} has none of these trims: {reason}")
    trims = _at_rest_once(found.trims)
    asked = BuildFile(file=file, model=model, trims=trims, missing=found.missing)
    _check_maneuvers(document, asked)
    return asked


def _at_rest_once(trims: tuple[Trim, ...]) -> tuple[Trim, ...]:
    """The trims; of those at rest in one reduced state the one with the least control."""
    best: dict[bytes, Trim] = {}
    for trim in trims:
        if trim.is_rest:
            here = best.setdefault(trim.reduced_state.tobytes(), trim)
            if np.abs(trim.control).sum() < np.abs(here.control).sum():
                best[trim.reduced_state.tobytes()] = trim
    return tuple(t for t in trims if not t.is_rest or t is best[t.reduced_state.tobytes()])


def build(
    asked: BuildFile,
    path: Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Automaton, LibraryBuild | None]:
    """The library of a build file, written to `path`, and how it was built if not at once."""
    file, part = asked.file, asked.file.maneuvers
    if asked.at_once or not asked.model.reduced_names:
        automaton = Automaton.of_model(
            asked.model,
            file.trims,
            pairs="neighbours" if part.pairs == "neighbours" else "all",
            late=part.late,
            strokes=part.strokes_m,
            turns=part.turns_rad,
            max_lateral_acceleration=file.max_lateral_acceleration_m_s2,
            leave_out=True,
        )
        automaton = replace(automaton, name=file.library)
        save_library(automaton, path)
        return automaton, None
    done = build_library(
        asked.model,
        asked.trims,
        pairs=asked.pairs(),
        objective=made(ManeuverObjective, part),
        settings=TransferSettings(
            intervals=part.intervals, steps=part.steps, duration=(0.02, part.max_duration_s)
        ),
        keep_sign=part.keep_sign,
        jobs=jobs,
        scheduler=scheduler,
        path=path,
        name=file.library,
        progress=progress,
    )
    return done.automaton, done


def _check_maneuvers(document: Document, asked: BuildFile) -> None:
    """Refuse keys that belong to the other method of joining trims."""
    part, given = asked.file.maneuvers, asked.file.maneuvers.model_fields_set
    if not asked.at_once:
        for key in ("late", "strokes_m", "turns_rad"):
            if key in given:
                raise document.error(
                    ("maneuvers", key),
                    f"is for vehicles whose control is the rate of the reduced state, at no price "
                    f"of effort, not for this {asked.model.name}",
                )
        with at(document, ("maneuvers",)):
            made(ManeuverObjective, part)
    for control in part.keep_sign:
        if control not in asked.model.control_names:
            raise document.error(
                ("maneuvers", "keep_sign"),
                f"the {asked.model.name} has no control {control!r}, need some of "
                f"{', '.join(asked.model.control_names)}",
            )
