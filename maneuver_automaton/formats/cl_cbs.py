"""Problems of CL-CBS and CSDO: a YAML file with agents, each with a start and a goal, and discs.

The pose is that of the rear axle. It stays within `map.dimensions`, from 0; the body may stick out.
Which vehicle drives is not in the file but in the planner's own `config.yaml`, the same in both.

CL-CBS counts yaw clockwise: it moves by (cos(-yaw), sin(-yaw)), so the heading is -yaw. Its
obstacles `[x, y]` are discs of one radius; [-1, -1] stands for none. CSDO moves by (cos(yaw),
sin(yaw)), and writes `[x, y, r]`, or `obstacles:` with nothing after it. A file with a radius, or
with nothing there, is CSDO's.

Source: Wen, Liu, Li (2022), *CL-MAPF: Multi-Agent Path Finding for Car-Like robots with kinematic
and spatiotemporal constraints*, arXiv 2011.00441; Yang et al. (2024), *CSDO: Enhancing Efficiency
and Success in Large-Scale Multi-Vehicle Trajectory Planning*, arXiv 2405.20858; and the files of
their benchmarks.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._limits import MOST_HEADING
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.formats.statement import Statement
from maneuver_automaton.formats.yaml_source import (
    Document,
    Where,
    check_names,
    numbers_at,
    positive_at,
    value_at,
)
from maneuver_automaton.problem import Bounds

FORMAT = "CL-CBS"
RADIUS = 0.8  # [m] of an obstacle that states none
ROWS = "[x, y] or [x, y, r]"
NO_OBSTACLE = (-1.0, -1.0)


def read_cl_cbs(path: Path, document: Document) -> tuple[Statement, ...]:
    """The fleet of a file."""
    agents = value_at(document, ("agents",), list, "a list of agents")
    if not agents:
        raise document.error(("agents",), "got no agent, need at least one")
    names = [value_at(document, ("agents", k, "name"), str, "a name") for k in range(len(agents))]
    check_names(document, "agents", names)
    numbers_at(document, ("map", "dimensions"), 2, "[width, height]")
    width, height = (positive_at(document, ("map", "dimensions", k)) for k in range(2))
    obstacles, sense = _obstacles(document)
    world = Statement(
        format=FORMAT,
        name=path.stem,
        obstacles=obstacles,
        bounds=Bounds(x=(0.0, width), y=(0.0, height)),
    )
    fleet = (
        replace(
            world,
            name=name,
            start=_pose(document, ("agents", k, "start"), sense),
            goal=_pose(document, ("agents", k, "goal"), sense),
        )
        for k, name in enumerate(names)
    )
    return (replace(world, fleet=tuple(fleet)),)


def _obstacles(document: Document) -> tuple[tuple[Obstacle, ...], float]:
    """The obstacles, and in which sense yaw counts: 1 counter-clockwise, -1 clockwise."""
    where: Where = ("map", "obstacles")
    rows = value_at(document, where, list | None, f"a list of {ROWS}")
    discs: list[tuple[float, ...]] = []
    for k in range(len(rows or ())):
        row = (*where, k)
        n = len(value_at(document, row, list, ROWS))
        if n not in (2, 3):
            raise document.error(row, f"got {n} numbers, need {ROWS}")
        discs.append(numbers_at(document, row, n, ROWS))
        if n == 3:
            positive_at(document, (*row, 2))
    obstacles = tuple(
        Obstacle(Disc(radius[0] if radius else RADIUS, (x, y)), name=f"obstacle {k + 1}")
        for k, (x, y, *radius) in enumerate(discs)
        if radius or (x, y) != NO_OBSTACLE
    )
    return obstacles, 1.0 if rows is None or any(len(disc) == 3 for disc in discs) else -1.0


def _pose(document: Document, where: Where, sense: float) -> Array:
    x, y, yaw = numbers_at(document, where, 3, "[x, y, yaw]")
    if abs(yaw) > MOST_HEADING:
        raise document.error((*where, 2), f"got the yaw {yaw:g}, need at most {MOST_HEADING:g} rad")
    return np.array([x, y, 0.0 + sense * yaw])
