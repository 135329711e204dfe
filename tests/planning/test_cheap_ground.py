"""Corridors along the cheapest way of a point over priced ground."""

import math

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.planning.cheap_ground import with_cheapest_way_left
from maneuver_automaton.search.lattice_query import lattice_query
from tests.scenes import dubins


@pytest.mark.parametrize("wide", [1, 3])
def test_a_way_leads_along_a_valley_however_narrow(wide):
    x = np.linspace(0.0, 10.0, 2000)
    valley = np.column_stack([x, 3.0 * np.sin(2.0 * math.pi * x / 10.0)])
    column, row = np.floor((valley + np.array([3.0, 6.0])) / 0.1).astype(int).T
    prices = np.full((120, 160), 3.0)
    for i in range(wide):
        prices[row + i - wide // 2, column] = 0.0
    ground = ma.Ground.of_raster(prices, resolution=0.1, origin=[-3.0, -6.0, 0.0])
    problem = ma.Problem(
        dubins(0.6), [0, 0, 1], [10, 0, 1], footprint=ma.Disc(0.2), place_costs=ground
    )
    *_, last = with_cheapest_way_left(lattice_query(problem, [0]))
    walls = last.obstacles[-1]
    j, i = np.floor(ma.SE2(walls.origin).inverse().act(valley) / walls.resolution).astype(int).T
    assert not walls.blocked[i, j].any()
