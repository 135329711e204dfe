"""What kernels that improve words take: the word they work on, and what is asked."""

from __future__ import annotations

from typing import NamedTuple

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.words.library import Scratch


class Work(NamedTuple):
    """Arrays of one word that is being improved; an edge leads to each trim, -1 for a switch."""

    start: Array  # (4,)
    trims: IntArray  # (n,)
    durations: Array  # (n,) [s]
    edges: IntArray  # (n,)
    poses: Array  # (n, 4) where coasts begin
    times: Array  # (n + 1,) when they do
    ends: Array  # (n,) when they end
    new_trims: IntArray  # (n,) of the word that may take its place
    new_durations: Array  # (n,) [s]
    new_edges: IntArray  # (n,)
    middle_trims: IntArray  # (9,) of two connections, and the trim between them
    middle_durations: Array  # (9,) [s]
    one: Scratch  # candidates of the first connection
    two: Scratch  # and of the second
    at: Array  # (points, 5) poses and times
    owners: IntArray  # (points,) trims that are coasted there
    best: Array  # (points,) cost of the cheapest path to each
    spent: Array  # (points,) [s] its duration
    back: IntArray  # (points,) where its last connection begins, -1 along the word
    by_trims: IntArray  # (points, 4) of that connection
    by_durations: Array  # (points, 4) [s]
    legs: IntArray  # (points,) of the cheapest path, the last first


class ImproveTask(NamedTuple):
    """Limits and sizes, as the kernels see them."""

    tries: int  # candidates of a connection that are proven, at most
    clock: float  # [s] time of the world at the start
    most_time: float  # [s]
    stay_until: float  # [s] time of the world until which the goal is kept
    most_trims: int  # 0: no limit
    least_coast: float  # [s]
    given_ends: bool  # whether the word begins and ends in given trims
    per_metre: float  # least cost per metre, maneuvers included
    radius: float  # [m] length scale
    shortest_span: float  # [s]
    snap: float  # chance of an end to snap to a switch
    via: float  # share of attempts with a via-point
    spread: float  # [m]
    free_heading: bool
