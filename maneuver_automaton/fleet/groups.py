"""The best plans of a few vehicles at once: over all their priorities, and conflict by conflict.

Both search a tree whose root is everybody's plan past the vehicles outside of the group. Where two
of the group meet, one child has the first of them give way, the other child the second.

Source: Ma, Harabor, Stuckey, Li, Koenig (2019), *Searching with Consistent Prioritization for
Multi-Agent Path Finding*, AAAI 33; Andreychuk, Yakovlev, Surynek, Atzmon, Stern (2022),
*Multi-agent pathfinding with continuous time*, Artificial Intelligence 305, here with bodies in
place of edges, so that what is left out of a child may hold a better plan: what comes out is the
best of these searches, not of all plans.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.fleet.conflicts import Course, Meeting, meetings
from maneuver_automaton.fleet.turns import Held, Turns
from maneuver_automaton.fleet.vehicle import LONG, Found

MOST_QUERIES = 30  # searches for one vehicle, of one tree
LOOKS = 400  # at a conflict, to see how long it lasts
WORTH = 1e-6  # share of the value that another leaf has to save


def by_priorities(turns: Turns, group: Sequence[int], held: Held, known: float) -> Held | None:
    """The cheapest plans of a group over who gives way to whom; None if none costs less than known.

    Depth first, the cheaper child first; what is not cheaper than the best leaf is left out. Who
    gives way does so to the whole plan of the other, and to those to whom that one gives way.
    """
    return _Priorities(turns, tuple(group), held, known).run()


@dataclass(slots=True, eq=False)
class _Priorities:
    turns: Turns
    group: tuple[int, ...]
    held: Held
    known: float
    best: Held | None = None
    asked: dict[tuple[int, tuple[int, ...]], Found | None] = field(default_factory=dict)
    kept: list[Found] = field(default_factory=list)  # as long as their ids are asked for

    def run(self) -> Held | None:
        plans: Held = {}
        for k in self.group:
            found = self._past(k, {})
            if found is None:
                return None
            plans[k] = found
        self._descend(plans, frozenset())
        return self.best

    def _descend(self, plans: Held, before: frozenset[tuple[int, int]]) -> None:
        if not _cost(plans) < self.known * (1.0 - WORTH):
            return
        met = _first_meeting(plans, self.turns.margin)
        if met is None:
            self.best, self.known = plans, _cost(plans)
            return
        children = []
        for first, second in ((met.one, met.other), (met.other, met.one)):
            pairs = _closed(before | {(first, second)})
            # Who gave way already and meets the other all the same has no way past it.
            if (first, second) in before or (second, first) in pairs:
                continue
            child = self._replanned(plans, second, pairs)
            if child is not None:
                children.append((_cost(child), child, pairs))
        for _, child, pairs in sorted(children, key=lambda row: row[0]):
            self._descend(child, pairs)

    def _replanned(self, plans: Held, first: int, pairs: frozenset[tuple[int, int]]) -> Held | None:
        """Plans in which one, and all behind it that meet those before them, give way."""
        plans = dict(plans)
        behind = {k for one, k in pairs if one == first}
        for k in _sorted_by(pairs, [first, *sorted(behind)]):
            above = {one: plans[one] for one, other in sorted(pairs) if other == k}
            if k != first and not _meet(plans, k, above, self.turns.margin):
                continue
            found = self._past(k, above)
            if found is None:
                return None
            plans[k] = found
        return plans

    def _past(self, k: int, above: Held) -> Found | None:
        key = k, tuple(sorted(id(one) for one in above.values()))
        if key not in self.asked:
            if len(self.asked) >= MOST_QUERIES or self.turns.budget.is_over:
                return None
            outside, past = self.turns.without_plan(self.held, set(self.group)), self.turns.past
            found = past(k, {**self.held, **above}, outside, again=True)
            if found is None:
                found = past(k, {**self.held, **above}, outside, most=LONG)
            self.asked[key] = found
            self.kept += [] if found is None else [found]
        return self.asked[key]


def _closed(pairs: frozenset[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """Who gives way to whom, and to whom those give way."""
    closed = set(pairs)
    while True:
        more = {(a, d) for a, b in closed for c, d in closed if b == c} - closed
        if not more:
            return frozenset(closed)
        closed |= more


def _sorted_by(pairs: frozenset[tuple[int, int]], numbers: Sequence[int]) -> list[int]:
    """Numbers, those before others first."""
    return sorted(numbers, key=lambda k: (sum(other == k for _, other in pairs), k))


def _cost(plans: Mapping[int, Found]) -> float:
    return math.fsum(one.cost for one in plans.values())


def _meet(plans: Held, k: int, others: Mapping[int, Found], margin: float) -> bool:
    courses = {k: plans[k].course} | {other: one.course for other, one in others.items()}
    return bool(meetings(courses, keep=margin, among=[k]))


def _first_meeting(plans: Held, margin: float) -> Meeting | None:
    found = meetings({k: one.course for k, one in plans.items()}, keep=margin)
    return found[0] if found else None


class _Node(NamedTuple):
    cost: float
    number: int  # of equal ones the first
    plans: Held
    avoided: dict[int, tuple[Obstacle, ...]]


def by_conflicts(turns: Turns, group: Sequence[int], held: Held, known: float) -> Held | None:
    """The cheapest plans of a group, conflict by conflict; None if none cost less than `known`.

    Best first. Whoever gives way keeps clear of the other's body as it is now, while the two are
    too near to each other, and is free before and after.
    """
    outside = turns.without_plan(held, set(group))
    queries, numbers = 0, itertools.count()

    def past(k: int, avoided: tuple[Obstacle, ...]) -> Found | None:
        nonlocal queries
        queries += 1
        return turns.past(k, held, outside, again=True, besides=avoided)

    root: Held = {}
    for k in group:
        found = past(k, ())
        if found is None:
            return None
        root[k] = found
    frontier = [_Node(_cost(root), next(numbers), root, {})]
    while frontier and queries < MOST_QUERIES and not turns.budget.is_over:
        node = heapq.heappop(frontier)
        if not node.cost < known * (1.0 - WORTH):
            return None
        met = _first_meeting(node.plans, turns.margin)
        if met is None:
            return node.plans
        for k, other in ((met.one, met.other), (met.other, met.one)):
            mine, its = node.plans[k].course, node.plans[other].course
            window = (met.time, _until(mine, its, met.time, turns.margin))
            more = _within(its.obstacles, window)
            avoided = {**node.avoided, k: (*node.avoided.get(k, ()), *more)}
            found = past(k, avoided[k])
            if found is not None:
                plans = {**node.plans, k: found}
                heapq.heappush(frontier, _Node(_cost(plans), next(numbers), plans, avoided))
    return None


def _within(bodies: Sequence[Obstacle], window: tuple[float, float]) -> list[Obstacle]:
    """Bodies that are there in a window of time [s], during that alone."""
    rows = []
    for one in bodies:
        first, last = max(one.presence[0], window[0]), min(one.presence[1], window[1])
        if first < last:
            rows.append(replace(one, present_s=(first, last)))
    return rows


def _until(one: Course, other: Course, begin: float, keep: float) -> float:
    """Until when two bodies are too near to each other [s], from a time on; inf if for ever."""
    last = max(one.quiet_after, other.quiet_after)
    times = np.linspace(begin, last, LOOKS) if last > begin else np.array([begin])
    near = np.zeros(times.size, dtype=np.bool_)
    for shapes, motion in zip(one.shapes, one.motions, strict=True):
        poses: Array = motion.at(times)
        frame = tuple(poses[0].tolist())
        world = world_of(other.bodies, shapes, frame, keep=keep)
        near |= clearances(world, world.into(poses), times=times) <= keep
    clear = np.flatnonzero(~near[1:])
    return float(times[clear[0] + 1]) if clear.size else math.inf
