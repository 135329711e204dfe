"""What a plan costs, by hand and by law."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.costs import Cost

WEIGHT = st.floats(0.0, 10.0)
CONTROLS = arrays(np.float64, (4, 2), elements=st.floats(-3.0, 3.0))
VELOCITIES = arrays(np.float64, (4, 4), elements=st.floats(-3.0, 3.0))


def rate(cost, control, velocity=(0.0, 0.0, 0.0)):
    """Cost per second of a single trim."""
    return cost.rates(np.array([control], dtype=float), np.array([velocity], dtype=float)).item()


@pytest.mark.parametrize(
    ("order", "expected"), [(1, 7.0), (1.0, 7.0), (2, 5.0), (2.0, 5.0), (math.inf, 4.0)]
)
def test_norms_by_hand(order, expected):
    assert rate(Cost(norm=1.0, norm_order=order), (3.0, -4.0)) == expected


def test_the_default_norm_is_euclidean():
    assert rate(Cost(norm=0.5), (3.0, -4.0)) == 2.5


def test_effort_by_hand():
    assert rate(Cost(effort=2.0), (3.0, -4.0)) == 50.0
    weights = [[2.0, 1.0], [1.0, 3.0]]
    # 2 * 9 + 2 * 1 * 3 * (-4) + 3 * 16
    assert rate(Cost(effort=1.0, effort_matrix=weights), (3.0, -4.0)) == 42.0
    assert rate(Cost(effort=0.5, effort_matrix=weights), (3.0, -4.0)) == 21.0


def test_the_matrix_weighs_the_effort_alone():
    cost = Cost(norm=1.0, time=3.0, effort_matrix=[[100.0, 0.0], [0.0, 100.0]])
    assert rate(cost, (3.0, 4.0)) == 8.0


def test_the_paper_s_rates_of_table_2():
    # effort |u|^2 plus half the norm |u|
    cost = Cost(effort=1.0, norm=0.5)
    assert rate(cost, (0.0, 0.0)) == 0.0
    assert rate(cost, (1.5, 0.0)) == 3.0
    assert rate(cost, (0.0, 1.0)) == 1.5
    assert rate(cost, (-0.25, 1.0)) == pytest.approx(1.0625 + 0.5 * math.sqrt(1.0625))


@pytest.mark.parametrize(
    ("velocity", "driven"),
    [
        ((3.0, -4.0, 9.0), 5.0),
        ((0.0, 0.0, 9.0), 0.0),
        ((2.0, -3.0, 9.0, 6.0), 7.0),
        ((0.0, 0.0, 0.0, -1.5), 1.5),
    ],
)
def test_length_is_the_way_driven_without_the_turning(velocity, driven):
    assert rate(Cost(length=2.0), (7.0,), velocity) == 2.0 * driven


def test_rest_costs_time_alone():
    cost = Cost(effort=1.0, norm=1.0, time=0.25, length=1.0)
    assert rate(cost, (0.0, 0.0)) == 0.25


@given(weights=st.lists(WEIGHT, min_size=4, max_size=4), controls=CONTROLS, twists=VELOCITIES)
def test_rates_add_up_and_none_is_negative(weights, controls, twists):
    names = ("effort", "norm", "time", "length")
    parts = [Cost(**{name: 1.0}).rates(controls, twists) for name in names]
    expected = sum(w * part for w, part in zip(weights, parts, strict=True))
    if any(weights):
        whole = Cost(**dict(zip(names, weights, strict=True)))
        rates = whole.rates(controls, twists)
        np.testing.assert_allclose(rates, expected, rtol=1e-12, atol=1e-300)
        assert (rates >= 0.0).all()


@given(controls=CONTROLS, root=arrays(np.float64, (2, 2), elements=st.floats(-2.0, 2.0)))
def test_effort_is_the_square_of_a_root_of_the_matrix(controls, root):
    matrix = root.T @ root + np.eye(2)
    rates = Cost(effort=1.0, effort_matrix=matrix).rates(controls, np.zeros((4, 3)))
    expected = ((controls @ root.T) ** 2).sum(axis=1) + (controls**2).sum(axis=1)
    np.testing.assert_allclose(rates, expected, atol=1e-11)


@given(controls=CONTROLS, twists=VELOCITIES)
def test_reverse_costs_as_much_as_forward(controls, twists):
    cost = Cost(effort=1.0, norm=1.0, time=1.0, length=1.0)
    np.testing.assert_array_equal(cost.rates(controls, twists), cost.rates(-controls, -twists))


FORWARD, REVERSE, SPIN, REST = [1.0, 0.0, 0.5], [-2.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("word", "switches", "changes"),
    [
        ([], 0, 0),
        ([FORWARD], 0, 0),
        ([FORWARD, FORWARD], 1, 0),
        ([FORWARD, REVERSE], 1, 1),
        ([FORWARD, SPIN, REVERSE], 2, 1),
        ([FORWARD, SPIN, FORWARD], 2, 0),
        ([SPIN, REST], 1, 0),
        ([SPIN, REVERSE, REST], 2, 0),
        ([REVERSE, FORWARD, REST, REVERSE], 3, 2),
    ],
)
def test_switches_by_hand(word, switches, changes):
    twists = np.array(word).reshape(len(word), 3)
    assert Cost(time=1.0, switch=1.0).switching(twists) == switches
    assert Cost(time=1.0, direction_change=1.0).switching(twists) == changes
    both = Cost(time=1.0, switch=0.5, direction_change=2.0)
    assert both.switching(twists) == 0.5 * switches + 2.0 * changes
    assert Cost(time=1.0).switching(twists) == 0.0


def test_a_sideways_motion_is_no_direction():
    sideways = [0.0, 1.0, 0.0]
    cost = Cost(time=1.0, direction_change=1.0)
    assert cost.switching(np.array([FORWARD, sideways, FORWARD])) == 0.0
    assert cost.switching(np.array([FORWARD, sideways, REVERSE])) == 1.0


def test_switches_alone_may_be_priced():
    cost = Cost(switch=1.0)
    assert rate(cost, (3.0, 4.0), FORWARD) == 0.0
    assert cost.switching(np.array([FORWARD, SPIN])) == 1.0


def test_the_matrix_is_a_read_only_copy():
    matrix = np.eye(2)
    cost = Cost(effort=1.0, effort_matrix=matrix)
    matrix[0, 0] = -1.0
    assert cost.effort_matrix.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    with pytest.raises(ValueError, match="read-only"):
        cost.effort_matrix[0, 0] = 2.0


NONE_POSITIVE = (
    "cost: effort, norm, time, length, switch, direction_change are all zero, "
    "need at least one positive"
)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"effort": -1.0}, "cost: effort must be at least 0, got -1.0"),
        ({"norm": math.nan}, "cost: norm must be at least 0, got nan"),
        ({"time": math.inf}, "cost: time must be finite, got inf"),
        ({"length": -1e-9}, "cost: length must be at least 0, got -1e-09"),
        ({"time": 1.0, "switch": -1.0}, "cost: switch must be at least 0, got -1.0"),
        ({"time": 1.0, "direction_change": math.nan},
         "cost: direction_change must be at least 0, got nan"),
        ({}, NONE_POSITIVE),
        ({"effort": 0.0, "time": 0.0}, NONE_POSITIVE),
        ({"norm": 1.0, "norm_order": 3}, "cost: norm_order must be 1, 2 or inf, got 3.0"),
        ({"norm": 1.0, "norm_order": math.nan}, "cost: norm_order must be 1, 2 or inf, got nan"),
        ({"effort": 1.0, "effort_matrix": [1.0, 2.0]},
         "cost: effort_matrix has shape (2,), need a square matrix"),
        ({"effort": 1.0, "effort_matrix": [[1.0, 2.0]]},
         "cost: effort_matrix has shape (1, 2), need a square matrix"),
        ({"effort": 1.0, "effort_matrix": [[1.0, 0.5], [0.0, 1.0]]},
         "cost: effort_matrix is not symmetric"),
        ({"effort": 1.0, "effort_matrix": [[1.0, 2.0], [2.0, 1.0]]},
         "cost: effort_matrix must be positive definite, its smallest eigenvalue is -1"),
        ({"effort": 1.0, "effort_matrix": [[1.0, 0.0], [0.0, 0.0]]},
         "cost: effort_matrix must be positive definite, its smallest eigenvalue is 0"),
        ({"effort": 1.0, "effort_matrix": [[math.nan, 0.0], [0.0, 1.0]]},
         "cost: effort_matrix: got nan, need finite numbers"),
        ({"effort": 1.0, "effort_matrix": "R"}, "cost: effort_matrix: got 'R', need numbers"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(values, message):
    with pytest.raises(ValueError) as error:
        Cost(**values)
    assert str(error.value) == message


def test_a_matrix_of_another_size_than_the_controls():
    cost = Cost(effort=1.0, effort_matrix=np.eye(3))
    with pytest.raises(ValueError) as error:
        cost.rates(np.zeros((1, 2)), np.zeros((1, 3)))
    assert str(error.value) == "cost: effort_matrix has shape (3, 3), need (2, 2) for 2 controls"


def test_costs_of_the_same_weights_are_equal():
    one, other = (Cost(effort=1.0, effort_matrix=[[2.0, 0.0], [0.0, k]]) for k in (1.0, 3.0))
    same = Cost(effort=1.0, effort_matrix=np.diag([2.0, 1.0]))
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert Cost(time=1.0) == Cost(time=1)
