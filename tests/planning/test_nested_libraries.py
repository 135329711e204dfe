"""A library with more trims, all those of a smaller one among them, never plans worse."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from tests.matrix.vehicles import VEHICLES
from tests.search.cases import compiled_only

pytestmark = compiled_only
SAME = 1e-3  # of a cost: polishing ends in one optimum with steps of another size
AMONG = 1e-2  # of a cost among obstacles, where plans are improved in small steps
QUICK = ("unicycle", "dubins", "stage")
SEARCH = ma.SearchSettings(max_expansions=300)
LONGEST = (pytest.mark.slow, pytest.mark.exhaustive)
TURNS = ma.UserModel(
    name="turns",
    group=ma.SE2,
    control_names=("curvature_rate",),
    reduced_names=("curvature",),
    velocity=lambda z, u: [1.0, 0.0, z[0]],
    dynamics=lambda z, u: [u[0]],
    control_limits=[[-0.1, 0.1]],
    reduced_limits=[[-0.5, 0.5]],
)


@functools.cache
def curvatures(count: int) -> ma.Automaton:
    """Steady turns, each linked to each: of 3 curvatures no maneuver turns by less than 2.5 rad."""
    return ma.Automaton.of_model(TURNS, {"curvature": np.linspace(-0.5, 0.5, count)}, pairs="all")


def problem(count: int, goal: list[float]) -> ma.Problem:
    ahead = "curvature 0"
    return ma.Problem(
        curvatures(count), [0, 0, 0], ma.Goal(goal, trim=ahead), start_trim=ahead, search=SEARCH
    )


@pytest.mark.parametrize(
    ("goal", "optimum", "counts"),
    [
        ([10.77, -4.52, -0.48], 11.83, (3,)),
        pytest.param([10.77, -4.52, -0.48], 11.83, (5, 9), marks=LONGEST),
        pytest.param([0.28, 10.81, -2.24], 21.951, (3, 5, 9), marks=LONGEST),
    ],
)
def test_turns_of_few_curvatures_are_polished_to_those_of_many(goal, optimum, counts):
    """The optimum: the least cost that 17 curvatures or another start have led to."""
    pytest.importorskip("casadi")
    costs = [ma.plan(problem(count, goal), time_limit=60).cost for count in counts]
    assert costs == pytest.approx([optimum] * len(counts), rel=SAME)


def without_a_third(vehicle):
    """The library of a vehicle without a third of its trims; those at its ends stay."""
    whole, drawn = vehicle.automaton, np.random.default_rng([6, 0])
    ends = {vehicle.end_trim, vehicle.moving_trim}
    ends |= {trim.name for trim in whole.trims if trim.is_rest}
    spare = [name for name in drawn.permutation(whole.trim_names).tolist() if name not in ends]
    kept = set(whole.trim_names) - set(spare[: max(1, len(spare) // 3)])
    maneuvers = [one for one in whole.maneuvers if {one.source, one.target} <= kept]
    trims = tuple(trim for trim in whole.trims if trim.name in kept)
    return replace(whole, trims=trims, maneuvers=tuple(maneuvers))


def test_of_many_trims_that_drift_aside_in_turns_some_that_turn_are_searched():
    """Of more than ten a few are: for a boat they were the straights alone, and it had no plan."""
    boat, course = VEHICLES["boat"], ma.Disc(0.6, [3.5, 1.0])
    controls = {
        f"{speed} m/s, {turn} rad/s": (speed, turn)
        for speed in (1.0, -0.5)
        for turn in (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6)
    }
    some = {name: turn for name, turn in controls.items() if abs(turn[1]) in (0.0, 0.6)}
    whole = boat.problem(obstacles=[course], search=SEARCH)
    few, best = (
        ma.plan(
            replace(whole, automaton=ma.Automaton.of_controls(boat.automaton.model, chosen)),
            time_limit=120,
        )
        for chosen in (some, controls)
    )
    assert best.cost <= few.cost * (1.0 + AMONG)


@pytest.mark.parametrize(
    "name",
    [*QUICK, *(pytest.param(n, marks=LONGEST) for n in ("car", "hovercraft", "user"))],
)
def test_trims_beside_those_of_a_library_cost_nothing(name):
    """By the same number of expansions, in free space and beside a box."""
    vehicle = VEHICLES[name]
    x, y = vehicle.goal[:2]
    far = vehicle.reach
    box = ma.Box([0.125 * far, 0.25 * far], [0.5 * x, 0.5 * y + 0.05 * far])
    for within, more in ((SAME, {}), (AMONG, {"obstacles": [box]})):
        whole = vehicle.problem(**more)
        few = ma.plan(replace(whole, automaton=without_a_third(vehicle)), time_limit=120)
        if few.plan is not None:
            best = ma.plan(whole, time_limit=120)
            assert best.plan is not None, best.reason
            assert best.cost <= few.cost * (1.0 + within)
