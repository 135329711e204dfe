"""Input and output of polishing, as values: a body, what is around it, and how it moves.

In an interval a piece of an obstacle that moves is all that this sweeps from its begin to its end,
and it is parted from the body in that interval alone. A motion that takes longer meets it
elsewhere: to first order each corner shifts by its velocity, times the share of the motion that
has passed.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.models.vehicle import Components
from maneuver_automaton.optimal_control.ipopt import SolveStatus
from maneuver_automaton.optimal_control.problem import Guess

Solid = tuple[Array, float]
"""Corners (n, 2) of a convex polygon, and the radius that rounds it: one corner makes a disc."""


PartPose = Callable[[Components], Sequence[Any]]
"""Pose (x, y, heading) of a part in the frame of the vehicle, from the reduced state."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyPart:
    """A rigid part of a vehicle: convex solids in its own frame, and where that frame is.

    Examples
    --------
    >>> hull = np.array([[-1.0, -0.5], [3.0, -0.5], [3.0, 0.5], [-1.0, 0.5]])
    >>> round(BodyPart(solids=((hull, 0.0),)).reach, 3)
    2.062
    """

    solids: tuple[Solid, ...]
    pose: PartPose | None = None  # in the frame of the vehicle; None: the same

    @property
    def reach(self) -> float:
        """Radius of the smallest box's circle around the part [m]: how big it is."""
        low = np.min([corners.min(axis=0) - by for corners, by in self.solids], axis=0)
        high = np.max([corners.max(axis=0) + by for corners, by in self.solids], axis=0)
        return float(np.hypot(*(high - low))) / 2.0


DIGITS = 9  # decimals of what a solver is given: see `settled`
INSIDE = (0.25, 0.5, 0.75)  # shares of an interval, at which it is looked at how far paths bend
NEARBY = 1e-3  # [s] for the velocity of a corner
ALWAYS, NEVER = -1, -2  # the interval of what is there in all of them, and in none


def settled(values: Array) -> Array:
    """The values without the last digits, in which a moved problem may differ from this one.

    Where a solver goes may depend on each digit that it begins with, of several local optima.
    """
    return np.asarray(np.round(values, DIGITS) + 0.0)


def settled_state(state: Sequence[float | None]) -> tuple[float | None, ...]:
    """The same of a state, of which None is free."""
    return tuple(None if value is None else float(settled(np.array(value))) for value in state)


class MovingSolid(NamedTuple):
    """A convex solid that moves."""

    corners: Array  # (m, 2) [m] in its own frame
    rounding: float  # [m]
    poses: Callable[[Array], Array]  # (n, 3) at times (n,) since the begin of the motion [s]
    there: tuple[float, float]  # [s] since the same, from when until when


class ObstaclePieces(NamedTuple):
    """Convex pieces of obstacles, while a motion of some duration is driven."""

    solids: list[Solid]
    interval: IntArray  # (n,) in which alone each counts, or `ALWAYS`, or `NEVER`
    first: int  # the number of the first one that moves
    shifts: Array  # (moving, corners, 2) [m/s] of the corners, by seconds of duration

    @property
    def move(self) -> bool:
        """Whether some move."""
        return self.first < len(self.solids)


def pieces_during(
    still: Sequence[Solid],
    movers: Sequence[MovingSolid],
    durations: Array,
    stays: Sequence[tuple[int, float]] = (),
) -> ObstaclePieces:
    """What stands still, and what moves in each interval of a motion of `durations` (n,) [s].

    Before it stays at a node for some time, what passes meanwhile belongs to the last interval.

    Corners of what moves are those at the begin of the interval, then those at its end: their hull
    is the piece.
    """
    solids, intervals, shifts = list(still), [np.full(len(still), ALWAYS)], []
    ends = np.cumsum([0.0, *durations.tolist()])
    late = np.zeros(len(ends))
    for node, seconds in stays:
        late[node:] += seconds
    clock = ends + late
    most = 2 * max((len(one.corners) for one in movers), default=0)
    for one in movers:
        first, last = one.there
        begin, end = np.clip(clock[:-1], first, last), np.clip(clock[1:], first, last)
        both = settled(np.concatenate([_corners(one, begin), _corners(one, end)], axis=1))
        # Of a clipped time nothing shifts.
        shares = np.stack([ends[:-1], ends[1:]], axis=1) / max(ends[-1], NEARBY)
        shares *= np.stack([begin == clock[:-1], end == clock[1:]], axis=1)
        rates = np.concatenate([_rates(one, begin), _rates(one, end)], axis=1)
        rates *= np.repeat(shares, len(one.corners), axis=1)[..., None]
        # How far paths of corners lead beside the chords [m], by some looks.
        beside, here, there = np.zeros(len(begin)), _corners(one, begin), _corners(one, end)
        for share in INSIDE:
            gap = _corners(one, begin + share * (end - begin)) - (here + share * (there - here))
            beside = np.maximum(beside, np.hypot(gap[..., 0], gap[..., 1]).max(axis=1))
        bulges = one.rounding + settled(beside)
        solids += list(zip(both, bulges.tolist(), strict=True))
        present = (clock[:-1] <= last) & (clock[1:] >= first)
        intervals.append(np.where(present, np.arange(len(durations)), NEVER))
        shifts.append(np.pad(settled(rates), ((0, 0), (0, most - rates.shape[1]), (0, 0))))
    return ObstaclePieces(
        solids,
        np.concatenate(intervals).astype(np.int64),
        len(still),
        np.concatenate([np.zeros((0, most, 2)), *shifts]),
    )


