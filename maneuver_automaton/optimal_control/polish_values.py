"""Input and output of polishing, as values."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.optimal_control.movers import MovingSolid, Pieces, pieces_during
from maneuver_automaton.optimal_control.problem import Guess
from maneuver_automaton.optimal_control.separation import BodyPart, Solid
from maneuver_automaton.optimal_control.solution import SolveStatus

LEAST_DURATION, MOST_DURATION = 1e-2, 1e4  # [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class PolishSettings:
    """How the problem is put to the solver, and when that stops."""

    step: float = 0.12  # [s] between nodes, as far as their number allows
    nodes: tuple[int, int] = (40, 300)  # fewest and most intervals
    near: float = 0.5  # pairs nearer than this get a line, in radii of the body ...
    ahead: float = 0.5  # ... or than the guess drives at its fastest in this time [s]
    clearance: float = 1e-4  # [m] kept between body and line, for the path between nodes
    tightening: float = 1e-6  # of all limits, in their units, so that closure has room
    effort: float = 3e-3  # price of full control, per second, for those that end in rates
    change: float = 1e-3  # price of a full change of control from one interval to the next
    tolerance: float = 1e-6
    violation: float = 1e-7
    acceptable: float = 1e-4
    acceptable_iterations: int = 8
    max_iterations: int = 300
    fixed_iterations: int = 150  # with fixed planes
    mu_init: float = 1e-3
    rounds: int = 8  # solves at most, with lines or margins added after each


class Guard(NamedTuple):
    """Limits of the twist, where any part of the body is in some solids, or everywhere."""

    speed: float = math.inf  # [m/s]
    lateral: float = math.inf  # [m/s^2] speed times turn rate
    reverse: bool = True  # whether it may drive backwards
    solids: tuple[Solid, ...] | None = None  # None: everywhere


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scene:
    """The body, the obstacles around it, half-planes for the reference point, and limits."""

    parts: tuple[BodyPart, ...] = ()
    pieces: tuple[Solid, ...] = ()
    movers: tuple[MovingSolid, ...] = ()
    walls: tuple[tuple[float, float, float], ...] = ()  # (a, b, c): a x + b y <= c
    guards: tuple[Guard, ...] = ()

    @property
    def body(self) -> list[Solid]:
        """Solids of all parts."""
        return [solid for part in self.parts for solid in part.solids]

    def during(self, durations: Array) -> Pieces:
        """Pieces of the obstacles while a motion is driven, of which intervals last so long [s]."""
        return _pieces_during(self, durations.tobytes() if self.movers else b"")


@functools.lru_cache(maxsize=8)  # a round asks for the same ones several times
def _pieces_during(scene: Scene, durations: bytes) -> Pieces:
    return pieces_during(scene.pieces, scene.movers, np.frombuffer(durations))


class Ends(NamedTuple):
    """First and last pose and reduced state; None leaves a component free."""

    start: tuple[float | None, ...]
    end: tuple[float | None, ...]
    duration: tuple[float, float] = (LEAST_DURATION, MOST_DURATION)  # [s] from the one to the other


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Polished:
    """Answer of the solver: states at nodes, controls and durations between them."""

    status: SolveStatus
    reason: str  # the solver's own word
    state: Array  # (n, n_x)
    control: Array  # (n - 1, n_u)
    durations: Array  # (n - 1,) [s]
    objective: float
    is_feasible: bool  # whether it breaks no condition of the program, solved or not
    iterations: int
    build_s: float
    solve_s: float

    @property
    def duration(self) -> float:
        """Final time [s]."""
        return float(self.durations.sum())

    @property
    def as_guess(self) -> Guess:
        """Guess for another grid of equal steps."""
        if np.ptp(self.durations) < 1e-12:
            return Guess(state=self.state, control=self.control, duration=self.duration)
        nodes = np.concatenate([[0.0], np.cumsum(self.durations)])
        even = np.linspace(0.0, nodes[-1], len(nodes))
        state = np.stack([np.interp(even, nodes, column) for column in self.state.T], axis=1)
        which = np.clip(np.searchsorted(nodes, even[:-1], side="right") - 1, 0, len(nodes) - 2)
        return Guess(state=state, control=self.control[which], duration=self.duration)


class Point(NamedTuple):
    """Numbers of all variables but the lines."""

    state: Array  # (n, n_x)
    control: Array  # (n - 1, n_u)
    durations: Array  # (n - 1,) [s]


class Answer(NamedTuple):
    """How the solver ended, and what it took."""

    status: SolveStatus
    reason: str
    objective: float
    iterations: int
    seconds: float
    is_feasible: bool  # whether the point breaks no condition of the program

    def then(self, later: Answer) -> Answer:
        """The answer after another solve, and what both took; an earlier point stays."""
        kept = later.is_feasible or not self.is_feasible
        return later._replace(
            objective=later.objective if kept else self.objective,
            iterations=self.iterations + later.iterations,
            seconds=self.seconds + later.seconds,
            is_feasible=self.is_feasible or later.is_feasible,
        )
