"""Problems of CL-CBS: a YAML file with agents, each with a start and a goal, and a map of discs.

The pose is that of the rear axle. The file counts yaw clockwise: the planner moves by
(cos(-yaw), sin(-yaw)), so the heading is -yaw. The pose stays within `map.dimensions`, from 0; the
body may stick out. Every obstacle is a disc of one radius; [-1, -1] stands for none. Which vehicle
drives is not in the file but in the planner's own `config.yaml`.

Source: Wen, Liu, Li (2022), *CL-MAPF: Multi-Agent Path Finding for Car-Like robots with kinematic
and spatiotemporal constraints*, arXiv 2011.00441, and the files of its benchmark.
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
    numbers_at,
    positive_at,
    shown,
    value_at,
)
from maneuver_automaton.problem import Bounds

FORMAT = "CL-CBS"
RADIUS = 0.8  # [m] of an obstacle
NO_OBSTACLE = (-1.0, -1.0)


def read_cl_cbs(path: Path, document: Document) -> tuple[Statement, ...]:
    """The fleet of a file."""
    agents = value_at(document, ("agents",), list, "a list of agents")
    if not agents:
        raise document.error(("agents",), "got no agent, need at least one")
    names: dict[str, int] = {}
    for k in range(len(agents)):
        name = value_at(document, ("agents", k, "name"), str, "a name")
        if name in names:
            raise document.error(
                ("agents", k, "name"),
                f"got {shown(name)}, the name of agents[{names[name]}] too, need another one",
            )
        names[name] = k
    numbers_at(document, ("map", "dimensions"), 2, "[width, height]")
    width, height = (positive_at(document, ("map", "dimensions", k)) for k in range(2))
    world = Statement(
        format=FORMAT,
        name=path.stem,
        obstacles=_obstacles(document),
        bounds=Bounds(x=(0.0, width), y=(0.0, height)),
    )
    fleet = (
        replace(
            world,
            name=name,
            start=_pose(document, ("agents", k, "start")),
            goal=_pose(document, ("agents", k, "goal")),
        )
        for name, k in names.items()
    )
    return (replace(world, fleet=tuple(fleet)),)


def _obstacles(document: Document) -> tuple[Obstacle, ...]:
    where: Where = ("map", "obstacles")
    rows = value_at(document, where, list, "a list of [x, y]")
    centers = [numbers_at(document, (*where, k), 2, "[x, y]") for k in range(len(rows))]
    return tuple(
        Obstacle(Disc(RADIUS, center), name=f"obstacle {k + 1}")
        for k, center in enumerate(centers)
        if center != NO_OBSTACLE
    )


def _pose(document: Document, where: Where) -> Array:
    x, y, yaw = numbers_at(document, where, 3, "[x, y, yaw]")
    if abs(yaw) > MOST_HEADING:
        raise document.error((*where, 2), f"got the yaw {yaw:g}, need at most {MOST_HEADING:g} rad")
    return np.array([x, y, 0.0 - yaw])
