"""`check` of a result file: its plans proven again, or what was driven looked at again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton.cli.inputs import Parts, naming, opened
from maneuver_automaton.cli.terminal import announced
from maneuver_automaton.collision.blocked import too_close
from maneuver_automaton.fleet import (
    Closest,
    DrivenVerdict,
    FleetLog,
    FleetProblem,
    FleetStep,
    verify_driven,
    verify_fleet,
)
from maneuver_automaton.fleet.driven import FINE
from maneuver_automaton.formats.documents import errors_at, kind_of, parsed
from maneuver_automaton.formats.plan_json import load_plan, load_plans
from maneuver_automaton.planning.on_the_way import Passed, going_on, still_ahead
from maneuver_automaton.planning.verdict import Verdict, verify
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.receding_horizon import ClosedLoop, within
from maneuver_automaton.recording.values import pair_text
from maneuver_automaton.roads import RoadFleetResult
from maneuver_automaton.scenario import FleetScenario

ENDING = ".json"
AGREES = 1e-9  # share by which a cost may differ from that of the file
THERE = 1e-9  # [m, rad] between a start and where a vehicle begins
NEARER = 1e-6  # [m] by which a distance may be below that of the file


class Finding(NamedTuple):
    """One line of the report; `holds` is None for a fact that is not judged."""

    what: str
    words: str
    holds: bool | None = None
    worst: float | None = None


def findings(path: Path, parts: Parts, *, leave: bool = False) -> tuple[str, list[Finding]] | None:
    """Name and findings of a result file; None of any other; a plan may `leave` a contact."""
    if path.suffix.lower() != ENDING or not kind_of(parsed(path)):
        return None
    file = opened(path, parts)
    file.needed()
    if file.roads:
        roads = file.result()
        return roads.name, list(_on_road(roads))
    scenario = file.scenario
    assert scenario is not None
    if isinstance(scenario, FleetScenario):
        if file.kind == "fleet":
            return scenario.name, _plans(path, file.document, scenario.fleet)
        return scenario.name, _loop(path, file.document, file.result())
    if file.kind == "loop":
        loop = file.result()
        return scenario.name, [*_loop(path, file.document, _log_of(loop)), *_on_the_way(loop)]
    plan = load_plan(path, model=scenario.problem.automaton.model)
    with announced(), naming(path):
        verdict = verify(scenario.problem, plan, leave=leave or None)
    return scenario.name, [_plan("plan", verdict, file.document.get("cost"))]


# -- plans


def _plans(path: Path, document: Mapping[str, Any], fleet: FleetProblem) -> list[Finding]:
    """What holds of the plans of several vehicles, each alone and every pair."""
    plans = load_plans(path)
    with announced(), naming(path):
        verdict = verify_fleet(fleet, plans)
    stated = document["vehicles"]
    rows = [
        _plan(f"{name}: plan", verdict.verdicts[name], stated[name].get("cost"))
        if name in verdict.verdicts
        else Finding(f"{name}: plan", _why_none(stated.get(name, {}).get("reason")), holds=False)
        for name in fleet.names
    ]
    return [*rows, *_pairs(verdict.closest, verdict.too_near)]


def _on_road(result: RoadFleetResult) -> Iterator[Finding]:
    """What the judge says of each drive past the others, and whether it ends at a goal."""
    for name, one in result.results.items():
        if one.plan is None or one.verdict is None:
            yield Finding(f"{name}: plan", _why_none(one.reason), holds=False)
            continue
        scene, verdict = one.planner.scene, one.verdict
        said = "; ".join(words for _, words in verdict.faults)
        yield Finding(
            f"{name}: driven",
            said or f"to the edge of the road {verdict.edge_m:.3g} m",
            holds=verdict.clean,
            worst=None if math.isinf(verdict.clearance_m) else verdict.clearance_m,
        )
        end = one.plan.start_time + one.plan.duration
        middle = one.planner.vehicle.middle_of(one.plan.end)
        speed = float(one.plan.trims[-1].reduced_state[0])
        there = any(goal.contains(middle, speed=speed, time=end) for goal in scene.goals)
        words = f"reached at {end:.6g} s" if there else one.reason or "it ends elsewhere"
        yield Finding(f"{name}: goal", words, holds=there)
    near = tuple(one for one in result.pairs if one.distance_m <= too_close(0.0))
    yield from _pairs(result.pairs, near)


def _pairs(closest: Sequence[Closest], too_near: Sequence[Closest]) -> list[Finding]:
    """Those that come too near, or one line for all."""
    if not too_near:
        words = "there is none that comes near"
        if closest:
            one = closest[0]
            words = f"nearest are {' and '.join(one.pair)} at {one.time_s:.4g} s"
        least = closest[0].distance_m if closest else None
        return [Finding("every pair: apart", words, holds=True, worst=least)]
    return [
        Finding(
            f"{' and '.join(one.pair)}: apart",
            f"{one.distance_m:.3g} m at {one.time_s:.4g} s",
            holds=False,
            worst=one.distance_m,
        )
        for one in too_near
    ]


def _plan(what: str, verdict: Verdict, stated: Any) -> Finding:
    """What holds of a plan, and whether it costs what its file says."""
    if not verdict.passed:
        return Finding(what, verdict.reason, holds=False)
    same = _agrees(stated, verdict.cost)
    clearance = None if verdict.audit is None else verdict.audit.min_clearance_m
    words = f"cost {verdict.cost:.9g}" + ("" if same else f", but the file says {stated}")
    return Finding(what, "; ".join([words, *verdict.notes]), holds=same, worst=clearance)


def _why_none(reason: str | None) -> str:
    return f"there is none: {reason}" if reason else "there is none"


def _agrees(stated: Any, cost: float) -> bool:
    return isinstance(stated, int | float) and abs(stated - cost) <= AGREES * max(1.0, abs(cost))


# -- closed loops


def _log_of(loop: ClosedLoop) -> FleetLog:
    """The loop of one vehicle as that of a fleet."""
    steps = [
        FleetStep(
            number=step.number,
            time=step.time,
            poses={"vehicle": pose},
            plans={"vehicle": step.plan},
            driven={"vehicle": step.plan},
            values={"vehicle": step.value},
            arrivals={"vehicle": math.inf},
            off_plan={"vehicle": 0.0},
            solve_s=step.solve_s,
        )
        for step, pose in zip(loop.steps, loop.poses, strict=False)
    ]
    return FleetLog(
        problem=FleetProblem(  # which admits no fixed time, and no goal in motion but of who leaves
            [replace(loop.problem, horizon=Horizon(), via=())], names=["vehicle"], leaves=[True]
        ),
        step=loop.step,
        steps=tuple(steps),
        driven={"vehicle": loop.driven},
        arrived_s={"vehicle": float(loop.times[-1])} if loop.reached else {},
        broken_down=(),
        closest=None,
        status=loop.status,
        cost=loop.cost,
    )


def _on_the_way(loop: ClosedLoop) -> Iterator[Finding]:
    """Whether what was driven passed all that is on the way, if the loop has arrived."""
    problem, passed = loop.problem, tuple[Passed, ...]()
    if not problem.via:
        return
    for piece in loop.driven:
        passed = going_on(problem, passed, piece)
    left = still_ahead(problem, passed)
    named = ", ".join(f"{one.number} at {one.time:.4g} s" for one in passed if not one.stay_left)
    yield Finding(
        "vehicle: on the way",
        f"passed {named or 'nothing'}" + (f", {len(left)} left" if left else ""),
        holds=None if any(step.off_plan for step in loop.steps) else not (left and loop.reached),
    )


def _loop(path: Path, document: Mapping[str, Any], log: FleetLog) -> list[Finding]:
    """What holds of what was driven: each vehicle alone, and every pair."""
    several = "vehicles" in document
    with errors_at(path):
        with announced():
            verdict = verify_driven(log)
        rows = [
            one
            for name, problem in zip(log.problem.names, log.problem.problems, strict=True)
            for one in _vehicle(
                log, verdict, name, problem, document["vehicles"][name] if several else document
            )
        ]
        if several:
            rows += _together(log, verdict, document["clearance_m"]["between"])
        broken = {one["step"] for one in document["broken_guarantees"]}
        rows.append(
            Finding(
                "guarantees: as the file says",
                f"broken in {len(broken)} steps" if broken else "hold in every step",
                holds=not broken,
            )
        )
        return rows


def _vehicle(
    log: FleetLog, verdict: DrivenVerdict, name: str, problem: Problem, stated: Mapping[str, Any]
) -> Iterator[Finding]:
    """Whether it begins and ends where the file says, drove as its model does, and hit nothing."""
    pieces = list(log.pieces_of(name).values())
    if not pieces:
        claims = name in log.arrived_s
        words = "it was never there" + (", but the file says that it arrived" if claims else "")
        yield Finding(f"{name}: driven", words, holds=False if claims else None)
        return
    cost = math.fsum(log.costs_of(name).values())
    off = float(np.abs(pieces[0].start - problem.start).max())
    clearance = verdict.clearances_m[name]
    jump = verdict.jumps_m[name]
    beside = f", moved by disturbances, by {jump:.3g} m at most" if jump > THERE else ""
    wrong = [
        said
        for bad, said in (
            (off > THERE, f"it begins {off:.3g} beside its start"),
            (name in verdict.defects, verdict.defects.get(name, "")),
            (clearance <= 0.0, "an obstacle is hit"),
            (not _agrees(stated.get("cost"), cost), f"but the file says {stated.get('cost')}"),
        )
        if bad
    ]
    yield Finding(
        f"{name}: driven",
        "; ".join([f"cost {cost:.9g}{beside}", *wrong]),
        holds=not wrong,
        worst=None if math.isinf(clearance) else clearance,
    )
    yield _ended(log, name, problem, stated)


def _ended(log: FleetLog, name: str, problem: Problem, stated: Mapping[str, Any]) -> Finding:
    """Whether it is at a goal, if the file says so."""
    pose = np.array(stated["steps"][-1]["vehicle_pose"], dtype=np.float64)
    driven = next(reversed(log.pieces_of(name).values())).end
    there = any(within(pose, goal) for goal in problem.goals)
    what, arrived = f"{name}: goal", log.arrived_s.get(name)
    if arrived is None:
        broken = name in log.broken_down
        return Finding(what, str(stated["status"]), holds=None if broken else False)
    off = float(np.abs(pose - driven).max())
    if off > THERE and not any(within(driven, goal) for goal in problem.goals):
        return Finding(what, "what was driven ends elsewhere", holds=False, worst=off)
    words = f"reached at {arrived:.6g} s" if there else "the file says so, but it is elsewhere"
    return Finding(what, words, holds=there)


def _together(log: FleetLog, verdict: DrivenVerdict, stated: float | None) -> Iterator[Finding]:
    """Whether any two kept apart, and the file says what was measured."""
    undisturbed = max(verdict.jumps_m.values(), default=0.0) <= THERE
    near = [row for row in verdict.closest if row.distance_m < log.problem.margin - 2.0 * FINE]
    for row in near:
        # Disturbances may use up what plans keep, but not more.
        yield Finding(
            f"{' and '.join(row.pair)}: apart",
            f"{row.distance_m:.6g} m at {row.time_s:.5g} s, plans keep {log.problem.margin:g} m",
            holds=False if undisturbed or row.distance_m <= 0.0 else None,
            worst=row.distance_m,
        )
    if not near:
        nearest = verdict.closest[:1]
        yield Finding(
            "every pair: apart",
            pair_text(nearest[0]) if nearest else "there is none that comes near",
            holds=True,
            worst=nearest[0].distance_m if nearest else None,
        )
    if verdict.distance_m < (math.inf if stated is None else stated) - NEARER:
        yield Finding(
            "least distance: as the file says",
            f"but the file says {stated}",
            holds=False,
            worst=verdict.distance_m,
        )
