"""Work on a fleet in pieces: here, in processes, or on a Dask cluster, with the same answers.

A piece of work is about some of the vehicles, past the plans of others; it changes nothing but what
it returns, and what it finds out of those vehicles alone. Other processes keep the vehicles, so
that only plans travel, as numbers: trims and maneuvers are those of the automaton.
"""

from __future__ import annotations

import io
import math
import os
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeAlias

from maneuver_automaton._parallel import Gathered
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.turns import Held, Turns
from maneuver_automaton.fleet.vehicle import Found, Vehicle
from maneuver_automaton.fleet.vehicles import prepare_vehicles, vehicles_of
from maneuver_automaton.planning.result import LowerBound
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.words.word import Word

KEPT = 2  # fleets whose vehicles a process keeps
LEAST_S = 1e-3  # [s] a limit is positive
PIECES = 2  # sent to each process at a time, so that none waits long for another


How: TypeAlias = Literal["alone", "in turn", "by priorities", "by conflicts"]
"""Better plans: of each by itself, one after another, or of a group at once."""


class Task(NamedTuple):
    """A piece of work: whose plans are asked for, and past which."""

    numbers: tuple[int, ...]
    held: Held
    how: How = "in turn"  # to look for better plans
    known: float = math.inf  # cost of those that they have


class Done(NamedTuple):
    """What came of it."""

    held: Held | None  # plans; None if there are none
    queries: int = 0


Work: TypeAlias = Callable[[Turns, Task], Done]


class _Told(NamedTuple):
    """A plan found, as it travels."""

    plan: Plan
    cost: float
    goal_index: int


class _Known(NamedTuple):
    """What is known of one vehicle by itself."""

    alone: _Told | None
    ways: tuple[Word, ...]
    bound: LowerBound | None
    why_none: str


class _Message(NamedTuple):
    """Pieces of one kind of work for another process."""

    work: Work | None  # None: only have all ready
    tasks: tuple[tuple[Task, dict[int, _Told]], ...]  # without plans, which follow
    known: dict[int, _Known]
    seconds: float  # [s] that are left


class _Reply(NamedTuple):
    done: tuple[tuple[dict[int, _Told] | None, int], ...]
    known: dict[int, _Known]
    expansions: dict[int, int]


