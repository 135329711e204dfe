"""A covered field: all of it, by one plan that stays inside, in the cheapest order."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely

import maneuver_automaton as ma
from maneuver_automaton.collision.shapes import Polygon
from maneuver_automaton.field.covering import _swaths_along, cheapest_order
from tests.field.cases import BODY, CAR, FORWARDS, OBLONG, oblong, pond, tractor

BOTH = pytest.mark.parametrize("covered", [oblong, pond])


def swept(plan):
    """What the body sweeps, by shapely, from samples."""
    ring = shapely.Polygon(BODY.corners)
    return shapely.union_all(
        [shapely.transform(ring, ma.SE2(pose).act) for pose in plan.sample().pose]
    )


@pytest.mark.parametrize("covered", [oblong, pytest.param(pond, marks=pytest.mark.slow)])
def test_all_inside_the_headland_is_worked(covered):
    done = covered()
    field = done.problem
    strips = shapely.union_all(
        [shapely.LineString(one[:, :2]).buffer(field.width / 2, cap_style="flat")
         for one in done.swaths]
    )  # fmt: skip
    inner = field.whole.buffer(-field.headland, join_style="mitre")
    assert strips.intersection(inner).area >= 0.99 * inner.area
    assert done.covered == pytest.approx(strips.intersection(inner).area / inner.area)


@BOTH
def test_the_body_stays_in_the_field_and_drives_every_swath(covered):
    done = covered()
    plan = done.result.plan
    assert done.result.audit.passed
    assert field_of(done).contains(swept(plan))
    path = shapely.LineString(plan.sample().pose[:, :2])
    for begin, end in done.swaths:
        assert path.buffer(1e-6).contains(shapely.LineString([begin[:2], end[:2]]))
    np.testing.assert_allclose(plan.start, done.swaths[0, 0], atol=1e-12)
    np.testing.assert_allclose(plan.end[:2], done.swaths[-1, 1, :2], atol=1e-9)
    assert done.result.cost == pytest.approx(plan.duration)
    length = shapely.length(path)
    assert sum(done.lengths) == pytest.approx(length, rel=1e-4)


def field_of(done):
    return shapely.Polygon(done.problem.shape.corners, done.problem.shape.holes)


def test_an_oblong_has_as_many_swaths_as_widths_fit():
    done = oblong()  # 40 - 24 = 16 long, 34 - 24 = 10 wide
    assert len(done.swaths) == 4
    assert done.lengths[0] == pytest.approx(4 * 16.0)
    assert done.order_bound == done.turns_cost  # proven


def test_every_order_of_a_few_swaths_is_looked_at():
    rng = np.random.default_rng(7)
    for n in (2, 3, 4):
        costs = rng.uniform(1.0, 9.0, size=(2 * n, 2 * n))
        costs[rng.random(costs.shape) < 0.2] = np.inf
        costs[np.arange(2 * n)[:, None] // 2 == np.arange(2 * n) // 2] = np.inf
        orders = (
            [2 * i + d for i, d in zip(swaths, flips, strict=True)]
            for swaths in itertools.permutations(range(n))
            for flips in itertools.product((0, 1), repeat=n)
        )
        best = min(sum(costs[pair] for pair in itertools.pairwise(one)) for one in orders)
        order, bound = cheapest_order(costs)
        assert sum(costs[pair] for pair in itertools.pairwise(order)) == pytest.approx(best)
        assert bound == pytest.approx(best)


def test_many_swaths_are_near_a_bound_and_each_driven_once():
    """Twenty beside each other: up and down, each turn of the least cost."""
    n = 20
    side, place = np.arange(2 * n) % 2, np.arange(2 * n) // 2
    costs = 5.0 + np.abs(place[:, None] - place) + 100.0 * (side[:, None] == side)
    costs[place[:, None] == place] = np.inf
    order, bound = cheapest_order(costs)
    assert sorted(state // 2 for state in order) == list(range(n))
    found = sum(costs[pair] for pair in itertools.pairwise(order))
    assert found == bound == 6.0 * (n - 1)


@pytest.mark.parametrize("by", [[-5.0, 3.0, 2.5]])
def test_a_moved_field_has_the_moved_plan(by):
    here, by = oblong(), ma.SE2(by)
    there = ma.cover(here.problem.moved(by), time_limit=10.0)
    np.testing.assert_allclose(
        there.swaths[:, :, :2], by.act(here.swaths[:, :, :2].reshape(-1, 2)).reshape(-1, 2, 2),
        atol=1e-8,
    )  # fmt: skip
    moved = here.result.plan.moved(by)
    assert there.result.plan.word == moved.word
    np.testing.assert_allclose(there.result.plan.durations, moved.durations, atol=1e-7)


def test_swaths_keep_away_from_what_stands_in_the_field():
    tree = ma.Obstacle(ma.Disc(0.5, [20.0, 17.0]))
    problem = ma.FieldProblem(tractor().with_obstacles([tree]), OBLONG, width=3.0, headland=6.0)
    assert problem.inner.distance(shapely.Point(20.0, 17.0)) > 6.0


@pytest.mark.exhaustive
@pytest.mark.slow
def test_with_inertia_swaths_are_driven_at_speed():
    car = ma.SecondOrderCar(wheelbase=2.0, max_speed=2.0, max_acceleration=1.0, max_steering=0.6,
                            max_steering_rate=1.0)  # fmt: skip
    robot = ma.Automaton.of_model(car, {"speed": [0.0, 1.0], "steering": [-0.6, 0.0, 0.6]})
    planner = ma.Planner(robot, start_trim=robot.trims[robot.rest].name)
    field = ma.FieldProblem(planner, [[0, 0], [50, 0], [50, 36], [0, 36]], width=6.0, headland=12.0)
    done = ma.cover(field, time_limit=10.0)
    assert done.result.audit.passed, done.result.reason
    assert done.order_bound is None
    assert {trim.reduced_state[0] for trim in done.result.plan.trims} <= {0.0, 1.0}


@pytest.mark.parametrize("width", [3.0, 1e4])
def test_one_swath_takes_no_turn(width):
    strip = [[0, 0], [60, 0], [60, 27], [0, 27]]  # 3 m of it inside the headland
    done = ma.cover(ma.FieldProblem(tractor(), strip, width=width, headland=12.0))
    assert (len(done.swaths), done.turns, done.turns_cost, done.order_bound) == (1, (), 0.0, 0.0)
    assert done.covered == pytest.approx(1.0)
    assert done.result.audit.passed


@pytest.mark.parametrize(
    ("field", "how", "said"),
    [
        ([[0, 0], [20, 20], [20, 0], [0, 20]], {"width": 3.0},
         "field: self-intersection[10 10], need a simple polygon"),
        (OBLONG, {"width": 0.0}, "field: width must be at least 0.001 m, got 0.0"),
        (OBLONG, {"width": 3.0, "headland": -1.0},
         "field: headland must be at least 0 m, got -1.0"),
    ],
)  # fmt: skip
def test_bad_input_is_told(field, how, said):
    with pytest.raises(ValueError) as error:
        ma.FieldProblem(tractor(), field, **how)
    assert str(error.value) == said


def test_a_field_narrower_than_turns_says_what_is_missing():
    narrow = ma.FieldProblem(tractor(), [[0, 0], [60, 0], [60, 12], [0, 12]], width=3.0)
    with pytest.raises(ValueError) as error:
        ma.cover(narrow)
    assert str(error.value) == (
        "field: nothing is left of it inside a headland of 12 m: the largest circle in it has a "
        "radius of 6 m; need a wider field, or a smaller headland (the vehicle turns within 2.92 m)"
    )
    done = ma.cover(ma.FieldProblem(tractor(), narrow.shape, width=3.0, headland=2.0))
    assert done.result.plan is None
    assert done.result.reason.startswith("no turn was found from the end of a swath at (")


def test_vehicles_that_cannot_are_refused():
    spin = ma.Planner(ma.Automaton.of_controls(ma.Unicycle(), {"spin": (0.0, 1.0)}))
    with pytest.raises(ValueError, match="no trim leads straight ahead, need one for the swaths"):
        ma.FieldProblem(spin, OBLONG, width=3.0)
    tram = ma.Planner(ma.Automaton.of_controls(CAR, {"ahead": (2.0, 0.0)}))
    with pytest.raises(ValueError, match="no trim turns, need some for the turns between swaths"):
        ma.FieldProblem(tram, OBLONG, width=3.0)
    helicopter = ma.Planner(ma.load_stock_library("helicopter"))
    with pytest.raises(ValueError, match="flies or is bound to a lattice"):
        ma.FieldProblem(helicopter, OBLONG, width=3.0)
    moves = ma.Obstacle(ma.Disc(1.0), motion=ma.Motion([0.0, 1.0], [[0, 0, 0], [1, 0, 0]]))
    with pytest.raises(ValueError, match="an obstacle moves or is a map, need shapes that stand"):
        ma.FieldProblem(tractor().with_obstacles([moves]), OBLONG, width=3.0)
    assert isinstance(ma.FieldProblem(tractor(), OBLONG, width=3.0).shape, Polygon)
    assert ma.Automaton.of_controls(CAR, FORWARDS)


def test_as_many_swaths_as_fields2cover_counts():
    """The cell of its test of the objective NSwathModified, without headland."""
    cell = [[0, 0], [4, 0], [4, 5], [0, 4]]
    slots = [[[x, 0.1], [x, 3.0], [x + 0.1, 3.6], [x + 0.1, 0.1]] for x in (0.1, 2.1)]
    across, along = [], []
    for n in range(3):
        for angle, found in ((0.0, across), (np.pi / 2, along)):
            field = ma.FieldProblem(
                tractor(), ma.Polygon(cell, slots[:n]), width=0.1, headland=1e-9
            )
            found.append(len(_swaths_along(field, angle)))
    assert (across, along) == ([50, 85, 120], [40, 41, 42])
