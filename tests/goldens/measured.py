"""What is kept of an answer, and how a later answer is held against it."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import maneuver_automaton as ma
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.receding_horizon import ClosedLoop
from tests.goldens.loops import Loop, all_loops
from tests.goldens.scenes import Scene, all_kinematic

FOLDER = Path(__file__).parent
EQUAL = 1e-9  # relative, by which two costs may differ and count as the same
RUNS = 5  # of a scene with inertia, of which the cheapest counts
LONGER = (1.0, 2.0, 4.0)  # times a limit, in turn: a machine that is busy may need it
DIGITS = 13


def data(name: str) -> dict[str, Any]:
    """The content of a data file."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


@functools.cache
def dearer() -> dict[str, dict[str, Any]]:
    """Scenes that may have become dearer: the reason, and by which share."""
    return data("dearer")


def kept(name: str) -> dict[str, dict[str, Any]]:
    """The entries of a data file, by name."""
    return {key: value for key, value in data(name).items() if key != "commit"}


def share_dearer(now: float, before: float) -> float:
    """By which share a cost has risen; negative if it has fallen."""
    return (now - before) / max(abs(before), 1e-12)


def against_kept(name: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """What is wrong with a later answer: empty if it is the same, cheaper, or listed as dearer."""
    if now["status"] != before["status"]:
        missed = before["status"] in ("no_plan", "out_of_budget")
        if missed and now["status"] == "found":
            return ""
        return f"{name}: {now['status']}, was {before['status']}"
    if "cost" not in before:
        return ""
    share = share_dearer(now["cost"], before["cost"])
    if share < -EQUAL:
        return ""
    most = dearer().get(name, {"share": 0.0})["share"] + EQUAL
    if share > most:
        return f"{name}: cost {now['cost']} is {share:.3g} dearer than {before['cost']}"
    if name not in dearer() and now["word"] != before["word"]:
        return f"{name}: {now['word']} costs as much as {before['word']}, but is another word"
    return ""


def rounded(number: float) -> float:
    """The number to 13 digits."""
    return float(f"{number:.{DIGITS}g}")


def answer(scene: Scene) -> PlanResult:
    """The plan of a scene, short trims included, as they were when it was recorded."""
    problem, horizon = scene.problem, scene.problem.horizon
    if not horizon.min_coast:
        problem = replace(problem, horizon=replace(horizon, min_coast=0.0))
    return ma.plan(problem, time_limit=scene.time_limit)


@functools.cache
def planned(name: str) -> PlanResult:
    """The plan of a kinematic scene, planned once in a session."""
    return answer(all_kinematic()[name])


def record_of(result: PlanResult) -> dict[str, Any]:
    """What is kept of a kinematic answer."""
    record: dict[str, Any] = {"status": result.status.value}
    if result.plan is None or result.cost is None:
        return record
    return record | {
        "cost": rounded(result.cost),
        "goal": result.goal_index,
        "word": list(result.plan.word),
        "durations": [rounded(time) for time in result.plan.durations.tolist()],
    }


def cheapest_of(scene: Scene, *, runs: int = RUNS) -> dict[str, Any]:
    """Status, the cheapest cost of several runs, and the costs of them all, cheapest first."""
    results = [answer(scene) for _ in range(runs)]
    found = sorted(rounded(one.cost) for one in results if one.cost is not None)
    if not found:
        return {"status": results[0].status.value}
    return {"status": "found", "cost": found[0], "costs": found}


def record_of_loop(loop: ClosedLoop) -> dict[str, Any]:
    """What is kept of a closed loop."""
    return {
        "status": loop.status,
        "reached": loop.reached,
        "steps": len(loop.steps),
        "cost": rounded(loop.cost),
        "guarantees": sorted(
            {one.guarantee.value for _, one in (*loop.violations, *loop.disturbed)}
        ),
        "values": [rounded(step.value) for step in loop.steps],
    }


@functools.cache
def driven(name: str) -> dict[str, Any]:
    """What is kept of the loop of a name, driven once in a session."""
    return record_of_loop(all_loops()[name].run())


def cheapest_loop(loop: Loop, *, runs: int) -> dict[str, Any]:
    """Of several runs of a loop the cheapest that reaches its goal, without its values."""
    records = [record_of_loop(loop.run()) for _ in range(runs)]
    best = min(records, key=lambda one: (not one["reached"], one["cost"]))
    broken = sorted({name for one in records for name in one["guarantees"]})
    return {
        "status": best["status"],
        "reached": best["reached"],
        "steps": max(one["steps"] for one in records),
        "cost": best["cost"],
        "guarantees": broken,
        "costs": sorted(one["cost"] for one in records),
    }
