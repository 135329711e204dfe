"""All vehicles at one moment of a loop: where they are, what they hold, what is proven of it."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.fleet.agreement import Knowledge
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.held import (
    distance_to_obstacles,
    left_to_pay,
    off_plan,
    rejoined,
    rest_of_plan,
    resting,
    stopping,
    why_not_free,
)
from maneuver_automaton.fleet.meetings import Gap, Nearby, meetings
from maneuver_automaton.fleet.result import FleetGuarantee, FleetStep, FleetViolation, Swap
from maneuver_automaton.fleet.vehicle import QUICK, FleetMember, OwnPlan
from maneuver_automaton.fleet.workers import PlanRequest, Proposal, Terms, ToPass, Workers, answered
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.settings import EXACT

FADES, MORE = 0.97, 1.15  # of the time that is kept for the end of a step
AT_FIRST, MOST_KEPT = 0.5, 0.6  # shares of a step's limit

Around = tuple[int, int, int]  # how many are there, and how often plans were exchanged
ROUNDING = 2e-4  # [m] less than two bodies are apart, which the kernels can still prove
Other = tuple[int, OwnPlan]  # a plan that another one may drive, and who that is
MANY = 40  # others that a search looks at; all that are proven
AWAY = 0.5  # of its way, from which on others are not looked at if there are many


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoopSettings:
    """How a fleet's loop is closed."""

    step: float  # delta [s]
    margin: float  # that another plan costs less
    keep: float  # [m] that any two bodies keep
    tube_m: float
    time_limit: float  # [s] per step
    swaps_per_step: int | None
    at_once: int
    group_size: int
    delay_steps: int
    workers: Workers | None

    def __post_init__(self) -> None:
        plain_numbers(self)


@dataclass(slots=True, eq=False)
class Effort:
    """What a vehicle has exchanged, and what it has looked for in vain."""

    version: int = -1  # how often its plan was exchanged; -1: it never joined
    # Plans are the same as long as they are only driven, or rejoined at nearly the same cost.
    lineage: int = 0
    settled: int | None = None  # no plan alone is cheaper than that of this lineage
    in_vain: Around | None = None  # past these nothing was found
    attempts: int = 0  # in vain, since its last exchange
    gain: float = math.inf  # what the way alone would have saved when it looked last

    def exchanged(self) -> None:
        """Another plan is held."""
        self.version += 1
        self.lineage += 1
        self.attempts = 0


@dataclass(slots=True, eq=False)
class Proofs:
    """What was proven in the last step."""

    apart: dict[int, FleetCourse] = field(default_factory=dict)  # from all, and free
    crossing: set[tuple[int, int]] = field(default_factory=set)  # whose plans are not apart
    gap: Gap | None = None


@dataclass(slots=True, eq=False)
class LoopState:
    """What a fleet's loop knows from step to step; vehicles by number."""

    settings: LoopSettings
    vehicles: list[FleetMember]
    agreement: Knowledge
    first: dict[int, OwnPlan]  # plans for those that enter
    held: dict[int, OwnPlan] = field(default_factory=dict)
    arrived: set[int] = field(default_factory=set)
    broken: set[int] = field(default_factory=set)
    silent: set[int] = field(default_factory=set)  # whose workers do not answer any more
    assigned: set[int] = field(default_factory=set)  # who got another problem since the last step
    efforts: list[Effort] = field(init=False)
    due: dict[int, tuple[int, OwnPlan, OwnPlan]] = field(default_factory=dict)  # when, what, for?
    stopped: dict[int, OwnPlan] = field(default_factory=dict)  # what was left of their void plans
    proofs: Proofs = field(default_factory=Proofs)
    kept_s: float = field(init=False)  # of a step's limit for what follows its searches
    last: FleetStep | None = None

    def __post_init__(self) -> None:
        self.efforts = [Effort() for _ in self.vehicles]
        self.kept_s = AT_FIRST * self.settings.time_limit

    def note_end(self, seconds: float) -> None:
        """A step took so much longer than its searches might [s]: that is kept in the next ones.

        As much as the last steps took, and a little more; at most a share of the limit.
        """
        kept = max(FADES * self.kept_s, MORE * seconds)
        self.kept_s = min(kept, MOST_KEPT * self.settings.time_limit)


