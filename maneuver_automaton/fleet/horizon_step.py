"""One step of a fleet's loop: shift all plans, rejoin, plan anew what is void, exchange, check."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.fleet.agreement import Knowledge
from maneuver_automaton.fleet.asking import Answer, Past, Question, Workers, answered
from maneuver_automaton.fleet.conflicts import Course, meetings
from maneuver_automaton.fleet.guarantees import After, Before, broken, gap_between
from maneuver_automaton.fleet.held import (
    LATER,
    arrival,
    begin_of,
    distance_to_obstacles,
    given_up,
    is_over,
    leads,
    left_to_pay,
    off_plan,
    reach_of,
    rejoined,
    rest_of_plan,
    resting,
    stopping,
    why_not_free,
)
from maneuver_automaton.fleet.log import FleetGuarantee, FleetStep, FleetViolation, Swap
from maneuver_automaton.fleet.nearby import Nearby, near_pairs
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.tracking import back_onto
from maneuver_automaton.fleet.vehicle import LONG, QUICK, Found, Vehicle
from maneuver_automaton.fleet.verdict import nearest
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.settings import EXACT

Around = tuple[int, int, int]  # how many are there, and how often plans were exchanged
Other = tuple[int, Found]  # a plan that another one may drive, and who that is

NEARLY = 0.005  # share of its cost: a plan rejoined that is no dearer is the same one
WORTH = 1e-6  # share of its cost that another plan saves at least
EASED = (1.0, 0.5, 0.0)  # shares of the margin, where a void plan has none that keeps all of it
SHARES = (0.5, 1.0, 2.0)  # of a step, when it is looked at how far a plan is beside another one
REJOINS = 0.5  # share of the tube: farther beside its plan, a vehicle asks for one from there
MANY = 40  # others that a search looks at; all that are proven
AWAY = 0.5  # of its way, from which on others are not looked at if there are many
AGAIN = 4  # steps until who has no plan looks again past the same plans
LEAST = 1e-3  # [m] kept even then
ROUNDING = 2e-4  # [m] less than two bodies are apart, which the kernels can still prove


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoopSettings:
    """How a fleet's loop is closed."""

    step: float  # delta [s]
    margin: float  # that another plan costs less
    tube_m: float
    time_limit: float  # [s] per step
    swaps_per_step: int | None
    at_once: int
    group_size: int
    delay_steps: int


@dataclass(slots=True, eq=False)
class LoopState:
    """What a fleet's loop knows from step to step; vehicles by number."""

    fleet: FleetProblem
    settings: LoopSettings
    vehicles: list[Vehicle]
    agreement: Knowledge
    first: dict[int, Found]  # plans for those that enter
    held: dict[int, Found] = field(default_factory=dict)
    arrived: set[int] = field(default_factory=set)
    broken: set[int] = field(default_factory=set)
    versions: dict[int, int] = field(default_factory=dict)  # how often a plan was exchanged
    # Plans are the same as long as they are only driven, or rejoined at nearly the same cost.
    lineage: dict[int, int] = field(default_factory=dict)
    settled: dict[int, int] = field(default_factory=dict)  # no way alone is cheaper than this one
    in_vain: dict[int, Around] = field(default_factory=dict)  # past these nothing was found
    attempts: dict[int, int] = field(default_factory=dict)  # in vain, since its last exchange
    gains: dict[int, float] = field(default_factory=dict)  # what the way alone would have saved
    due: dict[int, tuple[int, Found, Found]] = field(default_factory=dict)  # when, what, for what
    workers: Workers | None = None
    silent: set[int] = field(default_factory=set)  # whose workers do not answer any more
    crossing: set[tuple[int, int]] = field(default_factory=set)  # whose plans are not apart
    assigned: set[int] = field(default_factory=set)  # who got another problem since the last step
    proven: dict[int, Course] = field(default_factory=dict)  # apart from all, and free
    last: FleetStep | None = None


