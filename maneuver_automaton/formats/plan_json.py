"""plan.json: the answer to a problem as a file, and the plan back from it.

Every key is always there: without a plan the numbers are null and the lists empty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, cast

import numpy as np
from typing_extensions import TypedDict

from maneuver_automaton import bounds
from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.audit import TerminalError
from maneuver_automaton.automaton import Plan, Primitive
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.documents import (
    FLEET,
    DocumentHead,
    ModelEntry,
    checked,
    document_of,
    errors_at,
    kind_of,
    library_entries,
    parsed,
    read_document,
    write_document,
)
from maneuver_automaton.formats.entries import (
    Flag,
    Known,
    Number,
    Pairs,
    Whole,
    entry,
    made,
    of,
    says,
)
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model
from maneuver_automaton.planning import Alternative, LowerBound, PlanResult, PlanStatus
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.problem import Problem

FAR = 1e6  # [m] from here on poses are written relative to the start
TIMINGS = ("load", "automaton", "search", "first_plan", "refine", "audit")
COUNTS = ("expansions", "collision_queries")
TIME_TOLERANCE = 1e-9  # [s], relative to the duration, between a switch and its sample


class NarrowestEntry(TypedDict):
    """The passage that is too narrow."""

    place: tuple[Number, Number]
    missing_m: Number


class BoundEntry(TypedDict):
    """What proves the lower bound."""

    value: Number
    kind: Annotated[str, says("of bound that won")]
    history: Annotated[Pairs, says("[[s, value]]")]


class PlacePriceEntry(TypedDict):
    """What one cost of places adds to a plan's cost."""

    kind: Annotated[str, says("Clearance, Ground, or what a user's own is called")]
    per: Annotated[str, says("metre or second")]
    price: Number
    error: Annotated[Number, says("of its integration, as estimated")]


class CostPartsEntry(TypedDict):
    """The parts of a plan's cost."""

    invariant: Annotated[Number, says("what does not depend on where the plan is")]
    places: Annotated[list[PlacePriceEntry], says("what does")]


class PrimitiveEntry(TypedDict):
    """A trim or a maneuver."""

    kind: Literal["trim", "maneuver"]
    name: str
    control: NotRequired[Annotated[list[Number] | None, says("of a trim, in the model's units")]]
    duration_s: Number
    source: NotRequired[Annotated[str, says("of a maneuver: the trim that it begins in")]]
    target: NotRequired[Annotated[str, says("of a maneuver: the trim that it ends in")]]


class TerminalErrorEntry(TypedDict):
    """How far the end is from the goal, headings modulo a full turn."""

    position_m: Known
    heading_rad: Known


class TrajectoryEntry(TypedDict):
    """Samples at every switch, and at most 0.05 m and 0.05 rad apart."""

    origin: Annotated[list[Number], says("to be added to x, y; zero unless one exceeds 1e6 m")]
    time_s: list[Number]
    pose: Annotated[list[list[Number]], says("[[x, y, heading(, z)]]; headings are continuous")]
    reduced_state: list[list[Number]]
    control: Annotated[list[list[Number]], says("control[i] holds from time i to i + 1")]


class AuditEntry(TypedDict):
    """What the audit found."""

    passed: Flag | None
    max_dynamics_defect: Known
    min_clearance_m: Known
    terminal_position_m: Known
    terminal_heading_rad: Known
    place_price: NotRequired[Annotated[Known, says("of the places, integrated anew")]]


class AlternativeEntry(TypedDict):
    """A costlier plan."""

    cost: Number
    duration_s: Number
    word: list[str]
    primitives: list[PrimitiveEntry]
    terminal_error: TerminalErrorEntry


class PassedEntry(TypedDict):
    """A pose on the way that the plan passes."""

    number: Annotated[Whole, says("of the pose on the way, from 1")]
    time_s: Annotated[Number, says("on the clock of the trajectory")]
    pose: Annotated[list[Number], says("[x, y, heading(, z)] there")]


