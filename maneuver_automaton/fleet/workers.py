"""Who does the work of a fleet: this process, others beside it, or a worker for each vehicle."""

from __future__ import annotations

import io
import math
import os
import pickle
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np

from maneuver_automaton._brief import brief
from maneuver_automaton._parallel import Gathered
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.fleet.coordination import HeldPlans, Turns
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.held import proposal
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.vehicle import FleetMember, OwnPlan, prepare_vehicles, vehicles_of
from maneuver_automaton.planning.result import LowerBound
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.words.word import Word

WORD, WHOLE = 0, 1  # by numbers of the library, or all of it where it is not of the library alone
NONE = 0xFFFF  # no maneuver between two trims
HEAD = struct.Struct("<BBHHd")  # kind, components of a pose, trims, number of the goal, cost
PIECE = struct.Struct("<Hd")  # number of the trim, duration [s]


def encoded(vehicle: FleetMember, found: OwnPlan) -> bytes:
    """A plan in few bytes.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, FleetProblem, Problem, Unicycle
    >>> from maneuver_automaton.fleet.held import resting
    >>> from maneuver_automaton.fleet.vehicle import vehicles_of
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


def decoded(vehicle: FleetMember, message: bytes) -> OwnPlan:
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
    return OwnPlan(plan, cost, goal_index, course)


class ToPass(NamedTuple):
    """A plan that another vehicle may drive, and what has to be kept from it [m]."""

    number: int
    found: OwnPlan
    keep: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanRequest:
    """What a vehicle is asked for: a plan past what the others may drive, below a cost."""

    number: int
    base: OwnPlan  # what it drives
    time: float  # [s]
    after: float  # [s] that it drives on with it
    others: tuple[ToPass, ...]
    between: float  # [m] that any two vehicles keep
    known: float  # what it must cost less than
    most: int  # expansions
    tube_m: float  # that the vehicle may be beside its plan
    keep: float  # [m] from obstacles, if that is less than its margin

    __repr__ = brief


class Proposal(NamedTuple):
    """A plan past the others, and the way alone; None for what does not cost less."""

    found: OwnPlan | None
    alone: OwnPlan | None


class Workers(Protocol):
    """Those that look for plans, each for its vehicles; `ask` says what has come of it."""

    def ask(self, questions: Sequence[PlanRequest], budget: Budget) -> list[Proposal | None]:
        """The answers in order; None from who does not answer any more."""

    @property
    def counts(self) -> dict[str, int]:
        """Messages and bytes so far, by name."""


def answered(
    vehicle: FleetMember,
    question: PlanRequest,
    budget: Budget,
    left_of: Callable[[OwnPlan], FleetCourse],
) -> Proposal:
    """The answer of a vehicle; `left_of` says what is left of a plan's course."""
    seen: list[Obstacle] = []
    keep = question.keep
    for _, one, own in question.others:
        course = left_of(one)
        if own < question.between:  # it is seen smaller, so that there is a way out
            keep = min(keep, own)
            grown = max(course.grown - (question.between - own), 0.0)
            course = replace(course, grown=grown)
        seen += course.obstacles
    found, alone = proposal(
        vehicle,
        question.base,
        time=question.time,
        after=question.after,
        others=seen,
        budget=budget,
        known=question.known,
        most=question.most,
        tube_m=question.tube_m,
        keep=keep,
    )
    return Proposal(found, alone)


REFERENCE = 12  # bytes that name a plan that is known already: number of the vehicle, and of it
SETTINGS = 64  # bytes of the other numbers of a question


class Asked(NamedTuple):
    """A question as it is sent: plans by number, and those that are new as bytes."""

    base: int
    others: tuple[tuple[int, int, float], ...]  # number of a vehicle, of its plan, distance to keep
    new: dict[int, tuple[int, bytes]]  # by its number: whose it is, and the plan
    settings: tuple[float, float, float, float, int, float, float]
    limit_s: float


class VehicleWorker:
    """What stands on the other side: one vehicle, and the plans of others that it was told."""

    def __init__(self, fleet: FleetProblem, number: int) -> None:
        self.number = number
        self.vehicles = vehicles_of(fleet)
        self.known: dict[int, OwnPlan] = {}
        prepare_vehicles([self.vehicles[number]])

    def ask(self, asked: Asked) -> tuple[bytes | None, bytes | None]:
        """The answer to a question; plans that are not named in it are forgotten."""
        for name, (owner, said) in asked.new.items():
            self.known[name] = decoded(self.vehicles[owner], said)
        used = {asked.base, *(name for _, name, _ in asked.others)}
        self.known = {name: found for name, found in self.known.items() if name in used}
        time, after, between, known, most, tube_m, keep = asked.settings
        question = PlanRequest(
            number=self.number,
            base=self.known[asked.base],
            time=time,
            after=after,
            others=tuple(ToPass(j, self.known[name], own) for j, name, own in asked.others),
            between=between,
            known=known,
            most=most,
            tube_m=tube_m,
            keep=keep,
        )
        vehicle, budget = self.vehicles[self.number], Budget.from_now(asked.limit_s)
        found, alone = answered(vehicle, question, budget, lambda one: one.course.after(time))
        return (
            None if found is None else encoded(vehicle, found),
            None if alone is None else encoded(vehicle, alone),
        )


