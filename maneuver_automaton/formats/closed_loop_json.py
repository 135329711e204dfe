"""closed_loop.json: what a closed loop did, and the loop taken up again; statistics.json of many.

One entry per step applied, and a last one where the vehicle ended; a loop that was stopped goes on
from them as if it had not been.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, NotRequired

import numpy as np
from pydantic import Discriminator, Field, Tag
from typing_extensions import TypedDict

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.automaton.pieces import Piece, plan_of, words_of
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.documents import (
    BrokenEntry,
    DocumentHead,
    ModelEntry,
    document_of,
    errors_at,
    library_entries,
    misstated,
    read_document,
    write_document,
)
from maneuver_automaton.formats.entries import (
    Flag,
    Known,
    Number,
    Numbers,
    Positive,
    Whole,
    entry,
    made,
    of,
    says,
)
from maneuver_automaton.formats.plan_json import PassedEntry
from maneuver_automaton.formats.yaml_source import shown
from maneuver_automaton.groups import group_of
from maneuver_automaton.planning.on_the_way import Passed, still_ahead
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import (
    ClosedLoop,
    Decision,
    Guarantee,
    Origin,
    Outcome,
    Statistics,
    Step,
    Violation,
    within,
)

MOST_STEPS = 1_000_000
FINEST_M, FINEST_RAD = 0.05, 0.05  # between samples of what was driven
NOTHING = "nothing"  # the name of a step in which nothing was applied


VehiclePose = Annotated[Numbers, says("where it was, if pose is where it will be")]


class MetEntry(PassedEntry):
    """A pose on the way that was passed, or where the vehicle has begun to stay."""

    until_s: Annotated[Number, of("until"), says("it was passed then, or was stood at last")]
    stay_left_s: Annotated[Number, of("stay_left"), says("to stand there; 0 if it is passed")]


class PlaceEntry(TypedDict):
    """Where the vehicle was at a time, and what it had paid and had left to pay."""

    time_s: Number
    pose: Numbers
    value: Annotated[Known, says("cost of what is left; null if the plan does not arrive")]
    accumulated_cost: Annotated[Number, says("of all steps before")]


class AppliedEntry(PlaceEntry):
    """A step that was applied, and the plan from there."""

    control: Annotated[Numbers | None, says("null if it varies, or nothing is left to do")]
    word: list[str]
    plan: list[Piece]
    replanned: Annotated[Flag, says("the word is not the rest of the previous one")]
    solve_s: Number
    number: Annotated[Whole, Field(ge=0, lt=MOST_STEPS, description="0 for the first")]
    vehicle_pose: VehiclePose
    measured_pose: Annotated[
        Numbers | None, of("measured"), says("that was measured, if it is used a step later")
    ]
    goal: Annotated[Whole, of("goal_index"), says("which of several")]
    applied_s: Annotated[Number, says("until the next step")]
    applied_cost: Number
    origin: Annotated[str, says("of the plan: " + ", ".join(one.value for one in Origin))]
    value_of_the_rest: Annotated[
        Known, of("shifted_value"), says("of the last plan; null if it has none here")
    ]
    off_plan: Annotated[Known, says("m or rad between pose and the last plan's prediction")]
    lower_bound: Number
    gap: NotRequired[Annotated[Known, says("(value - lower_bound) / value")]]
    exhaustive: Annotated[Flag, says("no admitted word is cheaper")]
    arrived: Flag
    decision: NotRequired[Annotated[str, says(", ".join(one.value for one in Decision))]]
    deed: NotRequired[Annotated[str, says("decision, in files of earlier versions")]]
    free_until_s: Annotated[Known, says("no contact is predicted until then")]
    clearance_m: Known
    broken_guarantees: Annotated[list[BrokenEntry], of("violations")]
    disturbed: NotRequired[Annotated[list[BrokenEntry], says("what noise took from it")]]
    via: NotRequired[
        Annotated[list[MetEntry], of("passed"), says("met on the way by its end, if anything is")]
    ]


class EndedEntry(PlaceEntry):
    """Where the loop ended."""

    control: None
    word: None
    plan: None
    replanned: None
    solve_s: None
    vehicle_pose: VehiclePose


class PiecesEntry(TypedDict):
    """The audit of the pieces that were driven."""

    pieces: Whole
    failed: Whole
    max_dynamics_defect: Known


def has_ended(row: Any) -> str:
    """Which of two kinds a row of `steps` is of: the last one says where the vehicle ended."""
    return "<ended>" if isinstance(row, dict) and row.get("word", "") is None else "<applied>"


Ended = Annotated[EndedEntry, Tag("<ended>")]
StepEntry = Annotated[Annotated[AppliedEntry, Tag("<applied>")] | Ended, Discriminator(has_ended)]


class LoopDocument(DocumentHead):
    """What a closed loop of one vehicle did."""

    vehicle: NotRequired[ModelEntry | None]
    automaton_hash: NotRequired[Annotated[str, says("what the library was")]]
    status: NotRequired[Annotated[str, says("reached, steps_spent or no_plan")]]
    reached: Flag
    cost: NotRequired[Annotated[Number, says("accumulated over the steps applied")]]
    duration_s: NotRequired[Number]
    step_s: Positive
    steps_bound: NotRequired[Annotated[Whole | None, says("steps are proven to suffice")]]
    audit: NotRequired[PiecesEntry]
    min_clearance_m: NotRequired[Known]
    collisions: NotRequired[Annotated[Whole, says("steps that hit an obstacle, by the audit")]]
    broken_guarantees: NotRequired[list[BrokenEntry]]
    disturbed: NotRequired[list[BrokenEntry]]
    via: NotRequired[
        Annotated[list[MetEntry], of("passed"), says("met on the way, if anything is")]
    ]
    steps: Annotated[list[StepEntry], Field(min_length=1)]


def closed_loop_to_dict(loop: ClosedLoop, *, name: str = "") -> LoopDocument:
    """The content of closed_loop.json, as plain values; `name` is that of the scenario."""
    automaton, poses = loop.problem.automaton, loop.poses.tolist()
    left = loop.value if math.isfinite(loop.value) else 0.0
    document = document_of(
        LoopDocument,
        loop,
        name=name,
        **library_entries(automaton),
        notes=left_out(loop.problem),
        duration_s=loop.times[-1] - loop.times[0],
        audit={
            "pieces": len(loop.audits),
            "failed": sum(not audit.passed for audit in loop.audits),
            "max_dynamics_defect": max(
                (float(audit.max_dynamics_defect) for audit in loop.audits), default=None
            ),
        },
        collisions=len(list(loop.collisions)),
        broken_guarantees=entries_of(loop.violations),
        disturbed=entries_of(loop.disturbed),
        steps=[
            *(
                entry(
                    AppliedEntry,
                    step,
                    word=step.plan.word,
                    plan=words_of(step.plan, automaton),
                    vehicle_pose=pose,
                )
                for step, pose in zip(loop.steps, poses, strict=False)
            ),
            ended_entry(loop.times[-1], poses[-1], left, loop.cost),
        ],
    )
    if not loop.problem.via:
        del document["via"]
        for row in document["steps"]:
            row.pop("via", None)  # type: ignore[typeddict-item]
    return document


def save_closed_loop(
    loop: ClosedLoop, path: Path | str, *, name: str = "", interrupted: bool = False
) -> None:
    """Write closed_loop.json in one step; the scenario's `name` heads the pictures drawn of it."""
    write_document(closed_loop_to_dict(loop, name=name), path, interrupted=interrupted)


