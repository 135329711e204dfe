"""plan.json and closed_loop.json of several vehicles: what each has, what holds of all together.

Names are those of the files of one vehicle wherever they mean the same: under `vehicles` each has
what its own plan.json or closed_loop.json would have.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, TypeAlias

import numpy as np
from pydantic import Discriminator, Field, Tag
from typing_extensions import TypedDict

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.automaton.pieces import Piece, plan_of, words_of
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import Closest, FleetLog, FleetProblem, FleetResult, FleetStep, Swap
from maneuver_automaton.fleet.driven import DrivenVerdict
from maneuver_automaton.formats.closed_loop_json import (
    Ended,
    PlaceEntry,
    VehiclePose,
    ended_entry,
    has_ended,
)
from maneuver_automaton.formats.documents import (
    FLEET,
    ClearanceEntry,
    ClosestEntry,
    DocumentHead,
    ModelEntry,
    document_of,
    errors_at,
    read_document,
    vehicle_entry,
    write_document,
)
from maneuver_automaton.formats.entries import (
    Flag,
    Known,
    Number,
    Numbers,
    Pairs,
    Positive,
    Whole,
    entry,
    made,
    number,
    of,
    or_inf,
    says,
)
from maneuver_automaton.formats.plan_json import PlanDocument, plan_to_dict, result_of
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.problem import Problem

TIMINGS = ("load", "automaton", "alone", "first_plan", "search", "audit")
COUNTS = ("expansions", "queries", "rounds")
MOST_SAID = 3  # vehicles whose reasons stand in the reason of the fleet


class FleetDocument(DocumentHead):
    """The plans of several vehicles, and what holds of them together."""

    kind: Literal["fleet"]
    status: Annotated[str, says("found: all have plans; partial: some; no_plan")]
    objective: NotRequired[Annotated[str, says("what was improved: sum or last")]]
    cost: NotRequired[Annotated[Known, says("sum of the costs")]]
    alone_cost: Annotated[Number, says("of the paths of all by themselves, as found")]
    sum_s: NotRequired[Annotated[Number, says("sum of the times until each arrives")]]
    last_s: NotRequired[Annotated[Number, says("when the last one arrives, on the clock of all")]]
    lower_bound: Annotated[Number, says("no plans have less of the objective")]
    gap: NotRequired[Annotated[Known, says("null if someone has no plan")]]
    clearance_m: ClearanceEntry
    closest: Annotated[list[ClosestEntry], says("pairs that come near, the nearest first")]
    order: Annotated[list[str], says("in which the vehicles that meet were planned")]
    improvements: Annotated[Pairs, says("[[s, objective]]")]
    timing_s: NotRequired[dict[str, Known]]
    counts: NotRequired[dict[str, Whole]]
    vehicles: Annotated[dict[str, PlanDocument], says("by name, as one vehicle's plan.json")]


def fleet_to_dict(result: FleetResult, *, name: str = "") -> FleetDocument:
    """The content of plan.json for several vehicles, as plain values.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import plan_fleet
    >>> controls = {"rest": (0, 0), "on": (1, 0), "left": (0, 1), "right": (0, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> ways = [Problem(robot, [0, y, 0], [4, y, 0], footprint=Disc(0.3)) for y in (0, 2)]
    >>> fleet = FleetProblem(ways, names=["low", "high"])
    >>> document = fleet_to_dict(plan_fleet(fleet, time_limit=60.0, max_rounds=0))
    >>> document["kind"], document["status"], list(document["vehicles"]), document["sum_s"]
    ('fleet', 'found', ['low', 'high'], 8.0)
    """
    to_obstacles = (one.clearance_m for one in result.results.values())
    return document_of(
        FleetDocument,
        result,
        kind=FLEET,
        name=name,
        reason=reason_of(result),
        clearance_m={
            "between": number(result.clearance_m),
            "to_obstacles": number(min(map(or_inf, to_obstacles), default=None)),
        },
        timing_s=dict.fromkeys(TIMINGS) | result.timing_s,
        counts=dict.fromkeys(COUNTS, 0) | result.counts,
        vehicles={
            vehicle: plan_to_dict(one, name=vehicle)
            | {"reason": result.reasons.get(vehicle, one.reason)}
            for vehicle, one in result.results.items()
        },
    )


def reason_of(result: FleetResult) -> str:
    """Who has no plan, and why, in one line; empty if all have one."""
    said = [f"{name}: {why}" for name, why in result.reasons.items()]
    more = f"; and {len(said) - MOST_SAID} more" if len(said) > MOST_SAID else ""
    return "; ".join(said[:MOST_SAID]) + more


def save_fleet(
    result: FleetResult,
    path: Path | str,
    *,
    name: str = "",
    source: Mapping[str, Any] | None = None,
    interrupted: bool = False,
) -> None:
    """Write plan.json of several vehicles in one step.

    Parameters
    ----------
    result : FleetResult
    path : Path or str
    name : str
        Of the scenario, which heads pictures.
    source : mapping, optional
        The files that it was planned from, for `check`: `file`, `with`, `case`. Paths are written
        as seen from the plan.
    interrupted : bool
        Whether a signal came before the work was done, which the file says then.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    write_document(fleet_to_dict(result, name=name), path, source=source, interrupted=interrupted)


def load_fleet(path: Path | str, fleet: FleetProblem) -> FleetResult:
    """The result of a plan.json of several vehicles; `verify_fleet` proves what it claims again."""
    document = read_of_fleet(path, "fleet", fleet)
    stated = document["vehicles"]
    results = {
        name: result_of(stated[name], problem, place=f"{path}: vehicles.{name}")
        for name, problem in zip(fleet.names, fleet.problems, strict=True)
    }
    with errors_at(path):
        return made(
            FleetResult,
            document,
            FleetDocument,
            problem=fleet,
            results=results,
            clearance_m=or_inf(document["clearance_m"]["between"]),
            reasons={name: one.reason for name, one in results.items() if one.plan is None},
            timing_s={},
            counts={},
        )


def read_of_fleet(path: Path | str, kind: str, fleet: FleetProblem) -> dict[str, Any]:
    """What a file of this kind holds of a fleet; it has to be that of these vehicles."""
    document = read_document(path, kind)
    if set(stated := document["vehicles"]) != set(fleet.names):
        raise InvalidScenario(
            f"{path}: vehicles: got {', '.join(stated)}, need {', '.join(fleet.names)}"
        )
    return document


Row: TypeAlias = Mapping[str, Any]  # an object of the file


class SwapEntry(TypedDict):
    """Plans exchanged for others, of one vehicle or of several at once."""

    vehicles: Annotated[list[str], of("names")]
    before: Annotated[Known, says("cost of what was left of their plans; null if not all arrived")]
    after: Number
    past: Annotated[dict[str, Whole], says("proven past the plan of this number")]
    holds: dict[str, Whole]


class FleetBrokenEntry(TypedDict):
    """A guarantee that did not hold, of which vehicles, and why."""

    step: NotRequired[Annotated[Whole, says("its number, where it is not that of the row")]]
    guarantee: str
    vehicles: Annotated[list[str], of("names")]
    reason: str


class FleetStepEntry(TypedDict):
    """What holds of all vehicles in a step; in the last entry, where it ended."""

    time_s: Number
    value: Annotated[Known, says("cost of what is left; null if not all plans arrive")]
    accumulated_cost: Number
    number: NotRequired[Whole]
    swaps: list[SwapEntry]
    asked: Annotated[list[str], says("who looked for another plan")]
    void: Annotated[list[str], says("whose plans were void, and planned anew")]
    refused: Annotated[list[str], says("who has not been let in yet")]
    arrived: list[str]
    gap_m: Annotated[Known, says("any two keep it over the rest of the plans")]
    distance_m: Annotated[Known, says("least of any two along what was driven")]
    solve_s: Known
    broken_guarantees: Annotated[list[FleetBrokenEntry], of("violations")]


class HeldEntry(TypedDict):
    """A plan that is held from a step on, from where and when it began."""

    time_s: Number
    pose: Numbers
    plan: list[Piece]


class DroveEntry(PlaceEntry):
    """A step of one vehicle."""

    control: Numbers | None
    word: list[str]
    plan: list[Piece]
    replanned: Flag
    number: Whole
    vehicle_pose: VehiclePose
    measured_pose: Numbers
    arrival_s: Annotated[Known, says("when its plan arrives; null if it does not")]
    off_plan_m: Number
    plan_time_s: Number
    held: Annotated[HeldEntry | None, says("the plan held from now on, if it is another one")]
    driven: Annotated[list[Piece] | None, says("if it was not the begin of the plan")]


VehicleStep = Annotated[Annotated[DroveEntry, Tag("<applied>")] | Ended, Discriminator(has_ended)]


class VehicleLoopEntry(TypedDict):
    """What one vehicle did."""

    vehicle: ModelEntry
    automaton_hash: str
    status: Annotated[str, says("arrived, under_way, broken_down or not_there")]
    reached: Flag
    arrived_s: Known
    cost: Number
    steps: Annotated[list[VehicleStep], Field(min_length=1)]


class FleetLoopDocument(DocumentHead):
    """What a closed loop of several vehicles did."""

    kind: Literal["fleet"]
    status: Annotated[str, says("reached or steps_spent")]
    reached: NotRequired[Flag]
    cost: Annotated[Number, says("of all that was driven")]
    duration_s: NotRequired[Number]
    step_s: Positive
    sum_s: NotRequired[Number]
    last_s: NotRequired[Number]
    clearance_m: NotRequired[ClearanceEntry]
    closest: list[ClosestEntry]
    collisions: NotRequired[list[str]]
    broken_guarantees: NotRequired[list[FleetBrokenEntry]]
    counts: dict[str, Whole]
    vehicles: dict[str, VehicleLoopEntry]
    steps: Annotated[list[FleetStepEntry], Field(min_length=1)]


def fleet_loop_to_dict(
    log: FleetLog, driven: DrivenVerdict, *, name: str = ""
) -> FleetLoopDocument:
    """The content of closed_loop.json for several vehicles, as plain values."""
    fleet, times = log.problem, log.times
    vehicles = {
        one: _vehicle(log, one, problem)
        for one, problem in zip(fleet.names, fleet.problems, strict=True)
    }
    return document_of(
        FleetLoopDocument,
        log,
        kind=FLEET,
        name=name,
        notes=left_out(*fleet.problems),
        duration_s=times[-1] - times[0],
        clearance_m={
            "between": number(driven.distance_m),
            "to_obstacles": number(driven.clearance_m),
        },
        closest=driven.closest,
        collisions=driven.collisions,
        broken_guarantees=[entry(FleetBrokenEntry, one, step=k) for k, one in log.violations],
        vehicles=vehicles,
        steps=_steps(log, vehicles),
    )


# -- all together


def _steps(log: FleetLog, vehicles: Mapping[str, Any]) -> list[FleetStepEntry]:
    """What holds of all vehicles in each step, and where it ended."""
    spent = {name: {e["time_s"]: e for e in one["steps"]} for name, one in vehicles.items()}
    known = dict.fromkeys(vehicles, 0.0)
    rows: list[FleetStepEntry] = []
    for step, value in zip(log.steps, log.values.tolist(), strict=True):
        for name, entries in spent.items():
            if step.time in entries:
                known[name] = entries[step.time]["accumulated_cost"]
        spent_yet = math.fsum(known.values())
        rows.append(entry(FleetStepEntry, step, value=value, accumulated_cost=spent_yet))
    return [*rows, _ended(log, vehicles)]


def _ended(log: FleetLog, vehicles: Mapping[str, Any]) -> FleetStepEntry:
    last = [one["steps"][-1] for one in vehicles.values()]
    values = [
        one["steps"][-1]["value"] for name, one in vehicles.items() if name not in log.broken_down
    ]
    return entry(
        FleetStepEntry,
        None,
        time_s=log.times[-1],
        value=None if None in values else math.fsum(values),
        accumulated_cost=math.fsum(one["accumulated_cost"] for one in last),
        arrived=sorted(log.arrived_s),
        **{key: [] for key in ("swaps", "asked", "void", "refused", "broken_guarantees")},
    )


# -- one vehicle


def _vehicle(log: FleetLog, name: str, problem: Problem) -> VehicleLoopEntry:
    """What one vehicle did, as closed_loop.json of one vehicle says it."""
    automaton, pieces = problem.automaton, log.pieces_of(name)
    spent = list(accumulate(log.costs_of(name).values(), initial=0.0))
    rows: list[DroveEntry] = []
    held = None
    for cost, (k, piece) in zip(spent, pieces.items(), strict=False):
        step = log.steps[k]
        rows.append(_row(step, name, piece, cost, held, problem))
        held = step.plans[name]
    when, pose, value = _end_of(log, name, problem)
    broken, arrived = name in log.broken_down, log.arrived_s.get(name)
    status = "broken_down" if broken else "under_way" if arrived is None else "arrived"
    return {
        "vehicle": vehicle_entry(automaton.model),
        "automaton_hash": automaton_hash(automaton),
        "status": status if pieces else "not_there" if arrived is None else status,
        "reached": arrived is not None,
        "arrived_s": None if arrived is None else float(arrived),
        "cost": spent[-1],
        "steps": [*rows, ended_entry(when, pose.tolist(), value, spent[-1])],
    }


def _row(
    step: FleetStep, name: str, piece: Plan, cost: float, held: Plan | None, problem: Problem
) -> DroveEntry:
    plan, automaton = step.driven[name], problem.automaton
    now = step.plans[name]
    exchanged = {one for swap in step.swaps for one in swap.names} | set(step.void)
    other = any(  # what was driven is not the begin of the plan, but of other velocities
        not np.array_equal(one.body_velocity, meant.body_velocity)
        for one, meant in zip(piece.trims, plan.trims, strict=False)
    )
    begun = {"time_s": now.start_time, "pose": now.start, "plan": words_of(now, automaton)}
    return entry(
        DroveEntry,
        step,
        pose=plan.start,
        value=step.values[name],
        accumulated_cost=cost,
        control=step.control_of(name),
        word=plan.word,
        plan=words_of(plan, automaton),
        replanned=name in exchanged,
        vehicle_pose=piece.start,
        measured_pose=step.poses[name],
        arrival_s=step.arrivals[name],
        off_plan_m=step.off_plan[name],
        plan_time_s=plan.start_time,
        held=None if now is held else entry(HeldEntry, None, **begun),
        driven=words_of(piece, automaton) if other else None,
    )


def _end_of(log: FleetLog, name: str, problem: Problem) -> tuple[float, Array, float]:
    """When and where a vehicle ended, and what it had left to pay."""
    pieces = log.pieces_of(name)
    if not pieces:
        return float(log.times[0]), problem.start, math.inf
    k, piece = next(reversed(pieces.items()))
    gone = next((step for step in log.steps[k + 1 :] if name in step.plans), None)
    if gone is not None:  # it has arrived, and left
        return float(gone.time), gone.poses[name], 0.0
    value = 0.0 if name in log.arrived_s else log.steps[k].values[name] - log.costs_of(name)[k]
    return float(log.times[k + 1]), piece.end, max(value, 0.0)


# -- reading


def load_fleet_loop(path: Path | str, fleet: FleetProblem) -> FleetLog:
    """The loop of a closed_loop.json of several; `verify_driven` proves what it claims again."""
    document = read_of_fleet(path, "fleet-loop", fleet)
    stated = document["vehicles"]
    problems = dict(zip(fleet.names, fleet.problems, strict=True))
    for name, problem in problems.items():
        if stated[name]["automaton_hash"] != automaton_hash(problem.automaton):
            raise InvalidScenario(
                f"{path}: vehicles.{name}.automaton_hash: this loop was driven with another library"
            )
    step_s, did, pieces = float(document["step_s"]), {}, {}
    for name, problem in problems.items():
        with errors_at(f"{path}: vehicles.{name}"):
            did[name] = _did(stated[name]["steps"][:-1], problem.automaton)
    with errors_at(path):
        steps = [_step_of(k, row, did) for k, row in enumerate(document["steps"][:-1])]
        for before, after in pairwise(steps):
            if not after.time > before.time:
                raise ValueError(
                    f"steps: step {after.number} is at {after.time:g} s, need more than "
                    f"{before.time:g} s"
                )
    for name, problem in problems.items():
        with errors_at(f"{path}: vehicles.{name}"):
            pieces[name] = tuple(
                _piece(steps[number], name, row, step_s, problem.automaton)
                for number, (row, _, _) in did[name].items()
            )
    with errors_at(path):
        closest = [made(Closest, one, ClosestEntry) for one in document["closest"]]
        return made(
            FleetLog,
            document,
            FleetLoopDocument,
            problem=fleet,
            steps=tuple(steps),
            driven=pieces,
            arrived_s={
                name: float(one["arrived_s"]) for name, one in stated.items() if one["reached"]
            },
            broken_down=tuple(
                sorted(name for name, one in stated.items() if one["status"] == "broken_down")
            ),
            closest=min(closest, key=lambda row: row.distance_m, default=None),
        )


def _did(rows: Sequence[Row], automaton: Automaton) -> dict[int, tuple[Row, Plan, Plan]]:
    """By step what a vehicle did, the plan that it held, and what it drove of it."""
    found: dict[int, tuple[Row, Plan, Plan]] = {}
    held: Plan | None = None
    for row in rows:
        if (it := row["held"]) is not None:
            held = plan_of(_pose(it["pose"], automaton), float(it["time_s"]), it["plan"], automaton)
        if held is None:
            raise ValueError(f"steps: holds no plan at {row['time_s']:g} s")
        start, time = _pose(row["pose"], automaton), float(row["plan_time_s"])
        found[int(row["number"])] = (row, held, plan_of(start, time, row["plan"], automaton))
    return found


def _pose(numbers: Any, automaton: Automaton) -> Array:
    return as_array("steps: pose", numbers, last=automaton.model.group.dof)


def _piece(step: FleetStep, name: str, row: Row, step_s: float, automaton: Automaton) -> Plan:
    pose = _pose(row["vehicle_pose"], automaton)
    undisturbed = step.piece_of(name, pose, step.time + step_s, automaton.model)
    if row["driven"] is None:
        return undisturbed
    return plan_of(pose, undisturbed.start_time, row["driven"], automaton)


def _step_of(
    number: int, row: Row, did: Mapping[str, Mapping[int, tuple[Row, Plan, Plan]]]
) -> FleetStep:
    if row["number"] != number:
        raise ValueError(f"steps: number: got {row['number']}, need {number}")
    here = {name: its[number] for name, its in did.items() if number in its}
    own = {name: its for name, (its, _, _) in here.items()}
    late = [name for name, its in own.items() if its["time_s"] != row["time_s"]]
    if late:
        raise ValueError(
            f"vehicles.{late[0]}: step {number} is at {own[late[0]]['time_s']:g} s, "
            f"need {row['time_s']:g} s"
        )
    return made(
        FleetStep,
        row,
        FleetStepEntry,
        poses={name: np.array(its["measured_pose"], dtype=float) for name, its in own.items()},
        plans={name: held for name, (_, held, _) in here.items()},
        driven={name: plan for name, (_, _, plan) in here.items()},
        values={name: or_inf(its["value"]) for name, its in own.items()},
        arrivals={name: or_inf(its["arrival_s"]) for name, its in own.items()},
        off_plan={name: float(its["off_plan_m"]) for name, its in own.items()},
        swaps=tuple(made(Swap, one, SwapEntry, order=k) for k, one in enumerate(row["swaps"])),
    )
