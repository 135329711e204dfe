"""Driving a scene in closed loop: plan, drive one tick, plan again."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Player, picture, player_frame, player_page
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.roads.decision import AT_REST, RoadDecision
from maneuver_automaton.roads.judge import RoadVerdict, judged
from maneuver_automaton.roads.missed import nearest_miss
from maneuver_automaton.roads.planner import RoadPlanner
from maneuver_automaton.roads.scene import RoadScene


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadStep:
    """One step: the state before it, what was decided there, and the control applied."""

    number: int
    time: float  # [s]
    state: Array  # (5,) x, y, heading of the rear axle, speed, steering, in the planner's frame
    decision: RoadDecision
    value: float  # cost of the plan that was decided for
    applied_cost: float  # of its first step
    replanned: bool  # the plan is not the tail of the last one
    solve_s: float  # [s] to decide
    cpu_s: float  # [s] of it that the processor spent on this thread

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "state", last=5)

    @property
    def control(self) -> Array:
        """Acceleration [m/s^2] and steering rate [rad/s] (2,) until the next step."""
        return np.asarray(self.decision.controls[0])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadDrive:
    """A drive from its start to where it ended, and what the audit says of it."""

    planner: RoadPlanner
    steps: tuple[RoadStep, ...]
    driven: Plan  # all that was driven, in the coordinates and on the clock of the scene
    reached: bool  # a goal, and the verdict is clean
    status: str  # reached | touched | off_road | undrivable | missed | steps_spent
    reason: str  # one line; empty if reached
    verdict: RoadVerdict

    __repr__ = brief

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file states and is not obeyed, or was read otherwise: a sentence each."""
        after = [_state_after(self.planner, s.state, s.control) for s in self.steps[-1:]]
        states = [*(step.state for step in self.steps), *after]
        return self.planner.notes(np.array(states or [self.planner.start_state]))

    @property
    def solve_s(self) -> Array:
        """Time (n,) that every step took to decide [s]."""
        return np.array([step.solve_s for step in self.steps])

    def player(self, *, title: str = "") -> Player:
        """A page that plays it: `.html`, or `.save(path)`; `title` heads it."""
        return player_page(self, title=title)

    def _repr_html_(self) -> str:
        return player_frame(self)

    def _repr_png_(self) -> bytes | None:
        return picture(self)


def drive_scene(
    planner: RoadPlanner,
    *,
    steps: int | None = None,
    first: RoadDecision | None = None,
    progress: Callable[[int], None] | None = None,
) -> RoadDrive:
    """Close the loop until a goal is reached, or its time is over.

    The planner knows the recorded motion of all moving obstacles before it happens.

    Parameters
    ----------
    planner : RoadPlanner
    steps : int, optional
        Steps at most.
    first : RoadDecision, optional
        What was decided before the start, such as the decision of `plan_road`.
    progress : callable, optional
        Called with the number of each step that is done.
    """
    driver = Driver(planner, first, steps)
    with patient():
        if not driver.is_done:
            planner.warm()
        while not (driver.is_done or stopped()):
            driver.step(driver.planner)
            if progress is not None:
                progress(driver.tick)
    return driver.drive(planner.scene)


