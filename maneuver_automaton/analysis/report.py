"""What a check of a symmetry found, and the sentence that says it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import LieGroup


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SymmetryReport:
    """Whether something is invariant under a group, and if not, where, how much, and why.

    Each coordinate of the group is tried on its own: translation in x, in y, rotation, climb. The
    group they generate is the whole group, so nothing else needs to be tried.
    """

    what: str  # "vector field", "stage cost", ...
    holds: bool
    worst_violation: float  # in the units of the component
    tolerance: float  # relative to the values met there (at least 1) [-]
    state: Array  # (n_x,) where the worst happens; (2, n_x) for boundary conditions
    control: Array  # (n_u,), or (pieces, n_u) for a flow; empty for boundary conditions
    group_element: LieGroup  # that moves the state there
    components: tuple[str, ...]  # violated there, worst first; none if all holds
    broken: tuple[str, ...]  # the motions it is not invariant under, worst first
    intact: tuple[str, ...]  # the motions it is invariant under
    message: str

    def __str__(self) -> str:
        return self.message


def motion_of(coordinate: str) -> str:
    """Name of the motion that moves one coordinate.

    Examples
    --------
    >>> [motion_of(name) for name in ("x", "heading", "z")]
    ['translation in x', 'rotation', 'climb']
    """
    name, _, number = coordinate.partition("_")
    kind = {"heading": "rotation", "z": "climb"}.get(name, f"translation in {name}")
    return f"{kind} of part {number}" if number else kind


def unit_of(coordinate: str) -> str:
    """Say the unit of a coordinate of a pose, with a space in front.

    Examples
    --------
    >>> unit_of("heading"), unit_of("y")
    (' rad', ' m')
    """
    return " rad" if coordinate.startswith("heading") else " m"


def listed(motions: Sequence[str]) -> str:
    """Motions in a row, with 'translation' for all planar ones together.

    Examples
    --------
    >>> listed(["rotation", "translation in x", "translation in y"])
    'rotation and translation'
    >>> listed(["translation in y"])
    'translation in y'
    """
    planar = {"translation in x", "translation in y"}
    if planar <= set(motions):
        motions = [*(motion for motion in motions if motion not in planar), "translation"]
    if len(motions) < 2:
        return "".join(motions)
    return f"{', '.join(motions[:-1])} and {motions[-1]}"
