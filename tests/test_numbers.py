"""Numbers as people write them: kernels are compiled for float64 alone, whatever is handed in."""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton import analysis
from maneuver_automaton._kernel_cache import KernelCache  # with numba, which runs kernels then
from maneuver_automaton._kernel_list import kernel_names, signatures_of
from maneuver_automaton.receding_horizon import RecedingHorizon
from maneuver_automaton.recording import recording_of

NUMBERS = (int, float, np.int32, np.int64, np.float32, np.float64, Fraction, Decimal, np.array)
ARRAYS: tuple[Callable[[Any], Any], ...] = (
    lambda rows: np.array(rows, dtype=np.int64).tolist(),
    lambda rows: np.array(rows, dtype=np.int16),
    lambda rows: np.array(rows, dtype=np.float32),
    lambda rows: np.array(rows, dtype=">f8"),
    lambda rows: np.array(rows, dtype=np.float64, order="F"),
    lambda rows: np.repeat(np.array(rows, dtype=np.float64), 2, axis=-1)[..., ::2],
    lambda rows: np.array(rows, dtype=np.float64)[::-1].copy()[::-1],
    tuple,
)


class Plain:
    """Numbers as they are."""

    def __call__(self, value: Any) -> Any:
        return value


class Drawn(Plain):
    """Numbers of types that are drawn, one by one."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)

    def __call__(self, value: Any) -> Any:
        return self.rng.choice(ARRAYS if np.ndim(value) else NUMBERS)(value)


def robot(n: Plain) -> ma.Automaton:
    controls = {"rest": (0, 0), "ahead": (1, 0), "left": (1, 1), "right": (1, -1), "back": (-1, 0)}
    trims = [
        ma.Trim(name=name, body_velocity=n([speed, 0, turn]), control=n([speed, turn]))
        for name, (speed, turn) in controls.items()
    ]
    return ma.Automaton(ma.Unicycle(max_speed=n(2), max_turn_rate=n(2)), tuple(trims))


def problem(n: Plain, *, moving: bool = False, guarded: bool = False) -> ma.Problem:
    obstacles: list[Any] = [
        ma.Disc(n(1), n([4, 0])),
        ma.Box(n([1, 2]), n([4, 4]), n(1)),
        ma.Polygon(n([[7, -2], [8, -2], [8, -1]])),
        ma.Obstacle(ma.Disc(n(1), n([0, 6])), height=n((-1, 3)), present_s=n((0, 50))),
        ma.OccupancyMap(n([[1, 0], [0, 1]]), resolution=n(1), origin=n([10, 3, 0])),
    ]
    if moving:
        crossing = ma.Motion(n([0, 30]), n([[6, -8, 0], [6, 8, 0]]))
        obstacles.append(ma.Obstacle(ma.Disc(n(1)), motion=crossing))
    yard = ma.Box(n([2, 2]), n([5, -4]))
    zones = [ma.Zone(shape=yard, max_speed=n(1), max_lateral_acceleration=n(2))]
    return ma.Problem(
        robot(n),
        n([0, 0, 0]),
        ma.Goal(n([9, 1, 0]), tolerance_m=n(1), tolerance_rad=n(1))
        if guarded
        else ma.Goal(n([9, 1, 0])),
        cost=ma.Cost(time=n(1), length=n(1), direction_change=n(1), norm_order=n(2)),
        horizon=ma.Horizon(max_time=n(40), max_trims=n(40)),
        start_time=n(1),
        bounds=ma.Bounds(x=n((-5, 15)), y=n((-10, 10))),
        search=ma.SearchSettings(
            max_expansions=n(900), cell=n(1) if guarded else None, improve=False
        ),
        obstacles=obstacles,
        footprint=ma.Box(n([1, 1])),
        body_height=n((0, 1)),
        margin=n(0),
        zones=zones if guarded else (),
    )


def planned(n: Plain) -> float | None:
    return ma.plan(problem(n), time_limit=n(60)).cost


def planned_within(n: Plain) -> float | None:
    return ma.plan(problem(n, guarded=True), time_limit=n(60)).cost


def planned_among_movers(n: Plain) -> float | None:
    return ma.plan(problem(n, moving=True), time_limit=n(60)).cost


def planned_in_free_space(n: Plain) -> float | None:
    cost = ma.Cost(effort=n(1), norm=n(1), effort_matrix=n([[1, 0], [0, 2]]))
    horizon = ma.Horizon(time=n(8), min_coast=n(0))
    return ma.plan(
        ma.Problem(robot(n), n([0, 0, 0]), n([3, 2, 0]), cost=cost, horizon=horizon)
    ).cost


def planned_by_a_planner(n: Plain) -> float | None:
    stated = problem(n)
    planner = ma.Planner(
        stated.automaton,
        obstacles=stated.obstacles,
        footprint=stated.footprint,
        margin=n(1),
        body_height=n((0, 1)),
        search=ma.SearchSettings(max_expansions=n(2000), improve=False),
    )
    return planner.plan(n([0, 0, 0]), n([9, -4, 0]), start_time=n(1), time_limit=n(60)).cost


def driven(n: Plain) -> float | None:
    free = ma.Problem(robot(n), n([0, 0, 0]), n([5, 3, 0]), cost=ma.Cost(time=n(1)))
    controller = RecedingHorizon(free, step=n(1), margin=n(0), time_limit=n(60), stand=n(2))
    controller.step(n([0, 0, 0]))
    _, log = controller.step(n([1, 0, 0]))
    return log.value


def verified(n: Plain) -> float | None:
    stated = problem(n)
    plan = ma.Plan(n([0, 0, 0]), stated.automaton.trims[1:3], durations=n([1, 1]), start_time=n(1))
    plan.pose_at(n(2))
    return ma.verify(stated, plan).cost


def with_inertia(n: Plain) -> float | None:
    car = ma.SecondOrderUnicycle(
        max_speed=n(1), max_turn_rate=n(1), max_acceleration=n(1), max_angular_acceleration=n(1)
    )
    trims = ma.trims_of(car, {"speed": n([0, 1]), "turn_rate": n([-1, 0, 1])}).trims
    library = ma.build_library(car, trims).automaton
    search = ma.SearchSettings(max_expansions=n(500), polish=False)
    wall = ma.Box(n([1, 1]), n([3, 2]))
    stated = ma.Problem(
        library, n([0, 0, 0]), n([6, 0, 0]), obstacles=wall, footprint=ma.Disc(n(1)), search=search
    )
    return ma.plan(stated, time_limit=n(60)).cost


QUICK = (planned,)
OTHERS = (
    verified,
    planned_in_free_space,
    planned_within,
    planned_among_movers,
    planned_by_a_planner,
    driven,
    with_inertia,
)
SCENES = {one.__name__: one for one in QUICK + OTHERS}


def compiled_anew(name: str, seeds: range) -> set[str]:
    """Kernels beyond those compiled ahead; the drawn numbers must have the plain ones' answer."""
    beyond: set[str] = set()
    load = KernelCache.load_overload

    def asked(cache: KernelCache, signature: Any, context: Any) -> Any:
        listed = signatures_of(cache.name) if cache.name in kernel_names() else ()
        if tuple(signature) not in listed:
            beyond.add(cache.name)
        return load(cache, signature, context)

    KernelCache.load_overload = asked  # type: ignore[method-assign]
    expected = SCENES[name](Plain())
    assert expected is not None
    for seed in seeds:
        assert SCENES[name](Drawn(seed)) == expected, seed
    return beyond


