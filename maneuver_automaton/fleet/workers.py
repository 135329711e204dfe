"""Who does the work of a fleet: this process, others beside it, or those of a cluster.

Whoever works keeps the vehicles, so that only plans travel, as numbers of the automaton. Who knows
the fleet's problem makes the same plan of them, to the last bit: the answers are the same anywhere.
"""

from __future__ import annotations

import functools
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
    LONG,
    WITH_TIME,
    FleetMember,
    OwnPlan,
    load_vehicles,
    prepare_vehicles,
    vehicles_of,
)
from maneuver_automaton.planning.result import LowerBound
from maneuver_automaton.words.word import Word

KEPT, KEPT_PLANS = 2, 4  # fleets whose vehicles a process keeps, and plans of each of these
LEAST_LIMIT = 1e-3  # [s] a limit is positive
PIECES = 2  # sent to each process at a time, so that none waits long for another


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
    found = vehicle.own(unpacked(sent, vehicle.problem.automaton), goal_index, cost=cost)
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
    there.plan_alone(budget)
    spent = 0.0 if head is None else vehicle.problem.cost_of(head)
    if there.alone is None or not there.alone.cost + spent < terms.known:
        return Proposal(None, None)
    other = None
    if not budget.is_over:
        other = there.past(others, budget, most=terms.most, known=terms.known - spent)
    found = None if other is None else after_head(vehicle, head, other)
    return Proposal(found, after_head(vehicle, head, there.alone))


class DaskWorkers:
    """The processes of a Dask cluster, which look for the plans of a fleet's vehicles.

    A request is a start, words and durations: any process that knows the fleet answers it, and
    another one if that is lost. Under counted work the loop is that of one process, to the last
    bit. Who gets no answer drives the plan that it holds, and looks for no other one.

    Parameters
    ----------
    fleet : FleetProblem
    client : distributed.Client
        Of a cluster with processes; see the extra ``distributed``.
    patience_s : float
        Who has no answer so long after its time limit gets none any more [s].
    """

    def __init__(self, fleet: FleetProblem, client: Any, *, patience_s: float = 30.0) -> None:
        self.fleet, self.client, self.patience_s = fleet, client, patience_s
        self.vehicles = vehicles_of(fleet)
        self.gone: dict[int, str] = {}  # by the number of the vehicle, and why
        self._token = os.urandom(16).hex()
        self._counts = {"worker_messages": 0, "worker_plans": 0, "worker_bytes": 0}
        if not client.scheduler_info(n_workers=-1)["workers"]:
            raise ValueError("workers: the cluster has none, need at least one")
        client.run(_knows, self._token, fleet)

    @property
    def counts(self) -> dict[str, int]:
        """Messages, plans in them, and bytes of these, both ways."""
        return dict(self._counts)

    def ask(self, questions: Sequence[PlanRequest], budget: Budget) -> list[Proposal | None]:
        """The answers in order; all look at the same time. None from who is gone."""
        limit_s = max(budget.left, 0.0)
        sent = [None if one.number in self.gone else self._sent(one) for one in questions]
        begun = [None if one is None else self._begun(None, one, limit_s) for one in sent]
        return [self._answer(one, future, limit_s) for one, future in zip(sent, begun, strict=True)]

    def _sent(self, request: PlanRequest) -> _SentRequest:
        k = request.number
        base = encoded(self.vehicles[k], request.base)
        others = tuple((j, encoded(self.vehicles[j], one), own) for j, one, own in request.others)
        self._count([base, *(said for _, said, _ in others)])
        return _SentRequest(k, base, others, request.terms)

    def _begun(self, fleet: FleetProblem | None, sent: _SentRequest, limit_s: float) -> Any:
        return self.client.submit(_answered, self._token, fleet, sent, limit_s, pure=False)

    def _answer(self, sent: _SentRequest | None, future: Any, limit_s: float) -> Proposal | None:
        if sent is None:
            return None
        try:
            most = limit_s + self.patience_s
            said = future.result(timeout=most)
            if said is None:  # a process that has begun since
                said = self._begun(self.fleet, sent, limit_s).result(timeout=most)
        except Exception as error:  # noqa: BLE001, whatever it is, nobody answers
            self.gone[sent.number] = str(error) or f"no answer in {most:g} s"
            return None
        self._count([one for one in said if one is not None])
        vehicle = self.vehicles[sent.number]
        return Proposal(*(None if one is None else decoded(vehicle, one) for one in said))

    def _count(self, plans: Sequence[bytes]) -> None:
        self._counts["worker_messages"] += 1
        self._counts["worker_plans"] += len(plans)
        self._counts["worker_bytes"] += sum(map(len, plans))


