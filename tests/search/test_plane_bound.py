"""The way round the obstacles is a bound: no way of the body's inscribed disc is shorter."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice import plane_bound
from maneuver_automaton.search.lattice_query import lattice_query
from tests import scenes
from tests.quickly import quick_are
from tests.reference_lattice import shortest_way
from tests.search.cases import compiled_only
from tests.solids import clearance_at

pytestmark = compiled_only


def bound_and_way(problem):
    """The bound, and the way of the inscribed disc: around polygons a little too large."""
    query = lattice_query(problem, tuple(range(len(problem.goals))))
    radius = query.world.body.inscribed
    wide = radius / math.cos(math.pi / 32)  # sides of the rounded corners touch the true arc
    solids = []
    for obstacle in problem.obstacles:
        shape = obstacle.shape
        if isinstance(shape, Disc):
            whole = shape.radius + radius
            solids.append(shapely.Point(shape.center).buffer(whole / math.cos(math.pi / 32)))
            continue
        polygon = shapely.Polygon(shape.corners, getattr(shape, "holes", ()))
        solids.append(polygon.buffer(wide, quad_segs=8) if radius else polygon)
    ways = [shortest_way(solids, problem.start[:2], goal.pose[:2]) for goal in problem.goals]
    return plane_bound(query), min(ways), query


def random_problem(seed):
    rng = np.random.default_rng(seed)
    body = [(Box([1.6, 0.9]),), (Disc(0.5),), ()][seed % 3]
    while True:
        obstacles = [
            Obstacle(Box(rng.uniform(0.5, 5.0, 2), rng.uniform(0.0, 14.0, 2), rng.uniform(0, 3)))
            if rng.random() < 0.7
            else Obstacle(Disc(float(rng.uniform(0.3, 1.5)), rng.uniform(0.0, 14.0, 2)))
            for _ in range(8)
        ]
        ends = [[*rng.uniform(0.0, 14.0, 2), 0.0] for _ in range(2)]
        problem = Problem(scenes.reeds_shepp(), *ends, obstacles=obstacles, footprint=body)
        if min(clearance_at(problem, end) for end in ends) > 0.1:
            return problem


@pytest.mark.parametrize("seed", quick_are([1, 4, 6], range(12)))
def test_the_bound_is_never_longer_than_the_shortest_way(seed):
    bound, way, query = bound_and_way(random_problem(seed))
    straight = float(np.hypot(*(query.goals[0] - query.start)[:2]))
    assert way >= straight - 1e-9 or math.isinf(way)
    assert bound <= way + 1e-9