class PlanDocument(DocumentHead):
    """The answer to a problem."""

    vehicle: NotRequired[ModelEntry | None]
    automaton_hash: NotRequired[Annotated[str, says("what the library was")]]
    status: Annotated[str, says("how planning ended")]
    narrowest: NotRequired[Annotated[NarrowestEntry | None, says("only where one is known")]]
    cost: NotRequired[Known]
    cost_parts: NotRequired[
        Annotated[CostPartsEntry, of("cost_parts"), says("only where places are priced")]
    ]
    duration_s: NotRequired[Known]
    lower_bound: NotRequired[Annotated[Known, says("no plan costs less")]]
    gap: NotRequired[Annotated[Known, says("(cost - lower_bound) / cost")]]
    bound: NotRequired[BoundEntry | None]
    certificate: NotRequired[Annotated[Known, says("smallest reduced cost over the library")]]
    primitives: Annotated[list[PrimitiveEntry], says("they add up to duration_s")]
    terminal_error: NotRequired[TerminalErrorEntry | None]
    via: NotRequired[Annotated[list[PassedEntry], says("passed on the way, if anything is")]]
    clearance_m: NotRequired[Annotated[Known, says("least distance to an obstacle")]]
    trajectory: TrajectoryEntry
    audit: NotRequired[AuditEntry | None]
    alternatives: NotRequired[Annotated[list[AlternativeEntry], says("costlier plans, by cost")]]
    improvements: NotRequired[Annotated[Pairs, says("[[s, cost]] of the plans found")]]
    timing_s: NotRequired[Annotated[dict[str, Known], says("what took how long")]]
    counts: NotRequired[Annotated[dict[str, Whole], says("expansions, gains, plans refused, ...")]]


def plan_to_dict(result: PlanResult, *, name: str = "") -> PlanDocument:
    """The content of plan.json, as plain values; `name` is that of the scenario.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.planning import PlanStatus
    >>> from maneuver_automaton.problem import Problem
    >>> robot = Automaton.of_controls(Unicycle(), {"spin": (0.0, 1.0)})
    >>> document = plan_to_dict(
    ...     PlanResult(
    ...         problem=Problem(robot, [0, 0, 0], [1, 0, 0]),
    ...         status=PlanStatus.UNREACHABLE,
    ...         reason="only spins: the position never changes",
    ...     )
    ... )
    >>> document["status"], document["cost"], document["primitives"]
    ('unreachable', None, [])
    """
    document = document_of(
        PlanDocument,
        result,
        name=name,
        **library_entries(result.problem.automaton),
        duration_s=None if result.plan is None else result.plan.duration,
        primitives=primitive_entries(result.plan),
        trajectory=trajectory_entry(result.plan),
        terminal_error=entry(TerminalErrorEntry, result.terminal_error),
        via=[entry(PassedEntry, one, time_s=one.time) for one in result.via],
        audit=entry(AuditEntry, result.audit),
        alternatives=[
            entry(
                AlternativeEntry,
                one,
                duration_s=one.plan.duration,
                word=one.plan.word,
                primitives=primitive_entries(one.plan),
            )
            for one in result.alternatives
        ],
        timing_s=dict.fromkeys(TIMINGS) | result.timing_s,
        counts=dict.fromkeys(COUNTS, 0) | result.counts,
        **_cost_parts(result),
    )
    if result.narrowest is None:
        del document["narrowest"]
    if not result.problem.via:
        del document["via"]
    if document["audit"] and document["audit"].get("place_price") is None:
        document["audit"].pop("place_price", None)
    return document


def _cost_parts(result: PlanResult) -> dict[str, CostPartsEntry]:
    """The key of the parts of a plan's cost; none where places cost nothing."""
    problem, plan = result.problem, result.plan
    if plan is None or not problem.place_costs:
        return {}
    prices = [
        entry(PlacePriceEntry, found, kind=type(cost).__name__, per=cost.per)
        for cost, found in zip(problem.place_costs, problem.place_prices_of(plan), strict=True)
    ]
    return {"cost_parts": {"invariant": problem.invariant_cost_of(plan), "places": prices}}


