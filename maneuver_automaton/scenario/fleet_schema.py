"""The scenario file of several vehicles as values: what stands at the top, and what in an entry.

An entry states what a file of one vehicle does, and leaves out what stands at the top. What an
entry is together with the top is checked as a file of one vehicle; here, what stands where.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict

from maneuver_automaton.scenario.checks import (
    Count,
    Name,
    Need,
    NotNegative,
    Number,
    Part,
    Positive,
    Several,
    Text,
)
from maneuver_automaton.scenario.schema import (
    AutomatonPart,
    BoundsPart,
    CostPart,
    Goals,
    HorizonPart,
    Obstacle,
    RecedingHorizonPart,
    SearchPart,
    Start,
    ZonePart,
)
from maneuver_automaton.scenario.vehicle_parts import VehiclePart

AT_TOP = "left out: that of the top"
Obstacles = Annotated[tuple[Obstacle, ...], Several("a list of obstacles", at_least=0)]
Zones = Annotated[tuple[ZonePart, ...], Several("a list of zones", at_least=0)]


class FleetPart(Part):
    """How several vehicles are planned."""

    objective: Annotated[Literal["sum", "last"], Need("sum or last")] = Field(
        "sum", description="sum of the costs, or the last arrival"
    )
    between_m: NotNegative | None = Field(
        None, description="distance of any two; left out: the greatest margin_m"
    )
    orders: Count = Field(8, description="orders of the vehicles that are tried")
    time_limit_s: Positive = Field(10.0, description="upper bound for planning them all")


class VehicleEntry(Part):
    """One of several vehicles: what it has of its own, and what differs from the top."""

    name: Name | None = Field(None, description="a name of its own; left out: its number, from 1")
    priority: Number = Field(0.0, description="the greater, the sooner it is planned")
    leaves: Annotated[bool, Strict(), Need("true or false")] = Field(
        False, description="true: it is gone once it has arrived"
    )
    start_time_s: Number | None = Field(None, description="time at the start; until then it waits")
    vehicle: VehiclePart | None = Field(None, description=AT_TOP)
    automaton: AutomatonPart | None = Field(None, description=AT_TOP)
    start: Start = Field(description="a mapping {pose, ...}")
    goal: Goals = Field(description="a mapping {pose, ...}, or a list of these")
    cost: CostPart | None = Field(None, description=AT_TOP)
    horizon: HorizonPart | None = Field(None, description=AT_TOP)
    bounds_m: BoundsPart | None = Field(None, description=AT_TOP)
    margin_m: NotNegative | None = Field(None, description=AT_TOP)
    obstacles: Obstacles | None = Field(None, description=AT_TOP)
    zones: Zones | None = Field(None, description=AT_TOP)
    search: SearchPart | None = Field(None, description=AT_TOP)


class FleetFile(Part):
    """Several vehicles that keep apart."""

    schema_version: Literal[1] = Field(alias="schema", description="1")
    name: Text | None = Field(None, description="what the situation is called")
    vehicle: VehiclePart | None = Field(None, description="of all that name none")
    automaton: AutomatonPart | None = Field(None, description="of all that name none")
    cost: CostPart | None = Field(None, description="left out: {time: 1}")
    horizon: HorizonPart | None = Field(None, description="left out: any number of trims")
    bounds_m: BoundsPart | None = Field(None, description="left out: none")
    margin_m: NotNegative = Field(0.0, description="distance kept from everything")
    obstacles: Obstacles = Field((), description="what no vehicle must touch")
    zones: Zones = Field((), description="where not every motion is admitted")
    search: SearchPart | None = Field(None, description="how to search")
    vehicles: Annotated[
        tuple[VehicleEntry, ...], Several("a list of at least one vehicle", at_least=1)
    ] = Field(description="a list of {name, start, goal, ...}")
    fleet: FleetPart = Field(default_factory=FleetPart, description="how they are planned")
    receding_horizon: RecedingHorizonPart | None = Field(None, description="only for mpc")


SHARED = ("name", "vehicles", "fleet", "receding_horizon")  # keys of the top that no entry has
OWN = ("name", "priority", "leaves", "start_time_s")  # keys of an entry that no file has
