"""Who does the work of a fleet: this process, others beside it, or a worker for each vehicle.

Whoever works keeps the vehicles, so that only plans travel, as numbers of the automaton. Who knows
the fleet's problem makes the same plan of them, to the last bit: the answers are the same anywhere.
"""

from __future__ import annotations

import math
import os
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

from maneuver_automaton._brief import brief
from maneuver_automaton._parallel import Gathered
from maneuver_automaton.automaton.pieces import packed, unpacked
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.fleet.coordination import (
    HeldPlans,
    Turns,
    by_conflicts,
    by_priorities,
    is_short,
)
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.held import after_head, onward, with_room
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.vehicle import (
    AT_ONCE,
    WITH_TIME,
    FleetMember,
    OwnPlan,
    load_vehicles,
    prepare_vehicles,
    vehicles_of,
)
from maneuver_automaton.planning.result import LowerBound
from maneuver_automaton.words.word import Word

KEPT = 2  # fleets whose vehicles a process keeps
LEAST_LIMIT = 1e-3  # [s] a limit is positive
PIECES = 2  # sent to each process at a time, so that none waits long for another
REFERENCE = 12  # bytes that name a plan that is known already: number of the vehicle, and of it
SETTINGS = 64  # bytes of the other numbers of a request


def encoded(vehicle: FleetMember, found: OwnPlan) -> bytes:
    """A plan in some 200 bytes: start, word, durations; all of it if not of the library alone."""
    stays = found.course.until == math.inf
    sent = (packed(found.plan, vehicle.problem.automaton), found.cost, found.goal_index, stays)
    return pickle.dumps(sent, pickle.HIGHEST_PROTOCOL)


def decoded(vehicle: FleetMember, message: bytes) -> OwnPlan:
    """The plan of a message; a ValueError if it is none."""
    try:  # of our own making, over a channel of our own
        sent, cost, goal_index, stays = pickle.loads(message)
    except (pickle.UnpicklingError, EOFError) as error:
        raise ValueError(f"plan of {vehicle.name!r}: a message is cut off ({error})") from error
    plan = unpacked(sent, vehicle.problem.automaton)
    found = vehicle.own(plan, goal_index, cost=cost)
    return replace(found, course=found.course.staying) if stays else found


# -- a loop's vehicles that look for better plans


class ToPass(NamedTuple):
    """A plan that another vehicle may drive, and what has to be kept from it [m]."""

    number: int
    found: OwnPlan
    keep: float


class Terms(NamedTuple):
    """The numbers of a request."""

    time: float  # [s]
    after: float  # [s] that the vehicle drives on with what it holds
    between: float  # [m] that any two vehicles keep
    known: float  # what another plan must cost less than
    most: int  # expansions
    tube_m: float  # that the vehicle may be beside its plan
    keep: float  # [m] from obstacles, if that is less than its margin


@dataclass(frozen=True, slots=True, eq=False)
class PlanRequest:
    """What a vehicle is asked for: a plan past what the others may drive, below a cost."""

    number: int
    base: OwnPlan  # what it drives
    others: tuple[ToPass, ...]
    terms: Terms

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
    request: PlanRequest,
    budget: Budget,
    left_of: Callable[[OwnPlan], FleetCourse],
) -> Proposal:
    """Another plan past the others that costs less, and the way alone, if that does.

    Both from a time on, with what is committed. They keep the vehicle's margin, or a distance [m]
    that is less, and end where it arrives from anywhere in its tube. `left_of` says what is left of
    a plan's course.
    """
    terms, keep = request.terms, request.terms.keep
    others: list[Obstacle] = []
    for _, one, own in request.others:
        course = left_of(one)
        if own < terms.between:  # it is seen smaller, so that there is a way out
            keep = min(keep, own)
            course = replace(course, grown=max(course.grown - (terms.between - own), 0.0))
        others += course.obstacles
    head, problem = onward(vehicle, request.base, terms.time, terms.after)
    if problem is None:
        return Proposal(None, None)
    problem = with_room(problem, terms.tube_m)
    if keep < problem.margin:
        problem = replace(problem, margin=keep)
    there = FleetMember(
        vehicle.number, vehicle.name, problem, vehicle.leaves, vehicle.grown, vehicle.workspace
    )
    there.plan_alone(budget, bounded=False)
    spent = 0.0 if head is None else vehicle.problem.cost_of(head)
    if there.alone is None or not there.alone.cost + spent < terms.known:
        return Proposal(None, None)
    other = None
    if not budget.is_over:
        other = there.past(others, budget, most=terms.most, known=terms.known - spent)
    found = None if other is None else after_head(vehicle, head, other)
    return Proposal(found, after_head(vehicle, head, there.alone))