def save_plan(
    result: PlanResult, path: Path | str, *, name: str = "", interrupted: bool = False
) -> None:
    """Write plan.json in one step; `interrupted` by a signal it says so.

    The `name` of the scenario heads the pictures that are drawn of the file.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    write_document(plan_to_dict(result, name=name), path, interrupted=interrupted)


def trajectory_entry(plan: Plan | None) -> TrajectoryEntry:
    """Samples of a plan; far from the origin sampled from (0, 0), so that no digit is lost."""
    if plan is None:
        return {"origin": [], "time_s": [], "pose": [], "reduced_state": [], "control": []}
    origin = np.zeros(2)
    samples = plan.sample()
    if np.abs(samples.pose[:, :2]).max() > FAR:
        origin = plan.start[:2]
        samples = replace(plan, start=np.concatenate([np.zeros(2), plan.start[2:]])).sample()
    return {
        "origin": origin.tolist(),
        "time_s": samples.time.tolist(),
        "pose": samples.pose.tolist(),
        "reduced_state": samples.reduced_state.tolist(),
        "control": samples.control.tolist(),
    }


def primitive_entries(plan: Plan | None) -> list[PrimitiveEntry]:
    """Trims and maneuvers in order; a maneuver has no control of its own, but two ends."""
    entries: list[PrimitiveEntry] = []
    if plan is None:
        return entries
    for primitive, duration in zip(plan.primitives, plan.primitive_durations, strict=True):
        trim = primitive if isinstance(primitive, Trim) else None
        entry: PrimitiveEntry = {
            "kind": "maneuver" if trim is None else "trim",
            "name": primitive.name,
            "control": None if trim is None else trim.control.tolist(),
            "duration_s": float(duration),
        }
        if isinstance(primitive, Maneuver):
            entry |= {"source": primitive.source, "target": primitive.target}
        entries.append(entry)
    return entries


# -- reading


def read_plan_document(path: Path | str) -> dict[str, Any]:
    """The content of a plan.json, as plain values.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, or is no plan.json.
    """
    value = parsed(path)
    if isinstance(value, dict) and value.get("kind") == FLEET:
        names = ", ".join(map(str, value.get("vehicles") or ())) or "none"
        raise InvalidScenario(
            f"{path}: holds plans of several vehicles ({names}), need that of one; see load_plans"
        )
    return checked("road-plan" if kind_of(value) == "road-plan" else "plan", value, path)


def read_fleet_document(path: Path | str) -> dict[str, Any] | None:
    """The content of a plan.json of several vehicles, as plain values; None of any other."""
    value = parsed(path)
    if not isinstance(value, dict) or value.get("kind") != FLEET:
        return None
    return checked(kind_of(value), value, path)


def load_plan(path: Path | str, *, vehicle: str | None = None, model: Model | None = None) -> Plan:
    """The plan of a plan.json; no automaton is needed.

    The body velocity of each trim is taken from the samples: the logarithm of the motion over a
    stretch of less than half a turn, per second.

    Parameters
    ----------
    path : Path or str
    vehicle : str, optional
        Which of several vehicles, by its name, if the file holds their plans.
    model : Model, optional
        Of the vehicle, which the file does not name: what lies between the samples of a maneuver
        follows its equations then. Without it the twist is constant from sample to sample.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, is no plan.json, or holds no plan, or none of that vehicle.
    """
    if vehicle is None:
        return _plan_of_file(read_plan_document(path), str(path), model)
    vehicles = (read_fleet_document(path) or {}).get("vehicles", {})
    if vehicle not in vehicles:
        names = ", ".join(vehicles) or "one vehicle without a name"
        raise InvalidScenario(f"{path}: holds no vehicle {vehicle!r}, but {names}")
    return _plan_of_file(vehicles[vehicle], f"{path}: vehicles.{vehicle}", model)


def load_plans(path: Path | str) -> dict[str, Plan]:
    """The plans of a plan.json of several vehicles, by the names of those that have one.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, or holds no plans of several vehicles.
    """
    document = read_fleet_document(path)
    if document is None:
        raise InvalidScenario(f"{path}: holds the plan of one vehicle, need load_plan")
    return {
        name: _plan_of_file(one, f"{path}: vehicles.{name}")
        for name, one in document["vehicles"].items()
        if not isinstance(one, dict) or one.get("status") == "found"
    }


def _plan_of_file(document: Any, place: str, model: Model | None = None) -> Plan:
    """The plan of a document at a place of a file; or InvalidScenario."""
    with errors_at(place):
        if document["status"] != "found":
            raise InvalidScenario(f"{place}: holds no plan, its status is {document['status']!r}")
        return plan_of_document(document, model)


def load_result(path: Path | str, problem: Problem) -> PlanResult:
    """The result of a plan.json of this `problem`; alternatives with maneuvers are left out."""
    return result_of(read_document(path, "plan"), problem, place=str(path))


def result_of(document: Mapping[str, Any], problem: Problem, *, place: str) -> PlanResult:
    """The result of a document that is read already; `place` is where it stands, for messages."""
    if document.get("automaton_hash") != automaton_hash(problem.automaton):
        raise InvalidScenario(f"{place}: automaton_hash: this was planned with another library")
    passage, bound = document.get("narrowest"), document.get("bound")
    same = ("cost", "lower_bound", "gap", "certificate", "clearance_m")
    with errors_at(place):
        status = PlanStatus(document["status"])
        found = status is PlanStatus.FOUND
        others = (_alternative(one, problem) for one in document.get("alternatives") or ())
        return PlanResult(
            problem=problem,
            status=status,
            reason=document.get("reason", ""),
            plan=plan_of_document(document, problem.automaton.model) if found else None,
            bound=bound and made(LowerBound, bound, BoundEntry),
            terminal_error=_error(document.get("terminal_error")),
            alternatives=tuple(one for one in others if one is not None),
            improvements=tuple(
                (float(at), float(cost)) for at, cost in document.get("improvements", ())
            ),
            narrowest=passage and made(bounds.Narrowest, passage, NarrowestEntry),
            notes=tuple(document.get("notes", ())),
            **cast("Any", {key: document.get(key) for key in same}),
        )


def _alternative(stated: AlternativeEntry, problem: Problem) -> Alternative | None:
    """A costlier plan of trims; None where it has maneuvers."""
    automaton, rows = problem.automaton, stated["primitives"]
    error = _error(stated["terminal_error"])
    known = all(one["kind"] == "trim" and one["name"] in automaton for one in rows)
    if not known or error is None:
        return None
    plan = Plan(
        problem.start,
        [automaton[one["name"]] for one in rows],
        durations=[one["duration_s"] for one in rows],
        start_time=problem.start_time,
    )
    return Alternative(plan=plan, cost=stated["cost"], terminal_error=error)


def _error(stated: TerminalErrorEntry | None) -> TerminalError | None:
    if stated is None or None in stated.values():
        return None
    return made(TerminalError, stated, TerminalErrorEntry)


def plan_of_document(document: Mapping[str, Any], model: Model | None = None) -> Plan:
    """The plan of a plan.json that is read already; `model` is as in `load_plan`."""
    trajectory, primitives = document["trajectory"], document["primitives"]
    time = as_array("trajectory.time_s", trajectory["time_s"])
    pose = as_array("trajectory.pose", trajectory["pose"], last=(3, 4))
    origin = as_array("trajectory.origin", trajectory["origin"], last=2)
    if time.ndim != 1 or pose.ndim != 2 or len(time) != len(pose) or not len(time):
        raise ValueError(
            f"trajectory: got {len(time)} times and {len(pose)} poses, need one pose per time"
        )
    samples = Trajectory(
        time=time,
        pose=pose,
        reduced_state=_rows(trajectory, "reduced_state", len(time)),
        control=_rows(trajectory, "control", len(time)),
        model=model,
    )
    for k, one in enumerate(primitives):
        if (kind := one["kind"]) not in ("trim", "maneuver"):
            raise ValueError(f"primitives[{k}].kind: got {kind!r}, need 'trim' or 'maneuver'")
    durations = [
        float(as_array(f"primitives[{k}].duration_s", one["duration_s"]))
        for k, one in enumerate(primitives)
    ]
    due = time[0] + np.concatenate([[0.0], np.cumsum(durations)])
    switches = [int(np.abs(time - at).argmin()) for at in due]  # samples
    tolerance = TIME_TOLERANCE * max(1.0, float(np.abs(due).max()))
    if np.abs(time[switches] - due).max() > tolerance or switches[-1] != len(time) - 1:
        raise ValueError("trajectory: has no sample at a switching time of the primitives")
    pieces = [
        _primitive(entry, _stretch(samples, begin, end))
        for entry, begin, end in zip(primitives, switches[:-1], switches[1:], strict=True)
    ]
    passed = {
        name: _passed(name, course, at)
        for one in pieces
        if isinstance(one, Maneuver) and (course := one.course) is not None
        for name, at in ((one.source, 0), (one.target, -1))
    }
    start = pose[0].copy()
    start[:2] += origin
    plan = Plan.of_primitives(
        start, pieces, durations=durations, trims=passed, start_time=float(time[0])
    )
    return replace(plan, notes=tuple(map(str, document.get("notes") or ())))


def _rows(trajectory: Mapping[str, Any], key: str, count: int) -> Array:
    """One row of numbers (n,) for every sample; rows may be empty."""
    rows = np.array(trajectory[key], dtype=np.float64).reshape(len(trajectory[key]), -1)
    if len(rows) != count:
        raise ValueError(f"trajectory.{key}: got {len(rows)} rows for {count} times")
    return rows


def _stretch(samples: Trajectory, begin: int, end: int) -> Trajectory:
    """The samples from one to another, from time 0 and seen from the first pose."""
    rows = slice(begin, end + 1)
    group = group_of(samples.pose.shape[1])
    pose = (group(samples.pose[begin]).inverse() @ group(samples.pose[rows])).pose.copy()
    pose[0] = 0.0
    control = samples.control[rows].copy()
    control[-1] = control[max(len(control) - 2, 0)]
    return Trajectory(
        time=samples.time[rows] - samples.time[begin],
        pose=pose,
        reduced_state=samples.reduced_state[rows],
        control=control,
        model=samples.model,
    )


def _primitive(entry: Mapping[str, Any], course: Trajectory) -> Primitive:
    if entry["kind"] == "trim":
        return Trim(
            name=entry["name"],
            control=entry["control"],
            body_velocity=_twist(course.time, course.pose),
            reduced_state=course.reduced_state[0],
        )
    return Maneuver.along(
        course, name=entry["name"], source=entry["source"], target=entry["target"]
    )


def _passed(name: str, course: Trajectory, at: int) -> Trim:
    """A trim that lasts no time, before or after a maneuver: its twist does not matter."""
    return Trim(
        name=name,
        control=np.zeros(course.control.shape[1]),
        body_velocity=np.zeros(course.pose.shape[1]),
        reduced_state=course.reduced_state[at],
    )


def _twist(time: Array, pose: Array) -> Array:
    """Body velocity (dof,) of the trim that runs through the samples."""
    group = group_of(pose.shape[1])
    span = float(time[-1] - time[0])
    if span <= 0.0:
        return np.zeros(group.dof)
    last = int(np.flatnonzero(np.abs(pose[:, 2] - pose[0, 2]) < np.pi)[-1])
    if last == 0:
        raise ValueError("trajectory: two samples of a trim are half a turn apart, need more")
    twist = (group(pose[0]).inverse() @ group(pose[last])).log() / (time[last] - time[0])
    twist[2] = (pose[-1, 2] - pose[0, 2]) / span  # the longer stretch says it better
    return np.asarray(twist, dtype=np.float64)