class Moment:
    """What is known of all vehicles at the time of a step, and what has become of them in it.

    What is held, and who knows of it, changes in one way: `hold`, or an exchange.
    """

    def __init__(
        self, state: LoopState, time: float, poses: dict[int, Array], budget: Budget
    ) -> None:
        self.state = state
        self.held = state.held
        self.vehicles = state.vehicles
        self.keep = state.settings.keep
        self.tube = state.settings.tube_m
        start = state.vehicles[0].problem.start
        self.frame = (float(start[0]), float(start[1]), 0.0)
        self.time = time
        self.nearby = Nearby(time)
        self.poses = poses
        self.budget = budget
        self.searches = budget.before(state.kept_s)  # what follows them takes the rest
        self.number = 0 if state.last is None else state.last.number + 1
        self.void: list[int] = []
        self.violations: list[FleetViolation] = []
        self.refused: list[int] = []  # who could not be let in
        self.swaps: list[Swap] = []
        self.in_group: set[int] = set()  # who exchanged its plan with others at once
        self.asked: list[int] = []  # who looked for a better plan
        # What was left to pay, and the arrival, before any exchange: after plans are rejoined.
        self.before: dict[int, tuple[float, float]] = {}
        self.off: dict[int, float] = {}
        # Who has another plan, or another problem, not by an exchange of its own.
        self.disturbed: set[int] = set(state.assigned)
        state.assigned.clear()
        self.beside: dict[int, Plan] = {}  # driven, within the tube of the plan that is held
        # Pairs that stand nearer to each other than the margin keep what they have [m], and who
        # stands nearer to an obstacle than its own.
        self.pressed: dict[tuple[int, int], float] = {}
        self.near: dict[int, float] = {}
        self._left: dict[
            int, tuple[OwnPlan, FleetCourse]
        ] = {}  # what is left of courses, by identity

    def left_of(self, found: OwnPlan) -> FleetCourse:
        """What is left of a plan's course."""
        known = self._left.get(id(found))
        if known is None:
            known = self._left[id(found)] = (found, found.course.after(self.time))
        return known[1]

    def keep_of(self, k: int, j: int) -> float:
        """What two vehicles have to keep [m]: the margin, or what they have now if that is less."""
        return self.pressed.get((min(k, j), max(k, j)), self.keep)

    def first_meeting(
        self, k: int, found: OwnPlan, others: Collection[Other], most: float = math.inf
    ) -> float:
        """When a plan first comes too near to one of others [s]; inf if never.

        Nearer than two vehicles have to keep, or than a distance `most` [m] that is less.
        """
        first = math.inf
        near = self.nearby.near(found.course, [one.course for _, one in others], keep=self.keep)
        others = [other for other, is_near in zip(others, near, strict=True) if is_near]
        keeps = [min(self.keep_of(k, j), most) for j, _ in others]
        for keep in dict.fromkeys(keeps):
            seen = [one for (_, one), own in zip(others, keeps, strict=True) if own == keep]
            courses = {n: self.left_of(one) for n, one in enumerate((found, *seen))}
            met = meetings(courses, keep=keep, among=[0], frame=self.frame)
            first = min([first, *(row.time for row in met)])
        return first

    def is_proven(self, k: int, found: OwnPlan, others: Collection[Other]) -> bool:
        """Whether a plan keeps apart from others, and is free of what is not of the fleet."""
        if self.first_meeting(k, found, others) < math.inf:
            return False
        return not why_not_free(self.vehicles[k], self.left_of(found), self.near.get(k, math.inf))

    def expected_by(self, k: int, but: Collection[int] = ()) -> list[Other]:
        """All plans that others may drive, as a vehicle knows it, each with its number."""
        known = self.state.agreement.others_of(k)
        return [(j, one) for j, some in known.items() if j not in but for one in some]

    def flag(self, guarantee: FleetGuarantee, numbers: Sequence[int], reason: str) -> None:
        """Note that a guarantee is broken, of whom, and why."""
        names = tuple(self.vehicles[k].name for k in numbers)
        self.violations.append(FleetViolation(guarantee, names, reason))

    def hold(self, k: int, found: OwnPlan) -> None:
        """Another plan is held, whatever the others say to it."""
        self.take(k, found)
        self.state.efforts[k].gain = math.inf
        self.disturbed.add(k)
        self.state.agreement.announce(k, found)

    def take(self, k: int, found: OwnPlan) -> None:
        """A vehicle holds another plan."""
        self.held[k] = found
        self.beside.pop(k, None)
        self.state.efforts[k].exchanged()
        self.off[k] = self.offset_from(k, found)

    def offset_from(self, k: int, found: OwnPlan) -> float:
        """How far a vehicle is beside a plan [m]; 0 if by no more than rounding."""
        pose = self.poses[k]
        off = off_plan(self.vehicles[k], found, self.time, pose)
        return 0.0 if off <= EXACT * (1.0 + float(abs(pose).max())) else off

    def make_void(self, k: int) -> None:
        """A plan is void."""
        if k in self.void:
            return
        self.void.append(k)
        self.note_near(k)

    def note_near(self, k: int) -> None:
        """Who stands nearer to an obstacle than its margin keeps what it has."""
        vehicle, here = self.vehicles[k], self.standing(k)
        if why_not_free(vehicle, here):
            least = min(distance_to_obstacles(vehicle, here), vehicle.problem.margin)
            self.near[k] = max(least - ROUNDING, 0.0)

    def standing(self, k: int) -> FleetCourse:
        """A vehicle as it is where its plans begin, for ever."""
        course = self.held[k].course
        poses = [way.at(self.time) for way in course.motions]
        if self.off[k] > self.state.settings.tube_m:
            moved = SE2(self.poses[k][:3]) @ SE2(poses[0]).inverse()
            poses = [(moved @ SE2(pose)).pose for pose in poses]
        ways = tuple(Motion([self.time], [pose]) for pose in poses)
        return replace(course, motions=ways, until=math.inf)

    def agreed(self, k: int, found: OwnPlan) -> bool:
        """Whether all others agree to a plan: it is proven past the one that each of them holds."""
        past = self.state.agreement.others_of(k)
        return self.state.agreement.agree(
            k,
            found,
            self.held[k],
            lambda j: not any(one.course is self.held[j].course for one in past[j]),
        )

    def knows(self, k: int, j: int) -> bool:
        """Whether a vehicle expects of another one what that drives."""
        return self.state.agreement.knows(k, j, self.held[j])

    def begin_of(self, k: int) -> Array:
        """Where plans of a vehicle begin: on its plan if it is within its tube, else measured."""
        on_it = self.off[k] <= self.state.settings.tube_m
        return self.held[k].plan.pose_at(self.time) if on_it else self.poses[k]

    def rest_of(self, k: int) -> Plan:
        """What is left of the plan that a vehicle holds."""
        return rest_of_plan(self.vehicles[k], self.held[k], self.time)

    def from_here(self, k: int, pose: Array | None = None) -> OwnPlan:
        """What a vehicle holds, if it begins at a pose, or where it was measured."""
        start = self.poses[k] if pose is None else pose
        return replace(self.held[k], plan=replace(self.rest_of(k), start=start))

    def stopping(self, k: int) -> OwnPlan:
        """The plan by which a vehicle comes to rest soonest."""
        return stopping(self.vehicles[k], self.held[k], self.time, self.begin_of(k))

    def rejoined(self, k: int, found: OwnPlan, pose: Array | None = None) -> Iterator[OwnPlan]:
        """A plan made to start at a pose, or where the vehicle was measured, in several ways."""
        start = self.poses[k] if pose is None else pose
        return rejoined(self.vehicles[k], found, self.time, start, self.tube)

    def resting(self, k: int, found: OwnPlan | None = None) -> OwnPlan:
        """A plan to stay where a vehicle was measured, as at the end of another plan."""
        return resting(self.vehicles[k], self.poses[k], self.time, found)

    def left_to_pay(self, k: int) -> float:
        """Cost of what is left of the plan that a vehicle holds."""
        return left_to_pay(self.vehicles[k], self.held[k], self.time)

    def near_to(self, k: int, found: OwnPlan) -> list[int]:
        """Those that may come near a vehicle that drives a plan."""
        others = [j for j in self.held if j != k]
        near = self.nearby.near(found.course, [self.held[j].course for j in others], keep=self.keep)
        return [j for j, is_near in zip(others, near, strict=True) if is_near]


