"""Recordings of plans and drives on roads, of one vehicle and of several."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.recording.values import (
    Curve,
    Environment,
    Event,
    Fact,
    Mover,
    Recording,
    Table,
    nearest_fact,
    shown,
    times_of,
)
from maneuver_automaton.roads import (
    RoadDrive,
    RoadFleetDrive,
    RoadFleetResult,
    RoadPlanner,
    RoadPlanResult,
    RoadScene,
    RoadVerdict,
)


def _plan(result: RoadPlanResult) -> Recording:
    verdict, plan = result.verdict, result.plan
    facts = []
    if plan is not None and verdict is not None:
        until = f"reached at {plan.switching_times[-1]:.6g} s"
        facts.append(Fact(label="goal", value=until, heads=False))
        if result.cost is not None:
            facts.append(Fact(label="cost", value=result.cost, digits=6))
        facts += [Fact(label="duration", value=plan.duration, unit="s"), *_room(verdict)]
    if plan is not None and result.decision is not None:
        stop = "free" if result.decision.stops else "none was found"
        facts.append(Fact(label="stop after it", value=stop, heads=False))
        facts.append(Fact(label="searched", value=f"{result.search_s:.3g} s", heads=False))
    scene = result.planner.scene
    return Recording(
        kind="road_plan",
        title=scene.name,
        status="no_plan" if plan is None else "found",
        reason=result.reason,
        ending=result.reason,
        facts=(*facts, _notes(result.notes)),
        movers=(_mover("", result.planner, plan, result.reason, cost=result.cost),),
        world=_world(scene, ()),
        curves=() if plan is None else (_across("", result.planner, plan),),
    )


def _drive(drive: RoadDrive) -> Recording:
    replanned = sum(step.replanned for step in drive.steps)
    scene, end = drive.planner.scene, drive.driven.switching_times[-1]
    goal = f"reached at {end:.6g} s" if drive.reached else f"{drive.status}: {drive.reason}"
    return Recording(
        kind="road_drive",
        title=scene.name,
        status=drive.status,
        reason=drive.reason,
        ending="goal reached" if drive.reached else drive.reason,
        facts=(
            Fact(label="goal", value=goal),
            Fact(label="cost", value=drive.cost, digits=6, heads=False),
            Fact(label="duration", value=drive.driven.duration, unit="s"),
            Fact(label="steps", value=f"{len(drive.steps)}, {replanned} replanned"),
            Fact(label="collisions", value=str(len(drive.verdict.hit)), heads=False),
            *_room(drive.verdict),
            Fact(label="time per step", value=times_of(drive.solve_s), heads=False),
            _notes(drive.notes),
        ),
        movers=(_driven("", drive),),
        world=_world(scene, ()),
        events=tuple(_events("", drive)),
        curves=(_across("", drive.planner, drive.driven), _solve_times("", drive)),
    )


def _plans(result: RoadFleetResult) -> Recording:
    found, count = len(result.plans), len(result.results)
    rows = result.results.items()
    why = "; ".join(f"{name}: {one.reason}" for name, one in rows if one.plan is None)
    return Recording(
        kind="road_fleet",
        title=result.name,
        status="found" if result.found else "no_plan",
        reason=why,
        facts=(
            Fact(label="plans", value=f"{found} of {count}"),
            *_of_all(result, [one.plan for _, one in rows if one.plan is not None]),
            Fact(label="order", value=", ".join(result.order), heads=False),
            Fact(label="searched", value=f"{result.search_s:.3g} s", heads=False),
            _notes(joint_notes(result)),
        ),
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
            Fact(label="reached", value=f"{reached} of {len(drive.results)}"),
            *_of_all(drive, [one.driven for _, one in rows if one.steps]),
            Fact(label="steps", value=f"{len(steps)}, {replanned} replanned"),
            Fact(label="time per step", value=times_of(one.solve_s for one in steps), heads=False),
            Fact(label="planned before", value=f"{drive.before.search_s:.3g} s", heads=False),
            _notes(joint_notes(drive)),
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


def joint_notes(fleet: RoadFleetResult | RoadFleetDrive) -> list[str]:
    """Notes of several vehicles: those on their file once, any other with the vehicle's name."""
    said = [
        note if note in one.planner.scene.notes else f"{name}: {note}"
        for name, one in fleet.results.items()
        for note in one.notes
    ]
    return list(dict.fromkeys(said))


def _notes(notes: Sequence[str]) -> Fact:
    return Fact(label="notes", value="; ".join(notes), heads=False)


def _room(verdict: RoadVerdict) -> list[Fact]:
    """How far it kept from road users and from the edge of the road."""
    near, edge = verdict.clearance_m, f"to the edge of the road {verdict.edge_m:.3g} m"
    if math.isinf(near):
        return [Fact(label="clearance", value=f"nobody is near, {edge}")]
    return [Fact(label="clearance", value=near, unit="m", digits=3, note=edge)]


def _of_all(result: RoadFleetResult | RoadFleetDrive, plans: Sequence[Plan]) -> list[Fact]:
    """Cost of all, the longest drive, and how near any two came."""
    cost = math.fsum(one.cost or 0.0 for one in result.results.values())
    longest = max((plan.duration for plan in plans), default=0.0)
    facts = [
        Fact(label="cost", value=cost, digits=6, heads=False),
        Fact(label="duration", value=longest, unit="s", heads=False),
    ]
    near = [one.verdict.clearance_m for one in result.results.values() if one.verdict is not None]
    if near and math.isfinite(min(near)):
        facts.append(Fact(label="clearance", value=min(near), unit="m", digits=3, heads=False))
    if result.pairs:
        facts.append(Fact(label="apart", value=result.distance_m, unit="m", digits=3))
        facts.append(nearest_fact(result.pairs))
    return facts


def tables(result: RoadPlanResult | RoadDrive | RoadFleetResult | RoadFleetDrive) -> list[Table]:
    """Every vehicle of several; nothing of one."""
    if isinstance(result, RoadPlanResult | RoadDrive):
        return []
    rows = [
        [name, *(_planned(one) if isinstance(one, RoadPlanResult) else _ended(one)),
         *(["", ""] if one.verdict is None
           else [f"{one.verdict.clearance_m:.3g}", f"{one.verdict.edge_m:.3g}"])]
        for name, one in result.results.items()
    ]  # fmt: skip
    columns = ("vehicle", "status", "cost", "arrival [s]", "clearance [m]", "edge [m]")
    return [Table(columns=columns, rows=rows, numbers=(2, 3, 4, 5))]


def _planned(one: RoadPlanResult) -> list[str]:
    """Status, cost and arrival of a plan."""
    if one.plan is None:
        return ["no plan", "", ""]
    return ["found", shown(one.cost, 6), f"{one.plan.switching_times[-1]:.6g}"]


def _ended(one: RoadDrive) -> list[str]:
    """Status, cost and arrival of a drive."""
    until = one.driven.start_time + one.driven.duration
    return [one.status, f"{one.cost:.6g}", f"{until:.6g}" if one.reached else ""]


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


RECORDED = {
    RoadPlanResult: _plan,
    RoadDrive: _drive,
    RoadFleetResult: _plans,
    RoadFleetDrive: _drives,
}
