"""A plan as the pieces of its word, and back: by name in files, by number between processes.

Whoever has the library makes the same plan of them, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NotRequired

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import TypedDict

from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.automaton.courses import samples_entry
from maneuver_automaton.automaton.cutting import tail_of, with_samples_at
from maneuver_automaton.automaton.plan import Plan, Primitive
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim


class Piece(TypedDict):
    """A trim or a maneuver of a plan, and all about it that the library does not say."""

    kind: Literal["trim", "maneuver"]
    name: str
    duration_s: float
    control: NotRequired[list[float]]  # of a trim
    source: NotRequired[str]  # of a maneuver: the trims at its ends
    target: NotRequired[str]
    body_velocity: NotRequired[list[float]]
    reduced_state: NotRequired[list[float]]
    course: NotRequired[dict[str, Any]]  # samples: time, pose, reduced_state, control


def words_of(plan: Plan, library: Automaton) -> list[Piece]:
    """The primitives of a plan with their durations: enough to make it again from its start.

    Those that the library holds are told by their names and ends, others in full.
    """
    return [
        _piece(primitive, float(duration), library)
        for primitive, duration in zip(plan.primitives, plan.primitive_durations, strict=True)
    ]


def plan_of(start: ArrayLike, time: float, words: Sequence[Piece], library: Automaton) -> Plan:
    """The plan from a pose (dof,) at a time [s]; maneuvers are those of the library, or cut."""
    durations = [float(one["duration_s"]) for one in words]
    if all(one["kind"] == "trim" for one in words) and library.is_kinematic:
        trims = tuple(_trim(one, library) for one in words)
        return Plan(start, trims, durations=durations, start_time=time)
    primitives: list[Primitive] = [
        _coasted(one, library) if one["kind"] == "trim" else _maneuver(one, library)
        for one in words
    ]
    if not primitives and library.rest is not None:
        at_rest = (library.trims[library.rest],)
        return Plan(start, at_rest, durations=[0.0], start_time=time)
    passed = _passed(primitives, library)
    return Plan.of_primitives(start, primitives, durations=durations, trims=passed, start_time=time)


def packed(plan: Plan, library: Automaton) -> Any:
    """The same between processes: start, word and durations; all of it if not of the library alone.

    Primitives are numbers of the library, so that a plan takes some 200 bytes where `words_of` says
    it in names.
    """
    numbers = {id(one): n for n, one in enumerate((*library.trims, *library.maneuvers, None))}
    rows = [numbers.get(id(one), -1) for one in (*plan.trims, *plan.maneuvers)]
    if -1 in rows:
        return plan
    parts = plan.start, np.array(rows, dtype=np.uint32), plan.durations
    return plan.start_time, len(plan.trims), *(one.tobytes() for one in parts)


def unpacked(sent: Any, library: Automaton) -> Plan:
    """The plan that `packed` was given, in a process that has the same library."""
    if isinstance(sent, Plan):
        return sent
    begin, count, start, rows, durations = sent
    known = (*library.trims, *library.maneuvers, None)
    word = tuple(known[n] for n in np.frombuffer(rows, dtype=np.uint32).tolist())
    return Plan(
        np.frombuffer(start),
        word[:count],
        durations=np.frombuffer(durations),
        maneuvers=word[count:],
        start_time=begin,
    )


def _piece(primitive: Primitive, duration: float, library: Automaton) -> Piece:
    """A trim or maneuver by its name; with what it does if the library holds none such."""
    entry: Piece
    if isinstance(primitive, Trim):
        entry = {
            "kind": "trim",
            "name": primitive.name,
            "control": primitive.control.tolist(),
            "duration_s": duration,
        }
        known = library[primitive.name] if primitive.name in library.trim_names else None
        if not library.is_kinematic:
            if known is None:
                entry["body_velocity"] = primitive.body_velocity.tolist()
                entry["reduced_state"] = primitive.reduced_state.tolist()
        # At will, a trim at another pace is made of its control; one that noise moves is not.
        elif (
            known is not None
            and np.array_equal(primitive.control, known.control)
            and not np.array_equal(primitive.body_velocity, known.body_velocity)
        ):
            entry["body_velocity"] = primitive.body_velocity.tolist()
        return entry
    entry = {
        "kind": "maneuver",
        "name": primitive.name,
        "source": primitive.source,
        "target": primitive.target,
        "duration_s": duration,
    }
    if primitive.course is not None and _in_library(entry, library) is None:
        entry["course"] = samples_entry(primitive.course)
    return entry


def _passed(primitives: Sequence[Primitive], library: Automaton) -> dict[str, Trim]:
    """Trims between maneuvers and at their ends, by name: of the library, or of a course's ends."""
    model = library.model
    still = np.zeros(len(model.control_names))
    known = {trim.name: trim for trim in library.trims}
    known |= {one.name: one for one in primitives if isinstance(one, Trim)}
    for one in primitives:
        if isinstance(one, Trim) or one.course is None:
            continue
        for name, state in ((one.source, 0), (one.target, -1)):
            if name not in known:
                reduced = one.course.reduced_state[state]
                velocity = np.asarray(model.body_velocity(reduced, still))
                known[name] = Trim(
                    name=name, body_velocity=velocity, control=still, reduced_state=reduced
                )
    return known


def _coasted(entry: Piece, library: Automaton) -> Trim:
    """A trim of the library, or one that the piece tells all about."""
    if entry["name"] in library or "reduced_state" not in entry:
        return library[entry["name"]]
    return Trim(
        name=entry["name"],
        body_velocity=np.array(entry["body_velocity"]),
        control=np.array(entry["control"]),
        reduced_state=np.array(entry["reduced_state"]),
    )


def _in_library(entry: Piece, library: Automaton) -> Maneuver | None:
    sought = (entry["name"], entry["source"], entry["target"])
    return next(
        (one for one in library.maneuvers if (one.name, one.source, one.target) == sought), None
    )


def _maneuver(entry: Piece, library: Automaton) -> Maneuver:
    """The maneuver of the library, or what was left of it when the step began."""
    one = _in_library(entry, library)
    if one is None:
        # A maneuver whose course is written in the log.
        if "course" not in entry:
            raise ValueError(
                f"maneuver {entry['name']!r}: the library has none of this name and ends"
            )
        columns = ("time", "pose", "reduced_state", "control")
        samples = {name: np.array(entry["course"][name], dtype=np.float64) for name in columns}
        course = Trajectory(**samples, model=library.model)
        name, source, target = entry["name"], entry["source"], entry["target"]
        return Maneuver.along(course, name=name, source=source, target=target)
    begun = one.duration - float(entry["duration_s"])
    if begun <= 0.0:
        return one
    trims = (library[one.source], library[one.target])
    still = np.zeros(library.model.group.dof)
    whole = Plan(still, trims, durations=[0.0, 0.0], maneuvers=(one,))
    rest = tail_of(with_samples_at(whole, [begun], library.model), begun)
    assert rest.maneuvers[0] is not None
    return rest.maneuvers[0]


def _trim(entry: Piece, library: Automaton) -> Trim:
    """The trim of the library; one at another pace is made from its control."""
    name, control = entry["name"], entry["control"]
    if "body_velocity" in entry:
        twist = np.array(entry["body_velocity"])
        return Trim(name=name, body_velocity=twist, control=np.array(control))
    if name in library and library[name].control.tolist() == control:
        return library[name]
    return Automaton.of_controls(library.model, {name: control}).trims[0]
