"""Conditions under which a library of trims reaches every pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import as_array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LibraryReport:
    """Whether turn-move-turn is possible, and what is missing for it."""

    missing: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing

    def __str__(self) -> str:
        word = "every pose by turn, move, turn"
        if self.holds:
            return f"library reaches {word}"
        return f"library does not reach {word}: {'; '.join(self.missing)}"


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
    twists = as_array("body_velocities", body_velocities, last=3)
    if twists.ndim != 2:
        raise ValueError(f"body_velocities: got shape {twists.shape}, need (m, 3)")
    v_x, v_y, turn = twists.T
    still, level = np.hypot(v_x, v_y) <= tolerance, np.abs(turn) <= tolerance
    asked = {
        f"words of at most {max_trims} trims, need 3": max_trims is None or max_trims >= 3,
        "no rest, with body velocity (0, 0, 0), to wait for a fixed final time": still & level,
        "no forward straight, with body velocity (v > 0, 0, 0)": (
            (v_x > tolerance) & (np.abs(v_y) <= tolerance) & level
        ),
        "no spin, with body velocity (0, 0, w != 0)": still & ~level,
    }
    return LibraryReport(missing=tuple(what for what, there in asked.items() if not np.any(there)))
