"""Lattice primitives for a least turning radius: straights, and arcs between straights.

A primitive leads from the middle of a cell, at one of 16 headings, to the middle of another cell at
another heading: straight ahead, along an arc, straight ahead. Headings point at cells, so that
straights stay on the grid. For two headings the shortest such motion is taken whose arc is no
sharper than the vehicle turns.

Source: the lattice generator of navigation2, `nav2_smac_planner/lattice_primitives`, for the
motions; Pivtoraiko, Kelly (2005), *Efficient constrained path planning via search in state
lattices*, i-SAIRAS, for leaving out what chains of others do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray, wrapped
from maneuver_automaton.formats.lattice import Lattice, Move

QUARTER = ((1, 0), (2, 1), (1, 1), (1, 2))  # directions of headings [cells]; 16 in four quarters
MOST_TURNED = 3  # headings by which one primitive turns at most, as Nav2's: 63 to 72 degrees
MOST_CELLS = 200  # in a turning radius: what is finer makes primitives of thousands of poses
ALIKE = 1e-9  # [cells] lengths and radii that differ by less are equal
SPIN_STEP = 0.2  # [rad] between poses of a turn on the spot, as Nav2's


class _Turn(NamedTuple):
    """From a heading to another: cells between the ends, and the stretches between them."""

    cells: tuple[int, int]
    before: float  # [cells] straight
    radius: float  # [cells]
    after: float  # [cells] straight
    length: float  # [cells]


def lattice_of_arcs(*, resolution: float, turning_radius: float, spins: bool = False) -> Lattice:
    """Primitives of a vehicle that drives ahead on arcs of a least radius.

    Parameters
    ----------
    resolution : float
        Side of a cell [m].
    turning_radius : float
        Least radius [m].
    spins : bool
        Whether it turns on the spot too, to the headings beside its own.

    Raises
    ------
    ValueError
        If a number is not positive, or the radius is more than 200 cells.

    Examples
    --------
    >>> lattice = lattice_of_arcs(resolution=0.05, turning_radius=0.5)
    >>> [(move.end, move.poses[-1, :2].round(3).tolist()) for move in lattice.moves[:3]]
    [(0, [0.2, 0.0]), (1, [0.35, 0.1]), (2, [0.4, 0.15])]
    """
    if not (resolution > 0.0 and turning_radius > 0.0):
        raise ValueError(
            f"resolution and turning_radius must be positive, got {resolution} m and "
            f"{turning_radius} m"
        )
    radius = turning_radius / resolution
    if radius > MOST_CELLS:
        raise ValueError(
            f"turning_radius: {turning_radius:g} m are {radius:.6g} cells of {resolution:g} m, "
            f"need at most {MOST_CELLS}"
        )
    directions = _directions()
    headings = np.mod(np.arctan2(directions[:, 1], directions[:, 0]), 2.0 * math.pi)
    n = len(headings)
    steps = [k for k in range(-MOST_TURNED, MOST_TURNED + 1) if k]
    turns = {
        (a, (a + k) % n): _shortest(headings[a], headings[(a + k) % n], radius)
        for a in range(n)
        for k in steps
    }
    gap = float(np.diff(headings).min())
    moves = []
    for a in range(n):
        count = math.ceil(radius * gap / float(np.hypot(*directions[a])) - ALIKE)
        ends = {a: _straight(headings[a], count * directions[a])}
        for k in steps:
            b = (a + k) % n
            if not _is_chain(turns, a, k, n):
                ends[b] = _along(headings[a], headings[b], turns[a, b])
        moves += [Move(start=a, end=b, poses=_scaled(ends[b], resolution)) for b in sorted(ends)]
        if spins:
            moves += [
                Move(start=a, end=b, poses=_spin(headings[a], headings[b]))
                for b in sorted(((a - 1) % n, (a + 1) % n))
            ]
    return Lattice(
        resolution=resolution,
        headings=headings,
        moves=tuple(moves),
        turning_radius=turning_radius,
    )


def _directions() -> IntArray:
    """Cells (16, 2) at which the headings point, counter-clockwise from the x axis."""
    quarter = np.array(QUARTER)
    turned = np.array([[0, 1], [-1, 0]])
    return np.concatenate([quarter @ np.linalg.matrix_power(turned, k) for k in range(4)])


def _shortest(first: float, last: float, radius: float) -> _Turn:
    """The shortest motion to a cell, of all whose arc has at least a radius [cells].

    Straights cut at a corner, d1 from the start and d2 from the end. The arc that touches both
    begins and ends min(d1, d2) from there, and its radius is that over tan(turn / 2).
    """
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
    return _Turn(
        cells=(int(i[best]), int(j[best])),
        before=float(ahead[best] - on_arc[best]),
        radius=float(arcs[best]),
        after=float(beyond[best] - on_arc[best]),
        length=float(length[best]),
    )


def _is_chain(turns: dict[tuple[int, int], _Turn], a: int, k: int, n: int) -> bool:
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


def _straight(heading: float, to: Array) -> Array:
    """Poses (n, 3) [cells, cells, rad], at most a cell apart."""
    count = math.ceil(float(np.hypot(*to)) - ALIKE)
    places = np.linspace(0.0, 1.0, count + 1)[:, None] * to
    return np.column_stack([places, np.full(count + 1, heading)])


def _along(first: float, last: float, turn: _Turn) -> Array:
    """Poses (n, 3) [cells, cells, rad] of a straight, an arc and a straight."""
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
            xs, ys = (
                x + shares * length * math.cos(heading),
                y + shares * length * math.sin(heading),
            )
        poses.append(np.column_stack([xs, ys, headings]))
    whole = np.concatenate(poses)
    whole[-1] = [*turn.cells, first + angle]
    return whole


def _spin(first: float, last: float) -> Array:
    """Poses (n, 3) of a turn on the spot."""
    angle = float(wrapped(last - first))
    count = math.ceil(abs(angle) / SPIN_STEP)
    return np.column_stack([np.zeros((count + 1, 2)), np.linspace(first, first + angle, count + 1)])


def _scaled(poses: Array, resolution: float) -> Array:
    return np.asarray(poses * np.array([resolution, resolution, 1.0]))
