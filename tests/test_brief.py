"""Every public value shows itself in at most ten lines, however much it holds."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton._brief import MOST_LINES, WIDTH, brief

ROOT = Path(__file__).parents[1]
ROBOT = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
CROWD = [ma.Obstacle(ma.Disc(0.1, [x, 3.0]), name=f"post {x}") for x in range(2, 300)]
PROBLEM = ma.Problem(ROBOT, [0, 0, 0], [1, 0, 0], obstacles=CROWD)


def values():
    yield ROBOT
    yield ma.load_scenario(ROOT / "scenarios/grid_1681.yaml")
    yield ma.load_scenario(ROOT / "scenarios/grid_1681.yaml").problem.automaton
    yield ma.load_stock_library("hovercraft")
    yield PROBLEM
    result = ma.plan(PROBLEM)
    yield from (result, result.plan, result.plan.as_arrays(), result.bound)
    yield ma.Planner(ROBOT, obstacles=CROWD)
    yield ma.RecedingHorizon(PROBLEM, step=0.5)
    yield ma.simulate(ma.Problem(ROBOT, [-1, 0, 0], [0, 0, 0]), step=0.1)
    yield ma.Polygon(np.random.default_rng(0).random((5000, 2)))
    yield ma.OccupancyMap(np.ones((900, 900), dtype=bool), resolution=0.1)
    yield ma.Motion(np.arange(999.0), np.zeros((999, 3)))
    yield ma.SE2(np.zeros((999, 3)))
    yield result.plan.sample()


def test_every_value_shows_itself_in_ten_lines():
    for value in values():
        lines = repr(value).splitlines()
        assert 1 <= len(lines) <= MOST_LINES
        assert max(map(len, lines)) <= WIDTH
        assert type(value).__name__ in lines[0]


def test_every_public_dataclass_with_arrays_or_tuples_is_brief():
    long = [
        name
        for name in ma.__all__
        if dataclasses.is_dataclass(one := getattr(ma, name))
        and one.__repr__ is not brief
        and any("Array" in str(f.type) or "tuple[" in str(f.type) for f in dataclasses.fields(one))
    ]
    assert long == ["Bounds"]  # three pairs of numbers


def test_what_is_not_at_its_default_is_shown():
    assert (
        repr(ma.Goal([5, 5, 0], tolerance_m=0.1)) == "Goal(pose=[5.0, 5.0, 0.0], tolerance_m=0.1)"
    )
    assert repr(ma.Obstacle(ma.Disc(1.0), name="post")) == (
        "Obstacle(shape=Disc(radius=1.0), name='post')"
    )
    assert repr(ROBOT) == ("Automaton(model=Unicycle(), trims=(<Trim 'ahead'>, <Trim 'spin'>))")
