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
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze, wrapped
from maneuver_automaton.automaton import Automaton, Trajectory
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.groups import SE2
from maneuver_automaton.models.lattice_body import LatticeBody
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

    Examples
    --------
    >>> quarter = Move(start=0, end=1, poses=[[0, 0, 0], [1, 1, np.pi / 2]])
    >>> grid = Lattice(resolution=1.0, headings=[0, np.pi / 2], moves=(quarter,))
    >>> automaton = automaton_of_lattice(grid)
    >>> automaton.trim_names, automaton.maneuvers[0].displacement.round(3).tolist()
    (('heading 0', 'heading 1'), [1.0, 1.0, 1.571])
    >>> round(automaton.maneuvers[0].duration, 3)
    1.571
    """
    if not (speed > 0.0 and turn_rate > 0.0):
        raise ValueError(
            f"lattice: speed and turn_rate must be positive, got {speed} m/s and {turn_rate} rad/s"
        )
    body = LatticeBody(resolution=lattice.resolution, turning_radius=lattice.turning_radius)
    trims = tuple(
        Trim(
            name=f"heading {k}",
            body_velocity=np.zeros(3),
            control=np.zeros(3),
            reduced_state=_direction(angle),
        )
        for k, angle in enumerate(lattice.headings.tolist())
    )
    counts = [0] * len(trims)
    maneuvers = []
    for move in lattice.moves:
        course = _course(move, speed, turn_rate)
        maneuvers.append(
            Maneuver.along(
                course,
                name=f"{counts[move.start]} from heading {move.start}",
                source=trims[move.start].name,
                target=trims[move.end].name,
                cost_multiplier=move.cost_multiplier,
            )
        )
        counts[move.start] += 1
    return Automaton(body, trims, tuple(maneuvers), name=lattice.name)


def lattice_of_automaton(automaton: Automaton, *, kind: str) -> Lattice:
    """The lattice that an automaton is; `kind` is the file that is wanted, for the message.

    Raises
    ------
    InvalidLibrary
        If it is none: another vehicle, trims that move, ends beside the grid or the headings.
    """
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
    moves = tuple(_move(automaton, maneuver, headings, kind) for maneuver in automaton.maneuvers)
    return Lattice(
        resolution=body.resolution,
        headings=headings,
        moves=moves,
        turning_radius=body.turning_radius,
        name=automaton.name,
    )


def continuous(poses: ArrayLike, *, last_heading: float) -> Array:
    """Poses (n, 3) whose headings do not jump, the last one equal to `last_heading` up to turns.

    Examples
    --------
    >>> continuous([[0, 0, 0.1], [1, 0, 6.2]], last_heading=6.2).round(3)[:, 2].tolist()
    [0.1, -0.083]
    """
    array = np.array(as_array("poses", poses, last=3))
    array[:, 2] = np.unwrap(array[:, 2])
    array[-1, 2] += float(wrapped(last_heading - array[-1, 2]))
    return array


def arcs(poses: Array) -> tuple[float, float, float]:
    """Radius and lengths of arcs and straights [m] of the motion along poses (n, 3).

    The radius is speed over turn rate, so positive ahead to the left; 0 without an arc. It is that
    of the stretches that turn most, since one may be an arc in part only.

    Examples
    --------
    >>> tuple(np.round(arcs(np.array([[0, 0, 0], [1, 0, 0], [3, 2, np.pi / 2]])), 3).tolist())
    (2.0, 3.142, 1.0)
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
    """Columns and rows from the start of a primitive to its end; None if it ends beside the grid.

    Examples
    --------
    >>> cells(Move(start=0, end=0, poses=[[0, 0, 0], [0.5, -0.1, 0]]), 0.1)
    (5, -1)
    """
    across = move.poses[-1, :2] / resolution
    whole = np.round(across)
    if np.abs(across - whole).max() > ON_GRID:
        return None
    return int(whole[0]), int(whole[1])


def _direction(angle: float) -> Array:
    return np.array([math.cos(angle), math.sin(angle)])


def _twists(poses: Array) -> Array:
    """Constant twists (n - 1, 3) that lead from pose to pose in 1 s each."""
    group = SE2(poses)
    return (SE2(group.pose[:-1]).inverse() @ SE2(group.pose[1:])).log()


def _course(move: Move, speed: float, turn_rate: float) -> Trajectory:
    """The motion from pose to pose, seen from the first one."""
    poses = move.poses
    moving = np.append(True, np.any(np.diff(poses, axis=0) != 0.0, axis=1))
    poses = poses[moving]
    steps = _twists(poses)
    spans = np.maximum(np.hypot(steps[:, 0], steps[:, 1]) / speed, np.abs(steps[:, 2]) / turn_rate)
    control = steps / np.where(spans > 0.0, spans, 1.0)[:, None]
    seen = (SE2(poses[0]).inverse() @ SE2(poses)).pose + 0.0
    return Trajectory(
        time=np.append(0.0, np.cumsum(spans)),
        pose=seen,
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
