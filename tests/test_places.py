"""What places cost: rates, prices along motions, and what moves with the problem."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import shapely

from maneuver_automaton import (
    SE2,
    Automaton,
    Box,
    Car,
    Clearance,
    Cost,
    Disc,
    Ground,
    Obstacle,
    OccupancyMap,
    Plan,
    Planner,
    Polygon,
    Problem,
    SearchSettings,
    plan,
    verify,
)
from maneuver_automaton.formats.plan_json import plan_to_dict
from maneuver_automaton.places import gradient_of

CONTROLS = {f"{v:+d} {s:+.1f}": (v, s) for v in (1, -1) for s in (-0.5, 0.0, 0.5)}
CAR = Automaton.of_controls(Car(wheelbase=2.5, max_steering=0.5), CONTROLS)
BODY = Box([4.0, 2.0], [1.25, 0.0])
WALLS = (
    Obstacle(Box([30.0, 1.0], [8.0, 2.5])),
    Obstacle(Disc(0.7, [9.0, -2.5])),
    Obstacle(Polygon([[14, -1.5], [16, -4], [12, -4]])),
)
LAWN = Polygon([[2.0, -3.0], [7.5, -3.0], [6.0, 3.0], [3.0, 3.0]])


@dataclass(frozen=True)
class Crosswind:
    """A user's own: dearer to the north, by time."""

    per: str = "second"

    def rates(self, poses, velocities):
        """Rises with y."""
        return np.exp(0.3 * poses[..., 1])


def problem(*places, **more):
    """From left to right between walls."""
    start, goal = more.pop("start", [0, 0, 0]), more.pop("goal", [18, 0.5, 0.0])
    given = {"obstacles": WALLS, "footprint": BODY, "cost": Cost(length=1.0)} | more
    return Problem(CAR, start, goal, place_costs=places, **given)


def along(one, rate, many=8000):
    """The integral over time of a rate at poses and a velocity, trim by trim, at many midpoints."""
    total = 0.0
    for begin, trim, lasting in zip(
        one.switching_poses[:-1], one.trims, one.durations, strict=True
    ):
        times = (np.arange(many) + 0.5) * lasting / many
        poses = (SE2(begin) @ SE2.exp(times[:, None] * trim.body_velocity)).pose
        total += float(np.mean(rate(poses, trim.body_velocity))) * lasting
    return total


def curved():
    """A plan with bends near to the walls and over the lawn."""
    trims = [CAR["+1 +0.0"], CAR["+1 +0.5"], CAR["+1 -0.5"], CAR["+1 +0.0"], CAR["-1 -0.5"]]
    return Plan([0.0, -0.3, 0.0], trims, durations=[4.0, 1.1, 1.1, 7.0, 1.5])


def test_a_clearance_is_what_shapely_measures():
    cost, one = Clearance(weight=3.0, within=1.5), curved()
    solids = shapely.union_all(
        [
            shapely.box(-7, 2, 23, 3),
            shapely.Point(9, -2.5).buffer(0.7, quad_segs=2000),
            shapely.Polygon([[14, -1.5], [16, -4], [12, -4]]),
        ]
    )

    def rate(poses, velocity):
        bodies = shapely.polygons(SE2(poses[:, None]).act(BODY.corners))
        near = np.maximum(0.0, 1.0 - shapely.distance(bodies, solids) / 1.5)
        return 3.0 * near**2 * np.hypot(*velocity[:2])

    found = problem(cost).place_prices_of(one)[0]
    whole = problem(cost).cost_of(one)
    assert found.price == pytest.approx(along(one, rate, 500), abs=1e-3 * whole)
    assert found.price > 1.0
    assert found.error <= 1e-3 * whole
    assert whole == pytest.approx(problem().cost_of(one) + found.price)
    assert problem(cost).cost_of(Plan([0, 0, 0], (), durations=[])) == 0.0


def test_ground_costs_the_way_on_it():
    one, lawn = curved(), shapely.Polygon(LAWN.corners)
    line = shapely.LineString(one.sample(max_step_m=1e-3).pose[:, :2])
    on = shapely.length(shapely.intersection(line, lawn))
    here = problem(Ground(LAWN, price=5.0))
    assert here.place_prices_of(one)[0].price == pytest.approx(
        5.0 * on, abs=1e-3 * here.cost_of(one)
    )
    by_time = problem(Ground(LAWN, 5.0, per="second"))
    assert by_time.cost_of(one) == pytest.approx(here.cost_of(one), rel=1e-3)  # at 1 m/s
    at_once = plan(replace(by_time, start=[4.0, 0.0, 0.0], goals=[4.0, 0.0, 0.0]), time_limit=60.0)
    assert (at_once.cost, at_once.audit.place_price) == (0.0, 0.0)


@pytest.mark.parametrize("x", [5.0, 9.1])
def test_the_corner_of_an_area_counts_however_small(x):
    straight = Plan([0, 0, 0], [CAR["+1 +0.0"]], durations=[18.0])
    corner = Polygon([[x, 0.02], [x + 3.0, -2.98], [x - 3.0, -2.98]])  # 4 cm of it are driven on
    here = problem(Ground(corner, price=20.0), goal=[18, 0, 0], obstacles=())
    assert here.place_prices_of(straight)[0].price == pytest.approx(0.8, abs=5e-3)
    assert verify(here, straight).audit.place_price == pytest.approx(0.8, abs=5e-3)