class DaskWorkers:
    """A worker of its own for every vehicle of a fleet, on the processes of a Dask cluster.

    Each keeps the fleet's problem, looks for the plans of its vehicle, and is told the plans that
    this one expects of the others. Under counted work the loop is that of one process, to the last
    bit. Whose worker is gone drives the plan that it holds, and looks for no other one.

    Parameters
    ----------
    fleet : FleetProblem
    client : distributed.Client
        Of a cluster with processes; see the extra ``distributed``.
    patience_s : float
        A worker that does not answer so long after its time limit is taken for gone [s].
    """

    def __init__(self, fleet: FleetProblem, client: Any, *, patience_s: float = 30.0) -> None:
        self.vehicles = vehicles_of(fleet)
        self.patience_s = patience_s
        problem = client.scatter(fleet, broadcast=True)
        places = sorted(client.scheduler_info(n_workers=-1)["workers"])
        if not places:
            raise ValueError("workers: the cluster has none, need at least one")
        begun = [
            client.submit(
                VehicleWorker,
                problem,
                one.number,
                actor=True,
                workers=[places[one.number % len(places)]],
                allow_other_workers=False,
                pure=False,
            )
            for one in self.vehicles
        ]
        self.actors: list[Any] = [one.result() for one in begun]
        self.gone: dict[int, str] = {}  # by the number of the vehicle, and why
        self._names: dict[OwnPlan, int] = {}  # plans that somebody knows
        self._next = 0
        self._told: list[set[int]] = [set() for _ in self.vehicles]
        self._counts = {"worker_messages": 0, "worker_plans": 0, "worker_bytes": 0}

    @property
    def counts(self) -> dict[str, int]:
        """Messages, plans in them, and bytes, both ways."""
        return dict(self._counts)

    def ask(self, questions: Sequence[PlanRequest], budget: Budget) -> list[Proposal | None]:
        """The answers in order; all look at the same time. None from who is gone."""
        limit_s = max(budget.left, 0.0)
        under_way = [self._sent(one, limit_s) for one in questions]
        return [
            self._answer(question.number, one, limit_s)
            for question, one in zip(questions, under_way, strict=True)
        ]

    def _sent(self, question: PlanRequest, limit_s: float) -> Any:
        k = question.number
        if k in self.gone:
            return None
        new: dict[int, tuple[int, bytes]] = {}
        rows = [(k, question.base), *((j, one) for j, one, _ in question.others)]
        names = []
        for owner, found in rows:
            name = self._names.get(found)
            if name is None:
                name = self._names[found] = self._next
                self._next += 1
            names.append(name)
            if name not in self._told[k] and name not in new:
                new[name] = (owner, encoded(self.vehicles[owner], found))
        asked = Asked(
            base=names[0],
            others=tuple(
                (j, name, own) for (j, _, own), name in zip(question.others, names[1:], strict=True)
            ),
            new=new,
            settings=(
                question.time,
                question.after,
                question.between,
                question.known,
                question.most,
                question.tube_m,
                question.keep,
            ),
            limit_s=limit_s,
        )
        self._told[k] = set(names)
        used = set().union(*self._told)
        self._names = {found: name for found, name in self._names.items() if name in used}
        self._count([said for _, said in new.values()], REFERENCE * len(names) + SETTINGS)
        try:
            return self.actors[k].ask(asked)
        except Exception as error:  # noqa: BLE001, whatever it is, the worker is gone
            self.gone[k] = str(error)
            return None

    def _answer(self, k: int, under_way: Any, limit_s: float) -> Proposal | None:
        if under_way is None:
            return None
        try:
            said = under_way.result(timeout=limit_s + self.patience_s)
        except Exception as error:  # noqa: BLE001, the same
            self.gone[k] = str(error) or f"no answer in {limit_s + self.patience_s:g} s"
            return None
        self._count([one for one in said if one is not None], 0)
        found, alone = (None if one is None else decoded(self.vehicles[k], one) for one in said)
        return Proposal(found, alone)

    def _count(self, plans: Sequence[bytes], more: int) -> None:
        self._counts["worker_messages"] += 1
        self._counts["worker_plans"] += len(plans)
        self._counts["worker_bytes"] += sum(map(len, plans)) + more


KEPT = 2  # fleets whose vehicles a process keeps
LEAST_S = 1e-3  # [s] a limit is positive
PIECES = 2  # sent to each process at a time, so that none waits long for another


How: TypeAlias = Literal["alone", "in turn", "by priorities", "by conflicts"]
"""Better plans: of each by itself, one after another, or of a group at once."""


class PoolTask(NamedTuple):
    """A piece of work: whose plans are asked for, and past which."""

    numbers: tuple[int, ...]
    held: HeldPlans
    how: How = "in turn"  # to look for better plans
    known: float = math.inf  # cost of those that they have


