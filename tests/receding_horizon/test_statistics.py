from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.receding_horizon import (
    Disturbance,
    Guarantee,
    Outcome,
    Statistics,
    simulate,
    simulate_many,
)
from maneuver_automaton.receding_horizon.statistics import outcome_of
from tests.receding_horizon.loops import AHEAD, NEAR, parking_loop, straight

NOISE = Disturbance(position_m=0.02, heading_rad=0.02)


def in_numbers(outcome: Outcome) -> tuple[object, ...]:
    """All of an outcome but the time it took."""
    return (
        outcome.start.tolist(),
        outcome.seed,
        outcome.reached,
        outcome.arrived_after,
        outcome.stayed,
        outcome.share_inside,
        outcome.steps,
        outcome.cost,
        outcome.first_value,
        outcome.violations,
        outcome.reason,
    )


def test_each_outcome_is_that_of_its_loop():
    problem = parking_loop(goal=NEAR)
    (seventh,) = simulate_many(
        problem, seeds=[7], step=1.0, steps=4, disturbance=NOISE, audit=True
    ).outcomes
    upset = Disturbance(position_m=0.02, heading_rad=0.02, seed=7)
    loop = simulate(problem, step=1.0, steps=4, disturbance=upset)
    assert in_numbers(seventh) == in_numbers(outcome_of(loop, seed=7))
    assert seventh.audits_failed == 0
    assert seventh.cost == loop.cost


def test_shares_by_hand():
    starts = [[-2.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    statistics = simulate_many(straight(), starts=starts, step=1.0)
    ahead, there, aside = statistics.outcomes
    assert (ahead.reached, ahead.arrived_after, ahead.steps, ahead.cost) == (True, 2, 2, 2.0)
    assert (there.reached, there.arrived_after, there.steps, there.cost) == (True, 0, 0, 0.0)
    assert (aside.reached, aside.arrived_after, aside.steps) == (False, None, 0)
    assert aside.reason
    assert statistics.reached == pytest.approx(2.0 / 3.0)
    assert statistics.stayed == pytest.approx(2.0 / 3.0)
    assert statistics.broken == 0
    assert statistics.solve_s.shape == (2,)


def test_in_and_out_of_the_set_again():
    inside = Disturbance(pushes={3: (0.5, 0.0, 0.0)})
    loop = simulate(parking_loop(goal=NEAR), step=2.0, steps=6, stay=True, disturbance=inside)
    outcome = outcome_of(loop)
    assert outcome.reached
    assert not outcome.stayed
    assert 0.0 < outcome.share_inside < 1.0
    assert outcome.reason == f"reached after {outcome.arrived_after} steps, outside again after 4"
    assert Statistics(outcomes=(outcome,)).stayed == 0.0


def test_what_a_push_takes_is_not_broken():
    upset = Disturbance(pushes={0: (-1.0, 0.0, 0.0), 1: (-1.0, 0.0, 0.0)})
    statistics = simulate_many(straight(1.0), step=0.5, steps=9, seeds=[0, 1], disturbance=upset)
    taken = [(k, one.guarantee) for each in statistics.outcomes for k, one in each.disturbed]
    assert [k for k, guarantee in taken if guarantee is Guarantee.DECREASE] == [1, 2, 1, 2]
    assert statistics.broken == 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"seeds": ()}, "got 1 starts and 0 seeds, need one of each"),
        ({"starts": np.zeros((0, 3))}, "got 0 starts and 1 seeds, need one of each"),
        ({"starts": np.zeros((2, 2, 3))}, r"starts: got shape \(2, 2, 3\), need \(n, 3\)"),
        ({"starts": [[0.0, 1.0]]}, r"starts: got shape \(1, 2\), need 3 components last"),
        ({"starts": [[0.0, 1.0, np.nan]]}, "starts: got nan, need finite numbers"),
        ({"jobs": 0}, "jobs must be at least 1, got 0"),
        ({"steps": 0}, "steps must be at least 1, got 0"),
    ],
)
def test_wrong_input(settings, message):
    with pytest.raises(ValueError, match=message):
        simulate_many(parking_loop(AHEAD), **({"step": 1.0} | settings))
