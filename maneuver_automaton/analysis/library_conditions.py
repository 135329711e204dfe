"""Conditions under which a library of trims reaches every pose, and a word that does."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, as_array, wrapped

TrimSequence = list[tuple[int, float]]
"""Trims by index, each with its coasting time [s], in order."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LibraryReport:
    """Whether turn-move-turn is possible: which trims serve, and what is missing."""

    holds: bool
    rests: tuple[int, ...]  # indices of trims that stand still
    straights: tuple[int, ...]  # that drive straight ahead
    spins: tuple[int, ...]  # that turn on the spot
    missing: tuple[str, ...]
    message: str

    def __str__(self) -> str:
        return self.message


def check_library(
    body_velocities: ArrayLike, *, max_trims: int | None = None, tolerance: float = 1e-12
) -> LibraryReport:
    """Whether a library has all that the existence lemma asks for.

    It asks for three trims in a word, and among the trims a rest, a forward straight and a spin.
    The rest is needed where the final time is fixed. A spin to either side will do.

    Source: the paper, Lemma 11.

    Parameters
    ----------
    body_velocities : (m, 3) array
        Twist of each trim [m/s, m/s, rad/s]; for the controls of a model its `body_velocity`.
    max_trims : int, optional
        Most trims that a word may have; no limit if None.
    tolerance : float
        What counts as zero [m/s, rad/s].

    Returns
    -------
    LibraryReport
        What holds, and what is missing.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> controls = np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 1.0]])
    >>> twists = Unicycle().body_velocity(np.zeros(0), controls)
    >>> check_library(twists, max_trims=3).holds
    True
    >>> check_library(twists[:2]).missing
    ('no spin, with body velocity (0, 0, w != 0)',)
    """
    v_x, v_y, turn = _columns(body_velocities)
    still, level = np.hypot(v_x, v_y) <= tolerance, np.abs(turn) <= tolerance
    rests = _indices(still & level)
    straights = _indices((v_x > tolerance) & (np.abs(v_y) <= tolerance) & level)
    spins = _indices(still & ~level)
    missing = []
    if max_trims is not None and max_trims < 3:
        missing.append(f"words of at most {max_trims} trims, need 3")
    if not rests:
        missing.append("no rest, with body velocity (0, 0, 0), to wait for a fixed final time")
    if not straights:
        missing.append("no forward straight, with body velocity (v > 0, 0, 0)")
    if not spins:
        missing.append("no spin, with body velocity (0, 0, w != 0)")
    message = (
        f"library does not reach every pose by turn, move, turn: {'; '.join(missing)}"
        if missing
        else "library reaches every pose by turn, move, turn"
    )
    return LibraryReport(
        holds=not missing,
        rests=rests,
        straights=straights,
        spins=spins,
        missing=tuple(missing),
        message=message,
    )


def turn_move_turn(
    start: ArrayLike, goal: ArrayLike, *, body_velocities: ArrayLike, angle_tolerance: float = 1e-12
) -> TrimSequence:
    """Spin until the goal lies ahead, drive there, spin to its heading: the quickest such word.

    Source: the paper, Lemma 11.

    Parameters
    ----------
    start, goal : (3,) arrays
        Poses x [m], y [m], heading [rad]; headings are equal modulo a full turn.
    body_velocities : (m, 3) array
        Twist of each trim [m/s, m/s, rad/s].
    angle_tolerance : float
        Turns up to this angle are not made [rad].

    Returns
    -------
    list of (trim index, duration [s])
        At most three trims, each of positive duration; none if the start is the goal.

    Raises
    ------
    ValueError
        If the library has no forward straight or no spin.

    Examples
    --------
    >>> twists = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, np.pi / 4]]
    >>> turn_move_turn([0.0, 1.0, 0.0], [0.0, 0.0, 0.0], body_velocities=twists)
    [(2, 6.0), (1, 2.0), (2, 2.0)]
    """
    twists = np.stack(_columns(body_velocities), axis=-1)
    library = check_library(twists)
    if not (library.straights and library.spins):
        raise ValueError(f"turn_move_turn: {library.message}")
    begin, end = as_array("start", start, last=3), as_array("goal", goal, last=3)
    distance = math.dist(begin[:2], end[:2])
    ahead = math.atan2(end[1] - begin[1], end[0] - begin[0]) if distance else float(begin[2])
    straight = max(library.straights, key=lambda i: float(twists[i, 0]))
    word = [
        _turn(ahead - float(begin[2]), twists, library.spins, angle_tolerance),
        (straight, distance / float(twists[straight, 0])),
        _turn(float(end[2]) - ahead, twists, library.spins, angle_tolerance),
    ]
    return [(trim, duration) for trim, duration in word if duration > 0.0]


def _turn(
    angle: float, twists: Array, spins: tuple[int, ...], tolerance: float
) -> tuple[int, float]:
    """Quickest spin through an angle modulo a full turn, and how long it takes."""
    if abs(wrapped(angle)) <= tolerance:
        return spins[0], 0.0
    times = {}
    for spin in spins:
        rate = float(twists[spin, 2])
        times[spin] = (math.copysign(1.0, rate) * angle) % (2 * math.pi) / abs(rate)
    return min(times.items(), key=lambda item: item[1])


def _columns(body_velocities: ArrayLike) -> tuple[Array, Array, Array]:
    twists = as_array("body_velocities", body_velocities, last=3)
    if twists.ndim != 2:
        raise ValueError(f"body_velocities: got shape {twists.shape}, need (m, 3)")
    return twists[:, 0], twists[:, 1], twists[:, 2]


def _indices(chosen: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(int(i) for i in np.flatnonzero(chosen))
