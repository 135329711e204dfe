"""A closed_loop.json for pictures: as the plan.json of what was driven, or as the loop it was."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.closed_loop_json import load_steps
from maneuver_automaton.formats.plan_json import read_json
from maneuver_automaton.groups import group_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import ClosedLoop, within

NEEDED = ("schema", "reached", "steps", "step_s")
FINEST_M, FINEST_RAD = 0.05, 0.05  # between samples
NOTHING = "nothing"  # the name of a step in which nothing was applied


def read_closed_loop_document(path: Path | str) -> dict[str, Any] | None:
    """The content of a closed_loop.json, of roads too; None if the file is none."""
    with contextlib.suppress(InvalidScenario):
        return read_json(path, needed=NEEDED, kind="closed loop")
    return None


def load_closed_loop(path: Path | str, problem: Problem) -> ClosedLoop:
    """The closed loop of a closed_loop.json; a file states neither its library nor its obstacles.

    What was driven is each plan from where the vehicle was, and then what disturbed it at once.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, or was planned with another library.
    """
    steps, poses = load_steps(path, problem.automaton)
    document = read_json(path, needed=NEEDED, kind="closed loop")
    try:
        return ClosedLoop(
            problem=problem,
            step=float(document["step_s"]),
            steps=steps,
            poses=poses,
            times=np.array([step["time_s"] for step in document["steps"]]),
            reached=bool(document["reached"]),
            status=str(document["status"]),
            reason=str(document["reason"]),
            cost=float(document["cost"]),
            value=float(document["steps"][-1]["value"]),
            driven=tuple(
                replace(step.piece, start=pose) for step, pose in zip(steps, poses, strict=False)
            ),
            inside=tuple(any(within(pose, goal) for goal in problem.goals) for pose in poses),
            steps_bound=document["steps_bound"],
        )
    except (ValueError, KeyError, TypeError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{path}: {said}") from error


def driven_document(document: Mapping[str, Any]) -> dict[str, Any]:
    """The drive of a closed loop in the words of plan.json.

    The vehicle is known where each step began; between, it is taken to move at a constant twist. A
    step is named after the primitives that were to be driven in it, and steps of one name in a row
    are one maneuver, as disturbances may have it turn otherwise in each.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a key is missing, or holds no numbers.
    """
    steps = document["steps"]
    time = as_array("steps: time_s", [step["time_s"] for step in steps])
    poses = as_array(
        "steps: pose", [step.get("vehicle_pose") or step["pose"] for step in steps], last=(3, 4)
    )
    names = [_driven(step, lasting) for step, lasting in zip(steps, np.diff(time), strict=False)]
    runs = [(name, [k for k, _ in run]) for name, run in groupby(enumerate(names), lambda p: p[1])]
    return {
        "name": document.get("name", ""),
        "vehicle": document.get("vehicle"),
        "status": "found",
        "cost": document["cost"],
        "duration_s": float(time[-1] - time[0]),
        "clearance_m": document.get("min_clearance_m"),
        "primitives": [
            {
                "kind": "maneuver",
                "name": name,
                "source": name,
                "target": name,
                "duration_s": float(time[rows[-1] + 1] - time[rows[0]]),
            }
            for name, rows in runs
        ],
        "trajectory": _trajectory(steps, time, poses),
    }


def _driven(step: Mapping[str, Any], lasting: float) -> str:
    """Names of the primitives that begin within a step."""
    begin, names = 0.0, []
    for one in step["plan"]:
        if begin < lasting * (1.0 - 1e-9):
            names.append(str(one["name"]))
        begin += float(one["duration_s"])
    return ", ".join(names) or NOTHING


def _trajectory(steps: list[Mapping[str, Any]], time: Array, poses: Array) -> dict[str, Any]:
    """Samples along an arc from the pose of each step to that of the next."""
    group = group_of(poses.shape[1])
    arcs = (group(poses[:-1]).inverse() @ group(poses[1:])).log()
    n_controls = max((len(step["control"] or ()) for step in steps[:-1]), default=0)
    columns: dict[str, list[Any]] = {"time_s": [], "pose": [], "control": [], "reduced_state": []}
    columns["origin"] = [0.0, 0.0]
    for k, (step, arc) in enumerate(zip(steps, arcs, strict=False)):
        reach = max(np.hypot(arc[0], arc[1]) / FINEST_M, abs(arc[2]) / FINEST_RAD, 1.0)
        shares = np.arange(np.ceil(reach)) / np.ceil(reach)
        sampled = (group(poses[k]) @ group.exp(shares[:, None] * arc)).pose
        columns["time_s"] += (time[k] + shares * (time[k + 1] - time[k])).tolist()
        columns["pose"] += sampled.tolist()
        columns["control"] += [step["control"] or [0.0] * n_controls] * shares.size
        columns["reduced_state"] += [step.get("reduced_state") or []] * shares.size
    for name, last in (("time_s", float(time[-1])), ("pose", poses[-1].tolist())):
        columns[name].append(last)
    for name in ("control", "reduced_state"):
        columns[name] += columns[name][-1:]
    return columns if len(steps) > 1 else {}
