"""Reeds-Shepp lengths over whole boxes of goals: below every path, and above the shortest.

A path of the classical kinds is fixed by two polar coordinates of the goal, so its parts are
monotone functions of a radius and an angle, and intervals of them are nearly as tight as can be.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array

QUARTER, HALF, FULL = 0.5 * np.pi, np.pi, 2.0 * np.pi  # turns
SLACK = 1e-12  # [rad] by which intervals are widened, for rounding
FORWARD, BACKWARD, EITHER = 1, -1, 0  # the sign that an angle has on a shortest path
MOST_TRIMS = 5  # of a shortest path

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class RealInterval:
    """Numbers between `low` and `high`, elementwise; operations enclose all results."""

    low: Array
    high: Array

    def __add__(self, other: RealInterval | float) -> RealInterval:
        if isinstance(other, RealInterval):
            return RealInterval(self.low + other.low, self.high + other.high)
        return RealInterval(self.low + other, self.high + other)

    def __neg__(self) -> RealInterval:
        return RealInterval(-self.high, -self.low)

    def __sub__(self, other: RealInterval | float) -> RealInterval:
        return self + (-other)

    @property
    def ends(self) -> tuple[Array, Array]:
        """Both ends."""
        return self.low, self.high

    def times(self, other: RealInterval) -> RealInterval:
        """Products."""
        products = np.stack([a * b for a in self.ends for b in other.ends])
        return RealInterval(products.min(axis=0), products.max(axis=0))

    def over(self, other: RealInterval) -> RealInterval:
        """Quotients; everything where the divisor may be zero."""
        apart = (other.low > 0.0) | (other.high < 0.0)
        divisor = [np.where(apart, end, 1.0) for end in other.ends]
        value = self.times(RealInterval(1.0 / divisor[1], 1.0 / divisor[0]))
        return RealInterval(
            np.where(apart, value.low, -np.inf), np.where(apart, value.high, np.inf)
        )

    def size(self) -> RealInterval:
        """Absolute values."""
        least = np.maximum(0.0, np.maximum(self.low, -self.high))
        return RealInterval(least, np.maximum(np.abs(self.low), np.abs(self.high)))

    def cos(self) -> RealInterval:
        """Cosines."""
        first, last = np.cos(self.low), np.cos(self.high)
        low = np.where(_holds(self, HALF), -1.0, np.minimum(first, last))
        return RealInterval(low, np.where(_holds(self, 0.0), 1.0, np.maximum(first, last)))

    def sin(self) -> RealInterval:
        """Sines."""
        return (self - QUARTER).cos()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Family:
    """Paths of one kind to the goals of boxes, on circles of radius 1.

    `angles` are turns that depend on the goal, each with the sign that it has on a shortest path;
    driven in the other gear it is as long, so for an upper bound the sign does not matter.
    """

    trims: int
    angles: tuple[tuple[RealInterval, int], ...]
    turn: RealInterval  # of which the angles are the sum or the difference, so not both smaller
    length: RealInterval  # of all else, at least zero
    somewhere: BoolArray  # whether shortest paths of the kind may exist for some goal of the box
    everywhere: BoolArray  # whether paths of the kind exist for all

    def lower(self) -> Array:
        """No shortest path of this kind to any goal of the box is shorter; inf if there is none."""
        angles = np.sum([_least(angle, sign) for angle, sign in self.angles], axis=0)
        turned = np.maximum(angles, _least(self.turn, EITHER))
        return np.where(self.somewhere, self.length.low + turned, np.inf)

    def upper(self) -> Array:
        """To every goal of the box a path of this kind is no longer; inf if not to every one."""
        angles = np.sum([_greatest(angle) for angle, _ in self.angles], axis=0)
        return np.where(self.everywhere, self.length.high + angles, np.inf)


def families(low: Array, high: Array) -> Iterator[Family]:
    """All 48 kinds of path to the goals of boxes from `low` (n, 3) to `high` (n, 3), radius 1.

    Source: Reeds, Shepp (1990), Sec. 8: eight forms, each also in reverse, mirrored, and, where it
    is not its own image, driven from the end to the start.
    """
    x, y, heading = (RealInterval(low[:, k], high[:, k]) for k in range(3))
    cos, sin = heading.cos(), heading.sin()
    from_end = (x.times(cos) + y.times(sin), x.times(sin) - y.times(cos), heading)
    for reverse in (False, True):
        for mirrored in (False, True):
            yield from _same(*_image(x, y, heading, reverse, mirrored))
            yield from _opposite(*_image(x, y, heading, reverse, mirrored))
            yield from _with_image(*_image(*from_end, reverse, mirrored))
            yield from _two_turns(*_image(x, y, heading, reverse, mirrored))
            yield from _two_turns(*_image(*from_end, reverse, mirrored))


def _image(
    x: RealInterval, y: RealInterval, heading: RealInterval, reverse: bool, mirrored: bool
) -> tuple[RealInterval, RealInterval, RealInterval]:
    """The goal of the path that is driven in the other gear, mirrored, or both."""
    turned = -heading if reverse != mirrored else heading
    return -x if reverse else x, -y if mirrored else y, turned


def _same(x: RealInterval, y: RealInterval, heading: RealInterval) -> Iterator[Family]:
    """Paths whose first and last circle are turned alike."""
    far, at = _polar(x - heading.sin(), y - 1.0 + heading.cos())
    yield Family(  # L S L (8.1)
        trims=3,
        angles=((at, FORWARD), (heading - at, FORWARD)),
        turn=heading,
        length=far,
        somewhere=far.high >= 0.0,
        everywhere=far.high >= 0.0,
    )
    # Where both circles nearly coincide the straight has any angle: of the two directions to drive
    # it, one leaves turns of half a turn together at most, or of the heading if that is more.
    turned = heading.size()
    yield Family(
        trims=3,
        angles=((turned, EITHER),),
        turn=heading,
        length=far + RealInterval(*(np.maximum(HALF - end, 0.0) for end in turned.ends[::-1])),
        somewhere=np.zeros(far.low.shape, dtype=np.bool_),
        everywhere=turned.high <= HALF + SLACK,
    )
    yield from _with_image(x, y, heading)
    last = (y - 1.0 + heading.cos()).over(heading.sin())
    first = x - heading.sin() - last.times(heading.cos())
    yield Family(  # S L S
        trims=3,
        angles=((heading, EITHER),),
        turn=heading,
        length=first.size() + last.size(),
        somewhere=np.zeros(far.low.shape, dtype=np.bool_),
        everywhere=np.isfinite(last.high),
    )


def _with_image(x: RealInterval, y: RealInterval, heading: RealInterval) -> Iterator[Family]:
    """Paths that are not their own image from the end."""
    sin, cos = heading.sin(), heading.cos()
    far, at = _polar(x - sin, y - 1.0 + cos)
    half = RealInterval(*(np.arcsin(np.minimum(end / 4.0, 1.0)) for end in far.ends))
    yield Family(  # L R L (8.3, 8.4)
        trims=3,
        angles=((at - half + HALF, FORWARD), (heading - at - half - HALF, EITHER)),
        turn=heading - half - half,
        length=half + half,
        somewhere=far.low <= 4.0,
        everywhere=far.high <= 4.0,
    )
    yield Family(  # the same by the other middle circle: never shortest, but of three trims
        trims=3,
        angles=((at + half, EITHER), (heading - at + half, EITHER)),
        turn=heading + half + half,
        length=half + half,
        somewhere=np.zeros(far.low.shape, dtype=np.bool_),
        everywhere=far.high <= 4.0,
    )
    straight = _tangent(far)
    bend = RealInterval(np.arctan2(straight.high, -2.0), np.arctan2(straight.low, -2.0))
    first = at + bend
    yield Family(  # L R(pi/2) S L (8.9)
        trims=4,
        angles=((first, FORWARD), (heading - QUARTER - first, BACKWARD)),
        turn=heading - QUARTER,
        length=(straight - 2.0).size() + QUARTER,
        somewhere=straight.high >= 2.0,
        everywhere=far.low >= 2.0,
    )
    far, at = _polar(x + sin, y - 1.0 - cos)
    first = at + QUARTER
    yield Family(  # L R(pi/2) S R (8.10)
        trims=4,
        angles=((first, FORWARD), (first + QUARTER - heading, BACKWARD)),
        turn=heading - QUARTER,
        length=(far - 2.0).size() + QUARTER,
        somewhere=far.high >= 2.0,
        everywhere=far.high >= 0.0,
    )


def _two_turns(x: RealInterval, y: RealInterval, heading: RealInterval) -> Iterator[Family]:
    """Paths of two turns and a straight, L R S: never shortest, but among those of three parts."""
    sin, cos = heading.sin(), heading.cos()
    along = x.times(cos) + y.times(sin) - sin
    aside = y.times(cos) - x.times(sin) - 1.0 - cos
    wide = aside.size()
    half = RealInterval(*(np.sqrt(np.maximum(4.0 - end**2, 0.0)) for end in wide.ends[::-1]))
    for last, ahead in ((along - half, half), (along + half, -half)):
        _, bend = _polar(ahead, aside)
        yield Family(
            trims=3,
            angles=((heading + bend + QUARTER, EITHER), (bend + QUARTER, EITHER)),
            turn=heading,
            length=last.size(),
            somewhere=np.zeros(wide.low.shape, dtype=np.bool_),
            everywhere=wide.high <= 2.0,
        )


def _opposite(x: RealInterval, y: RealInterval, heading: RealInterval) -> Iterator[Family]:
    """Paths whose first and last circle are turned against each other: their own images."""
    far, at = _polar(x + heading.sin(), y - 1.0 - heading.cos())
    straight = _tangent(far)
    first = at + RealInterval(np.arctan2(2.0, straight.high), np.arctan2(2.0, straight.low))
    yield Family(  # L S R (8.2)
        trims=3,
        angles=((first, FORWARD), (first - heading, FORWARD)),
        turn=heading,
        length=straight,
        somewhere=far.high >= 2.0,
        everywhere=far.low >= 2.0,
    )
    first = at + RealInterval(np.arctan2(straight.high, -2.0), np.arctan2(straight.low, -2.0))
    yield Family(  # L R(pi/2) S L(pi/2) R (8.11)
        trims=5,
        angles=((first, FORWARD), (first - heading, FORWARD)),
        turn=heading,
        length=(straight - 4.0).size() + HALF,
        somewhere=straight.high >= 4.0,
        everywhere=far.low >= 2.0,
    )
    middle = RealInterval(
        *(np.arccos(np.minimum((2.0 + end) / 4.0, 1.0)) for end in far.ends[::-1])
    )
    first = at + middle - 1.5 * np.pi
    yield Family(  # L R(u) L(u) R, the middle two in one gear (8.7)
        trims=4,
        angles=((first, FORWARD), (first - middle - middle - heading, BACKWARD)),
        turn=heading + middle + middle,
        length=middle + middle,
        somewhere=far.low <= 2.0,
        everywhere=far.high <= 2.0,
    )
    middle = RealInterval(
        *(np.arccos(np.clip(1.25 - end**2 / 16.0, -1.0, 1.0)) for end in far.ends)
    )
    # Angle of ``sin u + i (2 - cos u)``, which is least, pi / 3, at u = pi / 3.
    ends = [np.arctan2(2.0 - np.cos(u), np.sin(u)) for u in middle.ends]
    least = np.where((middle.low <= HALF / 3) & (middle.high >= HALF / 3), HALF / 3, np.inf)
    first = at - HALF - RealInterval(np.minimum(least, np.minimum(*ends)), np.maximum(*ends))
    yield Family(  # L R(u) L(u) R, the middle two in either gear (8.8); for u beyond pi/2 too
        trims=4,
        angles=((first, FORWARD), (first - heading, FORWARD)),
        turn=heading,
        length=middle + middle,
        somewhere=(far.high >= 2.0) & (far.low <= np.sqrt(20.0)),
        everywhere=(far.low >= 2.0) & (far.high <= 6.0),
    )


def _tangent(far: RealInterval) -> RealInterval:
    """Length of the inner tangent of two circles of radius 1, their centres apart by `far`."""
    return RealInterval(*(np.sqrt(np.maximum(end**2 - 4.0, 0.0)) for end in far.ends))


def _polar(x: RealInterval, y: RealInterval) -> tuple[RealInterval, RealInterval]:
    """Radius and angle of the points of rectangles; all angles where one holds the origin."""
    across, along_y = x.size(), y.size()
    far = RealInterval(np.hypot(across.low, along_y.low), np.hypot(across.high, along_y.high))
    middle = np.arctan2(0.5 * (y.low + y.high), 0.5 * (x.low + x.high))
    along, aside = np.cos(middle), np.sin(middle)
    corners = np.stack(
        [np.arctan2(v * along - u * aside, u * along + v * aside) for u in x.ends for v in y.ends]
    )
    around = far.low <= 0.0
    low = np.where(around, -HALF, middle + corners.min(axis=0))
    return far, RealInterval(low, np.where(around, HALF, middle + corners.max(axis=0)))


def _holds(angle: RealInterval, value: float) -> BoolArray:
    """Whether an interval holds `value`, modulo a full turn."""
    return np.asarray(
        np.floor((angle.high - value + SLACK) / FULL) >= np.ceil((angle.low - value - SLACK) / FULL)
    )


def _least(angle: RealInterval, sign: int) -> Array:
    """Least size of an angle of that sign, modulo a full turn and within half a turn."""
    if sign == EITHER:
        return np.minimum(_least(angle, FORWARD), _least(angle, BACKWARD))
    low = (angle if sign == FORWARD else -angle).low - SLACK
    past = low - FULL * np.floor(low / FULL)
    size = np.where(past <= HALF + 2.0 * SLACK, past, np.inf)
    return np.where(_holds(angle, 0.0), 0.0, size)


def _greatest(angle: RealInterval) -> Array:
    """Greatest size of an angle, driven in the gear in which it is shorter."""
    sizes = [np.abs(np.remainder(end + HALF, FULL) - HALF) for end in angle.ends]
    return np.where(_holds(angle, HALF), HALF, np.maximum(*sizes))
