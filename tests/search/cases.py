"""Problems that several tests and benchmarks of the search pose."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Unicycle
from maneuver_automaton.models.user import UserModel
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.words import Word as FoundWord
from tests.reference import Word

# The paper's Table 2; with the spin reversed, the sequence that the paper names is the best one.
TABLE_2 = {
    "rest": (0.0, 0.0),
    "straight": (1.5, 0.0),
    "cw": (-0.25, -1.0),
    "acw": (-0.25, 1.0),
    "spin": (0.0, 1.0),
}
LONG = {"cw": "clockwise", "acw": "anticlockwise"}
NAMED_TABLE_2 = {LONG.get(name, name): control for name, control in TABLE_2.items()}
REVERSED_SPIN = TABLE_2 | {"spin": (0.0, -1.0)}
SLOW_AND_FAST = {
    "rest": (0.0, 0.0),
    "fast": (1.0, 0.0),
    "slow": (0.4, 0.0),
    "left": (1.0, 1.0),
    "right": (1.0, -1.0),
    "slow left": (0.4, 0.4),
    "slow right": (0.4, -0.4),
    "back": (-1.0, 0.0),
}
REEDS_SHEPP = {
    "L+": (1.0, 1.0),
    "S+": (1.0, 0.0),
    "R+": (1.0, -1.0),
    "L-": (-1.0, 1.0),
    "S-": (-1.0, 0.0),
    "R-": (-1.0, -1.0),
}
DUBINS = {name: REEDS_SHEPP[name] for name in ("L+", "S+", "R+")}
VECTORS = Path(__file__).parents[2] / "../shared/data/steering-vectors/ompl-reeds-shepp-dubins.csv"
INTERPRETED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
compiled_only = pytest.mark.skipif(INTERPRETED, reason="takes long where kernels are interpreted")
PARKING_COST = Cost(effort=1.0, norm=0.5)


def robot(controls, model=None) -> Automaton:
    return Automaton.of_controls(model or Unicycle(), controls)


def parking(controls=None, *, cost=PARKING_COST, **horizon) -> Problem:
    """From (0, 1, 0) to the origin, in eight seconds with at most four trims."""
    limits = {"time": 8.0, "max_trims": 4} | horizon
    library = robot(controls or TABLE_2)
    return Problem(library, [0.0, 1.0, 0.0], [0.0, 0.0, 0.0], cost=cost, horizon=Horizon(**limits))


def without_rest(controls) -> dict[str, tuple[float, float]]:
    return {name: control for name, control in controls.items() if any(control)}


def helicopter() -> Automaton:
    """Cruise, turns, climb and descent: trims in SE(2) x R, controls [v, omega, v_z]."""
    model = UserModel(
        name="helicopter",
        group=SE2xR,
        control_names=("speed", "turn", "climb"),
        velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
    )
    return robot(
        {
            "hover": (0.0, 0.0, 0.0),
            "ahead": (2.0, 0.0, 0.0),
            "left": (2.0, 0.5, 0.2),
            "right": (2.0, -0.5, -0.2),
            "lift": (0.0, 0.0, 1.0),
            "sink": (0.0, 0.0, -1.0),
        },
        model,
    )


def lasting(word):
    """The trims of a word that last a while, with their times."""
    used = word.durations > 0.0
    return tuple(word.trims[used].tolist()), word.durations[used]


def names(problem: Problem, solution: FoundWord) -> tuple[str, ...]:
    return tuple(problem.automaton.trim_names[k] for k in solution.trims)


def end_off_goal(problem: Problem, solution: FoundWord, goal: int = 0) -> tuple[float, float]:
    """Distance [m] and heading difference [rad] between the end of a solution and a goal."""
    group = SE2 if problem.start.size == 3 else SE2xR
    pose = group(problem.start)
    for trim, time in zip(solution.trims, solution.durations, strict=True):
        pose = pose @ group.exp(time * problem.automaton.body_velocities[trim])
    off = pose.pose - problem.goals[goal].pose
    return float(np.linalg.norm(np.delete(off, 2))), float(
        abs(np.remainder(off[2] + np.pi, 2 * np.pi) - np.pi)
    )


def reference_word(problem: Problem, solution: FoundWord) -> tuple[Word, np.ndarray]:
    """The moving trims of a solution as a word for the slow twin, with their times."""
    group = SE2 if problem.start.size == 3 else SE2xR
    twists = problem.automaton.body_velocities
    moving = twists[solution.trims].any(axis=1)
    rows = solution.trims[moving]
    goal = (group(problem.start).inverse() @ group(problem.goals[0].pose)).pose
    padded = not moving.all()
    time = problem.horizon.time
    rates = problem.rates[rows]
    if padded:
        rest = int(solution.trims[~moving][0])
        rates = rates - problem.rates[rest]
    word = Word(
        twists[rows],
        rates,
        goal,
        total=None if padded else time,
        at_most=time if padded else problem.horizon.max_time,
    )
    return word, solution.durations[moving]


@dataclass(frozen=True, slots=True)
class Vector:
    """A pair of poses, seen from the first at turning radius one, and the shortest lengths."""

    row: int
    goal: tuple[float, float, float]
    reeds_shepp: float
    dubins: float


def vectors() -> Iterator[Vector]:
    """Pairs of the file, lengths and places divided by the turning radius."""
    with VECTORS.open(newline="") as lines:
        for number, row in enumerate(csv.DictReader(lines)):
            radius = float(row["turning_radius_m"])
            start, goal = (
                SE2([float(row[f"x{k}_m"]), float(row[f"y{k}_m"]), float(row[f"yaw{k}_rad"])])
                for k in range(2)
            )
            x, y, heading = (start.inverse() @ goal).pose.tolist()
            yield Vector(
                row=number,
                goal=(x / radius, y / radius, heading),
                reeds_shepp=float(row["reeds_shepp_length_m"]) / radius,
                dubins=float(row["dubins_length_m"]) / radius,
            )