class _SentRequest(NamedTuple):
    """A request as it is sent, its plans as bytes."""

    number: int
    base: bytes
    others: tuple[tuple[int, bytes, float], ...]  # number of a vehicle, its plan, distance to keep
    terms: Terms


def _knows(token: str, fleet: FleetProblem) -> None:
    """In another process: have a fleet ready, before a clock runs."""
    _fleet_here(token, fleet)


def _answered(
    token: str, fleet: FleetProblem | None, sent: _SentRequest, limit_s: float
) -> tuple[bytes | None, bytes | None] | None:
    """In another process: the answer to a request; None if the fleet is not known here."""
    here = _fleet_here(token, fleet)
    if here is None:
        return None
    number, base, others, terms = sent
    passed = tuple(ToPass(j, here.plan(j, said), own) for j, said, own in others)
    request = PlanRequest(number, here.plan(number, base), passed, terms)
    vehicle, budget = here.vehicles[number], Budget.from_now(limit_s)
    proposal = answered(vehicle, request, budget, lambda one: one.course.after(terms.time))
    found, alone = (None if one is None else encoded(vehicle, one) for one in proposal)
    return found, alone


# -- a fleet's plans, in pieces of work

How: TypeAlias = Literal[
    "alone", "in order", "better alone", "in turn", "with time", "by priorities", "by conflicts"
]
"""Ways of each by itself; plans in an order; better ways, or plans one after another, also improved
for longer, or at once."""


class PoolTask(NamedTuple):
    """A piece of work: whose plans are asked for, past which; it learns of those vehicles alone."""

    numbers: tuple[int, ...]
    held: HeldPlans
    how: How = "in turn"
    known: float = math.inf  # cost of those that they have
    times: int = 0  # that the order was tried before: each doubles the work


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
        turns.most = LONG << task.times
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
        """What comes of pieces of work, in order; nothing of those that a signal broke off."""
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


class _FleetHere:
    """What a process keeps of a fleet: its vehicles, and the plans that were sent last."""

    def __init__(self, fleet: FleetProblem) -> None:
        self.margin, self.vehicles = fleet.margin, vehicles_of(fleet)
        self.plan = functools.lru_cache(KEPT_PLANS * len(fleet))(
            lambda k, said: decoded(self.vehicles[k], said)
        )
        prepare_vehicles(self.vehicles)


_FLEETS: dict[str, _FleetHere] = {}  # the last ones, by their tokens


def _fleet_here(token: str, fleet: FleetProblem | None) -> _FleetHere | None:
    """The fleet of a token; None if it is not known here, and not given."""
    if token not in _FLEETS and fleet is not None:
        _FLEETS[token] = _FleetHere(fleet)
        for old in list(_FLEETS)[:-KEPT]:
            del _FLEETS[old]
    return _FLEETS.get(token)


def _served(parcel: _Parcel) -> _Reply | None:
    """In another process: the reply to a parcel; None if the fleet is not known here."""
    here = _fleet_here(parcel.token, parcel.fleet)
    if here is None:
        return None
    vehicles = here.vehicles
    for k, known in parcel.known.items():
        _learn(vehicles[k], known)
    before = [one.expansions for one in vehicles]
    found: list[tuple[dict[int, bytes] | None, int]] = []
    budget = Budget.from_now(max(parcel.seconds, LEAST_LIMIT))
    for task, told in parcel.tasks:
        held = {k: here.plan(k, said) for k, said in told.items()}
        plans, queries = done(Turns(vehicles, here.margin, budget), task._replace(held=held))
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