class SentRequest(NamedTuple):
    """A request as it is sent: plans by number, and those that are new as bytes."""

    base: int
    others: tuple[tuple[int, int, float], ...]  # number of a vehicle, of its plan, distance to keep
    new: dict[int, tuple[int, bytes]]  # by its number: whose it is, and the plan
    terms: Terms
    limit_s: float


class VehicleWorker:
    """What stands on the other side: one vehicle, and the plans of others that it was told."""

    def __init__(self, fleet: FleetProblem, number: int) -> None:
        self.number = number
        self.vehicles = vehicles_of(fleet)
        self.known: dict[int, OwnPlan] = {}
        prepare_vehicles([self.vehicles[number]])

    def ask(self, sent: SentRequest) -> tuple[bytes | None, bytes | None]:
        """The answer to a request; plans that are not named in it are forgotten."""
        for name, (owner, said) in sent.new.items():
            self.known[name] = decoded(self.vehicles[owner], said)
        used = {sent.base, *(name for _, name, _ in sent.others)}
        self.known = {name: found for name, found in self.known.items() if name in used}
        others = tuple(ToPass(j, self.known[name], own) for j, name, own in sent.others)
        request = PlanRequest(self.number, self.known[sent.base], others, sent.terms)
        vehicle, budget = self.vehicles[self.number], Budget.from_now(sent.limit_s)
        proposal = answered(vehicle, request, budget, lambda one: one.course.after(sent.terms.time))
        found, alone = (None if one is None else encoded(vehicle, one) for one in proposal)
        return found, alone


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
            self._answer(one.number, sent, limit_s)
            for one, sent in zip(questions, under_way, strict=True)
        ]

    def _sent(self, request: PlanRequest, limit_s: float) -> Any:
        k = request.number
        if k in self.gone:
            return None
        new: dict[int, tuple[int, bytes]] = {}
        names = []
        for owner, found in [(k, request.base), *((j, one) for j, one, _ in request.others)]:
            name = self._names.get(found)
            if name is None:
                name = self._names[found] = self._next
                self._next += 1
            names.append(name)
            if name not in self._told[k] and name not in new:
                new[name] = (owner, encoded(self.vehicles[owner], found))
        others = tuple(
            (j, name, own) for (j, _, own), name in zip(request.others, names[1:], strict=True)
        )
        self._told[k] = set(names)
        used = set().union(*self._told)
        self._names = {found: name for found, name in self._names.items() if name in used}
        self._count([said for _, said in new.values()], REFERENCE * len(names) + SETTINGS)
        try:
            return self.actors[k].ask(SentRequest(names[0], others, new, request.terms, limit_s))
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
        return Proposal(*(None if one is None else decoded(self.vehicles[k], one) for one in said))

    def _count(self, plans: Sequence[bytes], more: int) -> None:
        self._counts["worker_messages"] += 1
        self._counts["worker_plans"] += len(plans)
        self._counts["worker_bytes"] += sum(map(len, plans)) + more


# -- a fleet's plans, in pieces of work

How: TypeAlias = Literal[
    "alone", "in order", "better alone", "in turn", "with time", "by priorities", "by conflicts"
]
"""Ways of each by itself; plans in an order; better ways, or plans one after another, also improved
for longer, or at once."""


class PoolTask(NamedTuple):
    """A piece of work: whose plans are asked for, and past which.

    It changes nothing but what it returns, and what it finds out of those vehicles alone.
    """

    numbers: tuple[int, ...]
    held: HeldPlans
    how: How = "in turn"
    known: float = math.inf  # cost of those that they have


class Done(NamedTuple):
    """What came of it."""

    held: HeldPlans | None  # plans; None if there are none
    queries: int = 0


