"""plan.json: the answer to a problem as a file, and the plan back from it.

Strict JSON; numbers read back to the last bit. Every key is always there: without a plan the
numbers are null and the lists empty.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton._files import open_input, write_text_atomically
from maneuver_automaton.audit import Audit, TerminalError
from maneuver_automaton.automaton import Plan, Primitive
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model
from maneuver_automaton.planning import Alternative, LowerBound, PlanResult
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim

if TYPE_CHECKING:
    from maneuver_automaton.bounds import Narrowest

SCHEMA = 1
FAR = 1e6  # [m] from here on poses are written relative to the start
TIMINGS = ("load", "automaton", "search", "first_plan", "refine", "audit")
COUNTS = ("expansions", "collision_queries")
TRAJECTORY = ("origin", "time_s", "pose", "reduced_state", "control")
LISTS = (
    "primitives",
    "stop",
    "alternatives",
    "steps",
    "broken_guarantees",
    "closest",
)  # of objects
FLEET = "fleet"  # the kind of a file with plans of several vehicles
TIME_TOLERANCE = 1e-9  # [s], relative to the duration, between a switch and its sample


def plan_to_dict(result: PlanResult, *, name: str = "") -> dict[str, Any]:
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
    plan = result.plan
    return {
        "schema": SCHEMA,
        "version": package_version(),
        "name": name,
        "vehicle": vehicle_entry(result.problem.automaton.model),
        "automaton_hash": automaton_hash(result.problem.automaton),
        "status": result.status.value,
        "reason": result.reason,
        "notes": list(result.notes),
        **_narrowest(result.narrowest),
        "cost": _number(result.cost),
        "duration_s": None if plan is None else plan.duration,
        "lower_bound": _number(result.lower_bound),
        "gap": _number(result.gap),
        "bound": _bound(result.bound),
        "certificate": _number(result.certificate),
        "primitives": primitive_entries(plan),
        "terminal_error": _terminal_error(result.terminal_error),
        "clearance_m": _number(result.clearance_m),
        "trajectory": trajectory_entry(plan),
        "audit": _audit(result.audit),
        "alternatives": [_alternative(one) for one in result.alternatives],
        "improvements": [[float(at), float(cost)] for at, cost in result.improvements],
        "timing_s": {**dict.fromkeys(TIMINGS), **_floats(result.timing_s)},
        "counts": {**dict.fromkeys(COUNTS, 0), **{k: int(v) for k, v in result.counts.items()}},
    }


def vehicle_entry(model: Model) -> dict[str, Any]:
    """The vehicle by name, and what the columns of a trajectory are."""
    return {
        "model": model.name,
        "reduced_state": list(model.reduced_names),
        "control": list(model.control_names),
    }


def _bound(bound: LowerBound | None) -> dict[str, Any] | None:
    if bound is None:
        return None
    history = [[float(at), float(value)] for at, value in bound.history]
    return {"value": float(bound.value), "kind": bound.kind, "history": history}


def _narrowest(passage: Narrowest | None) -> dict[str, Any]:
    """The passage that is too narrow, where one is known."""
    if passage is None:
        return {}
    return {"narrowest": {"place": list(passage.place), "missing_m": passage.missing}}


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


def write_document(
    document: Mapping[str, Any], path: Path | str, *, interrupted: bool = False
) -> None:
    """Write a plan.json or closed_loop.json in one step: strict JSON, long lists entry by entry.

    Where a signal came before the work was done, the key `interrupted` says so.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    said = {**document, "interrupted": True} if interrupted else document
    write_text_atomically(Path(path), _object(said, "") + "\n")


def read_plan_document(path: Path | str) -> dict[str, Any]:
    """The content of a plan.json, as plain values.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, or is no plan.json.
    """
    document = _parsed(Path(path), "plan")
    if _is_of_fleet(document):
        names = ", ".join(map(str, document.get("vehicles") or ())) or "none"
        raise InvalidScenario(
            f"{path}: holds plans of several vehicles ({names}), need that of one; see load_plans"
        )
    return _checked(document, path, ("schema", "status", "primitives", "trajectory"), "plan")


def read_fleet_document(path: Path | str) -> dict[str, Any] | None:
    """The content of a plan.json of several vehicles, as plain values; None of any other.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, or misses what plans of several vehicles have.
    """
    document = _parsed(Path(path), "plan")
    if not _is_of_fleet(document):
        return None
    found = _checked(document, path, ("schema", "status", "vehicles"), "plan")
    if not isinstance(found["vehicles"], dict):
        raise InvalidScenario(f"{path}: vehicles: need an object with a plan for each name")
    return found


