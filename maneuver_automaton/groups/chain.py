"""Poses along a chain of motions."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups.se2 import _turned

FEW = 20  # trims, up to which plain numbers are quicker than arrays


def chained(start: Array, steps: Array) -> Array:
    """Poses (n + 1, dof) from `start` (dof,) on, each one of `steps` (n, dof) after the last.

    The products ``start @ steps[0] @ ... @ steps[k - 1]``, all at once.
    """
    poses = np.empty((len(steps) + 1, start.size))
    poses[0] = start
    poses[1:] = steps
    np.cumsum(poses[:, 2:], axis=0, out=poses[:, 2:])
    poses[1:, :2] = _turned(poses[:-1, 2], steps[:, :2])
    np.cumsum(poses[:, :2], axis=0, out=poses[:, :2])
    return poses


def coasted(start: Array, twists: Array, durations: Array) -> Array:
    """Poses (n + 1, dof) from `start` (dof,) on, after each of n trims; the heading is the third.

    To the last bit ``chained(start, exp(durations * twists))``: on plain numbers for a word of a
    few trims, which takes a tenth of the time that arrays take.
    """
    if len(durations) > FEW:
        return chained(start, displacements(twists, durations))
    pose: list[float] = start.tolist()
    poses = [pose]
    for twist, duration in zip(twists.tolist(), durations.tolist(), strict=True):
        pose = _after(pose, twist, duration)
        poses.append(pose)
    return np.array(poses)


def displacements(twists: Array, durations: Array) -> Array:
    """Displacements (n, dof) of trims, ``exp(durations * twists)`` to the last bit."""
    steps = durations[:, None] * twists
    turn = np.pi * (steps[:, 2] / np.pi)
    half = np.pi * (steps[:, 2] / (2 * np.pi))
    straight = turn == 0.0
    turn[straight] = half[straight] = 1.0
    ahead, aside = np.sin(turn) / turn, np.sin(steps[:, 2] / 2) * (np.sin(half) / half)
    ahead[straight] = 1.0
    x, y = ahead * steps[:, 0] - aside * steps[:, 1], aside * steps[:, 0] + ahead * steps[:, 1]
    steps[:, 0], steps[:, 1] = x, y
    return steps


def after(poses: Array, steps: Array) -> Array:
    """Poses (n, dof) after steps (n, dof), each in the frame of one of `poses` (n, dof)."""
    found = poses + steps
    found[:, :2] = poses[:, :2] + _turned(poses[:, 2], steps[:, :2])
    return found


def end_of_coasting(start: Array, twists: Iterable[Array], durations: Iterable[float]) -> Array:
    """Pose (dof,) from `start` (dof,) after all trims: the last one of `coasted`."""
    pose: list[float] = start.tolist()
    for twist, duration in zip(twists, durations, strict=False):
        pose = _after(pose, twist.tolist(), duration)
    return np.array(pose)


def seen_from(start: Array, pose: Array) -> Array:
    """A pose (dof,) seen from another: places are subtracted first, so that no digit is lost.

    To the last bit ``start.inverse() @ pose`` of poses that are moved to where `start` is 0.
    """
    here, there = start.tolist(), pose.tolist()
    x, y = there[0] - here[0], there[1] - here[1]
    c, s = math.cos(-here[2]), math.sin(-here[2])
    planar = [c * x - s * y, s * x + c * y, there[2] - here[2]]
    return np.array(planar if len(here) == 3 else [*planar, there[3] - here[3]])


def _after(pose: list[float], twist: list[float], duration: float) -> list[float]:
    """Pose after a trim; the formula of `SE2.exp`, in the same order of operations."""
    x, y, turn = duration * twist[0], duration * twist[1], duration * twist[2]
    if turn:
        ahead, aside = _sinc(turn / math.pi), math.sin(turn / 2) * _sinc(turn / (2 * math.pi))
        x, y = ahead * x - aside * y, aside * x + ahead * y
    c, s = math.cos(pose[2]), math.sin(pose[2])
    planar = [pose[0] + (c * x - s * y), pose[1] + (s * x + c * y), pose[2] + turn]
    return planar if len(pose) == 3 else [*planar, pose[3] + duration * twist[3]]


def _sinc(share: float) -> float:
    """What `np.sinc` comes to, of a share that is not zero."""
    angle = math.pi * share
    return math.sin(angle) / angle if angle else 1.0
