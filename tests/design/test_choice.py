"""Which trims are chosen: by hand, and against all choices there are."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import linprog

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.design.choice import best_choices, mixing_costs, mixing_factors
from maneuver_automaton.models import Omnidirectional, Unicycle


def grid(model, axes, cost):
    """Twists and rates of all moving trims of a grid of controls."""
    automaton = Automaton.of_grid(model, axes)
    moving = automaton.body_velocities.any(axis=1)
    twists = automaton.body_velocities[moving]
    return twists, cost.rates(automaton.controls[moving], twists)


def best_of_all(twists, rates, size, kept):
    """Least factor of all choices of that size that hold those kept: slow, obvious."""
    others = [k for k in range(len(twists)) if k not in kept]
    return min(
        float(mixing_factors(twists, rates, np.array([*kept, *some])).max())
        for some in combinations(others, size - len(kept))
    )


def cheapest_straights(twists, rates):
    """The trims ahead and back that cost least per metre."""
    found = []
    for sign in (1.0, -1.0):
        along = [k for k in range(len(twists)) if twists[k, 2] == 0.0 < sign * twists[k, 0]]
        found += sorted(along, key=lambda k: rates[k] / abs(twists[k, 0]))[:1]
    return found


def test_mixtures_by_hand():
    # a straight of two turns costs as much; a spin of what drives on, nothing can make
    turns = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0]])
    wanted = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.5], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert mixing_costs(turns, np.array([1.0, 3.0]), wanted).tolist() == [2.0, 1.5, math.inf, 0.0]


@pytest.mark.parametrize("seed", range(5))
def test_mixtures_are_optima_of_linear_programs(seed):
    rng = np.random.default_rng(seed)
    twists, wanted = rng.normal(size=(7, 3)), rng.normal(size=(10, 3))
    rates = rng.uniform(0.5, 2.0, size=7)
    for cost, twist in zip(mixing_costs(twists, rates, wanted), wanted, strict=True):
        found = linprog(rates, A_eq=twists.T, b_eq=twist)
        assert cost == pytest.approx(found.fun if found.success else math.inf)


def test_a_circle_of_twists_is_cut_by_regular_polygons():
    # |v| and |w| weigh the same: n trims at even angles lose 1 / cos(pi / n)
    angles = np.arange(240) * math.pi / 120
    twists = np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=-1)
    twists[np.abs(twists) < 1e-12] = 0.0
    found = {len(one.chosen): one.factor for one in best_choices(twists, np.ones(240), most=12)}
    for n in (4, 8, 12):
        assert found[n] == pytest.approx(1.0 / math.cos(math.pi / n), rel=1e-9)
    assert found[12] < 1.05


@pytest.mark.parametrize(
    "axes", [([-1, 1], [-0.9, -0.5, 0, 0.4, 0.9]), ([0.5, 1], [-0.7, 0, 0.2, 1])]
)
def test_every_size_is_the_best_there_is(axes):
    twists, rates = grid(Unicycle(), axes, Cost(effort=1.0, time=0.3))
    straight = cheapest_straights(twists, rates)
    found = {len(one.chosen): one.factor for one in best_choices(twists, rates, most=6)}
    assert found
    least = math.inf
    for size in range(len(straight), 7):
        slow = best_of_all(twists, rates, size, straight)
        least = min(least, slow)
        held = min((factor for n, factor in found.items() if n <= size), default=math.inf)
        assert held == pytest.approx(least) or (math.isinf(held) and math.isinf(least))


def test_mirror_images_come_in_pairs():
    twists, rates = grid(Unicycle(), [np.linspace(-1, 1, 9)] * 2, Cost(effort=1.0, time=1.0))
    for one in best_choices(twists, rates, most=12):
        rows = {tuple(row) for row in (twists[one.chosen] + 0.0).tolist()}
        assert rows == {(v_x, v_y, -turn + 0.0) for v_x, v_y, turn in rows}
        assert one.factor == mixing_factors(twists, rates, one.chosen).max()


def test_without_a_straight_and_without_mirror_images():
    # only left turns, of which the tightest and the widest hold all between
    twists = np.array([[1.0, 0.0, w] for w in (0.2, 0.5, 1.0)])
    (only,) = best_choices(twists, np.ones(3), most=3)
    assert only.chosen.tolist() == [0, 2]
    assert only.factor == 1.0


def test_twists_along_one_line():
    twists = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    *_, last = best_choices(twists, np.ones(3), most=3)
    assert last.chosen.tolist() == [1, 2]
    assert last.factor == 1.0


def test_vehicles_that_move_sideways():
    twists, rates = grid(Omnidirectional(), [[-1, 0, 1]] * 3, Cost(effort=1.0, time=1.0))
    found = list(best_choices(twists, rates, most=26))
    factors = [one.factor for one in found]
    assert factors == sorted(factors, reverse=True)
    assert found[-1].factor == pytest.approx(1.0)
    for one in found:
        assert one.factor == pytest.approx(mixing_factors(twists, rates, one.chosen).max())
