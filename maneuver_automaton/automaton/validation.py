"""What an automaton can and cannot do: dead ends, duplicates, whether every pose is in reach."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton.automaton import Automaton

if TYPE_CHECKING:
    import networkx

PARALLEL = 1e-9  # sine of the angle below which two twists count as parallel


@dataclass(frozen=True, slots=True, kw_only=True)
class AutomatonReport:
    """What `validate` found; names of trims, in the order of the automaton."""

    components: tuple[tuple[str, ...], ...]  # trims that can reach each other, largest first
    dead_ends: tuple[str, ...]  # trims that cannot be left, though there are others elsewhere
    unused: tuple[str, ...]  # trims that no maneuver joins to the others
    duplicates: tuple[tuple[str, ...], ...]  # trims of one class with equal twists
    controllable: bool  # whether every pose can be reached from every pose
    reason: str  # why not, in words; empty if it can

    @property
    def connected(self) -> bool:
        """Whether every trim can be reached from every trim."""
        return len(self.components) == 1


def validate(automaton: Automaton) -> AutomatonReport:
    """Dead ends, trims out of each other's reach, unused and equal trims, controllability.

    A class of trims that switch freely is one node here, so tens of thousands of trims are
    quick. Poses are said to be in reach if one class by itself reaches them; that is all there
    is for a kinematic vehicle.

    A class reaches every pose of SE(2) if and only if one of its trims turns and another moves
    with a twist that is not parallel to it. *Only if*: without a turning trim the heading never
    changes; if all twists are parallel, the vehicle stays on one circle. *If*: any word can be
    continued by turning until its heading has changed by a whole fraction 2 pi / n of a full
    turn. It is then a rotation about some point, and n times the same is the identity; so every
    motion can be undone, and the reachable motions form a group. Its Lie algebra holds two
    twists that are not parallel, one of them turning, whose brackets give both translations:
    it is the whole group.

    In SE(2) x R the same holds if moreover the trims can climb and sink, and their pairs (turn
    rate, climb rate) span the plane: only then can any word be continued to no change of height
    *and* a fraction of a turn; and without it, height and heading stay coupled, or the height
    changes one way only.

    Source: Jurdjevic (1997), *Geometric Control Theory*, Ch. 3, for the last step.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "back": (-1.0, 0.0)})
    >>> validate(robot).reason
    'only straights: the heading never changes'
    """
    components, dead_ends, unused = _reach(automaton)
    controllable, reason = _controllable(automaton)
    return AutomatonReport(
        components=components,
        dead_ends=dead_ends,
        unused=unused,
        duplicates=_duplicates(automaton),
        controllable=controllable,
        reason=reason,
    )


def _reach(
    automaton: Automaton,
) -> tuple[tuple[tuple[str, ...], ...], tuple[str, ...], tuple[str, ...]]:
    """Strongly connected components, dead ends, and trims that nothing joins to the others."""
    classes = automaton.trim_classes
    n_classes = int(classes.max()) + 1
    if n_classes == 1:
        return (automaton.trim_names,), (), ()
    import networkx

    graph: networkx.DiGraph[int] = networkx.DiGraph()
    graph.add_nodes_from(range(n_classes))
    ends = {
        (int(classes[automaton.index_of(m.source)]), int(classes[automaton.index_of(m.target)]))
        for m in automaton.maneuvers
    }
    graph.add_edges_from((source, target) for source, target in ends if source != target)
    groups = [set(group) for group in networkx.strongly_connected_components(graph)]
    members = [_names_in(automaton, group) for group in groups]
    final = {c for group in groups if not _leaves(graph, group) for c in group}
    alone = {c for c in graph if graph.degree(c) == 0}
    return (
        tuple(sorted(members, key=len, reverse=True)),
        _names_in(automaton, (final - alone) if len(groups) > 1 else set()),
        _names_in(automaton, alone),
    )


def _leaves(graph: networkx.DiGraph[int], group: set[int]) -> bool:
    return any(target not in group for node in group for target in graph.successors(node))


def _names_in(automaton: Automaton, classes: set[int]) -> tuple[str, ...]:
    inside = np.isin(automaton.trim_classes, list(classes))
    return tuple(automaton.trim_names[k] for k in np.flatnonzero(inside))


def _duplicates(automaton: Automaton) -> tuple[tuple[str, ...], ...]:
    same: defaultdict[tuple[int, bytes], list[str]] = defaultdict(list)
    rows = automaton.body_velocities + 0.0  # -0.0 is 0.0
    for name, where, row in zip(automaton.trim_names, automaton.trim_classes, rows, strict=True):
        same[int(where), row.tobytes()].append(name)
    return tuple(tuple(names) for names in same.values() if len(names) > 1)


def _controllable(automaton: Automaton) -> tuple[bool, str]:
    """Whether one class reaches every pose; else why the largest one does not."""
    classes = automaton.trim_classes
    reasons: dict[int, str] = {}
    for where in np.unique(classes):
        twists = automaton.body_velocities[classes == where]
        reason = _what_is_missing(twists)
        if not reason:
            return True, ""
        reasons[int(np.count_nonzero(classes == where))] = reason
    if len(np.unique(classes)) == 1:
        return False, reasons[max(reasons)]
    return False, f"no class of trims reaches every pose by itself; {reasons[max(reasons)]}"


def _what_is_missing(twists: Array) -> str:
    """Why trims that switch freely do not reach every pose, "" if they do: `twists` (m, dof)."""
    if not twists.any():
        return "only rest: the vehicle never moves"
    if not twists[:, 2].any():
        return "only straights: the heading never changes"
    if _rank(twists[:, :3]) < 2:
        if not twists[:, :2].any():
            return "only spins: the position never changes"
        return "only one circle: every trim runs along the same one"
    if twists.shape[1] == 3:
        return ""
    climb = twists[:, 3]
    if not climb.any():
        return "only level trims: the height never changes"
    if not (climb > 0.0).any():
        return "only sinking and level trims: the height never rises"
    if not (climb < 0.0).any():
        return "only climbing and level trims: the height never falls"
    if _rank(twists[:, 2:]) < 2:
        return "turn rate and climb rate are proportional: height and heading stay coupled"
    return ""


def _rank(rows: Array) -> int:
    """Number of directions that `rows` span, each counted at unit length."""
    length = np.linalg.norm(rows, axis=1)
    unit = rows[length > 0.0] / length[length > 0.0, None]
    return int(np.count_nonzero(np.linalg.svd(unit, compute_uv=False) > PARALLEL))