def ended_entry(time: float, pose: list[float], value: float, cost: float) -> EndedEntry:
    """Where a vehicle ended, what it had left to pay, and what it had paid."""
    place = {"time_s": time, "pose": pose, "value": value, "accumulated_cost": cost}
    return entry(EndedEntry, None, **place, vehicle_pose=pose)


# -- reading


def load_steps(path: Path | str, automaton: Automaton) -> tuple[tuple[Step, ...], Array]:
    """Steps of a loop of this library, and where it was before each and at the end (n + 1, dof)."""
    document = read_document(path, "loop")
    if document.get("automaton_hash") != automaton_hash(automaton):
        raise InvalidScenario(f"{path}: automaton_hash: this loop was planned with another library")
    _check_rows(document["steps"], automaton, path)
    poses = np.array([row["vehicle_pose"] for row in document["steps"]], dtype=np.float64)
    with errors_at(path):
        steps = []
        for row in document["steps"][:-1]:
            plan = plan_of(row["pose"], float(row["time_s"]), row["plan"], automaton)
            decision = Decision(row.get("decision") or row["deed"])
            value = float(row["value"])  # of what is driven it is known
            known = {"value": value, "bound": partial(float, row["lower_bound"])}
            steps.append(made(Step, row, AppliedEntry, plan=plan, decision=decision, **known))
    return tuple(steps), poses