@pytest.mark.parametrize("kind", ["corners", "boxes", "discs", "rasters"])
def test_no_piece_over_an_edge_is_missed(kind):
    rng = np.random.default_rng(7)
    for _ in range(12):
        trims = [CAR[name] for name in rng.choice(list(CONTROLS), 3)]
        one = Plan(rng.uniform(-1, 1, 3), trims, durations=rng.uniform(0.3, 3.0, 3))
        # From the left of some pose, an area reaches over the way by 0.1 to 50 mm.
        here = SE2(one.pose_at(rng.uniform(0, one.duration)))
        deep, size = 10 ** rng.uniform(-4, -1.3), rng.uniform(0.3, 2.0)
        low, high, turn = rng.uniform(-1.4, -0.1), rng.uniform(0.1, 1.4), rng.uniform(-0.7, 0.7)
        tips = size * np.array([[0, 0], [np.tan(low), 1], [np.tan(high), 1]]) - [0, deep]
        edge = Polygon(here.act(tips))
        solid = shapely.Polygon(edge.corners)
        if kind == "discs":
            edge = Disc(size, here.act([0, size - deep]))
            solid = shapely.Point(edge.center).buffer(size, quad_segs=1000)
        cost = Ground(edge, 5.0)
        if kind in ("boxes", "rasters"):
            origin = (here @ SE2([0, -deep, turn + np.pi / 4])).pose
            solid = shapely.Polygon(SE2(origin).act(size * Box([1, 1], [0.5, 0.5]).corners))
            box = Box([size, size], SE2(origin).act([size / 2, size / 2]), heading=origin[2])
            flat = Ground.of_raster(np.full((4, 4), 5.0), resolution=size / 4, origin=origin)
            cost = flat if kind == "rasters" else Ground(box, 5.0)
        way = one.sample(max_step_m=5e-4).pose[:, :2]
        steps = shapely.linestrings(np.stack([way[:-1], way[1:]], axis=1))
        shapely.prepare(solid)
        steps = steps[shapely.intersects(solid, steps)]
        on = 5.0 * shapely.length(shapely.intersection(steps, solid)).sum()
        asked = Problem(CAR, one.start, one.end, cost=Cost(length=1.0), place_costs=cost)
        close = 5e-4 * (on + asked.invariant_cost_of(one))
        assert asked.place_prices_of(one)[0].price == pytest.approx(on, abs=close)
        assert verify(asked, one).audit.place_price == pytest.approx(on, abs=close)


def test_rasters_hills_and_costmaps():
    values = np.random.default_rng(0).uniform(0.0, 2.0, (16, 44))
    at = {"resolution": 0.5, "origin": [-2.0, -4.0, 0.0]}
    one = curved()
    for cost in (
        Ground.of_raster(values, **at),
        Ground.of_elevation(0.1 * values, price=4.0, **at),
        Crosswind(),
    ):
        per_metre = getattr(cost, "per", "") == "metre"

        def rate(poses, velocity, cost=cost, per_metre=per_metre):
            found = cost.rates(poses, np.broadcast_to(velocity, poses.shape))
            return found * (np.hypot(*velocity[:2]) if per_metre else 1.0)

        here = problem(cost)
        expected = along(one, rate)
        assert here.place_prices_of(one)[0].price == pytest.approx(
            expected, abs=1e-3 * here.cost_of(one)
        )
    ground, walls = Ground.of_costmap([[0, 126, 252, 253, 254, 255]], resolution=1.0)
    assert walls.blocked.tolist() == [[False, False, False, True, True, True]]
    assert ground.rates(np.array([[1.5, 0.5, 0.0]]), np.zeros((1, 3))).tolist() == [0.5]


def test_a_slope_across_is_forbidden():
    hill = np.tile(np.linspace(0.0, 8.0, 16)[:, None], (1, 60))  # rises to the left
    steep = Ground.of_elevation(hill, resolution=0.5, origin=[-4, -4, 0], max_cross_slope=0.5)
    bare = problem(steep, obstacles=())
    verdict = verify(bare, Plan([0, 0, 0], (CAR["+1 +0.0"],), durations=[18.0]))
    assert not verdict.passed
    assert "does not allow" in verdict.reason
    flat = replace(bare, place_costs=Ground.of_elevation(hill, resolution=0.5, origin=[-4, -4, 0]))
    assert flat.cost_of(Plan([0, 0, 0], (CAR["+1 +0.0"],), durations=[18.0])) == 18.0


def test_gradients_of_rasters():
    raster = Ground.of_raster([[0.0, 1.0, 4.0]], resolution=1.0)
    poses = np.array([[1.0, 0.5, 0.3]])
    assert gradient_of(raster, poses, np.zeros((1, 3))) == pytest.approx(np.array([[1.0, 0, 0]]))