def done(turns: Turns, task: PoolTask) -> Done:
    """What comes of a piece of work."""
    numbers, held = task.numbers, task.held
    if task.how in ("alone", "better alone"):
        for k in numbers:
            one = turns.vehicles[k]
            if task.how == "better alone":
                one.look_for_better_ways(turns.budget)
            else:  # half the work of a plan past others
                short = is_short(turns.budget, len(turns.vehicles) // 2)
                one.plan_alone(turns.budget, hurried=short)
        return Done(None)
    if task.how == "in order":
        return Done(turns.one_after_another(numbers, held), turns.queries)
    turns.schedule = WITH_TIME if task.how == "with time" else AT_ONCE
    if task.how in ("in turn", "with time"):
        return Done(turns.anew(numbers, held), turns.queries)
    search = by_priorities if task.how == "by priorities" else by_conflicts
    return Done(search(turns, numbers, held, task.known), turns.queries)


class _Known(NamedTuple):
    """What is known of one vehicle by itself."""

    alone: bytes | None
    ways: tuple[Word, ...]
    bound: LowerBound | None
    why_none: str


class _Parcel(NamedTuple):
    """Pieces of work for another process, which keeps fleets by their tokens."""

    token: str
    fleet: FleetProblem | None  # None: it is known there
    tasks: tuple[tuple[PoolTask, dict[int, bytes]], ...] = ()  # without plans, which follow
    known: Mapping[int, _Known] = {}
    seconds: float = 0.0  # [s] that are left


class _Reply(NamedTuple):
    done: list[tuple[dict[int, bytes] | None, int]]
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

    def load(self) -> None:
        """Load what all need, and have the other processes ready, before a clock runs."""
        load_vehicles(self.vehicles)
        if self.gathered is not None:
            list(self.gathered(_served, [_Parcel(self._token, self.fleet)] * self.jobs))

    def each(self, tasks: Sequence[PoolTask], budget: Budget) -> Iterator[Done]:
        """What comes of pieces of work, in their order; nothing of those that a signal broke off.

        What is learned of a vehicle alone counts for none of the other pieces: those about it come
        before.
        """
        if self.gathered is None or len(tasks) < 2:
            for task in tasks:
                yield done(Turns(self.vehicles, self.fleet.margin, budget), task)
            return
        size = max(1, -(-len(tasks) // (PIECES * self.jobs)))
        chunks = [tasks[k : k + size] for k in range(0, len(tasks), size)]
        left = len(tasks)
        for reply in self._replies([self._parcel(chunk, budget.left) for chunk in chunks]):
            for k, known in reply.known.items():
                _learn(self.vehicles[k], known)
            for k, spent in reply.expansions.items():
                self.vehicles[k].expansions += spent
            for told, queries in reply.done:
                left -= 1
                held = {k: decoded(self.vehicles[k], said) for k, said in (told or {}).items()}
                yield Done(None if told is None else held, queries)
        yield from [Done(None)] * left

    def _parcel(self, tasks: Sequence[PoolTask], seconds: float) -> _Parcel:
        numbers = sorted({k for task in tasks for k in task.numbers})
        known = {k: _known(self.vehicles[k]) for k in numbers}
        rows = [(task._replace(held={}), _told(self.vehicles, task.held)) for task in tasks]
        return _Parcel(self._token, None, tuple(rows), known, seconds)

    def _replies(self, parcels: Sequence[_Parcel]) -> Iterator[_Reply]:
        """Replies to parcels; who does not know the fleet is told of it."""
        assert self.gathered is not None
        for parcel, reply in zip(parcels, list(self.gathered(_served, parcels)), strict=False):
            if reply is None:
                yield from self.gathered(_served, [parcel._replace(fleet=self.fleet)])
            else:
                yield reply


class _KnownFleet(NamedTuple):
    """What a process keeps of a fleet."""

    margin: float  # [m]
    vehicles: list[FleetMember]
    last: dict[int, tuple[bytes, OwnPlan]]  # sent last, with all that is prepared for them


_FLEETS: dict[str, _KnownFleet] = {}  # the last ones, by their tokens


def _served(parcel: _Parcel) -> _Reply | None:
    """In another process: the reply to a parcel; None if the fleet is not known here."""
    if parcel.token not in _FLEETS:
        if parcel.fleet is None:
            return None
        _FLEETS[parcel.token] = _KnownFleet(parcel.fleet.margin, vehicles_of(parcel.fleet), {})
        prepare_vehicles(_FLEETS[parcel.token].vehicles)
        for old in list(_FLEETS)[:-KEPT]:
            del _FLEETS[old]
    margin, vehicles, last = _FLEETS[parcel.token]
    for k, known in parcel.known.items():
        _learn(vehicles[k], known)
    before = [one.expansions for one in vehicles]
    found: list[tuple[dict[int, bytes] | None, int]] = []
    budget = Budget.from_now(max(parcel.seconds, LEAST_LIMIT))
    for task, told in parcel.tasks:
        for k, said in told.items():
            if k not in last or last[k][0] != said:
                last[k] = said, decoded(vehicles[k], said)
        held = {k: last[k][1] for k in told}
        plans, queries = done(Turns(vehicles, margin, budget), task._replace(held=held))
        found.append((None if plans is None else _told(vehicles, plans), queries))
    known_now = {k: _known(vehicles[k]) for k in parcel.known}
    return _Reply(found, known_now, {k: vehicles[k].expansions - before[k] for k in parcel.known})


def _told(vehicles: Sequence[FleetMember], held: Mapping[int, OwnPlan]) -> dict[int, bytes]:
    return {k: encoded(vehicles[k], one) for k, one in held.items()}


def _known(vehicle: FleetMember) -> _Known:
    alone = None if vehicle.alone is None else encoded(vehicle, vehicle.alone)
    return _Known(alone, tuple(vehicle.ways), vehicle.bound, vehicle.why_none)


def _learn(vehicle: FleetMember, known: _Known) -> None:
    vehicle.alone = None if known.alone is None else decoded(vehicle, known.alone)
    vehicle.ways, vehicle.bound = list(known.ways), known.bound
    vehicle.why_none = known.why_none