class FleetStepUnderWay:
    """One step under way; it changes the state of its loop."""

    def __init__(
        self, state: LoopState, time: float, poses: dict[int, Array], budget: Budget
    ) -> None:
        self.state = state
        self.held = state.held
        self.vehicles = state.vehicles
        self.keep = state.fleet.margin
        self.tube = state.settings.tube_m
        start = state.vehicles[0].problem.start
        self.frame = (float(start[0]), float(start[1]), 0.0)
        self.time = time
        self.nearby = Nearby(time)
        self.poses = poses
        self.budget = budget
        self.number = 0 if state.last is None else state.last.number + 1
        self.swaps: list[Swap] = []
        self.asked: list[int] = []
        self.void: list[int] = []
        self.refused: list[int] = []
        self.violations: list[FleetViolation] = []
        self.off: dict[int, float] = {}
        # Who has another plan, or another problem, not by an exchange of its own.
        self.disturbed: set[int] = set(state.assigned)
        state.assigned.clear()
        self.in_group: set[int] = set()
        self.beside: dict[int, Plan] = {}  # driven, within the tube of the plan that is held
        # Pairs that stand nearer to each other than the margin keep what they have [m], and who
        # stands nearer to an obstacle than its own.
        self.pressed: dict[tuple[int, int], float] = {}
        self.near: dict[int, float] = {}
        self._left: dict[int, tuple[Found, Course]] = {}  # what is left of courses, by identity

    def run(self, broken_down: set[int]) -> FleetStep:
        """The step from begin to end."""
        state = self.state
        for k in [k for k in self.held if k not in self.poses]:
            del self.held[k]
        self._let_in()
        before = Before.of(self.vehicles, self.held, self.time, state.last)
        state.agreement.begin(self.number, self.held)
        self._rejoin()
        self._stop(broken_down & set(self.held))
        self._plan_anew()
        self._note_arrivals()
        self._exchange_what_is_due()
        self._exchange()
        return self._logged(before)

    # -- what is proven

    def _course(self, found: Found) -> Course:
        """What is left of a plan's course."""
        known = self._left.get(id(found))
        if known is None:
            known = self._left[id(found)] = (found, found.course.after(self.time))
        return known[1]

    def _keep_of(self, k: int, j: int) -> float:
        """What two vehicles have to keep [m]: the margin, or what they have now if that is less."""
        return self.pressed.get((min(k, j), max(k, j)), self.keep)

    def _first_meeting(
        self, k: int, found: Found, others: Collection[Other], most: float = math.inf
    ) -> float:
        """When a plan first comes too near to one of others [s]; inf if never.

        Nearer than two vehicles have to keep, or than a distance `most` [m] that is less.
        """
        first = math.inf
        near = self.nearby.near(found.course, [one.course for _, one in others], keep=self.keep)
        others = [other for other, is_near in zip(others, near, strict=True) if is_near]
        keeps = [min(self._keep_of(k, j), most) for j, _ in others]
        for keep in dict.fromkeys(keeps):
            seen = [one for (_, one), own in zip(others, keeps, strict=True) if own == keep]
            courses = {n: self._course(one) for n, one in enumerate((found, *seen))}
            met = meetings(courses, keep=keep, among=[0], frame=self.frame)
            first = min([first, *(row.time for row in met)])
        return first

    def _is_proven(self, k: int, found: Found, others: Collection[Other]) -> bool:
        """Whether a plan keeps apart from others, and is free of what is not of the fleet."""
        if self._first_meeting(k, found, others) < math.inf:
            return False
        keep = self.near.get(k, math.inf)
        return not why_not_free(self.vehicles[k], self._course(found), keep)

    def _expected_by(self, k: int, but: Collection[int] = ()) -> list[Other]:
        """All plans that others may drive, as a vehicle knows it, each with its number."""
        known = self.state.agreement.others_of(k)
        return [(j, one) for j, some in known.items() if j not in but for one in some]

    def _flag(self, guarantee: FleetGuarantee, numbers: Sequence[int], reason: str) -> None:
        names = tuple(self.vehicles[k].name for k in numbers)
        self.violations.append(FleetViolation(guarantee, names, reason))

    # -- who is there

    def _let_in(self) -> None:
        """Those that are new, if they keep apart from all: with their first plan, or at rest."""
        agreement, at_first = self.state.agreement, self.state.last is None
        for k in [k for k in self.poses if k not in self.held]:
            vehicle, pose = self.vehicles[k], self.poses[k]
            choices = [resting(vehicle, pose, self.time)]
            first = self.state.first.pop(k, None)
            if first is not None and self._off(k, first) == 0.0:
                choices.insert(0, first)
            others = {(j, id(one)): (j, one) for j, one in self.held.items()}
            for j, one in agreement.everything():
                if j in self.held:
                    others.setdefault((j, id(one)), (j, one))
            for found in choices:
                proven = self._is_proven(k, found, list(others.values()))
                if proven and (at_first or agreement.enter(k, found, self.held)):
                    self.held[k] = found
                    for count in (self.state.versions, self.state.lineage):
                        count[k] = count.get(k, -1) + 1
                    self.disturbed.add(k)
                    break
            else:
                self.refused.append(k)
        if at_first:
            agreement.start(self.held)
            for k in self.refused:
                self._flag(FleetGuarantee.HELD, [k], "it cannot stay where it begins")

    def _note_arrivals(self) -> None:
        """Whose plan is over: at the goal, or it has none that arrives."""
        for k, found in self.held.items():
            if k in self.state.arrived or not leads(found) or not is_over(found, self.time):
                continue
            vehicle = self.vehicles[k]
            there = within(self.poses[k], vehicle.problem.goals[found.goal_index])
            # Who leaves is gone for all others once its plan is over: within its tube, it goes.
            if there or (vehicle.leaves and self._off(k, found) <= self.state.settings.tube_m):
                self.state.arrived.add(k)
                continue
            # It stays where it is, or where its plan ends, and looks for another one.
            stay = resting(self.vehicles[k], self.poses[k], self.time)
            if not (self._is_proven(k, stay, self._expected_by(k)) and self._agreed(k, stay)):
                stay = given_up(found)
            self._hold(k, stay)

    def _hold(self, k: int, found: Found) -> None:
        """Another plan is held, whatever the others say to it."""
        self.held[k] = found
        self.beside.pop(k, None)
        self.state.versions[k] += 1
        self.state.lineage[k] += 1
        self.state.attempts[k] = 0
        self.state.gains.pop(k, None)
        self.disturbed.add(k)
        self.off[k] = self._off(k, found)
        self.state.agreement.announce(k, found)

    # -- off the plan

    def _off(self, k: int, found: Found) -> float:
        """How far a vehicle is beside a plan [m]; 0 if by no more than rounding."""
        pose = self.poses[k]
        off = off_plan(self.vehicles[k], found, self.time, pose)
        return 0.0 if off <= EXACT * (1.0 + float(abs(pose).max())) else off

    def _rejoin(self) -> None:
        """Those off their plans by no more than their tubes rejoin them; the others' are void."""
        self.off = {k: self._off(k, found) for k, found in self.held.items()}
        self._note_pressed()
        for k, found in self.held.items():
            off = self.off[k]
            if k in self.state.broken or off == 0.0:
                continue
            if off > self.state.settings.tube_m:
                self._make_void(k)
            elif k not in self.state.arrived and not self._tracks(k, found, REJOINS):
                self._rejoin_within(k, found)
        self._note_crossing()

    def _make_void(self, k: int) -> None:
        """A plan is void."""
        if k in self.void:
            return
        self.void.append(k)
        self._note_near(k)

    def _note_near(self, k: int) -> None:
        """Who stands nearer to an obstacle than its margin keeps what it has."""
        vehicle, here = self.vehicles[k], self._standing(k)
        if why_not_free(vehicle, here):
            least = min(distance_to_obstacles(vehicle, here), vehicle.problem.margin)
            self.near[k] = max(least - ROUNDING, 0.0)

    def _standing(self, k: int) -> Course:
        """A vehicle as it is where its plans begin, for ever."""
        course = self.held[k].course
        poses = [way.at(self.time) for way in course.motions]
        if self.off[k] > self.state.settings.tube_m:
            moved = SE2(self.poses[k][:3]) @ SE2(poses[0]).inverse()
            poses = [(moved @ SE2(pose)).pose for pose in poses]
        ways = tuple(Motion([self.time], [pose]) for pose in poses)
        return replace(course, motions=ways, until=math.inf)

    def _note_pressed(self) -> None:
        """Pairs that stand nearer to each other than the margin: on their plans, or measured."""
        discs = [
            (k, *place, reach_of(found, self.time))
            for k, found in self.held.items()
            for place in [self._begin(k)[:2].tolist()]
        ]
        for one, other in near_pairs(discs, self.keep):
            pair = {k: self._standing(k) for k in (one, other)}
            if meetings(pair, keep=self.keep, frame=self.frame):
                least = nearest(pair[one], pair[other]).distance
                self.pressed[one, other] = max(min(least, self.keep) - ROUNDING, 0.0)
        for k, found in self.held.items():
            proven = self.state.proven.get(k) is found.course  # it stands on a plan that is free
            if not (leads(found) or proven or k in self.state.broken):
                self._note_near(k)

    def _note_crossing(self) -> None:
        """Plans that lead too near to others since the last step are void, if that is known.

        Whoever had not heard of another one's emergency drove on.
        """
        for one, other in sorted(self.state.crossing):
            if one not in self.held or other not in self.held:
                continue
            if {one, other} & {*self.void} or {one, other} <= self.state.broken:
                continue
            if self._first_meeting(one, self.held[one], [(other, self.held[other])]) == math.inf:
                continue
            able = [k for k in (other, one) if k not in self.state.broken]
            moves = [k for k in able if not is_over(self.held[k], self.time)]
            for k, j in ((one, other), (other, one)):
                if k in (moves or able) and self.state.agreement.knows(k, j, self.held[j]):
                    self._make_void(k)
                    break

    def _rejoin_within(self, k: int, found: Found) -> None:
        others, left = self._expected_by(k), self._left_to_pay(k)
        choices, again = [], None
        for one in rejoined(self.vehicles[k], found, self.time, self.poses[k], self.tube):
            choices.append(one)
            if self._is_proven(k, one, others):
                again = one
                break
        if again is None or not self._agreed(k, again):
            if not (self._tracks(k, found) or self._drives_beside(k, found, choices)):
                self._make_void(k)
            return
        self.held[k] = again
        self.state.versions[k] += 1
        self.state.lineage[k] += int(again.cost > left * (1.0 + NEARLY))
        self.disturbed.add(k)
        self.off[k] = 0.0
        if k in self.state.due:
            when, other, _ = self.state.due[k]
            self.state.due[k] = (when, other, again)

    def _tracks(self, k: int, found: Found, share: float = 1.0) -> bool:
        """Whether a vehicle drives back onto the plan that it holds, without another one.

        It stays nearer to it than a share of its tube, and than obstacles are.
        """
        vehicle, step = self.vehicles[k], self.state.settings.step
        tube = share * self.state.settings.tube_m
        if vehicle.problem.obstacles:
            tube = min(tube, vehicle.problem.margin)
        if self.off[k] > tube or not leads(found):
            return False
        back = back_onto(vehicle, found, self.time, self.poses[k], step, tube)
        if back is not None:
            self.beside[k] = back
        return back is not None

    def _drives_beside(self, k: int, found: Found, choices: Sequence[Found]) -> bool:
        """Of the ways back to a plan that is still held, drive the one that is nearest to it.

        Whether there is one: it must not touch what is not of the fleet.
        """
        vehicle, step = self.vehicles[k], self.state.settings.step

        def farthest(plan: Plan) -> float:
            times = [self.time + share * step for share in SHARES]
            return max(off_plan(vehicle, found, time, plan.pose_at(time)) for time in times)

        tube = self.state.settings.tube_m
        back = back_onto(vehicle, found, self.time, self.poses[k], step, tube)
        plans = [self._from_here(k).plan, *(one.plan for one in choices)]
        for plan in [*([] if back is None else [back]), *sorted(plans, key=farthest)]:
            if not why_not_free(vehicle, vehicle.course_of(begin_of(vehicle, plan, step)), 0.0):
                self.beside[k] = plan
                return True
        return False

    def _agreed(self, k: int, found: Found) -> bool:
        """Whether all others agree to a plan: it is proven past the one that each of them holds."""
        past = self.state.agreement.others_of(k)
        return self.state.agreement.agree(
            k,
            found,
            self.held[k],
            lambda j: not any(one.course is self.held[j].course for one in past[j]),
        )

    def _stop(self, broken_down: set[int]) -> None:
        """Who breaks down stops as soon as it can; plans that would hit it are void.

        Who did so before, and is beside where it was to stop, stops there.
        """
        new = broken_down - self.state.broken
        tube = self.state.settings.tube_m
        beyond = {k for k in self.state.broken & set(self.held) if self.off[k] > tube}
        for k in sorted(new | beyond):
            self._hold(k, stopping(self.vehicles[k], self.held[k], self.time, self._begin(k)))
        self.state.broken |= new
        self.void = [k for k in self.void if k not in self.state.broken]
        for k, found in self.held.items():
            if k in self.state.broken or k in self.void:
                continue
            stopped = [(j, self.held[j]) for j in sorted(new | beyond) if self._knows(k, j)]
            if self._first_meeting(k, found, stopped) < math.inf:
                self._make_void(k)

    def _knows(self, k: int, j: int) -> bool:
        """Whether a vehicle expects of another one what that drives."""
        return self.state.agreement.knows(k, j, self.held[j])

    def _plan_anew(self) -> None:
        """Plans for those whose plans are void, the most urgent first; the next in its order."""
        waiting = list(self.void)
        if len(waiting) > 1:
            waiting.sort(
                key=lambda k: self._first_meeting(
                    k, self.held[k], self._expected_by(k, but=waiting)
                )
            )
        stopped, anew = set(self.state.broken), set[int]()
        while waiting:
            k = waiting.pop(0)
            stop = stopping(self.vehicles[k], self.held[k], self.time, self._begin(k))
            found = None if k in anew or k in self.state.silent else self._another(k, waiting)
            anew.add(k)
            if found is None:
                found = self._stopped(k, stop, stopped)
                stopped.add(k)
            self._hold(k, found)
            self.state.arrived.discard(k)
            for j, other in self.held.items():
                if j in stopped or j in waiting or j == k:
                    continue
                if self._first_meeting(j, other, [(k, found)]) == math.inf:
                    continue
                if self._knows(j, k):
                    waiting.append(j)
                    self._make_void(j)
                else:
                    when = self._first_meeting(j, other, [(k, found)])
                    reason = f"at {when:.6g} s it meets a vehicle that has not heard of it"
                    self._flag(FleetGuarantee.SAFETY, [k, j], reason)

    def _another(self, k: int, waiting: Sequence[int]) -> Found | None:
        """A plan for a vehicle whose plan is void; None if none is found.

        Past all that others may drive, or else past those whose plans are not void and past where
        the others stop.
        """
        vehicle, pose = self.vehicles[k], self._begin(k)
        everyone = self._expected_by(k)
        for one in rejoined(vehicle, self.held[k], self.time, pose, self.tube):
            if self._is_proven(k, one, everyone):
                return one
        past = everyone
        for _ in range(2 if waiting else 1):
            found = self._search(k, self._from_here(k, pose), past, math.inf, most=LONG)[0]
            if found is not None and self._is_proven(k, found, past):
                return found
            stops = [
                (j, stopping(self.vehicles[j], self.held[j], self.time, self._begin(j)))
                for j in waiting
            ]
            past = [*self._expected_by(k, but=waiting), *stops]
        return None

    def _stopped(self, k: int, stop: Found, stopped: Collection[int]) -> Found:
        """The plan of a vehicle that comes to rest, past those that do so already.

        Whoever would hit it is planned anew after it: this ends, at the latest, with all at rest.
        """
        last = [(j, one) for j, one in self.held.items() if j in stopped and j != k]
        for share in EASED:
            keep = max(share * self.keep, LEAST)
            if self._first_meeting(k, stop, last, keep) < math.inf:
                continue
            if share < 1.0:
                reason = f"no plan was found that keeps more than {keep:.3g} m"
                self._flag(FleetGuarantee.APART, [k], reason)
            return stop
        motions = (stop, self.held[k])
        times = [self._first_meeting(k, one, last, LEAST) for one in motions]
        reason = f"unavoidable: at {max(times):.6g} s it meets another vehicle"
        self._flag(FleetGuarantee.SAFETY, [k], reason)
        return motions[times.index(max(times))]

    def _begin(self, k: int) -> Array:
        """Where plans of a vehicle begin: on its plan if it is within its tube, else measured."""
        on_it = self.off[k] <= self.state.settings.tube_m
        return self.held[k].plan.pose_at(self.time) if on_it else self.poses[k]

    def _from_here(self, k: int, pose: Array | None = None) -> Found:
        """What a vehicle holds, if it begins at a pose, or where it was measured."""
        vehicle, found = self.vehicles[k], self.held[k]
        rest = rest_of_plan(vehicle, found, self.time)
        start = self.poses[k] if pose is None else pose
        return replace(found, plan=replace(rest, start=start))

    # -- exchanges

    def _search(
        self, k: int, base: Found, others: Collection[Other], known: float, *, most: int = QUICK
    ) -> Answer:
        """Another plan past the others, and the way alone; None for what does not cost less."""
        (answer,) = self._answers([self._question(k, base, others, known, most=most)])
        return answer

    def _question(
        self, k: int, base: Found, others: Collection[Other], known: float, *, most: int = QUICK
    ) -> Question:
        """What a vehicle is asked for."""
        settings = self.state.settings
        goals = self.vehicles[k].problem.goals
        if is_over(base, self.time) and any(within(base.plan.end, goal) for goal in goals):
            base = self._from_here(k)  # its plan says it is there, but it was measured elsewhere
        return Question(
            number=k,
            base=base,
            time=self.time,
            after=0.0 if k in self.void else settings.delay_steps * settings.step,
            others=tuple(
                Past(j, one, self._keep_of(k, j)) for j, one in self._seen(k, base, others)
            ),
            between=self.keep,
            known=known,
            most=most,
            tube_m=settings.tube_m,
            keep=self.near.get(k, math.inf),
        )

    def _seen(self, k: int, base: Found, others: Collection[Other]) -> Collection[Other]:
        """Of many others those that may come nearest to where a vehicle is, drives and wants to go.

        A plan that is found past these alone is proven past all.
        """
        if len(others) <= MANY:
            return others
        courses = [one.course for _, one in others]
        low, high = np.split(self.nearby.box_of(base.course), 2)
        for goal in self.vehicles[k].problem.goals:
            low, high = np.minimum(low, goal.pose[:2]), np.maximum(high, goal.pose[:2])
        gaps = self.nearby.gaps(np.concatenate([low, high]), courses)
        nearest_first = np.argsort(gaps, kind="stable")[:MANY].tolist()
        rows = list(others)
        return [rows[n] for n in sorted(nearest_first) if gaps[n] <= AWAY * (high - low).max()]

    def _answers(self, questions: Sequence[Question]) -> list[Answer]:
        """The answers to questions: of workers, or else found here."""
        if self.state.workers is None:
            return [
                answered(self.vehicles[one.number], one, self.budget, self._course)
                for one in questions
            ]
        asked = [one for one in questions if one.number not in self.state.silent]
        found = dict(zip(map(id, asked), self.state.workers.ask(asked, self.budget), strict=True))
        self.state.silent |= {one.number for one in asked if found[id(one)] is None}
        return [found.get(id(one)) or Answer(None, None) for one in questions]

    def _left_to_pay(self, k: int) -> float:
        return left_to_pay(self.vehicles[k], self.held[k], self.time)

    def _better_than(self, cost: float) -> float:
        """What another plan must cost less than."""
        if cost == math.inf:
            return cost
        return cost - max(self.state.settings.margin, WORTH * (1.0 + abs(cost)))

    def _exchange(self) -> None:
        """Some look for better plans, one after another: who looked in vain least often first.

        Among these who may gain most: what its way alone would have saved when it looked last.
        """
        settings, state = self.state.settings, self.state
        able = [
            k
            for k in self.held
            if k not in state.broken
            and k not in state.arrived
            and k not in self.void
            and k not in state.due
            and state.settled.get(k) != state.lineage[k]
        ]
        turn = self.number % max(len(able), 1)
        order = [*able[turn:], *able[:turn]]
        order.sort(key=lambda k: (state.attempts.get(k, 0), -state.gains.get(k, math.inf)))
        most = len(order) if settings.swaps_per_step is None else settings.swaps_per_step
        waiting = iter([k for k in order if k not in state.silent])
        while not self.budget.is_over:
            turns = min(settings.at_once, most - len(self.asked))
            batch = list(itertools.islice((k for k in waiting if self._may_gain(k)), turns))
            if not batch:
                return
            self._look_for_better(batch)

    def _around(self) -> Around:
        """What is held, as a number that changes with it."""
        lineage = self.state.lineage
        return len(self.held), sum(lineage.values()), sum(lineage[k] for k in self.held)

    def _may_gain(self, k: int) -> bool:
        """Whether something changed since a vehicle looked in vain.

        Later no more is to be had past the same plans: what is left of them is less. But who has
        none looks again, as as many expansions then lead farther.
        """
        again = not leads(self.held[k]) and (self.number + k) % AGAIN == 0
        return again or self.state.in_vain.get(k) != self._around()

    def _look_for_better(self, batch: Sequence[int]) -> None:
        """Some look for better plans at once, past the same ones; then one after another swaps."""
        around = self._around()
        bases = [self.held[k] for k in batch]
        values = [self._better_than(self._left_to_pay(k)) for k in batch]
        questions = [
            self._question(k, base, self._expected_by(k), known)
            for k, base, known in zip(batch, bases, values, strict=True)
        ]
        self.asked += batch
        answers = self._answers(questions)
        for k, base, known, answer in zip(batch, bases, values, answers, strict=True):
            # An exchange of another one of the batch may have changed it.
            if self.held[k] is not base or k in self.state.silent:
                continue
            if answer.alone is not None:
                self.state.gains[k] = known - answer.alone.cost
            if not self._exchanges(k, base, answer) and not self.budget.is_over:
                self.state.in_vain[k] = around
                self.state.attempts[k] = self.state.attempts.get(k, 0) + 1

    def _exchanges(self, k: int, base: Found, answer: Answer) -> bool:
        """A vehicle exchanges its plan for one that arrives no later; else a group looks for one.

        Whether there is one, also if not all agreed to it.
        """
        settings, (found, alone) = self.state.settings, answer
        if alone is None:
            if leads(base) and not self.budget.is_over:
                self.state.settled[k] = self.state.lineage[k]
            return False
        if found is not None and found.arrival <= arrival(base) * (1.0 + LATER) + LATER:
            if settings.delay_steps:
                self.state.due[k] = (self.number + settings.delay_steps, found, base)
            else:
                self._swap({k: found})
            return True
        if settings.group_size > 1 and not settings.delay_steps:
            return self._look_in_group(k, alone)
        return False

    def _exchange_what_is_due(self) -> None:
        """Answers that come now: exchanged if the plan is still held, and they are proven now."""
        for k, (when, found, base) in [*self.state.due.items()]:
            gone = self.held.get(k) is not base
            if gone or self.number >= when:
                del self.state.due[k]
            if gone or self.number < when:
                continue
            on_it = self._off(k, found) == 0.0
            again = rejoined(self.vehicles[k], found, self.time, self.poses[k], self.tube)
            for one in [found] if on_it else again:
                if self._swap({k: one}):
                    break

    def _look_in_group(self, k: int, alone: Found) -> bool:
        """A vehicle and those in its way look for plans whose sum is less."""
        state = self.state
        courses = {j: self._course(one) for j, one in self.held.items() if j != k}
        met = meetings(
            {**courses, k: self._course(alone)}, keep=self.keep, among=[k], frame=self.frame
        )
        near = [row.one if row.other == k else row.other for row in met]
        fixed = state.broken | state.arrived | state.silent
        movable = [j for j in near if j not in fixed]
        group = [k, *movable[: state.settings.group_size - 1]]
        if len(group) < 2 or any(j in state.due for j in group):
            return False
        return self._exchange_in_order(group) or self._exchange_in_order(group[::-1])

    def _exchange_in_order(self, group: Sequence[int]) -> bool:
        """Plans of a group, one after another, exchanged at once if their sum is less."""
        others = self._expected_by(group[0], but=group)
        found: dict[int, Found] = {}
        for n, j in enumerate(group):
            here = [*others, *found.items()]
            still = [
                (i, resting(self.vehicles[i], self.poses[i], self.time)) for i in group[n + 1 :]
            ]
            one = self._search(j, self.held[j], [*here, *still], math.inf)[0]
            if one is None and still:
                one = self._search(j, self.held[j], here, math.inf)[0]
            if one is None:
                return False
            found[j] = one
        return self._swap(found)

    def _swap(self, found: dict[int, Found]) -> bool:
        """Exchange plans if these pay and are proven past all that is held now, and each other."""
        before = math.fsum(self._left_to_pay(k) for k in found)
        after = math.fsum(left_to_pay(self.vehicles[k], one, self.time) for k, one in found.items())
        if not after < self._better_than(before):
            return False
        for n, (k, one) in enumerate(found.items()):
            others = [*self._expected_by(k, but=found), *list(found.items())[:n]]
            if not self._is_proven(k, one, others):
                return False
        versions = self.state.versions
        past = tuple(
            (self.vehicles[j].name, versions[j]) for j in sorted(self.held) if j not in found
        )
        if len(found) == 1:
            ((k, one),) = found.items()
            if not self._agreed(k, one):
                return False
            self.held[k] = one
        else:
            for k, one in found.items():
                self.held[k] = one
                self.state.agreement.announce(k, one)
            self.in_group |= set(found)
        for k, one in found.items():
            versions[k] += 1
            self.state.lineage[k] += 1
            self.state.attempts[k] = 0
            self.off[k] = self._off(k, one)
            self.beside.pop(k, None)
        names = tuple(self.vehicles[k].name for k in found)
        self.swaps.append(
            Swap(
                names=names,
                before=before,
                after=after,
                past=past,
                holds=tuple((self.vehicles[k].name, versions[k]) for k in found),
                order=len(self.swaps),
            )
        )
        return True

    # -- the log

    def _logged(self, before: Before) -> FleetStep:
        """All of the step, and the guarantees that it broke."""
        state = self.state
        fresh, few = self._fresh(), len(self.held) <= MANY
        looked_at = self.held if few else {k for j, near in fresh.items() for k in (j, *near)}
        courses = {k: self._course(self.held[k]) for k in looked_at}
        after = After(
            time=self.time,
            held=self.held,
            courses=courses,
            off=self.off,
            disturbed=self.disturbed,
            in_group=self.in_group,
            swaps=self.swaps,
            tube_m=state.settings.tube_m,
            keep=self.keep,
            frame=self.frame,
            fresh=fresh,
        )
        said = list(broken(self.vehicles, state.agreement, before, after))
        self.violations += said
        self._note_proven(said)
        gap = gap_between(courses, keep=self.keep, frame=self.frame) if few else self.keep
        if state.crossing:
            gap = 0.0
        names = [one.name for one in self.vehicles]
        plans = {names[k]: one.plan for k, one in self.held.items()}
        return FleetStep(
            number=self.number,
            time=self.time,
            poses={names[k]: self.poses[k] for k in self.held},
            plans=plans,
            driven={names[k]: self.beside.get(k) or self._from_here(k).plan for k in self.held},
            values={names[k]: self._left_to_pay(k) for k in self.held},
            arrivals={names[k]: arrival(one) for k, one in self.held.items()},
            off_plan={names[k]: self.off[k] for k in self.held},
            arrived=tuple(names[k] for k in sorted(state.arrived & set(self.held))),
            swaps=tuple(self.swaps),
            asked=tuple(names[k] for k in self.asked),
            void=tuple(names[k] for k in self.void),
            refused=tuple(names[k] for k in self.refused),
            silent=tuple(names[k] for k in sorted(state.silent & set(self.held))),
            gap_m=gap,
            violations=tuple(self.violations),
            solve_s=self.budget.elapsed,
        )

    def _fresh(self) -> dict[int, list[int]]:
        """Who holds a plan that is not proven yet, and whose plans may come near it."""
        held, proven = self.held, self.state.proven
        fresh = {}
        for k, found in held.items():
            if proven.get(k) is not found.course:
                others = [j for j in held if j != k]
                near = self.nearby.near(
                    found.course, [held[j].course for j in others], keep=self.keep
                )
                fresh[k] = [j for j, is_near in zip(others, near, strict=True) if is_near]
        return fresh

    def _note_proven(self, said: Sequence[FleetViolation]) -> None:
        """Which plans are proven for all later times, and which pairs are not apart."""
        state, numbers = self.state, {one.name: one.number for one in self.vehicles}
        unproven = {
            numbers[name]
            for one in said
            if one.guarantee in {FleetGuarantee.APART, FleetGuarantee.STILL}
            for name in one.names
        }
        state.proven = {k: one.course for k, one in self.held.items() if k not in unproven}
        state.crossing = {
            (min(pair), max(pair))
            for one in said
            if one.guarantee is FleetGuarantee.APART
            for pair in [[numbers[name] for name in one.names]]
        }

    def how_many_near(self, k: int, found: Found) -> int:
        """How many may come near a vehicle that drives a plan."""
        others = [one.course for j, one in self.held.items() if j != k]
        return sum(self.nearby.near(found.course, others, keep=self.keep))