def search(
    now: Moment,
    k: int,
    base: OwnPlan,
    others: Collection[Other],
    known: float,
    *,
    most: int = QUICK,
) -> Proposal:
    """Another plan past the others, and the way alone; None for what does not cost less."""
    (answer,) = answers_to(now, [request_of(now, k, base, others, known, most=most)])
    return answer


def request_of(
    now: Moment,
    k: int,
    base: OwnPlan,
    others: Collection[Other],
    known: float,
    *,
    most: int = QUICK,
    room: bool = True,
) -> PlanRequest:
    """What a vehicle is asked for; without room at its goal, noise may lead it out there."""
    settings = now.state.settings
    goals = now.vehicles[k].problem.goals
    if base.is_over(now.time) and any(within(base.plan.end, goal) for goal in goals):
        base = now.from_here(k)  # its plan says it is there, but it was measured elsewhere
    terms = Terms(
        time=now.time,
        after=0.0 if k in now.void else settings.delay_steps * settings.step,
        between=now.keep,
        known=known,
        most=most,
        tube_m=settings.tube_m if room else 0.0,
        keep=now.near.get(k, math.inf),
    )
    passed = tuple(ToPass(j, one, now.keep_of(k, j)) for j, one in _seen(now, k, base, others))
    return PlanRequest(k, base, passed, terms)