class Driver:
    """A vehicle along its drive: where it is, and what it does next if nothing better is found."""

    def __init__(
        self,
        planner: RoadPlanner,
        first: RoadDecision | None,
        steps: int | None = None,
        others: Sequence[Obstacle] = (),
    ) -> None:
        """`others` are there at the start, besides the traffic that the planner knows."""
        last = planner.last_tick
        self.planner = planner
        self.hopeless = planner.hopeless(others)
        self.limit = 0 if self.hopeless else min(last if steps is None else steps, last)
        self.state = planner.start_state
        self.tail = first
        self.tick = 0
        self.done: list[RoadStep] = []

    @property
    def reached(self) -> bool:
        """Whether it is at a goal."""
        return not self.hopeless and self.planner.at_goal(self.state, tick=self.tick)

    @property
    def is_done(self) -> bool:
        """Whether it is at a goal, or there are no steps left."""
        return self.reached or self.tick >= self.limit

    def step(self, planner: RoadPlanner) -> None:
        """Decide as a planner says, which knows the traffic of now, and drive a tick."""
        self.done.append(_step(planner, self.state, tick=self.tick, tail=self.tail))
        decision = self.done[-1].decision
        self.state = _state_after(planner, self.state, decision.controls[0])
        self.tick, self.tail = self.tick + 1, decision.tail()
        self.planner = self.planner.opened(self.state)

    @property
    def driven(self) -> Plan:
        """All that it drove, in the coordinates and on the clock of the scene."""
        applied = np.array([step.control for step in self.done]).reshape(-1, 2)
        return self.planner.plan_of(self.planner.start_state, applied)

    def drive(self, scene: RoadScene) -> RoadDrive:
        """The drive, judged among the traffic of a scene."""
        planner, at_goal, driven = self.planner, self.reached, self.driven
        states = np.array([*(step.state for step in self.done), self.state])
        status, reason = _ending(planner, states, stood=_stood(self.done), reached=at_goal)
        reason += ", when the drive was interrupted" if stopped() and not at_goal else ""
        verdict = judged(scene, planner.vehicle, driven)
        if self.hopeless is not None:
            status, reason = self.hopeless
        elif verdict.faults:  # they decide how it ended, wherever it ended
            status = verdict.faults[0][0]
            ended = reason or f"a goal was reached at {planner.time_of(self.tick):.6g} s"
            reason = "; ".join([*(said for _, said in verdict.faults), ended])
        return RoadDrive(
            planner=planner,
            steps=tuple(self.done),
            driven=driven,
            reached=status == "reached",
            status=status,
            reason=reason,
            verdict=verdict,
        )


def _step(planner: RoadPlanner, state: Array, *, tick: int, tail: RoadDecision | None) -> RoadStep:
    """Decide once, and measure how long that takes."""
    wall, cpu = time.perf_counter(), time.thread_time()
    decision, replanned = planner.decide(state, tick=tick, tail=tail)
    wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
    return RoadStep(
        number=tick,
        time=planner.time_of(tick),
        state=state,
        decision=decision,
        value=planner.price(decision),
        applied_cost=planner.price(decision, ticks=1),
        replanned=replanned,
        solve_s=wall,
        cpu_s=cpu,
    )


def _state_after(planner: RoadPlanner, state: Array, control: Array) -> Array:
    """The state (5,) that a control (2,) leads to in a tick, by the model's own equations."""
    course = drive(
        planner.vehicle.model, state[3:], control=control[None], durations=[planner.tick]
    )
    pose = (SE2(state[:3]) @ SE2(course.pose[-1])).pose
    speed, steering = course.reduced_state[-1].tolist()
    return np.array([*pose, 0.0 if abs(speed) <= AT_REST else speed, steering])


def _stood(steps: Sequence[RoadStep]) -> tuple[float, float] | None:
    """First and last time at which the vehicle stood, as no motion was free [s]."""
    times = [step.time for step in steps if step.decision.stands]
    return (times[0], times[-1]) if times else None


def _ending(
    planner: RoadPlanner, states: Array, *, stood: tuple[float, float] | None, reached: bool
) -> tuple[str, str]:
    """Status and reason after the `states` (n, 5) at all ticks."""
    if reached:
        return "reached", ""
    tick = len(states) - 1
    now, over = planner.time_of(tick), tick >= planner.last_tick
    looked_at = np.arange(0, len(states), planner.horizon.goals.every)
    times = np.array([planner.time_of(k) for k in looked_at.tolist()])
    why = nearest_miss(planner.local.goals, planner.vehicle, times, states[looked_at])
    if stood is not None:
        first, last = stood
        since = f"at {first:.6g} s" if first == last else f"from {first:.6g} s to {last:.6g} s"
        why += f"; no continuation was found {since}"
    why += planner.waits(states[-1], tick=tick)
    if over:
        return "missed", f"no goal was reached until {now:.6g} s, when the last one is over; {why}"
    return "steps_spent", f"no goal was reached in {tick} steps, until {now:.6g} s; {why}"
