"""What an automaton can and cannot do: what is in reach, dead ends, duplicates, every pose."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Maneuver


def trims_between(automaton: Automaton, start: int, goals: Iterable[int]) -> IntArray:
    """Indices, rising, of the trims reached from `start` that lead to one of `goals`."""
    classes, (sources, targets) = automaton.trim_classes, automaton.maneuver_classes.T
    nodes = np.zeros((2, int(classes.max()) + 1), dtype=np.bool_)
    nodes[0, classes[start]] = nodes[1, classes[np.fromiter(goals, np.int64)]] = True
    ahead, back = _reached(nodes[0], sources, targets), _reached(nodes[1], targets, sources)
    return np.flatnonzero((ahead & back)[classes])


@kept_by_first
def part_between(automaton: Automaton, start: int, goals: tuple[int, ...]) -> Automaton:
    """The trims of `trims_between` and the maneuvers among them; the same automaton if that is all.

    Start and goals stay, also where no maneuvers lead from one to the other.
    """
    kept = {start, *goals, *trims_between(automaton, start, goals).tolist()}
    return automaton if len(kept) == len(automaton) else _part(automaton, tuple(sorted(kept)))


@kept_by_first
def _part(automaton: Automaton, kept: tuple[int, ...]) -> Automaton:
    trims = tuple(automaton.trims[k] for k in kept)
    names = {trim.name for trim in trims}
    maneuvers = tuple(
        one for one in automaton.maneuvers if one.source in names and one.target in names
    )
    return Automaton(automaton.model, trims, maneuvers, name=automaton.name)


def _reached(found: NDArray[np.bool_], sources: IntArray, targets: IntArray) -> NDArray[np.bool_]:
    """All nodes that links lead to from those found, one link further each time."""
    while (fresh := targets[found[sources] & ~found[targets]]).size:
        found[fresh] = True
    return found


PARALLEL = 1e-9  # below this share of its size, a difference of twists or centers is none


@dataclass(frozen=True, slots=True, kw_only=True)
class AutomatonReport:
    """Findings of `validate`; names of trims, in the order of the automaton."""

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
    quick. Poses are said to be in reach if one component, a set of trims that can all reach each
    other, reaches them; that is all there is for a kinematic vehicle, which has one class.

    In SE(2), the trims and maneuvers of a component reach every pose if and only if one of the
    trims turns and there is no point, given in the frame of each trim, about which all of them
    turn or stand still and which every maneuver leaves where it is. *Only if*: without a turning
    trim the heading changes by steps, those of maneuvers, or not at all; with such a point, the
    vehicle stays on one circle. *If*: any word that leads back to its first trim can be continued
    by turning until its heading has changed by a whole fraction 2 pi / n of a full turn. It is
    then a rotation about some point, and n times the same is the identity; so every motion can be
    undone, and the motions from a trim back to itself form a group. It holds all rotations about
    the center of the turning trim, and, as the point is not left alone, those about some other
    center: together they make every translation.

    In SE(2) x R the same holds if moreover the trims can climb and sink, and their pairs (turn
    rate, climb rate) span the plane: then any word can be continued to no change of height *and*
    a fraction of a turn. Without it, height and heading stay coupled, or the height changes one
    way only, unless maneuvers do what trims cannot, which is not looked into.

    Source: Jurdjevic (1997), *Geometric Control Theory*, Ch. 3, for the last step.
    """
    components, dead_ends, unused = _reach(automaton)
    controllable, reason = _controllable(automaton, components)
    same: defaultdict[tuple[int, bytes], list[str]] = defaultdict(list)
    rows = automaton.body_velocities + 0.0  # -0.0 is 0.0
    for name, where, row in zip(automaton.trim_names, automaton.trim_classes, rows, strict=True):
        same[int(where), row.tobytes()].append(name)
    return AutomatonReport(
        components=components,
        dead_ends=dead_ends,
        unused=unused,
        duplicates=tuple(tuple(names) for names in same.values() if len(names) > 1),
        controllable=controllable,
        reason=reason,
    )