def _corners(one: MovingSolid, times: Array) -> Array:
    """Where the corners are (n, m, 2) at times (n,)."""
    x, y, heading = np.moveaxis(one.poses(times), -1, 0)[..., None]
    c, s = np.cos(heading), np.sin(heading)
    along, aside = one.corners.T
    return np.stack([x + c * along - s * aside, y + s * along + c * aside], axis=-1)


def _rates(one: MovingSolid, times: Array) -> Array:
    """Velocities (n, m, 2) of the corners [m/s]."""
    ahead, behind = _corners(one, times + NEARBY), _corners(one, times - NEARBY)
    return np.asarray((ahead - behind) / (2.0 * NEARBY))


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
    acceptable: tuple[float, int] = (1e-4, 8)  # tolerance after so many iterations within it
    max_iterations: int = 300
    fixed_iterations: int = 150  # with fixed planes
    mu_init: float = 1e-3
    rounds: int = 8  # solves at most, with lines or margins added after each


USUAL = PolishSettings()


class Guard(NamedTuple):
    """Limits of the twist, where any part of the body is in some solids, or everywhere."""

    speed: float = math.inf  # [m/s]
    lateral: float = math.inf  # [m/s^2] speed times turn rate
    reverse: bool = True  # whether it may drive backwards
    solids: tuple[Solid, ...] | None = None  # None: everywhere


class PlacesAt(NamedTuple):
    """What places cost."""

    rates: Callable[[Array, Array, Array], Array]  # (n, 2) a metre, a second: pose, state, control
    scale: float = math.inf  # [m] nothing that is priced is finer


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PolishScene:
    """The body, obstacles, half-planes for the reference point, limits, and prices of places."""

    parts: tuple[BodyPart, ...] = ()
    pieces: tuple[Solid, ...] = ()
    movers: tuple[MovingSolid, ...] = ()
    walls: tuple[tuple[float, float, float], ...] = ()  # (a, b, c): a x + b y <= c
    guards: tuple[Guard, ...] = ()
    places: PlacesAt | None = None
    stays: tuple[tuple[int, float], ...] = ()  # nodes at which it stands between, how long [s]

    @property
    def body(self) -> list[Solid]:
        """Solids of all parts."""
        return [solid for part in self.parts for solid in part.solids]

    def during(self, durations: Array) -> ObstaclePieces:
        """Pieces of the obstacles while a motion is driven, of which intervals last so long [s]."""
        return _pieces_during(self, durations.tobytes() if self.movers else b"")


@functools.lru_cache(maxsize=8)  # a round asks for the same ones several times
def _pieces_during(scene: PolishScene, durations: bytes) -> ObstaclePieces:
    return pieces_during(scene.pieces, scene.movers, np.frombuffer(durations), scene.stays)


NodeOnTheWay = tuple[int, tuple[float | None, ...]]
"""Number of a node between the first and the last, and its state; None leaves a component free."""


class MotionEnds(NamedTuple):
    """First and last pose and reduced state; None leaves a component free."""

    start: tuple[float | None, ...]
    end: tuple[float | None, ...]
    duration: tuple[float, float] = (LEAST_DURATION, MOST_DURATION)  # [s] from the one to the other

    @property
    def settled(self) -> MotionEnds:
        """The same without the last digits."""
        return self._replace(start=settled_state(self.start), end=settled_state(self.end))


class Polished(NamedTuple):
    """A `Point`, a `SolverAnswer`, and what it took to come there."""

    state: Array  # (n, n_x)
    control: Array  # (n - 1, n_u)
    durations: Array  # (n - 1,) [s]
    status: SolveStatus
    reason: str  # the solver's own word
    objective: float
    iterations: int
    solve_s: float
    is_feasible: bool  # whether it breaks no condition of the program, solved or not
    lines: int  # that part it from obstacles; of lines that stand still, those that hold it back
    seconds: float  # of it all

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
        guess = Guess.of_motion(even, known=nodes, state=self.state, control=self.control)
        return replace(guess, duration=self.duration)  # to the last bit


class Point(NamedTuple):
    """Numbers of all variables but the lines."""

    state: Array  # (n, n_x)
    control: Array  # (n - 1, n_u)
    durations: Array  # (n - 1,) [s]


class SolverAnswer(NamedTuple):
    """How the solver ended, and what it took."""

    status: SolveStatus
    reason: str
    objective: float
    iterations: int
    seconds: float
    is_feasible: bool  # whether the point breaks no condition of the program

    def then(self, later: SolverAnswer) -> SolverAnswer:
        """The answer after another solve, and what both took; an earlier point stays."""
        kept = later.is_feasible or not self.is_feasible
        return later._replace(
            objective=later.objective if kept else self.objective,
            iterations=self.iterations + later.iterations,
            seconds=self.seconds + later.seconds,
            is_feasible=self.is_feasible or later.is_feasible,
        )