class Done(NamedTuple):
    """What came of it."""

    held: HeldPlans | None  # plans; None if there are none
    queries: int = 0


Work: TypeAlias = Callable[[Turns, PoolTask], Done]


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


class _Parcel(NamedTuple):
    """Pieces of one kind of work for another process."""

    work: Work | None  # None: only have all ready
    tasks: tuple[tuple[PoolTask, dict[int, _Told]], ...]  # without plans, which follow
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
    vehicles: list[FleetMember]
    jobs: int = 1
    gathered: Gathered | None = None  # None: all is done here
    _token: str = field(default_factory=lambda: os.urandom(16).hex())

    def prepare(self) -> None:
        """Have ready what all need, here and in the other processes, before a clock runs."""
        prepare_vehicles(self.vehicles)
        if self.gathered is not None:
            ready = _packed(_Parcel(None, (), {}, 0.0), self.vehicles)
            sent = (self._token, self.fleet, ready)
            list(self.gathered(_served, [sent] * self.jobs))

    def each(self, work: Work, tasks: Sequence[PoolTask], budget: Budget) -> Iterator[Done]:
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

    def _message(self, work: Work, tasks: Sequence[PoolTask], seconds: float) -> bytes:
        numbers = {k for task in tasks for k in task.numbers}
        known = {k: _known(self.vehicles[k]) for k in sorted(numbers)}
        rows = tuple((task._replace(held={}), _told(task.held)) for task in tasks)
        return _packed(_Parcel(work, rows, known, seconds), self.vehicles)

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
    vehicles: list[FleetMember]
    last: dict[int, OwnPlan]  # plans that were sent last, with all that is prepared for them


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
    assert isinstance(message, _Parcel)
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


def _told(held: Mapping[int, OwnPlan]) -> dict[int, _Told]:
    return {k: _Told(one.plan, one.cost, one.goal_index) for k, one in held.items()}


def _held(vehicles: Sequence[FleetMember], told: Mapping[int, _Told]) -> HeldPlans:
    return {k: _found(vehicles[k], one) for k, one in told.items()}


def _found(vehicle: FleetMember, told: _Told, last: OwnPlan | None = None) -> OwnPlan:
    """A plan that was sent; the last one of the vehicle if it is the same."""
    if last is not None and last.cost == told.cost and _signed(last.plan) == _signed(told.plan):
        return last
    return OwnPlan(told.plan, told.cost, told.goal_index, vehicle.course_of(told.plan))


def _signed(plan: Plan) -> tuple[object, ...]:
    """What tells plans apart that are made of the same trims and maneuvers."""
    parts = [*map(id, plan.trims), *map(id, plan.maneuvers)]
    return *parts, plan.durations.tobytes(), plan.start.tobytes(), plan.start_time


def _known(vehicle: FleetMember) -> _Known:
    one = vehicle.alone
    alone = None if one is None else _Told(one.plan, one.cost, one.goal_index)
    return _Known(alone, tuple(vehicle.ways), vehicle.bound, vehicle.why_none)


def _learn(vehicle: FleetMember, known: _Known) -> None:
    vehicle.alone = None if known.alone is None else _found(vehicle, known.alone)
    vehicle.ways, vehicle.bound = list(known.ways), known.bound
    vehicle.why_none = known.why_none


class _Packer(pickle.Pickler):
    """Trims and maneuvers of the vehicles' automata travel as numbers."""

    def __init__(self, file: io.BytesIO, vehicles: Sequence[FleetMember]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self._names = {id(one): name for name, one in _primitives(vehicles)}

    def persistent_id(self, obj: Any) -> tuple[int, int] | None:
        """What stands for an object; None if it is sent as it is."""
        return self._names.get(id(obj))


class _Unpacker(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, vehicles: Sequence[FleetMember]) -> None:
        super().__init__(file)
        self._named = dict(_primitives(vehicles))

    def persistent_load(self, pid: Any) -> Trim | Maneuver:
        """The object that a name stands for."""
        return self._named[pid]


def _primitives(
    vehicles: Sequence[FleetMember],
) -> Iterator[tuple[tuple[int, int], Trim | Maneuver]]:
    """Trims and maneuvers of all automata, by the first vehicle that has each and by number."""
    seen: set[int] = set()
    for one in vehicles:
        automaton = one.problem.automaton
        if id(automaton) not in seen:
            seen.add(id(automaton))
            every: tuple[Trim | Maneuver, ...] = (*automaton.trims, *automaton.maneuvers)
            for k, primitive in enumerate(every):
                yield (one.number, k), primitive


def _packed(value: _Parcel | _Reply, vehicles: Sequence[FleetMember]) -> bytes:
    file = io.BytesIO()
    _Packer(file, vehicles).dump(value)
    return file.getvalue()


def _unpacked(body: bytes, vehicles: Sequence[FleetMember]) -> _Parcel | _Reply:
    value: _Parcel | _Reply = _Unpacker(io.BytesIO(body), vehicles).load()
    return value