def test_a_moved_problem_has_a_moved_plan():
    values = np.random.default_rng(1).uniform(0.0, 1.0, (16, 44))
    raster = Ground.of_raster(values, resolution=0.5, origin=[-2.0, -4.0, 0.0])
    hill = Ground.of_elevation(values, resolution=0.5, origin=[-2.0, -4.0, 0.0])
    costs = (Clearance(2.0, 1.0), Ground(LAWN, 2.0), raster, hill, Crosswind())
    by, here = SE2([3.0, -7.0, 2.1]), problem(*costs)
    there = here.moved(by)
    one = curved()
    prices = [
        [p.price for p in q.place_prices_of(r)] for q, r in ((here, one), (there, one.moved(by)))
    ]
    assert prices[0] == pytest.approx(prices[1], rel=1e-3)
    assert all(price > 0.0 for price in prices[0])
    assert there.starting_at(there.start, time=1.0).place_costs == there.place_costs


def test_plans_say_what_they_cost_and_where():
    work = SearchSettings(max_expansions=200, improve=False)
    here = problem(Clearance(2.0, 1.0), Ground(LAWN, 2.0), search=work)
    result = plan(here, time_limit=60.0)
    assert result.audit.passed
    assert result.certificate is None
    assert result.cost == pytest.approx(here.cost_of(result.plan))
    without = plan(replace(here, place_costs=()), time_limit=60.0)
    assert result.cost <= here.cost_of(without.plan) * (1 + 1e-9)
    assert result.audit.place_price == pytest.approx(
        result.cost - here.invariant_cost_of(result.plan), abs=1e-3 * result.cost
    )
    assert result.lower_bound <= result.cost
    assert not result.bound.optimal
    document = plan_to_dict(result)
    parts = document["cost_parts"]
    assert [one["kind"] for one in parts["places"]] == ["Clearance", "Ground"]
    assert result.cost == pytest.approx(
        parts["invariant"] + sum(one["price"] for one in parts["places"])
    )
    assert "place_price" in document["audit"]
    plain = plan_to_dict(without)
    assert "cost_parts" not in plain
    assert "place_price" not in plain["audit"]
    planner = Planner(CAR, obstacles=WALLS, footprint=BODY, place_costs=Clearance(2.0, 1.0))
    assert planner.problem([0, 0, 0], [18, 0.5, 0]).place_costs == planner.place_costs


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Clearance(-1.0, 1.0), "clearance: weight must be at least 0, got -1"),
        (lambda: Clearance(1.0, 0.0), "clearance: within must be positive, got 0.0 m"),
        (lambda: Clearance(1.0, 1.0, per="mile"), "per must be 'metre' or 'second', got 'mile'"),
        (lambda: Ground((), 1.0), "ground: need areas or a raster"),
        (lambda: Ground(LAWN, math.nan), "ground: price must be at least 0"),
        (lambda: Ground.of_raster([[-1.0]], resolution=1.0), "prices must be at least 0, got -1"),
        (lambda: Ground.of_raster([1.0], resolution=1.0), "has shape (1,), need (rows, columns)"),
        (
            lambda: Ground.of_costmap([[256]], resolution=1.0),
            "reach from 256 to 256, need 0 to 255",
        ),
        (
            lambda: Ground.of_elevation([[1.0]], resolution=1.0, max_cross_slope="0.3"),
            "elevation: max_cross_slope: got '0.3', need a number",
        ),
        (lambda: problem("near"), "place_costs[0]: got 'near', need Clearance, Ground, or"),
    ],
)
def test_what_is_wrong_is_said(make, said):
    with pytest.raises(ValueError) as error:
        make()
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("has", "said"),
    [
        ({"rates": lambda p, v: -np.ones(p.shape[:-1])}, "rates: got -1, need at least 0"),
        ({"rates": lambda p, v: np.full(p.shape[:-1], 1j)}, "rates: got array.*, need numbers"),
        ({"rates": lambda p, v: 1.0}, r"rates: got shape \(\), need \("),
        ({"allows": lambda p, v: 1.0}, r"allows: got shape \(\), need \("),
        ({"gradient": lambda p, v: p[..., :2]}, r"gradient: got shape .*2\), need .*3\)"),
        ({"scale": 0.0}, "scale must be positive, got 0.0 m"),
        ({"scale": "x"}, "scale: got 'x', need a number"),
        ({"scale": 1e-9}, "a scale of 1e-09 m, need at least 1.4e-05 m along a way of 14.7 m"),
    ],
)
def test_what_a_users_own_must_not_say(has, said):
    paid = Crosswind()
    for name, value in has.items():
        object.__setattr__(paid, name, value)
    with pytest.raises(ValueError, match=said):
        assert gradient_of(paid, *np.zeros((2, 5, 3))).sum() + problem(paid).cost_of(curved())


def test_moving_obstacles_and_maps():
    cells = OccupancyMap(np.ones((2, 2)), resolution=0.5, origin=[1.0, 2.0, 0.0])
    here = problem(Clearance(1.0, 2.0), obstacles=cells, footprint=())
    near = here.bound_place_costs[0].rates(np.array([[1.5, 1.0, 0.0]]), np.zeros((1, 3)))
    assert near == pytest.approx([0.25])
