"""The two checks that every value makes of its arrays."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton._arrays import Array, as_array, freeze, wrapped


@dataclass(frozen=True)
class Holder:
    """A value with one array."""

    rows: Array

    def __post_init__(self) -> None:
        freeze(self, "rows", last=(3, 4))


def test_a_float_array_is_not_copied():
    array = np.array([1.0, 2.0])
    assert as_array("x", array) is array


@pytest.mark.parametrize(
    "value",
    [[1, 2], (1, 2), range(1, 3), np.array([1, 2], dtype=np.int8), np.array([1, Fraction(2)])],
)
def test_numbers_of_any_kind_become_floats(value):
    array = as_array("x", value, last=2)
    assert array.dtype == np.float64
    assert array.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("shape", [(3,), (4,), (0, 3), (2, 5, 4)])
def test_only_the_last_axis_is_asked_for(shape):
    assert as_array("x", np.zeros(shape), last=(3, 4)).shape == shape


def test_without_a_length_any_shape_will_do():
    for value in (1.5, [], [[1.0], [2.0]]):
        np.testing.assert_array_equal(as_array("x", value), np.asarray(value))


@pytest.mark.parametrize(
    ("value", "last", "message"),
    [
        ("abc", None, "speed: got 'abc', need numbers"),
        ([1.0, [2.0]], None, "speed: got [1.0, [2.0]], need numbers"),
        ([{}], None, "speed: got [{}], need numbers"),
        ([1.0, "2"], None, "speed: got [1.0, '2'], need numbers"),
        (
            [1.0, 10**400],
            None,
            "speed: got [1.0, 100000000000000000...0000000000000000000], need numbers",
        ),
        ([1j], None, "speed: got [1j], need numbers"),
        ([1.0, 2.0], 3, "speed: got shape (2,), need 3 components last"),
        ([[1.0, 2.0]], (3, 4), "speed: got shape (1, 2), need 3 or 4 components last"),
        (1.0, 1, "speed: got shape (), need 1 components last"),
        ([0.0, np.nan], None, "speed: got nan, need finite numbers"),
        ([[0.0], [-np.inf]], 1, "speed: got -inf, need finite numbers"),
    ],
)
def test_what_is_wrong_is_said(value, last, message):
    with pytest.raises(ValueError) as error:
        as_array("speed", value, last=last)
    assert str(error.value) == message


def test_freezing_makes_a_copy_that_cannot_be_written():
    source = np.zeros((2, 3))
    held = Holder(source)
    source[0, 0] = 1.0
    assert not held.rows.any()
    with pytest.raises(ValueError, match="read-only"):
        held.rows[0, 0] = 1.0


def test_freezing_names_the_field():
    with pytest.raises(ValueError, match=r"^rows: got shape \(2,\), need 3 or 4 components last$"):
        Holder([1.0, 2.0])


@given(angles=arrays(np.float64, 5, elements=st.floats(-1e4, 1e4)))
def test_wrapping_takes_off_whole_turns(angles):
    there = wrapped(angles)
    assert (np.abs(there) <= np.pi).all()
    turns = (angles - there) / (2 * np.pi)
    np.testing.assert_allclose(turns, turns.round(), atol=1e-9)


@pytest.mark.parametrize(
    ("angle", "expected"), [(0.0, 0.0), (-0.5, -0.5), (7 * np.pi / 4, -np.pi / 4), (-7.0, -0.717)]
)
def test_wrapping_by_hand(angle, expected):
    assert float(wrapped(angle)) == pytest.approx(expected, abs=1e-3)
