"""A kinematic path as a plan of a vehicle with inertia: it stops wherever the twist jumps.

The path is followed exactly, so a plan that is free for the kinematic vehicle is free for this
one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Protocol

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton, Plan, Primitive
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import pace_within
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.problem import Horizon, Problem

SHORTEST = 1e-12  # [s] shorter coasts are left out


class StopsAndSteers(Model, Protocol):
    """A vehicle that can follow kinematic paths: its controls are the rates of its state."""

    @property
    def kinematic(self) -> Model:
        """The kinematic vehicle whose paths it can follow."""
        ...

    def state_along(self, twist: Array, pace: float) -> Array:
        """Reduced state (n_z,) in which it moves with ``pace * twist``; linear in the pace."""
        ...


def stop_and_steer(model: StopsAndSteers, path: Plan, *, first: Trim, last: Trim) -> Plan:
    """The fastest plan along a kinematic path that stops at every switch.

    Every trim of the path becomes a stroke from rest to rest: full acceleration, a coast at full
    speed where it is long enough, full braking. Between strokes the reduced state changes at rest.

    `model`: the vehicle. `path`: of its kinematic vehicle. `first`, `last`: trims at rest in which
    it begins and ends. Returns along the same poses.
    """
    for what, trim in (("first", first), ("last", last)):
        if not trim.is_rest:
            raise ValueError(f"{what} trim {trim.name!r}: it moves, need one that stands still")
    word = _Word(model, trims={first.name: first, last.name: last})
    at = first
    coasts = zip(path.trims, path.durations.tolist(), strict=True)
    for _, group in groupby(coasts, key=lambda one: one[0].body_velocity.tobytes()):
        pieces = list(group)
        twist, length = pieces[0][0].body_velocity, math.fsum(time for _, time in pieces)
        if not twist.any() or not length > SHORTEST:
            continue
        standing = word.trim(model.state_along(twist, 0.0), first, last)
        word.turn_at_rest(at, standing)
        word.stroke(standing, twist, length)
        at = standing
    word.turn_at_rest(at, last)
    if not word.primitives:
        return Plan(path.start, (first,), durations=[0.0], start_time=path.start_time)
    return Plan.of_primitives(
        path.start,
        word.primitives,
        durations=word.durations,
        trims=word.trims,
        start_time=path.start_time,
    )


@dataclass(slots=True, eq=False)
class _Word:
    """Primitives put one after the other."""

    model: StopsAndSteers
    trims: dict[str, Trim]
    primitives: list[Primitive] = field(default_factory=list)
    durations: list[float] = field(default_factory=list)

    def trim(self, state: Array, *known: Trim) -> Trim:
        """The trim of a reduced state, one that is known if it has this state."""
        for one in known:
            if np.array_equal(one.reduced_state, state):
                return one
        name = f"at {_numbers(state)}"
        while name in self.trims:
            if np.array_equal(self.trims[name].reduced_state, state):
                return self.trims[name]
            name += "'"
        controls = np.zeros(len(self.model.control_names))
        velocity = np.asarray(self.model.body_velocity(state, controls))
        self.trims[name] = Trim(
            name=name, body_velocity=velocity, control=controls, reduced_state=state
        )
        return self.trims[name]

    def turn_at_rest(self, source: Trim, target: Trim) -> None:
        """Change the reduced state at full rate where the vehicle stands."""
        change = target.reduced_state - source.reduced_state
        duration = float(np.max(np.abs(change) / self._rates))
        if duration > 0.0:
            name = f"at rest to {_numbers(target.reduced_state)}"
            self._maneuver(name, source, target, change / duration, duration)

    def stroke(self, standing: Trim, twist: Array, length: float) -> None:
        """Motion along a twist, from rest to rest, by `length` times that of a second."""
        per_pace = self.model.state_along(twist, 1.0) - standing.reduced_state
        growth = float(np.min(_ratio(self._rates, np.abs(per_pace))))
        low, high = np.moveaxis(self.model.reduced_limits, -1, 0)
        fastest = float(np.min(_ratio(np.where(per_pace > 0.0, high, -low), np.abs(per_pace))))
        pace = min(fastest, pace_within(self.model, twist), math.sqrt(length * growth))
        ramp = pace / growth
        moving = self.trim(standing.reduced_state + pace * per_pace)
        control = growth * per_pace
        spoken = _numbers(moving.reduced_state)
        self._maneuver(f"accelerate to {spoken}", standing, moving, control, ramp)
        coast = length / pace - ramp
        if coast > SHORTEST:
            self.primitives.append(moving)
            self.durations.append(coast)
        self._maneuver(f"brake from {spoken}", moving, standing, -control, ramp)

    @property
    def _rates(self) -> Array:
        """Greatest rates (n_z,) of the reduced state: its rates are the controls."""
        return np.asarray(self.model.control_limits[:, 1])

    def _maneuver(
        self, name: str, source: Trim, target: Trim, control: Array, duration: float
    ) -> None:
        state, controls = source.reduced_state, control[None]
        course = drive(self.model, state, control=controls, durations=[duration])
        self.trims[source.name], self.trims[target.name] = source, target
        one = Maneuver.along(course, name=name, source=source.name, target=target.name)
        self.primitives.append(one)
        self.durations.append(one.duration)


def _ratio(limits: Array, sizes: Array) -> Array:
    """Limits by sizes; infinite where the size is zero."""
    return np.where(sizes > 0.0, limits / np.where(sizes > 0.0, sizes, 1.0), np.inf)


def _numbers(state: Array) -> str:
    return ", ".join(f"{value + 0.0:.4g}" for value in state)


SWITCH_SHARE = 0.5  # of the time to change from limit to limit, as the price of a switch


def follows_paths(model: Model) -> bool:
    """Whether a vehicle can follow the paths of a kinematic one by stopping at its switches."""
    return hasattr(model, "kinematic") and hasattr(model, "state_along")


def kinematic_problem(problem: Problem, *, switch: float = SWITCH_SHARE) -> Problem:
    """The problem of the kinematic vehicle at its greatest speeds between the same obstacles.

    Its cost is time; `switch` is a price in units of the time that the vehicle with inertia takes
    to change its reduced state from one limit to the other.
    """
    model = problem.automaton.model
    automaton = extreme_automaton(problem.automaton)
    slowest = float(np.max(np.ptp(model.reduced_limits, axis=1) / model.control_limits[:, 1]))
    return simpler_problem(problem, automaton, cost=Cost(time=1.0, switch=switch * slowest))


def simpler_problem(problem: Problem, automaton: Automaton, *, cost: Cost) -> Problem:
    """The way of a kinematic vehicle between the same obstacles, from start to goals.

    Where places are priced, a second costs what it costs in the dearest trim: so much beside them.
    """
    if problem.place_costs:
        second = float(problem.rates.max()) or 1.0
        cost = replace(
            cost,
            time=second * cost.time,
            switch=second * cost.switch,
            direction_change=second * cost.direction_change,
        )
    return Problem(
        automaton,
        problem.start,
        tuple(replace(goal, trim=None, state=None) for goal in problem.goals),
        cost=cost,
        horizon=Horizon(),
        start_time=problem.start_time,
        bounds=problem.bounds,
        search=replace(problem.search, method="lattice"),
        obstacles=problem.obstacles,
        footprint=problem.footprint,
        margin=problem.margin,
        place_costs=problem.place_costs,
    )


@kept_by_first
def extreme_automaton(automaton: Automaton) -> Automaton:
    """Trims of the kinematic vehicle at the limits of the reduced state, and between at zero."""
    model: StopsAndSteers = automaton.model  # type: ignore[assignment]
    # The limits in falling order, and zero if it lies between.
    axes = [[high, *([0.0] if low < 0.0 < high else []), low] for low, high in model.reduced_limits]
    kinematic = model.kinematic
    states = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    twists = model.body_velocity(states, np.zeros((len(states), len(model.control_names))))
    moving = [(model.state_along(t, min(1.0, pace_within(model, t))), t) for t in twists if t.any()]
    names = kinematic.control_names
    controls = {
        ", ".join(f"{what} {v:.4g}" for what, v in zip(names, state + 0.0, strict=True)): state
        for state, _ in moving
    }
    return Automaton.of_controls(kinematic, controls)
