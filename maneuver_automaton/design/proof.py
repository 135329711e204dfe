"""The factor of short words, proven on boxes of goals by Reeds-Shepp intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton.design.reeds_shepp import MOST_TRIMS, Family, families

AT_ONCE = 50_000  # boxes that are looked at in one go
FIRST = 0.5  # size of the first boxes, in turning radii and radians
HALVES = 8  # of a box
SEED = 0  # of the goals that are sampled


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WordsProof:
    """How much costlier short words are than the shortest paths, over a disc of goals.

    It concerns goals within `radius` of the start, at all headings, to which the shortest path is
    at least `least` long.
    """

    max_trims: int
    turning_radius: float  # [m]
    radius: float  # [m]
    least: float  # [m]
    factor: float  # no goal has a greater one: proven
    sampled: float  # some goal has it
    worst: Array  # (3,) this goal [m, m, rad]
    boxes: int  # that were looked at
    finished: bool  # whether the factor is as near to the sampled one as was asked for

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "worst", last=3)

    def factors(self, goals: Array) -> Array:
        """The factors (n,) at goals (n, 3); NaN where the shortest path is not long enough."""
        sizes = {"turning_radius": self.turning_radius, "least": self.least}
        return factors_at(goals, max_trims=self.max_trims, **sizes)


def word_lengths(goals: ArrayLike, *, radius: float, max_trims: int) -> Array:
    """Length (...,) of the shortest word of six trims to poses (..., 3) that is looked at [m].

    The six: straight, and full lock to either side, in both gears. Of words of three trims all are
    looked at, of longer ones the kinds that Reeds and Shepp name, for every length of their parts.

    Examples
    --------
    >>> sideways = [0.0, 1.0, 0.0]
    >>> [round(float(word_lengths(sideways, radius=1.0, max_trims=n)), 3) for n in (3, 4)]
    [3.647, 2.636]
    """
    poses = as_array("goals", goals, last=3)
    scaled = poses.reshape(-1, 3) / np.array([radius, radius, 1.0])
    short, _ = _least(families(scaled, scaled), max_trims)
    return np.asarray(radius * short).reshape(poses.shape[:-1])


def proven_factor(
    *,
    turning_radius: float,
    radius: float,
    max_trims: int,
    least: float,
    goals: Array,
    tolerance: float,
    most_boxes: int,
) -> WordsProof:
    """Factor of words of at most `max_trims` of the six Reeds-Shepp trims over the shortest paths.

    Boxes of goals are halved where their bound is above the greatest ratio met, by more than
    `tolerance`. Over a box the ratio is at most 1, or that of an upper bound of the short words to
    a lower bound of the paths with more trims: where short words are shortest, nothing is lost.
    Mirror images and reversed paths make a quarter of the goals enough.
    """
    scale = np.array([turning_radius, turning_radius, 1.0])
    reach, shortest = radius / turning_radius, least / turning_radius
    met: tuple[float, Array] = 1.0, np.array([min(reach, 1.0), 0.0, 0.0])  # greatest ratio, where
    met = _worst(goals / scale, met, max_trims, shortest, reach)
    proven, looked = 1.0, 0
    finished = max_trims >= MOST_TRIMS
    across, around = math.ceil(reach / FIRST), math.ceil(2.0 * math.pi / FIRST)
    size = np.array([reach / across, reach / across, 2.0 * math.pi / around])
    corners = np.array(list(product(range(across), range(across), range(around)))) * size
    corners = _inside(corners - np.array([0.0, 0.0, math.pi]), reach)  # a quarter of the goals
    while not finished:
        open_corners, open_ratios = [], []
        for low in np.array_split(corners, 1 + len(corners) // AT_ONCE):
            ratios = _box_ratios(low, size, max_trims, shortest)
            met = _worst(low + 0.5 * size, met, max_trims, shortest, reach)
            looked += len(low)
            is_open = ratios > met[0] + tolerance
            proven = max(proven, float(ratios[~is_open].max(initial=1.0)))
            open_corners.append(low[is_open])
            open_ratios.append(ratios[is_open])
        corners, ratios = np.concatenate(open_corners), np.concatenate(open_ratios)
        finished = not len(corners)
        if looked + HALVES * len(corners) > most_boxes:  # what is open counts as it was bounded
            proven = max(proven, float(ratios.max(initial=1.0)))
            break
        # The eight halves of every box.
        half = 0.5 * size
        steps = np.array(list(product((0.0, 1.0), repeat=3))) * half
        corners, size = _inside((corners[:, None] + steps).reshape(-1, 3), reach), half
    return WordsProof(
        max_trims=max_trims,
        turning_radius=turning_radius,
        radius=radius,
        least=least,
        factor=max(proven, met[0]),
        sampled=met[0],
        worst=met[1] * scale,
        boxes=looked,
        finished=finished,
    )


def factors_at(goals: Array, *, turning_radius: float, max_trims: int, least: float) -> Array:
    """Length (n,) of short words to goals (n, 3) over that of shortest paths, NaN below `least`."""
    scaled = goals / np.array([turning_radius, turning_radius, 1.0])
    short, long = _least(families(scaled, scaled), max_trims)
    shortest = np.minimum(short, long)
    counts = shortest >= least / turning_radius
    return np.where(counts, short / np.where(counts, shortest, 1.0), np.nan)


def _worst(
    goals: Array, met: tuple[float, Array], max_trims: int, least: float, reach: float
) -> tuple[float, Array]:
    """The greatest ratio met, and at which goal, or what is worse among goals (n, 3)."""
    ratios = factors_at(goals, turning_radius=1.0, max_trims=max_trims, least=least)
    counts = np.isfinite(ratios) & (np.hypot(goals[:, 0], goals[:, 1]) <= reach)
    ratios = np.where(counts, ratios, 1.0)
    k = int(ratios.argmax()) if len(ratios) else -1
    return (float(ratios[k]), goals[k]) if k >= 0 and ratios[k] > met[0] else met


def _box_ratios(low: Array, size: Array, max_trims: int, least: float) -> Array:
    """Upper bounds (n,) of the ratio over boxes from `low` (n, 3)."""
    short, long = _least(families(low, low + size), max_trims)
    # a goal counts if its shortest path is at least `least`, and where no path with more trims is
    # the shortest, a short word is: this line carries the proof
    ratios = short / np.maximum(long, least)
    return np.where(_near(low, low + size) < least, 1.0, np.maximum(ratios, 1.0))


def _near(low: Array, high: Array) -> Array:
    """A length (n,) that no shortest path to the goals of boxes (n, 3) exceeds."""
    away = np.maximum(np.abs(low), np.abs(high))
    left = np.hypot(away[:, 0], away[:, 1]) + 4.0 * np.sin(0.25 * away[:, 2]) ** 2
    turn = 2.0 * np.arcsin(0.5 * np.sqrt(np.minimum(left, 4.0)))
    length = away[:, 2] + left + 2.0 * turn + 2.0 * np.sin(turn)
    return np.where(left <= 1.0, length, np.inf)


def _least(kinds: Iterator[Family], max_trims: int) -> tuple[Array, Array]:
    """Upper bounds (n,) of the short words, and lower bounds (n,) of shortest paths with more."""
    short, long = np.array(np.inf), np.array(np.inf)
    for family in kinds:
        if family.trims <= max_trims:
            short = np.minimum(short, family.upper())
        else:
            long = np.minimum(long, family.lower())
    return short, np.broadcast_to(long, short.shape)


def _inside(corners: Array, reach: float) -> Array:
    """Boxes some goals of which are within the disc."""
    return corners[np.hypot(corners[:, 0], corners[:, 1]) <= reach]
