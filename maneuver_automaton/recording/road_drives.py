"""Recordings of plans and drives on roads, of one vehicle and of several."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.recording.values import Curve, Environment, Event, Fact, Mover, Recording
from maneuver_automaton.roads import (
    RoadDrive,
    RoadFleetDrive,
    RoadFleetResult,
    RoadPlanner,
    RoadPlanResult,
    RoadScene,
)


def recorded(
    result: RoadPlanResult | RoadDrive | RoadFleetResult | RoadFleetDrive,
) -> Recording | None:
    """The recording of a plan or a drive on roads, of one vehicle or several."""
    if isinstance(result, RoadPlanResult):
        return _plan(result)
    if isinstance(result, RoadDrive):
        return _drive(result)
    if isinstance(result, RoadFleetResult):
        return _plans(result)
    return _drives(result) if isinstance(result, RoadFleetDrive) else None


def _plan(result: RoadPlanResult) -> Recording:
    verdict, plan = result.verdict, result.plan
    facts = []
    if plan is not None and verdict is not None:
        if result.cost is not None:
            facts.append(Fact(label="cost", value=result.cost, digits=6))
        facts += [
            Fact(label="duration", value=plan.duration, unit="s"),
            Fact(label="clearance", value=verdict.clearance_m, unit="m", digits=3),
            Fact(label="to the edge of the road", value=verdict.edge_m, unit="m", digits=3),
        ]
    scene = result.planner.scene
    return Recording(
        kind="road_plan",
        title=scene.name,
        status="no_plan" if plan is None else "found",
        reason=result.reason,
        ending=result.reason,
        facts=tuple(facts),
        movers=(_mover("", result.planner, plan, result.reason, cost=result.cost),),
        world=_world(scene, ()),
        curves=() if plan is None else (_across("", result.planner, plan),),
    )


def _drive(drive: RoadDrive) -> Recording:
    replanned = sum(step.replanned for step in drive.steps)
    scene = drive.planner.scene
    return Recording(
        kind="road_drive",
        title=scene.name,
        status=drive.status,
        reason=drive.reason,
        ending="goal reached" if drive.reached else drive.reason,
        facts=(
            Fact(label="goal", value=drive.status.replace("_", " ")),
            Fact(label="duration", value=drive.driven.duration, unit="s"),
            Fact(label="steps", value=f"{len(drive.steps)}, {replanned} replanned"),
            Fact(label="clearance", value=drive.verdict.clearance_m, unit="m", digits=3),
        ),
        movers=(_driven("", drive),),
        world=_world(scene, ()),
        events=tuple(_events("", drive)),
        curves=(_across("", drive.planner, drive.driven), _solve_times("", drive)),
    )


def _plans(result: RoadFleetResult) -> Recording:
    found, count = len(result.plans), len(result.results)
    number = str(count) if found == count else f"{found} of {count} with a plan"
    rows = result.results.items()
    why = "; ".join(f"{name}: {one.reason}" for name, one in rows if one.plan is None)
    return Recording(
        kind="road_fleet",
        title=result.name,
        status="found" if result.found else "no_plan",
        reason=why,
        facts=(Fact(label="vehicles", value=number), *_nearest(result)),
        movers=tuple(_mover(name, one.planner, one.plan, one.reason) for name, one in rows),
        world=_world(_first(result.results), result.results),
        curves=tuple(
            _across(name, one.planner, one.plan) for name, one in rows if one.plan is not None
        ),
    )


def _drives(drive: RoadFleetDrive) -> Recording:
    rows = drive.results.items()
    steps = [step for _, one in rows for step in one.steps]
    reached = sum(one.reached for _, one in rows)
    replanned = sum(step.replanned for step in steps)
    return Recording(
        kind="road_fleet_drive",
        title=drive.name,
        status=drive.status,
        reason=drive.reason,
        ending="all have reached a goal" if drive.reached else drive.reason,
        facts=(
            Fact(label="vehicles", value=f"{reached} of {len(drive.results)} reached a goal"),
            Fact(label="steps", value=f"{len(steps)}, {replanned} replanned"),
            *_nearest(drive),
        ),
        movers=tuple(_driven(name, one) for name, one in rows),
        world=_world(_first(drive.results), drive.results),
        events=tuple(event for name, one in rows for event in _events(name, one)),
        curves=(
            *(_across(name, one.planner, one.driven) for name, one in rows if one.steps),
            *(_solve_times(name, one) for name, one in rows),
        ),
    )


def _first(results: Mapping[str, Any]) -> RoadScene:
    planner: RoadPlanner = next(iter(results.values())).planner
    return planner.scene


def _nearest(result: RoadFleetResult | RoadFleetDrive) -> list[Fact]:
    if not result.pairs:
        return []
    return [Fact(label="nearest", value=result.distance_m, unit="m", digits=3)]


def _world(scene: RoadScene, planned: Mapping[str, Any] | tuple[()]) -> Environment:
    """The road and all on it but those who are planned: they are road users too."""
    return Environment(
        obstacles=tuple(one for one in scene.traffic if one.name not in planned),
        lanes=tuple(lanelet.ring for lanelet in scene.lanelets),
        source=scene.source,
        fleeting=True,
    )


def _driven(name: str, drive: RoadDrive) -> Mover:
    plan = drive.driven if drive.steps or not name else None
    return _mover(name, drive.planner, plan, drive.reason, reached=drive.reached)


def _mover(
    name: str,
    planner: RoadPlanner,
    plan: Plan | None,
    reason: str,
    *,
    cost: float | None = None,
    reached: bool | None = None,
) -> Mover:
    """A vehicle by its rear axle; one of several is there only while it drives."""
    scene, vehicle = planner.scene, planner.vehicle
    start = vehicle.rear_of(scene.start.middle)
    stands = Plan(start, (), durations=[], start_time=scene.start.time)
    whole = plan or stands
    leaves = bool(name) and plan is not None
    there = (whole.start_time, whole.start_time + whole.duration)
    return Mover(
        name=name,
        pieces=(whole,),
        model=vehicle.model,
        bodies={"": (vehicle.footprint,)},
        has_plan=plan is not None,
        reached=plan is not None if reached is None else reached,
        reason=reason,
        cost=cost,
        there=there if leaves else (-math.inf, math.inf),
        road=planner,
    )


def _events(name: str, drive: RoadDrive) -> list[Event]:
    return [
        Event(time=float(step.time), kind="replanned", mover=name)
        for step in drive.steps
        if step.replanned
    ]


def _across(name: str, planner: RoadPlanner, plan: Plan) -> Curve:
    """The acceleration across the road."""
    driven = plan.sample()
    speed, steering = driven.reduced_state[:, 0], driven.reduced_state[:, 1]
    across = speed**2 * np.tan(steering) / planner.vehicle.model.wheelbase
    label = "lateral acceleration"
    return Curve(label=label, unit="m/s²", time=driven.time, value=across, mover=name)


def _solve_times(name: str, drive: RoadDrive) -> Curve:
    times = np.array([step.time for step in drive.steps], dtype=np.float64)
    return Curve(label="solve time", unit="s", time=times, value=drive.solve_s, mover=name)
