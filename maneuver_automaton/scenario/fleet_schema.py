"""The scenario file of several vehicles as values: what stands at the top, and what in an entry.

An entry states what a file of one vehicle does, and leaves out what stands at the top. What an
entry is together with the top is checked as a file of one vehicle; here, what stands where.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, Strict

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
    Whole,
    optional,
)
from maneuver_automaton.scenario.schema import (
    AutomatonPart,
    BoundsPart,
    CostPart,
    Goals,
    HorizonPart,
    NoisePart,
    Obstacles,
    SearchPart,
    StartPart,
    Zones,
)
from maneuver_automaton.scenario.vehicles import VehiclePart

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
    leaves: Annotated[bool, Strict(), Need("true or false")] = Field(
        False, description="true: it is gone once it has arrived"
    )
    start_time_s: Number | None = optional("time at the start; until then it waits")
    vehicle: VehiclePart | None = optional(AT_TOP)
    automaton: AutomatonPart | None = optional(AT_TOP)
    start: StartPart = Field(description="a mapping {pose, ...}")
    goal: Goals = Field(description="a mapping {pose, ...}, or a list of these")
    cost: CostPart | None = optional(AT_TOP)
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
    cost: CostPart | None = optional("left out: {time: 1}")
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