@dataclass(slots=True, eq=False)
class WorkerPool:
    """Who does the work for a fleet: this process, or as many others as `jobs`."""

    fleet: FleetProblem
    vehicles: list[Vehicle]
    jobs: int = 1
    gathered: Gathered | None = None  # None: all is done here
    _token: str = field(default_factory=lambda: os.urandom(16).hex())

    def prepare(self) -> None:
        """Have ready what all need, here and in the other processes, before a clock runs."""
        prepare_vehicles(self.vehicles)
        if self.gathered is not None:
            ready = _packed(_Message(None, (), {}, 0.0), self.vehicles)
            sent = (self._token, self.fleet, ready)
            list(self.gathered(_served, [sent] * self.jobs))

    def each(self, work: Work, tasks: Sequence[Task], budget: Budget) -> Iterator[Done]:
        """What comes of pieces of work, in their order; nothing of those that a signal broke off.

        What is learned of a vehicle alone counts for none of the other pieces: those about it come
        before.
        """
        if self.gathered is None or len(tasks) < 2:
            for task in tasks:
                turns = Turns(self.vehicles, self.fleet.margin, budget)
                yield work(turns, task)
            return
        size = max(1, -(-len(tasks) // (PIECES * self.jobs)))
        chunks = [tasks[k : k + size] for k in range(0, len(tasks), size)]
        bodies = [self._message(work, chunk, budget.left) for chunk in chunks]
        left = len(tasks)
        for answer in self._sent(bodies):
            reply = _unpacked(answer, self.vehicles)
            assert isinstance(reply, _Reply)
            for k, known in reply.known.items():
                _learn(self.vehicles[k], known)
            for k, spent in reply.expansions.items():
                self.vehicles[k].expansions += spent
            for told, queries in reply.done:
                held = None if told is None else _held(self.vehicles, told)
                left -= 1
                yield Done(held, queries)
        yield from [Done(None)] * left

    def _message(self, work: Work, tasks: Sequence[Task], seconds: float) -> bytes:
        numbers = {k for task in tasks for k in task.numbers}
        known = {k: _known(self.vehicles[k]) for k in sorted(numbers)}
        rows = tuple((task._replace(held={}), _told(task.held)) for task in tasks)
        return _packed(_Message(work, rows, known, seconds), self.vehicles)

    def _sent(self, bodies: Sequence[bytes]) -> Iterator[bytes]:
        """Answers to messages; who does not know the fleet is told of it."""
        assert self.gathered is not None
        pieces = [(self._token, None, body) for body in bodies]
        for body, answer in zip(bodies, list(self.gathered(_served, pieces)), strict=False):
            if answer is None:
                yield from self.gathered(_served, [(self._token, self.fleet, body)])
            else:
                yield answer


class _Fleet(NamedTuple):
    """What a process keeps of a fleet."""

    problem: FleetProblem
    vehicles: list[Vehicle]
    last: dict[int, Found]  # plans that were sent last, with all that is prepared for them


_FLEETS: dict[str, _Fleet] = {}  # the last ones, by their tokens


def _served(piece: tuple[str, FleetProblem | None, bytes]) -> bytes | None:
    """In another process: the answer to a message; None if the fleet is not known here."""
    token, fleet, body = piece
    if token not in _FLEETS:
        if fleet is None:
            return None
        _FLEETS[token] = _Fleet(fleet, vehicles_of(fleet), {})
        prepare_vehicles(_FLEETS[token].vehicles)
        for old in list(_FLEETS)[:-KEPT]:
            del _FLEETS[old]
    problem, vehicles, last = _FLEETS[token]
    message = _unpacked(body, vehicles)
    assert isinstance(message, _Message)
    for k, known in message.known.items():
        _learn(vehicles[k], known)
    before = [one.expansions for one in vehicles]
    done: list[tuple[dict[int, _Told] | None, int]] = []
    budget = Budget.from_now(max(message.seconds, LEAST_S))
    for task, told in message.tasks:
        assert message.work is not None
        turns = Turns(vehicles, problem.margin, budget)
        last |= {k: _found(vehicles[k], one, last.get(k)) for k, one in told.items()}
        found = message.work(turns, task._replace(held={k: last[k] for k in told}))
        done.append((None if found.held is None else _told(found.held), found.queries))
    known_now = {k: _known(vehicles[k]) for k in message.known}
    spent = {k: vehicles[k].expansions - before[k] for k in message.known}
    return _packed(_Reply(tuple(done), known_now, spent), vehicles)


def _told(held: Mapping[int, Found]) -> dict[int, _Told]:
    return {k: _Told(one.plan, one.cost, one.goal_index) for k, one in held.items()}


def _held(vehicles: Sequence[Vehicle], told: Mapping[int, _Told]) -> Held:
    return {k: _found(vehicles[k], one) for k, one in told.items()}


def _found(vehicle: Vehicle, told: _Told, last: Found | None = None) -> Found:
    """A plan that was sent; the last one of the vehicle if it is the same."""
    if last is not None and last.cost == told.cost and _signed(last.plan) == _signed(told.plan):
        return last
    return Found(told.plan, told.cost, told.goal_index, vehicle.course_of(told.plan))


def _signed(plan: Plan) -> tuple[object, ...]:
    """What tells plans apart that are made of the same trims and maneuvers."""
    parts = [*map(id, plan.trims), *map(id, plan.maneuvers)]
    return *parts, plan.durations.tobytes(), plan.start.tobytes(), plan.start_time


def _known(vehicle: Vehicle) -> _Known:
    one = vehicle.alone
    alone = None if one is None else _Told(one.plan, one.cost, one.goal_index)
    return _Known(alone, tuple(vehicle.ways), vehicle.bound, vehicle.why_none)


def _learn(vehicle: Vehicle, known: _Known) -> None:
    vehicle.alone = None if known.alone is None else _found(vehicle, known.alone)
    vehicle.ways, vehicle.bound = list(known.ways), known.bound
    vehicle.why_none = known.why_none


class _Packer(pickle.Pickler):
    """Trims and maneuvers of the vehicles' automata travel as numbers."""

    def __init__(self, file: io.BytesIO, vehicles: Sequence[Vehicle]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self._names = {id(one): name for name, one in _primitives(vehicles)}

    def persistent_id(self, obj: Any) -> tuple[int, int] | None:
        """What stands for an object; None if it is sent as it is."""
        return self._names.get(id(obj))


class _Unpacker(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, vehicles: Sequence[Vehicle]) -> None:
        super().__init__(file)
        self._named = dict(_primitives(vehicles))

    def persistent_load(self, pid: Any) -> Trim | Maneuver:
        """The object that a name stands for."""
        return self._named[pid]


def _primitives(vehicles: Sequence[Vehicle]) -> Iterator[tuple[tuple[int, int], Trim | Maneuver]]:
    """Trims and maneuvers of all automata, by the first vehicle that has each and by number."""
    seen: set[int] = set()
    for one in vehicles:
        automaton = one.problem.automaton
        if id(automaton) not in seen:
            seen.add(id(automaton))
            every: tuple[Trim | Maneuver, ...] = (*automaton.trims, *automaton.maneuvers)
            for k, primitive in enumerate(every):
                yield (one.number, k), primitive


def _packed(value: _Message | _Reply, vehicles: Sequence[Vehicle]) -> bytes:
    file = io.BytesIO()
    _Packer(file, vehicles).dump(value)
    return file.getvalue()


def _unpacked(body: bytes, vehicles: Sequence[Vehicle]) -> _Message | _Reply:
    value: _Message | _Reply = _Unpacker(io.BytesIO(body), vehicles).load()
    return value