@pytest.mark.parametrize(
    "name",
    [
        *(one.__name__ for one in QUICK),
        *(
            pytest.param(one.__name__, marks=[pytest.mark.slow, pytest.mark.exhaustive])
            for one in OTHERS
        ),
    ],
)
def test_no_kernel_is_compiled_for_numbers_as_people_write_them(name):
    code = f"from tests.test_numbers import *; print(sorted(compiled_anew({name!r}, range(2))))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ma.Disc("1"), "Disc: radius: got '1', need a number"),
        (lambda: ma.Disc([1.0]), r"Disc: radius: got \[1.0\], need a number"),
        (lambda: ma.Disturbance(seed=1.5), "Disturbance: seed: got 1.5, need a whole number"),
        (lambda: ma.Horizon(max_trims=2.5), "Horizon: max_trims: got 2.5, need a whole number"),
        (lambda: ma.Bounds(x=(0, "far")), "Bounds: x: got .*, need two numbers"),
        (lambda: ma.Cost(time=1j), "Cost: time: got 1j, need a number"),
        (lambda: ma.Cost(time=np.complex128(1)), "Cost: time: got .*, need a number"),
        (lambda: ma.Cost(time=10**400), "Cost: time: got 1000000.{1,80}, need a number"),
        (lambda: ma.Horizon(stay="false"), "Horizon: stay: got 'false', need True or False"),
        (lambda: ma.Clearance(None, 1.0), "Clearance: weight: got None, need a number"),
        (lambda: PLAN.sample(max_step_m=0), "plan: max_step_m must be positive, got 0.0 m"),
        (
            lambda: PLAN.sample(max_step_rad=float("nan")),
            "plan: max_step_rad must be positive, got nan",
        ),
    ],
)
def test_what_is_no_number_is_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def of_a_fleet(**options):
    """Cost of a fleet of one, planned with arguments as they are handed in."""
    return ma.plan_fleet(ma.FleetProblem([FREE]), **{"max_rounds": 1} | options).cost


def of_a_fleet_driven(**options):
    return ma.simulate_fleet(ma.FleetProblem([FREE]), **{"step": 1, "steps": 2} | options).cost


