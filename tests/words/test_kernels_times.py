"""End of a word and its derivatives, against matrix exponentials and differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton._arrays import wrapped
from maneuver_automaton._compile import kernel
from maneuver_automaton.groups import SE2
from maneuver_automaton.words._kernels_times import (
    end_and_columns,
    lagrangian_hessian,
)
from maneuver_automaton.words.closing import conjugated
from tests import reference
from tests.quickly import draws

EVERYDAY = st.floats(-3.0, 3.0)
TINY = st.floats(-1e-7, 1e-7)
SPECIAL = st.sampled_from([0.0, 1.0, -1.0, 1e-300, np.pi])


@kernel
def derivatives(twists, times, p_x, p_y):
    """End, columns and Hessian of a word, as the kernels compute them."""
    n = times.size
    columns = np.empty((n, 3))
    hessian = np.empty((n, n))
    end = end_and_columns(twists, times, columns)
    lagrangian_hessian(columns, p_x, p_y, hessian)
    return end, columns, hessian


@st.composite
def words(draw, dof=4, least=1):
    """Twists (n, dof), times (n,) and displacements (n, dof) of up to six trims."""
    n = draw(st.integers(least, 6))
    numbers = EVERYDAY | TINY | SPECIAL
    twists = draw(arrays(np.float64, (n, dof), elements=numbers))
    times = draw(arrays(np.float64, n, elements=st.floats(0.0, 4.0) | st.just(0.0)))
    displacements = draw(arrays(np.float64, (n, dof), elements=EVERYDAY | st.just(0.0)))
    return twists, times, displacements


@settings(max_examples=draws(50))
@given(words())
def test_kernel_agrees_on_the_end_with_displacements(word):
    twists, times, displacements = word
    seen, product = conjugated(twists, displacements)
    end, _, _ = derivatives(seen, times, 0.0, 0.0)
    whole = (SE2(np.array(end)) @ SE2(product[:3])).pose
    off = whole - reference.word_end(twists[:, :3], times, displacements[:, :3])
    off[2] = wrapped(off[2])
    assert np.abs(off).max() < 1e-10
    exact = reference.word_end(twists, times, displacements)
    off = reference.plain_end(twists, times, displacements) - exact
    off[2] = wrapped(off[2])
    assert np.abs(off).max() < 1e-11


@settings(max_examples=draws(50))
@given(words())
def test_columns_are_the_derivatives_of_the_end(word):
    twists, times, _ = word
    _, columns, _ = derivatives(twists, times, 0.0, 0.0)
    expected = reference.jacobian(twists[:, :3], times)
    assert np.abs(columns.T - expected).max() < 1e-6


@settings(max_examples=15)
@given(words(), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_hessian_is_the_derivative_of_the_columns(word, p_x, p_y):
    twists, times, _ = word
    _, _, hessian = derivatives(twists, times, p_x, p_y)
    expected = reference.hessian(twists[:, :3], times, [p_x, p_y, 0.0])
    assert hessian == pytest.approx(expected, abs=1e-3)