def _is_of_fleet(document: Any) -> bool:
    return isinstance(document, dict) and document.get("kind") == FLEET


def read_json(path: Path | str, *, needed: Sequence[str], kind: str) -> dict[str, Any]:
    """The object of a strict JSON file of our `SCHEMA` that has the keys `needed`.

    Raises
    ------
    InvalidScenario
        If the file cannot be read, or is no such object; `kind` is what it should be.
    """
    return _checked(_parsed(Path(path), kind), path, needed, kind)


def _parsed(path: Path, kind: str) -> Any:
    """The value of a strict JSON file; or InvalidScenario."""
    try:
        with open_input(path) as stream:
            text = stream.read().decode("utf-8")
        return json.loads(text, parse_constant=_refuse_constant)
    except FileNotFoundError as error:
        raise InvalidScenario(f"{path}: no such file") from error
    except IsADirectoryError as error:
        raise InvalidScenario(f"{path}: is a folder, need a {_file_name(kind)}") from error
    except OSError as error:
        raise InvalidScenario(f"{path}: cannot be read: {error.strerror}") from error
    except json.JSONDecodeError as error:
        raise InvalidScenario(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from error
    except (ValueError, RecursionError) as error:
        raise InvalidScenario(f"{path}: not valid JSON: {error}") from error


def _checked(document: Any, path: Path | str, needed: Sequence[str], kind: str) -> dict[str, Any]:
    """The object that a file holds, of our `SCHEMA`, with the keys `needed`."""
    if not isinstance(document, dict) or any(key not in document for key in needed):
        raise InvalidScenario(
            f"{path}: is no {_file_name(kind)}, need an object with {', '.join(needed)}"
        )
    if document["schema"] != SCHEMA:
        raise InvalidScenario(f"{path}: schema: got {document['schema']!r}, need {SCHEMA}")
    return document


def _file_name(kind: str) -> str:
    return f"{kind.replace(' ', '_')}.json"


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
    document = read_fleet_document(path)
    vehicles = {} if document is None else document["vehicles"]
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
    try:
        if document["status"] != "found":
            raise InvalidScenario(f"{place}: holds no plan, its status is {document['status']!r}")
        return plan_of_document(document, model)
    except InvalidScenario:
        raise
    except (ValueError, KeyError, TypeError, IndexError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{place}: {said}") from error


@functools.cache
def package_version() -> str:
    """The version of this package; "0" where it is not installed."""
    try:
        return metadata.version("maneuver-automaton")
    except metadata.PackageNotFoundError:
        return "0"


def trajectory_entry(plan: Plan | None) -> dict[str, Any]:
    """Samples of a plan; far from the origin sampled from (0, 0), so that no digit is lost."""
    if plan is None:
        return {key: [] for key in TRAJECTORY}
    origin = np.zeros(2)
    samples = plan.sample()
    if np.abs(samples.pose[:, :2]).max() > FAR:
        origin = plan.start[:2]
        start = np.concatenate([np.zeros(2), plan.start[2:]])
        samples = replace(plan, start=start).sample()
    return {
        "origin": origin.tolist(),
        "time_s": samples.time.tolist(),
        "pose": samples.pose.tolist(),
        "reduced_state": samples.reduced_state.tolist(),
        "control": samples.control.tolist(),
    }


def primitive_entries(plan: Plan | None) -> list[dict[str, Any]]:
    """Trims and maneuvers in order; a maneuver has no control of its own, but two ends."""
    entries: list[dict[str, Any]] = []
    if plan is None:
        return entries
    for primitive, duration in zip(plan.primitives, plan.primitive_durations, strict=True):
        trim = primitive if isinstance(primitive, Trim) else None
        entry: dict[str, Any] = {
            "kind": "maneuver" if trim is None else "trim",
            "name": primitive.name,
            "control": None if trim is None else trim.control.tolist(),
            "duration_s": float(duration),
        }
        if isinstance(primitive, Maneuver):
            entry |= {"source": primitive.source, "target": primitive.target}
        entries.append(entry)
    return entries


def _alternative(one: Alternative) -> dict[str, Any]:
    return {
        "cost": float(one.cost),
        "duration_s": one.plan.duration,
        "word": list(one.plan.word),
        "primitives": primitive_entries(one.plan),
        "terminal_error": _terminal_error(one.terminal_error),
    }


def _terminal_error(error: TerminalError | None) -> dict[str, float | None]:
    return {
        "position_m": None if error is None else float(error.position_m),
        "heading_rad": None if error is None else float(error.heading_rad),
    }


def _audit(audit: Audit | None) -> dict[str, bool | float | None]:
    if audit is None:
        keys = ("passed", "max_dynamics_defect", "min_clearance_m")
        return dict.fromkeys((*keys, "terminal_position_m", "terminal_heading_rad"))
    return {
        "passed": bool(audit.passed),
        "max_dynamics_defect": float(audit.max_dynamics_defect),
        "min_clearance_m": _number(audit.min_clearance_m),
        "terminal_position_m": float(audit.terminal_position_m),
        "terminal_heading_rad": float(audit.terminal_heading_rad),
    }


def _number(value: float | None) -> float | None:
    """A number, or null where there is none or no limit."""
    return None if value is None or math.isinf(value) else float(value)


def _floats(values: Mapping[str, float]) -> dict[str, float]:
    return {key: float(value) for key, value in values.items()}


def _object(document: Mapping[str, Any], left: str) -> str:
    """An object, a key a line, `left` of which that many spaces stand."""
    inside = left + "  "
    rows = (
        f"{inside}{json.dumps(key)}: {_json(key, value, inside)}" for key, value in document.items()
    )
    return "{\n" + ",\n".join(rows) + f"\n{left}}}"


def _json(key: str, value: Any, left: str = "") -> str:
    """A value of the file in one line, but lists of objects one object a line, and vehicles."""
    if key in LISTS and value:
        rows = ",\n".join(f"{left}  {_json('', row)}" for row in value)
        return f"[\n{rows}\n{left}]"
    if key == "trajectory":
        rows = ",\n".join(
            f"{left}  {json.dumps(name)}: {_json('', row)}" for name, row in value.items()
        )
        return "{\n" + rows + f"\n{left}}}"
    if key == "vehicles":
        inside = left + "  "
        rows = ",\n".join(
            f"{inside}{json.dumps(name, ensure_ascii=False)}: {_object(row, inside)}"
            for name, row in value.items()
        )
        return "{\n" + rows + f"\n{left}}}"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is no JSON")


def plan_of_document(document: Mapping[str, Any], model: Model | None = None) -> Plan:
    """The plan of a plan.json that is read already; `model` is as in `load_plan`.

    Raises
    ------
    KeyError, TypeError, ValueError, IndexError
        If a key is missing, or holds no numbers.
    """
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
    durations = [_duration(k, entry) for k, entry in enumerate(primitives)]
    switches = _switches(time, durations)
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
        course,
        name=entry["name"],
        source=entry["source"],
        target=entry["target"],
    )


def _passed(name: str, course: Trajectory, at: int) -> Trim:
    """A trim that lasts no time, before or after a maneuver: its twist does not matter."""
    return Trim(
        name=name,
        control=np.zeros(course.control.shape[1]),
        body_velocity=np.zeros(course.pose.shape[1]),
        reduced_state=course.reduced_state[at],
    )


def _duration(k: int, entry: Mapping[str, Any]) -> float:
    if entry["kind"] not in ("trim", "maneuver"):
        raise ValueError(f"primitives[{k}].kind: got {entry['kind']!r}, need 'trim' or 'maneuver'")
    return float(as_array(f"primitives[{k}].duration_s", entry["duration_s"]))


def _switches(time: Array, durations: Sequence[float]) -> list[int]:
    """Index of the sample at every switching time."""
    due = time[0] + np.concatenate([[0.0], np.cumsum(durations)])
    indices = [int(np.abs(time - at).argmin()) for at in due]
    tolerance = TIME_TOLERANCE * max(1.0, float(np.abs(due).max()))
    if np.abs(time[indices] - due).max() > tolerance or indices[-1] != len(time) - 1:
        raise ValueError("trajectory: has no sample at a switching time of the primitives")
    return indices


def _twist(time: Array, pose: Array) -> Array:
    """Body velocity (dof,) of the trim that runs through the samples."""
    group = group_of(pose.shape[1])
    span = float(time[-1] - time[0])
    if span <= 0.0:
        return np.zeros(group.dof)
    turned = np.abs(pose[:, 2] - pose[0, 2])
    last = int(np.flatnonzero(turned < np.pi)[-1])
    if last == 0:
        raise ValueError("trajectory: two samples of a trim are half a turn apart, need more")
    motion = group(pose[0]).inverse() @ group(pose[last])
    twist = motion.log() / (time[last] - time[0])
    twist[2] = (pose[-1, 2] - pose[0, 2]) / span  # the longer stretch says it better
    return np.asarray(twist, dtype=np.float64)
