"""Lattice primitives as an automaton: headings are trims, primitives are maneuvers between them.

A primitive moves a body from the origin of a grid, at one of its headings, to another cell and
heading. On a grid the same motion from two headings is, in the frame of the body, two motions: so
every heading keeps its own maneuvers, and nothing is said twice.

The files that hold such primitives state poses and no times. A motion between two poses is here the
one at constant twist, at a speed and a turn rate that whoever reads the file chooses, whichever
limits it: what a controlled vehicle makes of it is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_range, freeze, wrapped
from maneuver_automaton.automaton import Automaton, Trajectory
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.groups import SE2
from maneuver_automaton.models.robots import LatticeBody
from maneuver_automaton.primitives import Maneuver, Trim

SPEED, TURN_RATE = 1.0, 1.0  # [m/s, rad/s] at which poses follow each other unless others are given
STRAIGHT = 1e-6  # [rad] a stretch that turns less is straight
FULLY = 0.9  # of the greatest turn between two poses: a stretch that turns more is on the arc
ON_GRID = 1e-3  # of a cell, between the end of a primitive and the cell that it is taken for
HEADING_TOLERANCE = 1e-6  # [rad] between the end of a primitive and its heading


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Move:
    """One primitive: from a heading to another, along poses in the directions of the grid."""

    start: int  # position of the first heading among those of the lattice
    end: int
    poses: Array  # (n, 3) from (0, 0, first heading), headings continuous [m, m, rad]
    cost_multiplier: float = 1.0  # of what the motion costs otherwise

    def __post_init__(self) -> None:
        freeze(self, "poses", last=3)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lattice:
    """A grid with headings, and the primitives on it."""

    resolution: float  # [m]
    headings: Array  # (k,) [rad], rising
    moves: tuple[Move, ...]
    turning_radius: float | None = None  # [m] if it is stated
    name: str = ""

    def __post_init__(self) -> None:
        freeze(self, "headings")


def automaton_of_lattice(
    lattice: Lattice, *, speed: float = SPEED, turn_rate: float = TURN_RATE
) -> Automaton:
    """The automaton of a lattice: a trim at rest for each heading, a maneuver for each primitive.

    Parameters
    ----------
    lattice : Lattice
        Headings and primitives.
    speed, turn_rate : float
        At which one pose follows another [m/s, rad/s]: a stretch takes the longer of the two times.
    """
    check_range("lattice: speed", speed, unit="m/s", infinite=True)
    check_range("lattice: turn_rate", turn_rate, unit="rad/s", infinite=True)
    body = LatticeBody(resolution=lattice.resolution, turning_radius=lattice.turning_radius)
    trims = tuple(
        Trim(
            name=f"heading {k}",
            body_velocity=np.zeros(3),
            control=np.zeros(3),
            reduced_state=np.array([math.cos(angle), math.sin(angle)]),
        )
        for k, angle in enumerate(lattice.headings.tolist())
    )
    counts = [0] * len(trims)
    maneuvers = []
    for move in lattice.moves:
        maneuvers.append(
            Maneuver.along(
                _course(move, speed, turn_rate),
                name=f"{counts[move.start]} from heading {move.start}",
                source=trims[move.start].name,
                target=trims[move.end].name,
                cost_multiplier=move.cost_multiplier,
            )
        )
        counts[move.start] += 1
    return Automaton(body, trims, tuple(maneuvers), name=lattice.name)


def lattice_of_automaton(automaton: Automaton, *, kind: str) -> Lattice:
    """The lattice that an automaton is; `kind` is the file that is wanted, for the message."""
    body = automaton.model
    if not isinstance(body, LatticeBody):
        raise InvalidLibrary(
            f"{automaton.name or 'automaton'}: a file of {kind} states motions on a grid of cells "
            f"and headings, got an automaton of the {body.name}; need one of lattice primitives, "
            "say the preset lattice_ackermann or lattice_diff of a lattice_body"
        )
    states = np.array([trim.reduced_state for trim in automaton.trims])
    headings = np.mod(np.arctan2(states[:, 1], states[:, 0]), 2.0 * np.pi)
    for k, trim in enumerate(automaton.trims):
        if not trim.is_rest or (k and not headings[k] > headings[k - 1]):
            raise InvalidLibrary(
                f"trim {trim.name!r}: a file of {kind} has headings only, need trims at rest, "
                "counter-clockwise from the x axis"
            )
    return Lattice(
        resolution=body.resolution,
        headings=headings,
        moves=tuple(_move(automaton, maneuver, headings, kind) for maneuver in automaton.maneuvers),
        turning_radius=body.turning_radius,
        name=automaton.name,
    )


def continuous(poses: ArrayLike, *, last_heading: float) -> Array:
    """Poses (n, 3) whose headings do not jump, the last one equal to `last_heading` up to turns."""
    array = np.array(as_array("poses", poses, last=3))
    array[:, 2] = np.unwrap(array[:, 2])
    array[-1, 2] += float(wrapped(last_heading - array[-1, 2]))
    return array


def arcs(poses: Array) -> tuple[float, float, float]:
    """Radius and lengths of arcs and straights [m] of the motion along poses (n, 3).

    The radius is speed over turn rate, so positive ahead to the left; 0 without an arc. It is that
    of the stretches that turn most, since one may be an arc in part only.
    """
    ahead, aside, turns = _twists(poses).T
    length = float(np.hypot(ahead, aside).sum())
    wholly = np.abs(turns) > max(STRAIGHT, FULLY * float(np.abs(turns).max(initial=0.0)))
    turn = float(turns[wholly].sum())
    if not (turn and ahead[wholly].any()):
        return 0.0, 0.0, length
    radius = float(ahead[wholly].sum()) / turn
    on_arcs = min(abs(radius) * float(np.abs(turns).sum()), length)
    return radius, on_arcs, length - on_arcs


def cells(move: Move, resolution: float) -> tuple[int, int] | None:
    """Columns and rows from start to end of a primitive; None if it ends beside the grid."""
    across = move.poses[-1, :2] / resolution
    whole = np.round(across)
    if np.abs(across - whole).max() > ON_GRID:
        return None
    return int(whole[0]), int(whole[1])


def _twists(poses: Array) -> Array:
    """Constant twists (n - 1, 3) that lead from pose to pose in 1 s each."""
    group = SE2(poses)
    return (SE2(group.pose[:-1]).inverse() @ SE2(group.pose[1:])).log()


def _course(move: Move, speed: float, turn_rate: float) -> Trajectory:
    """The motion from pose to pose, seen from the first one."""
    poses = move.poses[np.append(True, np.any(np.diff(move.poses, axis=0) != 0.0, axis=1))]
    steps = _twists(poses)
    spans = np.maximum(np.hypot(steps[:, 0], steps[:, 1]) / speed, np.abs(steps[:, 2]) / turn_rate)
    control = steps / np.where(spans > 0.0, spans, 1.0)[:, None]
    return Trajectory(
        time=np.append(0.0, np.cumsum(spans)),
        pose=(SE2(poses[0]).inverse() @ SE2(poses)).pose + 0.0,
        reduced_state=np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1),
        control=np.concatenate([control, control[-1:] if len(control) else np.zeros((1, 3))]),
    )


def _move(automaton: Automaton, maneuver: Maneuver, headings: Array, kind: str) -> Move:
    start, end = automaton.index_of(maneuver.source), automaton.index_of(maneuver.target)
    course = maneuver.course
    seen = np.stack([np.zeros(3), maneuver.displacement]) if course is None else course.pose
    poses = (SE2(np.array([0.0, 0.0, headings[start]])) @ SE2(seen)).pose
    move = Move(start=start, end=end, poses=poses, cost_multiplier=maneuver.cost_multiplier)
    body = automaton.model
    assert isinstance(body, LatticeBody)
    off = float(abs(wrapped(poses[-1, 2] - headings[end])))
    if cells(move, body.resolution) is None or off > HEADING_TOLERANCE:
        raise InvalidLibrary(
            f"maneuver {maneuver.name!r}: ends at ({poses[-1, 0]:.6g} m, {poses[-1, 1]:.6g} m, "
            f"{poses[-1, 2]:.6g} rad), but a file of {kind} needs ends in the middle of cells of "
            f"{body.resolution:g} m, at the heading of {maneuver.target!r}"
        )
    return move


QUARTER = ((1, 0), (2, 1), (1, 1), (1, 2))  # directions of headings [cells]; 16 in four quarters
MOST_TURNED = 3  # headings by which one primitive turns at most, as Nav2's: 63 to 72 degrees
MOST_CELLS = 200  # in a turning radius: what is finer makes primitives of thousands of poses
ALIKE = 1e-9  # [cells] lengths and radii that differ by less are equal
SPIN_STEP = 0.2  # [rad] between poses of a turn on the spot, as Nav2's


class _LatticeTurn(NamedTuple):
    """From a heading to another: cells between the ends, and the stretches between them."""

    cells: tuple[int, int]
    before: float  # [cells] straight
    radius: float  # [cells]
    after: float  # [cells] straight
    length: float  # [cells]


def lattice_of_arcs(*, resolution: float, turning_radius: float, spins: bool = False) -> Lattice:
    """Primitives that drive ahead on arcs of a least radius [m]; with `spins`, on the spot."""
    check_range("resolution", resolution, unit="m", infinite=True)
    check_range("turning_radius", turning_radius, unit="m", infinite=True)
    radius = turning_radius / resolution
    if radius > MOST_CELLS:
        raise ValueError(
            f"turning_radius: {turning_radius:g} m are {radius:.6g} cells of {resolution:g} m, "
            f"need at most {MOST_CELLS}"
        )
    turned = np.array([[0, 1], [-1, 0]])
    quarters = [np.array(QUARTER) @ np.linalg.matrix_power(turned, k) for k in range(4)]
    directions = np.concatenate(quarters)  # cells (16, 2), counter-clockwise from the x axis
    headings = np.mod(np.arctan2(directions[:, 1], directions[:, 0]), 2.0 * math.pi)
    n = len(headings)
    steps = [k for k in range(-MOST_TURNED, MOST_TURNED + 1) if k]
    turns = {
        (a, (a + k) % n): _shortest(headings[a], headings[(a + k) % n], radius)
        for a in range(n)
        for k in steps
    }
    gap, scale = float(np.diff(headings).min()), np.array([resolution, resolution, 1.0])
    moves = []
    for a in range(n):
        count = math.ceil(radius * gap / float(np.hypot(*directions[a])) - ALIKE)
        to = count * directions[a]
        places = np.linspace(0.0, 1.0, math.ceil(float(np.hypot(*to)) - ALIKE) + 1)[:, None] * to
        ends = {a: np.column_stack([places, np.full(len(places), headings[a])])}
        for k in steps:
            b = (a + k) % n
            if not _is_chain(turns, a, k, n):
                ends[b] = _along(headings[a], headings[b], turns[a, b])
        moves += [Move(start=a, end=b, poses=ends[b] * scale) for b in sorted(ends)]
        if spins:
            moves += [
                Move(start=a, end=b, poses=_spin(headings[a], headings[b]))
                for b in sorted(((a - 1) % n, (a + 1) % n))
            ]
    return Lattice(
        resolution=resolution, headings=headings, moves=tuple(moves), turning_radius=turning_radius
    )


def _shortest(first: float, last: float, radius: float) -> _LatticeTurn:
    """The shortest motion to a cell, of all whose arc has at least a radius [cells]."""
    turn = float(wrapped(last - first))
    bend = math.tan(0.5 * abs(turn))
    reach = math.ceil(2.0 * (radius * bend + math.sqrt(5.0)))
    i, j = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
    across = math.sin(turn)
    ahead = (i * math.sin(last) - j * math.cos(last)) / across
    beyond = (j * math.cos(first) - i * math.sin(first)) / across
    on_arc = np.minimum(ahead, beyond)
    arcs = on_arc / bend
    length = ahead + beyond - 2.0 * on_arc + arcs * abs(turn)
    length[arcs < radius - ALIKE] = math.inf
    alike = np.flatnonzero(length <= length.min() + ALIKE)
    best = int(alike[np.argmax(arcs[alike])])
    return _LatticeTurn(
        cells=(int(i[best]), int(j[best])),
        before=float(ahead[best] - on_arc[best]),
        radius=float(arcs[best]),
        after=float(beyond[best] - on_arc[best]),
        length=float(length[best]),
    )


def _is_chain(turns: dict[tuple[int, int], _LatticeTurn], a: int, k: int, n: int) -> bool:
    """Whether two smaller turns lead to the same cell and are no longer."""
    whole = turns[a, (a + k) % n]
    for part in range(1, abs(k)):
        middle = (a + int(math.copysign(part, k))) % n
        first, second = turns[a, middle], turns[middle, (a + k) % n]
        cells = np.add(first.cells, second.cells)
        longer = first.length + second.length > whole.length + ALIKE
        if np.array_equal(cells, whole.cells) and not longer:
            return True
    return False


def _along(first: float, last: float, turn: _LatticeTurn) -> Array:
    angle = float(wrapped(last - first))
    side = math.copysign(turn.radius, angle)
    poses = [np.array([[0.0, 0.0, first]])]
    for length, bent in ((turn.before, 0.0), (turn.radius * abs(angle), angle), (turn.after, 0.0)):
        if length <= ALIKE:
            continue
        x, y, heading = poses[-1][-1]
        shares = np.linspace(0.0, 1.0, math.ceil(length) + 1)[1:]
        headings = heading + bent * shares
        if bent:
            xs = x + side * (np.sin(headings) - math.sin(heading))
            ys = y - side * (np.cos(headings) - math.cos(heading))
        else:
            xs = x + shares * length * math.cos(heading)
            ys = y + shares * length * math.sin(heading)
        poses.append(np.column_stack([xs, ys, headings]))
    whole = np.concatenate(poses)
    whole[-1] = [*turn.cells, first + angle]
    return whole


def _spin(first: float, last: float) -> Array:
    angle = float(wrapped(last - first))
    count = math.ceil(abs(angle) / SPIN_STEP)
    return np.column_stack([np.zeros((count + 1, 2)), np.linspace(first, first + angle, count + 1)])


DIGITS = 12  # after the point, of a level


def levels_of(begins: Array, ends: Array, *, apart: float) -> Array:
    """Values, rising, less than `apart`: medians of begins, of ends where nothing begins."""
    values = np.unique(np.concatenate([begins, ends]))
    levels = []
    for group in np.split(values, np.flatnonzero(np.diff(values) > apart) + 1):
        begun = begins[(begins >= group[0]) & (begins <= group[-1])]
        levels.append(float(np.median(begun if begun.size else group)))
    return np.round(levels, DIGITS) + 0.0


def nearest_level(values: Array, levels: Array) -> Array:
    """The level (n,) next to each value (n,)."""
    chosen: Array = levels[np.abs(levels - values[:, None]).argmin(axis=1)]
    return chosen


def ending_at(course: Trajectory, state: ArrayLike) -> Trajectory:
    """A course whose last reduced state is that of its trim, to the last bit."""
    states = course.reduced_state.copy()
    states[-1] = state
    return replace(course, reduced_state=states)
