"""Paths round the other sides of obstacles: a stone is laid on each path that is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.problem import Problem

STONES = (  # where stones are laid and their radii, in shares of the path
    (0.5, 0.12),  # so wide that the other side of an obstacle is the shorter path
    (0.5, 0.02),  # so small that it closes a narrow passage alone
    (0.3, 0.08),
    (0.7, 0.08),
)


def with_stones(problem: Problem, known: Plan) -> Iterator[Problem]:
    """Problems with one more obstacle each, which closes the path of a known plan.

    Problems whose start or goal the stone touches are left out.
    """
    times = np.linspace(0.0, known.duration, 101)
    poses = known.pose_at(times)
    driven = np.append(0.0, np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T)))
    if not driven[-1] > 0.0:
        return
    for share, radius in STONES:
        place = poses[int(np.searchsorted(driven, share * driven[-1]))]
        disc = Obstacle(Disc(radius * float(driven[-1]), place[:2].tolist()), name="stone")
        closed = replace(problem, obstacles=(*problem.obstacles, disc))
        if blocked_ends(closed) is None:
            yield closed
