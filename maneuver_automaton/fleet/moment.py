"""All vehicles at one moment of a loop: where they are, what they hold, what is proven of it."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.fleet.conflicts import Course, meetings
from maneuver_automaton.fleet.held import (
    distance_to_obstacles,
    left_to_pay,
    off_plan,
    rest_of_plan,
    why_not_free,
)
from maneuver_automaton.fleet.log import FleetGuarantee, FleetViolation
from maneuver_automaton.fleet.loop_state import LoopState
from maneuver_automaton.fleet.nearby import Nearby
from maneuver_automaton.fleet.vehicle import Found
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon.settings import EXACT

ROUNDING = 2e-4  # [m] less than two bodies are apart, which the kernels can still prove

Other = tuple[int, Found]  # a plan that another one may drive, and who that is


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
        self.keep = state.fleet.margin
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
        self.off: dict[int, float] = {}
        # Who has another plan, or another problem, not by an exchange of its own.
        self.disturbed: set[int] = set(state.assigned)
        state.assigned.clear()
        self.beside: dict[int, Plan] = {}  # driven, within the tube of the plan that is held
        # Pairs that stand nearer to each other than the margin keep what they have [m], and who
        # stands nearer to an obstacle than its own.
        self.pressed: dict[tuple[int, int], float] = {}
        self.near: dict[int, float] = {}
        self._left: dict[int, tuple[Found, Course]] = {}  # what is left of courses, by identity

    def left_of(self, found: Found) -> Course:
        """What is left of a plan's course."""
        known = self._left.get(id(found))
        if known is None:
            known = self._left[id(found)] = (found, found.course.after(self.time))
        return known[1]

    def keep_of(self, k: int, j: int) -> float:
        """What two vehicles have to keep [m]: the margin, or what they have now if that is less."""
        return self.pressed.get((min(k, j), max(k, j)), self.keep)

    def first_meeting(
        self, k: int, found: Found, others: Collection[Other], most: float = math.inf
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

    def is_proven(self, k: int, found: Found, others: Collection[Other]) -> bool:
        """Whether a plan keeps apart from others, and is free of what is not of the fleet."""
        if self.first_meeting(k, found, others) < math.inf:
            return False
        keep = self.near.get(k, math.inf)
        return not why_not_free(self.vehicles[k], self.left_of(found), keep)

    def expected_by(self, k: int, but: Collection[int] = ()) -> list[Other]:
        """All plans that others may drive, as a vehicle knows it, each with its number."""
        known = self.state.agreement.others_of(k)
        return [(j, one) for j, some in known.items() if j not in but for one in some]

    def flag(self, guarantee: FleetGuarantee, numbers: Sequence[int], reason: str) -> None:
        """Note that a guarantee is broken, of whom, and why."""
        names = tuple(self.vehicles[k].name for k in numbers)
        self.violations.append(FleetViolation(guarantee, names, reason))

    def hold(self, k: int, found: Found) -> None:
        """Another plan is held, whatever the others say to it."""
        self.held[k] = found
        self.beside.pop(k, None)
        self.state.versions[k] += 1
        self.state.lineage[k] += 1
        self.state.attempts[k] = 0
        self.state.gains.pop(k, None)
        self.disturbed.add(k)
        self.off[k] = self.offset_from(k, found)
        self.state.agreement.announce(k, found)

    def offset_from(self, k: int, found: Found) -> float:
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

    def standing(self, k: int) -> Course:
        """A vehicle as it is where its plans begin, for ever."""
        course = self.held[k].course
        poses = [way.at(self.time) for way in course.motions]
        if self.off[k] > self.state.settings.tube_m:
            moved = SE2(self.poses[k][:3]) @ SE2(poses[0]).inverse()
            poses = [(moved @ SE2(pose)).pose for pose in poses]
        ways = tuple(Motion([self.time], [pose]) for pose in poses)
        return replace(course, motions=ways, until=math.inf)

    def agreed(self, k: int, found: Found) -> bool:
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

    def from_here(self, k: int, pose: Array | None = None) -> Found:
        """What a vehicle holds, if it begins at a pose, or where it was measured."""
        vehicle, found = self.vehicles[k], self.held[k]
        rest = rest_of_plan(vehicle, found, self.time)
        start = self.poses[k] if pose is None else pose
        return replace(found, plan=replace(rest, start=start))

    def left_to_pay(self, k: int) -> float:
        """Cost of what is left of the plan that a vehicle holds."""
        return left_to_pay(self.vehicles[k], self.held[k], self.time)

    def how_many_near(self, k: int, found: Found) -> int:
        """How many may come near a vehicle that drives a plan."""
        others = [one.course for j, one in self.held.items() if j != k]
        return sum(self.nearby.near(found.course, others, keep=self.keep))
