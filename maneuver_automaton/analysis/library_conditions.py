"""Conditions under which a library of trims reaches every pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, as_array


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


def _columns(body_velocities: ArrayLike) -> tuple[Array, Array, Array]:
    twists = as_array("body_velocities", body_velocities, last=3)
    if twists.ndim != 2:
        raise ValueError(f"body_velocities: got shape {twists.shape}, need (m, 3)")
    return twists[:, 0], twists[:, 1], twists[:, 2]


def _indices(chosen: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(int(i) for i in np.flatnonzero(chosen))