FREE = ma.Problem(robot(Plain()), [0, 0, 0], [3, 1, 0])
PLANNER = ma.Planner(FREE.automaton)
PLAN = ma.Plan([0, 0, 0], FREE.automaton.trims[1:3], durations=[1, 1])
GROWTH = analysis.GrowthBound(times=[1, 4], bounds=[1, 1], worst=np.ones((2, 3)), samples=1)
ARGUMENTS: dict[str, tuple[Callable[[Any], Any], float]] = {
    "time_limit": (lambda v: ma.plan(FREE, time_limit=v).cost, 60),
    "alternatives": (lambda v: len(ma.plan(FREE, alternatives=v).alternatives), 1),
    "gap": (lambda v: [one.cost for one in ma.plans(FREE, gap=v)][-1:], 1 / 2),
    "jobs": (lambda v: [one.cost for one in ma.plan_many([FREE], jobs=v)], 1),
    "limit of many": (
        lambda v: [one.cost for one in PLANNER.plan_many([0, 0, 0], [3, 1, 0], time_limit=v)],
        60,
    ),
    "start_time": (lambda v: PLANNER.plan([0, 0, 0], [3, 1, 0], start_time=v).cost, 1),
    "time": (lambda v: FREE.starting_at([0, 0, 0], time=v).start_time, 1),
    "incumbent": (lambda v: ma.lower_bound(FREE, incumbent=v, gap=1, max_work=100).value, 4),
    "gap of a bound": (lambda v: ma.lower_bound(FREE, gap=v, max_work=100).value, 1),
    "max_work": (lambda v: ma.lower_bound(FREE, max_work=v, gap=1).value, 100),
    "step": (lambda v: ma.simulate(FREE, step=v, steps=2).cost, 1),
    "steps": (lambda v: ma.simulate(FREE, step=1, steps=v).cost, 2),
    "within": (lambda v: ma.design_library(FREE.automaton, within=v).factor, 1),
    "most": (lambda v: ma.design_library(FREE.automaton, most=v).factor, 9),
    "max_step_m": (lambda v: len(PLAN.sample(max_step_m=v).time), 1 / 2),
    "max_step_rad": (lambda v: len(PLAN.sample(max_step_rad=v).time), 1 / 2),
    "limit of a fleet": (lambda v: of_a_fleet(time_limit=v), 60),
    "orders": (lambda v: of_a_fleet(orders=v), 1),
    "seed": (lambda v: of_a_fleet(seed=v), 1),
    "max_rounds": (lambda v: of_a_fleet(max_rounds=v), 1),
    "jobs of a fleet": (lambda v: of_a_fleet(jobs=v), 1),
    "step of a fleet": (lambda v: of_a_fleet_driven(step=v), 1),
    "steps of a fleet": (lambda v: of_a_fleet_driven(steps=v), 2),
    "swaps_per_step": (lambda v: of_a_fleet_driven(swaps_per_step=v), 1),
    "at_once": (lambda v: of_a_fleet_driven(at_once=v), 1),
    "group_size": (lambda v: of_a_fleet_driven(group_size=v), 1),
    "delay_steps": (lambda v: of_a_fleet_driven(delay_steps=v), 0),
    "seed of its loop": (lambda v: of_a_fleet_driven(seed=v), 1),
    "first_time_limit": (lambda v: of_a_fleet_driven(first_time_limit=v), 60),
    "step of a horizon": (lambda v: analysis.certified_horizon(GROWTH, step=v).horizon, 1),
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_arguments_are_numbers_of_any_type_and_nothing_else(name):
    ask, value = ARGUMENTS[name]
    expected = ask(value)
    for kind in NUMBERS:
        if value == kind(value):
            assert ask(kind(value)) == expected, kind
    for wrong in (str(value), [value], 1j):
        with pytest.raises(ValueError, match=r": got .*, need a (whole )?number"):
            ask(wrong)


TIMES: dict[str, Callable[[Any], Any]] = {
    "plan": PLAN.pose_at,
    "controls": PLAN.control_at,
    "motion": ma.Motion([0, 2], [[0, 0, 0], [2, 0, 0]]).at,
    "motion of a plan": ma.Motion.of_plan(PLAN).at,
    "mover": lambda v: recording_of(ma.plan(FREE, time_limit=60)).movers[0].pose_at(v),
    "coast": lambda v: PLAN.trims[0].coast(ma.SE2([0, 0, 0]), v).pose,
}


@pytest.mark.parametrize("name", TIMES)
def test_times_are_numbers_of_any_type_and_nothing_else(name):
    ask = TIMES[name]
    for kind in NUMBERS:
        np.testing.assert_array_equal(ask(kind(1)), ask(1.0))
    for wrong in ("1", b"1", 1j, None, ["1"], np.datetime64("2020-01-01"), np.nan):
        with pytest.raises(ValueError, match=r"(time|duration): got .*, need (finite )?numbers"):
            ask(wrong)
