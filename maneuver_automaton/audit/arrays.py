"""What the kernels of the audit take: outlines as edges, and boxes around those."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import by_value

BLOCK = 16  # edges in a box of several
SPARE = 1e-6  # [m] that nothing is left out for rounding
FIRST_WITHIN = 0.1  # of the body's size: how far around it edges are looked for first
FURTHER = 4.0  # times as far, if there is none

Points: TypeAlias = NDArray[np.complex128]
"""Points x + i y [m]; those of one call have shapes that broadcast."""


class Outline(NamedTuple):
    """Edges of rings; a disc is an edge without length that has a radius."""

    begins: Points  # (n,) [m], which are all corners
    ends: Points  # (n,) [m]
    radius: Array  # (n,) [m]
    solid: IntArray  # (n,) which solid each edge bounds, in order; holes bound theirs too

    def of(self, kept: NDArray[np.bool_] | IntArray) -> Outline:
        """Some of its edges, in order, their solids numbered anew."""
        solid = np.unique(self.solid[kept], return_inverse=True)[1]
        return Outline(self.begins[kept], self.ends[kept], self.radius[kept], solid)

    def at(self, rows: IntArray) -> Outline:
        """Some of its edges, in any order, each with the number of its solid."""
        return Outline(self.begins[rows], self.ends[rows], self.radius[rows], self.solid[rows])

    @property
    def firsts(self) -> IntArray:
        """Numbers of the first edges of the solids."""
        return np.flatnonzero(np.diff(self.solid, prepend=-1))

    def turns_about(self, points: Points) -> IntArray:
        """By how many turns each edge takes part in running around points (m,): (n, m)."""
        a, b = self.begins[:, None], self.ends[:, None]
        rises = (b.imag > points.imag).astype(np.int64) - (a.imag > points.imag)
        to = points - a
        turns = rises * (((b - a).conj() * to).imag * rises > 0.0)
        if self.radius.any():
            round_ = self.radius[:, None]
            turns += (round_ > 0.0) & (np.abs(to) <= round_)
        return turns

    def holds(self, points: Points) -> Any:
        """Whether points (m,) are in each solid (s, m): the rings run around them."""
        if not self.radius.size:
            return np.zeros((0, points.size), dtype=np.bool_)
        return np.asarray(np.add.reduceat(self.turns_about(points), self.firsts, axis=0) != 0)


class BodyOutline(NamedTuple):
    """The outline of a body, and how far it reaches."""

    edges: Outline
    firsts: Points  # (s,) a corner of each solid
    reach: Array  # (n,) [m] from the frame to each corner
    most_reach: float  # [m]
    radius: float  # [m] the greatest
    middle: complex  # of the box around the corners
    size: float  # [m] radius of a disc around the middle that holds the body


class EdgeBoxes(NamedTuple):
    """Boxes [low x, low y, high x, high y] around edges, neighbours beside each other."""

    number: IntArray  # (k,) of each edge
    boxes: Array  # (k, 4) [m]
    blocks: Array  # (b, 4) around `BLOCK` of them each


@by_value
class Spans(NamedTuple):
    """Stretches of time, in order, each within an element."""

    element: IntArray  # (m,)
    begin: Array  # (m,) share of the element
    end: Array  # (m,)

    def of(self, rows: Any) -> Spans:
        """Some of them, by number, slice or truth."""
        return Spans(self.element[rows], self.begin[rows], self.end[rows])


class Stated(NamedTuple):
    """Stretches in order; what the plan states of them is compared, and never driven from."""

    lengths: Array  # (n,) [s]
    controls: Array  # (n, n_u)
    states: Array  # (n, n_z) reduced states where they begin
    end_states: Array  # (n, n_z)
    ends: Array  # (n, dof) poses where they end
    twists: Array  # (n, dof) of trims; NaN along maneuvers
    pieces: IntArray  # (n,) number of the primitive


@by_value
class TimeElements(NamedTuple):
    """How stretches are cut: an element is a run of stretches, or a part of one."""

    first: IntArray  # (e,) stretch in which each begins
    share: Array  # (e,) of that stretch, that has passed then
    lengths: Array  # (e,) [s]
    runs: IntArray  # (e,) number of the run
    run: IntArray  # (n,) number of the run of each stretch


@by_value
class Ended(NamedTuple):
    """Where a drive is when stretches end, and how far off what is stated of it is."""

    time: Array  # (n,) [s]
    element: IntArray  # (n,)
    share: Array  # (n,) of the element; more than 1 by rounding alone
    poses: Array  # (n, dof)
    off: float  # [m, rad] at most, of poses and along elements
    turned: float  # [rad] the same, of the headings alone
