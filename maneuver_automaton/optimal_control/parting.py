"""Which pairs of body and obstacles are parted near a motion, by which lines, at which corners."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.optimal_control.polish_program import Program
from maneuver_automaton.optimal_control.polish_values import Point
from maneuver_automaton.optimal_control.separation import (
    TURNED,
    Facing,
    Lines,
    Pairs,
    Reach,
    Solid,
    facing,
    first_lines,
    near_pairs,
    reaches,
    shared_lines,
)

SWING = 1.1  # of what corners swing out between nodes is kept as a margin
STANDS_OUT = 1e-6  # [m] before the piece that a line belongs to


class Parting(NamedTuple):
    """Pairs, and the lines that part them at a margin: one for each, those of an owner alike."""

    pairs: Pairs  # (n,)
    owner: IntArray  # (n,) the pair whose line it is
    lines: Lines  # (n,)
    margins: Array  # (n,) [m] kept at the nodes
    facing: Facing  # of n: corners that the program looks at

    @property
    def own(self) -> IntArray:
        """The pairs (m,) that have lines of their own."""
        return np.flatnonzero(self.owner == np.arange(len(self.owner)))

    def lacks(self, pairs: Pairs) -> bool:
        """Whether some pairs are not among these."""
        return len(self.pairs.extended(pairs).interval) > len(self.owner)

    def depth(self, program: Program, point: Point) -> float:
        """How deep the body is inside obstacles [m]."""
        reach = self._reach(program, point)
        return float((reach.between - reach.piece).max(initial=0.0))

    def is_kept(self, program: Program, point: Point) -> bool:
        """Whether every path keeps half of the margin to its piece."""
        reach = self._reach(program, point)
        return bool((reach.between - reach.piece <= -0.5 * program.settings.clearance).all())

    def with_margins(self, program: Program, point: Point, *, fixed: bool) -> Parting:
        """With room for what corners swing out between nodes; `fixed` lines touch the pieces."""
        reach, lines = self._reach(program, point), self.lines
        if fixed:
            nearest = np.full(len(self.owner), np.inf)
            np.minimum.at(nearest, self.owner, reach.piece)
            lines = lines.shifted(nearest[self.owner])
        swing = program.settings.clearance + SWING * (reach.between - reach.nodes)
        return self._replace(lines=lines, margins=np.maximum(self.margins, swing))

    def moved(self, angle: Array, offset: Array) -> Parting:
        """With its own lines at other angles, and moved along their normals by offsets."""
        slot = np.cumsum(self.owner == np.arange(len(self.owner))) - 1
        mine = slot[self.owner]
        lines = Lines(angle[mine], self.lines.anchor).shifted(offset[mine])
        return self._replace(lines=lines)

    def joined(self, program: Program, point: Point, others: Pairs) -> Parting:
        """With the pairs that were not among them, parted by lines of their own."""
        pairs = self.pairs.extended(others)
        count = len(self.owner)
        if len(pairs.interval) == count:
            return self
        new = parted(program, point, Pairs(*(column[count:] for column in pairs)))
        both = self._replace(
            pairs=pairs,
            owner=np.concatenate([self.owner, new.owner + count]),
            lines=self.lines.extended(new.lines),
            margins=np.concatenate([self.margins, new.margins]),
        )
        return both._refaced(program, point)

    def split(self, program: Program, point: Point, tight: float) -> Parting:
        """With lines of their own for pieces that hold back the line of another, `tight` [m]."""
        reach = self._reach(program, point)
        before = reach.piece < reach.piece[self.owner] - STANDS_OUT
        which = np.flatnonzero(before & (reach.piece - reach.between < tight))
        if not len(which):
            return self
        own = _first(program, point, Pairs(*(column[which] for column in self.pairs)))
        lines = Lines(self.lines.angle.copy(), self.lines.anchor.copy())
        lines.angle[which], lines.anchor[which] = own
        owner = self.owner.copy()
        owner[which] = which
        return self._replace(owner=owner, lines=lines)._refaced(program, point)

    def faced(self, program: Program, point: Point) -> Parting:
        """With the corners too that are foremost now, if some are not looked at."""
        now = self._facing(program, point, np.zeros(1))
        return self if self.facing.holds(now) else self._refaced(program, point)

    def _refaced(self, program: Program, point: Point) -> Parting:
        now = self._facing(program, point, TURNED)
        return self._replace(facing=now.joined(self.facing))

    def _facing(self, program: Program, point: Point, turned: Array) -> Facing:
        points, both = program.points(point), _both(program, point)
        return facing(points, both, self.pairs, self.lines, self.owner, turned=turned)

    def _reach(self, program: Program, point: Point) -> Reach:
        return reaches(program.points(point), _both(program, point), self.pairs, self.lines)


def parted(program: Program, point: Point, pairs: Pairs) -> Parting:
    """Pairs with first lines at a point, of which pieces behind one another share one."""
    lines = _first(program, point, pairs)
    points, both = program.points(point), _both(program, point)
    reach = reaches(points, both, pairs, lines)
    owner = shared_lines(both[1], pairs, lines, reach)
    lines = lines.of(owner)
    faces = facing(points, both, pairs, lines, owner, turned=TURNED)
    return Parting(pairs, owner, lines, np.zeros(len(owner)), faces)


def _first(program: Program, point: Point, pairs: Pairs) -> Lines:
    return first_lines(program.points(point), *_both(program, point), pairs)


def _both(program: Program, point: Point) -> tuple[list[Solid], list[Solid]]:
    """Solids of the body, and of the obstacles while the motion of a point is driven."""
    return program.scene.body, program.pieces(point).solids


def held_near(program: Program, point: Point, within: float) -> list[IntArray]:
    """For each guard of the scene the intervals (k,) in which the body comes nearer than so [m]."""
    found = []
    for guard in program.scene.guards:
        if guard.solids is None:
            found.append(np.arange(program.n_intervals))
            continue
        among = replace(program.scene, pieces=guard.solids, movers=())
        found.append(np.unique(pairs_near(program._replace(scene=among), point, within).interval))
    return found


def pairs_near(program: Program, point: Point, within: float) -> Pairs:
    """Pairs nearer than `within` [m] at a point; see `near_pairs`."""
    scene, pieces = program.scene, program.pieces(point)
    if not (pieces.solids and scene.parts):
        empty = np.zeros(0, dtype=np.int64)
        return Pairs(empty, empty, empty)
    during = pieces.interval if pieces.move else None
    return near_pairs(
        program.points(point), scene.body, pieces.solids, within=within, during=during
    )
