"""A plan as vehicles tell it to each other: start, word, durations. Some 200 bytes.

Who knows the fleet's problem makes the same plan of them, to the last bit.
"""

from __future__ import annotations

import math
import pickle
import struct
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet.vehicle import Found, Vehicle

WORD, WHOLE = 0, 1  # by numbers of the library, or all of it where it is not of the library alone
NONE = 0xFFFF  # no maneuver between two trims
HEAD = struct.Struct("<BBHHd")  # kind, components of a pose, trims, number of the goal, cost
PIECE = struct.Struct("<Hd")  # number of the trim, duration [s]


def encoded(vehicle: Vehicle, found: Found) -> bytes:
    """A plan in few bytes.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, FleetProblem, Problem, Unicycle
    >>> from maneuver_automaton.fleet.held import resting
    >>> from maneuver_automaton.fleet.planning import vehicles_of
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0)})
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], footprint=Disc(0.3))
    >>> (vehicle,) = vehicles_of(FleetProblem([there]))
    >>> said = encoded(vehicle, resting(vehicle, [1.0, 2.0, 3.0], 0.5))
    >>> len(said), decoded(vehicle, said).plan.start.tolist()
    (57, [1.0, 2.0, 3.0])
    """
    plan, automaton = found.plan, vehicle.problem.automaton
    trims = {id(one): n for n, one in enumerate(automaton.trims)}
    maneuvers = {id(one): n for n, one in enumerate(automaton.maneuvers)}
    known = all(id(one) in trims for one in plan.trims) and all(
        one is None or id(one) in maneuvers for one in plan.maneuvers
    )
    kind = WORD if known else WHOLE
    head = HEAD.pack(kind, plan.start.size, len(plan.trims), found.goal_index, found.cost)
    stays = struct.pack("<B", found.course.until == math.inf)
    if kind == WHOLE:
        return head + stays + pickle.dumps(plan)
    start = struct.pack(f"<{plan.start.size + 1}d", *plan.start, plan.start_time)
    pieces = b"".join(
        PIECE.pack(trims[id(trim)], lasting)
        for trim, lasting in zip(plan.trims, plan.durations.tolist(), strict=True)
    )
    between = [NONE if one is None else maneuvers[id(one)] for one in plan.maneuvers]
    return head + stays + start + pieces + struct.pack(f"<{len(between)}H", *between)


def decoded(vehicle: Vehicle, message: bytes) -> Found:
    """The plan of a message; a ValueError if it is none."""
    automaton = vehicle.problem.automaton
    try:
        kind, dof, count, goal_index, cost = HEAD.unpack_from(message)
        at = HEAD.size
        (stays,) = struct.unpack_from("<B", message, at)
        at += 1
        if kind == WHOLE:
            plan = pickle.loads(message[at:])  # of our own making, over a channel of our own
        else:
            *start, begin = struct.unpack_from(f"<{dof + 1}d", message, at)
            at += 8 * (dof + 1)
            pieces = [PIECE.unpack_from(message, at + n * PIECE.size) for n in range(count)]
            at += count * PIECE.size
            between = struct.unpack_from(f"<{(len(message) - at) // 2}H", message, at)
            plan = Plan(
                np.array(start),
                tuple(automaton.trims[number] for number, _ in pieces),
                durations=[lasting for _, lasting in pieces],
                maneuvers=tuple(None if n == NONE else automaton.maneuvers[n] for n in between),
                start_time=begin,
            )
    except (struct.error, IndexError) as error:
        raise ValueError(f"plan of {vehicle.name!r}: a message is cut off ({error})") from error
    course = vehicle.course_of(plan)
    if stays and course.until < math.inf:
        course = replace(course, until=math.inf)
    return Found(plan, cost, goal_index, course)