def _check_rows(rows: list[dict[str, Any]], automaton: Automaton, path: Path | str) -> None:
    """Steps in order, each with poses and controls of the automaton; raises InvalidScenario."""
    before, dof = -math.inf, automaton.model.group.dof
    names = automaton.model.control_names
    for k, row in enumerate(rows):
        if (row["plan"] is None) != (k == len(rows) - 1):
            said = f"got {shown(row['plan'])}, need a list, but nothing in the last entry"
            raise misstated(path, ("steps", k, "plan"), said)
        for key in ("pose", "vehicle_pose"):
            if len(row[key]) != dof:
                raise misstated(path, ("steps", k, key), f"need {dof} numbers")
        if row["time_s"] < before:
            said = f"got {row['time_s']:g}, need at least {before:g}"
            raise misstated(path, ("steps", k, "time_s"), said)
        before, control = row["time_s"], row["control"]
        if control is None and row["plan"] and row["plan"][0]["kind"] == "trim":
            raise misstated(path, ("steps", k, "control"), "got nothing, need a list")
        if control is not None and len(control) != len(names):
            raise misstated(path, ("steps", k, "control"), f"need {', '.join(names)}")


def load_closed_loop(path: Path | str, problem: Problem) -> ClosedLoop:
    """The loop of a file: each plan from where the vehicle was, then what disturbed it at once."""
    steps, poses = load_steps(path, problem.automaton)
    document = read_document(path, "loop")
    passed: list[tuple[Passed, ...]] = [(), *(step.passed for step in steps)]
    inside = [
        any(within(pose, goal) for goal in problem.goals) and not still_ahead(problem, before)
        for pose, before in zip(poses, passed, strict=True)
    ]
    with errors_at(path):
        return made(
            ClosedLoop,
            document,
            LoopDocument,
            problem=problem,
            steps=steps,
            poses=poses,
            times=np.array([row["time_s"] for row in document["steps"]], dtype=np.float64),
            value=float(document["steps"][-1]["value"]),
            driven=tuple(
                replace(step.piece, start=pose) for step, pose in zip(steps, poses, strict=False)
            ),
            inside=tuple(inside),
        )


def entries_of(found: Iterable[tuple[int, Violation]]) -> list[BrokenEntry]:
    """Guarantees with the numbers of their steps, as the files have them."""
    return [entry(BrokenEntry, one, step=number) for number, one in found]


# -- what was driven, as a plan


def driven_document(document: Mapping[str, Any]) -> dict[str, Any]:
    """The drive of a closed loop in the words of plan.json.

    The vehicle is known where each step began; between, it is taken to move at a constant twist. A
    step is named after the primitives that were to be driven in it, and steps of one name in a row
    are one maneuver, as disturbances may have it turn otherwise in each.
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


# -- statistics


class OutcomeEntry(TypedDict):
    """How one closed loop went."""

    seed: Whole
    start: Numbers
    reached: Flag
    arrived_after_steps: Annotated[
        Whole | None, of("arrived_after"), says("until the goal was first reached")
    ]
    stayed: Annotated[Flag, says("at the goal from then on")]
    share_inside: Annotated[Number, says("of the steps after the first arrival")]
    steps: Whole
    cost: Number
    first_value: Number
    reason: str
    broken_guarantees: list[BrokenEntry]
    disturbed: NotRequired[list[BrokenEntry]]
    solve_s: Numbers


class StatisticsDocument(DocumentHead):
    """Many closed loops in a few numbers each."""

    loops_run: Whole
    reached: Annotated[Number, says("share that reached the goal")]
    stayed: Annotated[Number, says("share that reached it and stayed")]
    steps_with_a_broken_guarantee: Annotated[Whole, of("broken")]
    loops: Annotated[list[OutcomeEntry], Field(min_length=1)]


def statistics_to_dict(statistics: Statistics) -> StatisticsDocument:
    """The content of statistics.json, as plain values."""
    return document_of(
        StatisticsDocument,
        statistics,
        loops_run=len(statistics.outcomes),
        loops=[
            entry(
                OutcomeEntry,
                one,
                broken_guarantees=entries_of(one.violations),
                disturbed=entries_of(one.disturbed),
            )
            for one in statistics.outcomes
        ],
    )


def load_statistics(path: Path | str) -> Statistics:
    """The statistics of a statistics.json; raises InvalidScenario."""
    document = read_document(path, "statistics")
    with errors_at(path):
        return Statistics(outcomes=tuple(map(_outcome_of, document["loops"])))


def _outcome_of(row: Mapping[str, Any]) -> Outcome:
    broken, disturbed = (
        tuple((one["step"], made(Violation, one, BrokenEntry)) for one in row.get(key, ()))
        for key in ("broken_guarantees", "disturbed")
    )
    failed = {n for n, one in (*broken, *disturbed) if one.guarantee is Guarantee.NO_COLLISION}
    return made(
        Outcome,
        row,
        OutcomeEntry,
        violations=broken,
        disturbed=disturbed,
        audits_failed=len(failed),
    )
