"""Scenarios of several vehicles: each entry with the top of the file is a scenario of its own."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import Field

from maneuver_automaton._brief import brief
from maneuver_automaton._files import stem_of
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.fleet import FleetProblem
from maneuver_automaton.formats.documents import errors_at
from maneuver_automaton.formats.statement import MapFile, Statement
from maneuver_automaton.formats.yaml_source import Document, Where, check_names
from maneuver_automaton.models import Model
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import simulation
from maneuver_automaton.scenario.parts import (
    Count,
    FilePart,
    Name,
    Need,
    NotNegative,
    Number,
    Positive,
    Several,
    Text,
    Truth,
    Whole,
    at,
    checked,
    optional,
)
from maneuver_automaton.scenario.scenario import (
    Made,
    Scenario,
    check_schema,
    combined,
    disturbance_of,
    own_scenario,
    scenario_of_document,
)
from maneuver_automaton.scenario.schema import (
    AutomatonPart,
    BoundsPart,
    Goals,
    HorizonPart,
    NoisePart,
    Obstacles,
    PricedCostPart,
    ScenarioFile,
    SearchPart,
    StartPart,
    Zones,
)
from maneuver_automaton.scenario.vehicles import VehiclePart

LOOP = "receding_horizon"
Kind = TypeVar("Kind", bound=FilePart)


AT_TOP = "left out: that of the top"


class FleetPart(FilePart):
    """How several vehicles are planned."""

    objective: Annotated[Literal["sum", "last"], Need("sum or last")] = Field(
        "sum", description="sum of the costs, or the last arrival"
    )
    between_m: NotNegative | None = optional("distance of any two; left out: the greatest margin_m")
    orders: Count = Field(8, description="orders of the vehicles that are tried")
    time_limit_s: Positive = Field(10.0, description="upper bound for planning them all")


class FleetNoisePart(NoisePart, title="FleetNoise"):
    """What vehicles of a fleet do beside their plans; random numbers come from the seed."""

    instead: ClassVar = {
        "delay_steps": "no such key: answers of a fleet are late by delay_steps of receding_horizon"
    }

    seed: Whole = Field(0, description="seed of the random numbers")


class FleetLoopPart(FilePart):
    """Closed loop of several vehicles, for mpc."""

    instead: ClassVar = {
        "retimed": "no such key: vehicles of a fleet drive at the pace that others know of",
        "stay": "no such key: who has arrived stays at its goal, or leaves",
    }

    step_s: Positive = Field(description="time between two steps")
    steps: Count | None = optional("largest number of steps; left out: 100")
    time_limit_s: Positive = Field(1.0, description="upper bound for all searches of a step")
    margin: NotNegative = Field(0.0, description="another plan must cost less by more than this")
    tube_m: NotNegative | None = optional(
        "how far a body may be beside its plan; left out: half of between_m"
    )
    swaps_per_step: Count | None = optional(
        "vehicles that look for another plan in a step; left out: all"
    )
    group_size: Count = Field(1, description="so many exchange their plans at once, at most")
    delay_steps: Whole = Field(0, description="how many steps late an answer comes")
    disturbance: FleetNoisePart | None = optional(
        "of every vehicle that states none: {position_m, heading_rad, seed, ...}"
    )


class VehicleLoopPart(FilePart):
    """What happens to one of several vehicles in closed loop, for mpc."""

    joins_s: Number | None = optional(
        "when it appears at its start, and joins as soon as there is room"
    )
    breaks_s: Number | None = optional(
        "when it breaks down: it stops as soon as it can, and stays there"
    )
    disturbance: FleetNoisePart | None = optional(AT_TOP)


class VehicleEntry(FilePart):
    """One of several vehicles: what it has of its own, and what differs from the top."""

    name: Name | None = optional("a name of its own; left out: its number, from 1")
    priority: Number = Field(0.0, description="the greater, the sooner it is planned")
    leaves: Truth = Field(False, description="true: it is gone once it has arrived")
    start_time_s: Number | None = optional("time at the start; until then it waits")
    vehicle: VehiclePart | None = optional(AT_TOP)
    automaton: AutomatonPart | None = optional(AT_TOP)
    start: StartPart = Field(description="a mapping {pose, ...}")
    goal: Goals = Field(description="a mapping {pose, ...}, or a list of these")
    cost: PricedCostPart | None = optional(AT_TOP)
    horizon: HorizonPart | None = optional(AT_TOP)
    bounds_m: BoundsPart | None = optional(AT_TOP)
    margin_m: NotNegative | None = optional(AT_TOP)
    obstacles: Obstacles | None = optional(AT_TOP)
    zones: Zones | None = optional(AT_TOP)
    search: SearchPart | None = optional(AT_TOP)
    receding_horizon: VehicleLoopPart | None = optional(
        "only for mpc: {joins_s, breaks_s, disturbance}"
    )


class FleetFile(FilePart):
    """Several vehicles that keep apart."""

    schema_version: Literal[1] = Field(alias="schema", description="1")
    name: Text | None = optional("what the situation is called")
    vehicle: VehiclePart | None = optional("of all that name none")
    automaton: AutomatonPart | None = optional("of all that name none")
    cost: PricedCostPart | None = optional("left out: {time: 1}")
    horizon: HorizonPart | None = optional("left out: any number of trims")
    bounds_m: BoundsPart | None = optional("left out: none")
    margin_m: NotNegative = Field(0.0, description="distance kept from everything")
    obstacles: Obstacles = Field((), description="what no vehicle must touch")
    zones: Zones = Field((), description="where not every motion is admitted")
    search: SearchPart | None = optional("how to search")
    vehicles: Annotated[
        tuple[VehicleEntry, ...], Several("a list of at least one vehicle", at_least=1)
    ] = Field(description="a list of {name, start, goal, ...}")
    fleet: FleetPart = Field(default_factory=FleetPart, description="how they are planned")
    receding_horizon: FleetLoopPart | None = optional("only for mpc")


SHARED = ("name", "vehicles", "fleet", "receding_horizon")  # keys of the top that no entry has
OWN = ("name", "priority", "leaves", "start_time_s", "receding_horizon")  # keys of an entry alone


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FleetScenario:
    """What a file of several vehicles describes: their problems, and how they are planned."""

    name: str
    fleet: FleetProblem
    vehicles: tuple[Scenario, ...]  # each alone, in the order of the file
    settings: FleetPart = field(default_factory=FleetPart)
    receding_horizon: FleetLoopPart | None = None
    loops: Mapping[str, VehicleLoopPart] = field(default_factory=dict)  # of those that state more
    maps: tuple[MapFile, ...] = ()  # files of the maps among the obstacles of any
    path: Path | None = None
    timing_s: Mapping[str, float] = field(default_factory=dict)  # load, automaton [s]

    __repr__ = brief

    @property
    def time_limit_s(self) -> float:
        """Upper bound for planning them all [s]."""
        return self.settings.time_limit_s

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Those of all vehicles."""
        return self.fleet.problems

    @property
    def joins_s(self) -> dict[str, float]:
        """When those that join in closed loop appear, by name [s]."""
        return {name: one.joins_s for name, one in self.loops.items() if one.joins_s is not None}

    @property
    def breaks_s(self) -> dict[str, float]:
        """When those that break down in closed loop do, by name [s]."""
        return {name: one.breaks_s for name, one in self.loops.items() if one.breaks_s is not None}

    @property
    def disturbances(self) -> dict[str, simulation.Disturbance]:
        """What disturbs each vehicle in closed loop, by name; their own, or else that of the top.

        The seed of the top is that of the loop: each vehicle has numbers of its own.
        """
        top = self.receding_horizon and self.receding_horizon.disturbance
        found = {}
        for name in self.fleet.names:
            its = self.loops[name].disturbance if name in self.loops else None
            if its is not None:
                found[name] = disturbance_of(its)
            elif top:
                found[name] = disturbance_of(top, seed=0)
        return found