def _reach(
    automaton: Automaton,
) -> tuple[tuple[tuple[str, ...], ...], tuple[str, ...], tuple[str, ...]]:
    """Strongly connected components, dead ends, and trims that nothing joins to the others."""
    n_classes = int(automaton.trim_classes.max()) + 1
    if n_classes == 1:
        return (automaton.trim_names,), (), ()
    import networkx

    graph: networkx.DiGraph[int] = networkx.DiGraph()
    graph.add_nodes_from(range(n_classes))
    ends = set(map(tuple, automaton.maneuver_classes.tolist()))
    graph.add_edges_from((source, target) for source, target in ends if source != target)
    groups = [set(group) for group in networkx.strongly_connected_components(graph)]
    members = [_names_in(automaton, group) for group in groups]
    final = {c for group in groups if not set(networkx.node_boundary(graph, group)) for c in group}
    alone = {c for c in graph if graph.degree(c) == 0}
    return (
        tuple(sorted(members, key=len, reverse=True)),
        _names_in(automaton, (final - alone) if len(groups) > 1 else set()),
        _names_in(automaton, alone),
    )


def _names_in(automaton: Automaton, classes: set[int]) -> tuple[str, ...]:
    inside = np.isin(automaton.trim_classes, list(classes))
    return tuple(automaton.trim_names[k] for k in np.flatnonzero(inside))


def _controllable(
    automaton: Automaton, components: tuple[tuple[str, ...], ...]
) -> tuple[bool, str]:
    """Whether one component reaches every pose; else why the largest one does not."""
    reasons = []
    for names in components:
        inside = set(names)
        trims = np.array([automaton.index_of(name) for name in names])
        maneuvers = [m for m in automaton.maneuvers if m.source in inside and m.target in inside]
        reason = _what_is_missing(automaton, trims, maneuvers)
        if not reason:
            return True, ""
        reasons.append(reason)
    if len(components) == 1:
        return False, reasons[0]
    return False, f"no trims that reach each other reach every pose; {reasons[0]}"


def _what_is_missing(automaton: Automaton, trims: IntArray, maneuvers: Sequence[Maneuver]) -> str:
    """Why trims that reach each other do not reach every pose, "" if they do."""
    twists = automaton.body_velocities[trims]
    steps = np.array([maneuver.displacement for maneuver in maneuvers])
    steps = steps.reshape(-1, twists.shape[1])
    if not twists.any() and not steps.any():
        return "only rest: the vehicle never moves"
    if not twists[:, 2].any():
        if steps[:, 2].any():
            return "no trim turns: the heading changes in steps only, those of maneuvers"
        return "only straights: the heading never changes"
    if _has_one_center(automaton, trims, maneuvers):
        if not twists[:, :2].any() and not steps[:, :2].any():
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
    length = np.linalg.norm(twists[:, 2:], axis=1)
    unit = twists[length > 0.0, 2:] / length[length > 0.0, None]
    if np.count_nonzero(np.linalg.svd(unit, compute_uv=False) > PARALLEL) < 2:  # one direction
        return "turn rate and climb rate are proportional: height and heading stay coupled"
    return ""


def _has_one_center(automaton: Automaton, trims: IntArray, maneuvers: Sequence[Maneuver]) -> bool:
    """Whether all trims turn about, and all maneuvers keep, one and the same point."""
    classes = automaton.trim_classes
    twists = automaton.body_velocities[trims]
    turning = int(np.argmax(np.abs(twists[:, 2])))
    v_x, v_y, rate = twists[turning, :3]
    centers = {int(classes[trims[turning]]): np.array([-v_y, v_x]) / rate}
    lengths = [np.abs(maneuver.displacement[:2]).max() for maneuver in maneuvers]
    length = max(np.hypot(v_x, v_y) / abs(rate), *lengths, 0.0)
    left = [
        (
            int(classes[automaton.index_of(maneuver.source)]),
            int(classes[automaton.index_of(maneuver.target)]),
            SE2(maneuver.displacement[:3]),
        )
        for maneuver in maneuvers
    ]
    while ahead := [edge for edge in left if edge[0] in centers]:
        left = [edge for edge in left if edge[0] not in centers]
        for source, target, step in ahead:
            kept = step.inverse().act(centers[source])
            if np.abs(centers.setdefault(target, kept) - kept).max() > PARALLEL * length:
                return False
    known = np.array([centers[int(k)] for k in classes[trims]])
    slip_x = twists[:, 0] - twists[:, 2] * known[:, 1]
    slip_y = twists[:, 1] + twists[:, 2] * known[:, 0]
    pace = np.maximum(np.linalg.norm(twists[:, :2], axis=1), np.abs(twists[:, 2]) * length)
    return bool((np.hypot(slip_x, slip_y) <= PARALLEL * pace).all())
