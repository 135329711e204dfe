"""What kernels that improve words take: the word they work on, and what is asked."""

from typing import NamedTuple

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.search.arrays import LatticeArrays, Scene, WordLimits
from maneuver_automaton.words.library import Scratch


class WordSteps(NamedTuple):
    """Trims one after the other; an edge leads to each, -1 for a switch."""

    trims: IntArray  # (n,)
    durations: Array  # (n,) [s]
    edges: IntArray  # (n,)


class PointArrays(NamedTuple):
    """Points of a word, and the cheapest path to each, as in `_kernels_points`."""

    at: Array  # (points, 5) poses and times
    owners: IntArray  # (points,) trims that are coasted there
    best: Array  # (points,) cost of the cheapest path to each
    spent: Array  # (points,) [s] its duration
    back: IntArray  # (points,) where its last connection begins, -1 along the word
    by_trims: IntArray  # (points, 4) of that connection
    by_durations: Array  # (points, 4) [s]
    legs: IntArray  # (points,) of the cheapest path, the last first


class WordArrays(NamedTuple):
    """Arrays of one word that is being improved."""

    start: Array  # (4,)
    length: IntArray  # (1,) how many of its steps count
    now: WordSteps
    poses: Array  # (n, 4) where coasts begin
    times: Array  # (n + 1,) when they do
    ends: Array  # (n,) when they end
    new: WordSteps  # of the word that may take its place
    middle_trims: IntArray  # (9,) of two connections, and the trim between them
    middle_durations: Array  # (9,) [s]
    one: Scratch  # candidates of the first connection
    two: Scratch  # and of the second
    points: PointArrays


class ImproveTask(NamedTuple):
    """Limits and sizes, as the kernels see them."""

    tries: int  # candidates of a connection that are proven, at most
    limits: WordLimits
    given_ends: bool  # whether the word begins and ends in given trims
    per_metre: float  # least cost per metre, maneuvers included
    radius: float  # [m] length scale
    least_radius: float  # [m] of turns, for `least_cost`; 0 where any is left to maneuvers
    shortest_span: float  # [s]
    snap: float  # chance of an end to snap to a switch
    via: float  # share of attempts with a via-point
    spread: float  # [m]
    free_heading: bool


class Improving(NamedTuple):
    """One word, of which vehicle it is, among what, and what is asked of it."""

    word: WordArrays
    library: LatticeArrays
    task: ImproveTask
    scene: Scene