def fleet_of_document(
    document: Document, *, path: Path | None, begin: float, own: Model | None = None
) -> FleetScenario:
    """The scenario of a YAML file of several vehicles that was read since `begin` [s]."""
    check_schema(document)
    for key in ("start", "goal"):
        if key in document.value:
            raise document.error((key,), "stands beside vehicles, need it in each of them instead")
    file = checked(document, FleetFile, {"one_is": own and own.name})
    shared: Made = {}
    alone = [
        scenario_of_document(
            _entry(document, k, one),
            path=path,
            begin=begin,
            own=own
            if own and own.name == getattr(one.vehicle or file.vehicle, "model", "")
            else None,
            shared=shared,
        )
        for k, one in enumerate(file.vehicles)
    ]
    names = [one.name or str(k + 1) for k, one in enumerate(file.vehicles)]
    check_names(document, "vehicles", names)
    for k, one in enumerate(alone):
        fixed = one.problem.horizon.time
        if fixed is not None:
            raise _entry(document, k, file.vehicles[k]).error(
                ("horizon", "time_s"),
                f"got {fixed:g}, need free: vehicles that give way arrive later",
            )
    making = sum(one.timing_s["automaton"] for one in alone)
    with at(document, ("vehicles",)):
        fleet = FleetProblem(
            [one.problem for one in alone],
            names=names,
            margin=_between(file.fleet, alone),
            leaves=[one.leaves for one in file.vehicles],
            priority=[one.priority for one in file.vehicles],
        )
    loops = {
        name: one.receding_horizon
        for name, one in zip(names, file.vehicles, strict=True)
        if one.receding_horizon is not None
    }
    _check_loop(document, file, fleet)
    return FleetScenario(
        name=(stem_of(path) if path else document.name) if file.name is None else file.name,
        fleet=fleet,
        vehicles=tuple(replace(one, name=name) for one, name in zip(alone, names, strict=True)),
        settings=file.fleet,
        receding_horizon=file.receding_horizon,
        loops=loops,
        maps=_maps(alone),
        path=path,
        timing_s={"load": time.perf_counter() - begin - making, "automaton": making},
    )