def _seen(now: Moment, k: int, base: OwnPlan, others: Collection[Other]) -> Collection[Other]:
    """Of many others those that may come nearest to where a vehicle is, drives and wants to go."""
    if len(others) <= MANY:
        return others
    courses = [one.course for _, one in others]
    low, high = np.split(now.nearby.box_of(base.course), 2)
    for goal in now.vehicles[k].problem.goals:
        low, high = np.minimum(low, goal.pose[:2]), np.maximum(high, goal.pose[:2])
    gaps = now.nearby.gaps(np.concatenate([low, high]), courses)
    nearest_first = np.argsort(gaps, kind="stable")[:MANY].tolist()
    rows = list(others)
    return [rows[n] for n in sorted(nearest_first) if gaps[n] <= AWAY * (high - low).max()]


def answers_to(now: Moment, requests: Sequence[PlanRequest]) -> list[Proposal]:
    """The answers to requests: of workers, or else found here."""
    workers = now.state.settings.workers
    if workers is None:
        return [
            answered(now.vehicles[one.number], one, now.searches, now.left_of) for one in requests
        ]
    asked = [one for one in requests if one.number not in now.state.silent]
    found = dict(zip(map(id, asked), workers.ask(asked, now.searches), strict=True))
    now.state.silent |= {one.number for one in asked if found[id(one)] is None}
    return [found.get(id(one)) or Proposal(None, None) for one in requests]