def fleet_of_statement(
    statement: Statement,
    beside: Scenario | None,
    *,
    path: Path,
    settings: FleetPart | None = None,
    loop: FleetLoopPart | None = None,
) -> FleetScenario:
    """The fleet that a file `path` of another format states, with the scenario `beside` it."""
    part = settings or FleetPart()
    kinds: dict[int, tuple[Scenario, Automaton]] = {}  # by the vehicle that the file names
    alone = []
    for one in statement.fleet:
        rest, automaton = kinds.get(id(one.vehicle)) or (beside or own_scenario(one, path), None)
        its = combined(one, rest, path=path)
        if automaton is not None:  # an equal one, made again
            its = replace(its, problem=replace(its.problem, automaton=automaton))
        kinds[id(one.vehicle)] = (rest, its.problem.automaton)
        alone.append(its)
    with errors_at(path):
        fleet = FleetProblem(
            [one.problem for one in alone],
            names=[one.name for one in alone],
            margin=_between(part, alone),
        )
    return FleetScenario(
        name=statement.name,
        fleet=fleet,
        vehicles=tuple(alone),
        settings=part,
        receding_horizon=loop,
        maps=_maps(alone),
        path=path,
    )


def without_fleet(document: Document) -> tuple[Document, FleetPart, FleetLoopPart | None]:
    """A scenario beside a fleet, and what it says of how to plan one and to close its loop."""
    whole = document.value
    if not isinstance(whole, dict):
        return document, FleetPart(), None

    def part(key: str, kind: type[Kind]) -> Kind | None:
        if key not in whole:
            return None
        return checked(replace(document, value=whole[key], homes={(): (key,)}), kind)

    rest = {key: value for key, value in whole.items() if key not in ("fleet", LOOP)}
    settings = part("fleet", FleetPart) or FleetPart()
    return replace(document, value=rest), settings, part(LOOP, FleetLoopPart)


def _check_loop(document: Document, file: FleetFile, fleet: FleetProblem) -> None:
    """Raise where the loop of a file does not suit its vehicles."""
    loop = file.receding_horizon
    for k, one in enumerate(file.vehicles):
        if one.receding_horizon is not None and loop is None:
            raise document.error(
                ("vehicles", k, LOOP),
                "stands alone, need receding_horizon: {step_s: ...} at the top",
            )
    if loop is None:
        return
    most = 0.5 * fleet.margin
    if loop.tube_m is not None and loop.tube_m > most:
        raise document.error(
            (LOOP, "tube_m"),
            f"got {loop.tube_m:g}, need at most {most:g}, half of between_m: two bodies may both "
            "be beside their plans",
        )
    if loop.group_size > 1 and loop.delay_steps:
        raise document.error(
            (LOOP, "group_size"),
            f"got {loop.group_size}, need 1 where answers are late (delay_steps): those of several "
            "would have to come at once",
        )
    for k, (one, problem) in enumerate(zip(file.vehicles, fleet.problems, strict=True)):
        own = None if one.receding_horizon is None else one.receding_horizon.disturbance
        noise = loop.disturbance if own is None else own
        if noise is not None:
            where: Where = (LOOP, "disturbance")
            where = where if own is None else ("vehicles", k, *where)
            with at(document, where):
                simulation.checked(disturbance_of(noise), problem.start.size)
                if noise.twist_scale is not None and problem.has_inertia:
                    raise ValueError(
                        f"twist_scale: got {list(noise.twist_scale)}, need no such key for a "
                        "vehicle with inertia: a maneuver is driven as its model says"
                    )


def _maps(alone: Sequence[Scenario]) -> tuple[MapFile, ...]:
    return tuple({id(file): file for one in alone for file in one.maps}.values())


def _between(settings: FleetPart, alone: Sequence[Scenario]) -> float:
    if settings.between_m is not None:
        return settings.between_m
    return max(one.problem.margin for one in alone)


def _entry(document: Document, k: int, entry: VehicleEntry) -> Document:
    """What an entry and the top of the file state together, as a file of one vehicle."""
    where: Where = ("vehicles", k)
    top = {key: value for key, value in document.value.items() if key not in SHARED}
    its = {key: value for key, value in document.value["vehicles"][k].items() if key not in OWN}
    homes: dict[Where, Where] = {(key,): (*where, key) for key in its} | {(): where}
    homes |= {(key,): (key,) for key in top if key not in its}
    value: dict[str, Any] = top | its
    for key in ("vehicle", "automaton"):
        if key not in value:
            need = ScenarioFile.model_fields[key].description
            raise document.error(
                where, f"the key {key!r} is missing here and at the top, need {key}: {need}"
            )
    if entry.start_time_s is not None:
        if "time_s" in value["start"]:
            raise document.error(
                (*where, "start_time_s"), "the start has a time_s too, need one of them"
            )
        value["start"] = {**value["start"], "time_s": entry.start_time_s}
        homes["start", "time_s"] = (*where, "start_time_s")
    return replace(document, value=value, homes=homes)
