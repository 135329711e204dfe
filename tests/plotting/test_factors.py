from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import maneuver_automaton as ma
from maneuver_automaton.plotting import draw_factor

BOX = ma.Automaton.of_grid(ma.Unicycle(), [[-1.0, 1.0], [-1.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def words():
    return ma.design_library(BOX, max_trims=3, radius=2.0, least=1.0, tolerance=0.1).words


@pytest.mark.exhaustive
@pytest.mark.slow
def test_no_place_is_worse_than_what_is_proven(words):
    ax = Figure().add_subplot()
    factors = draw_factor(ax, words).get_array()
    assert 1.3 < factors.max() <= words.factor
    assert factors.min() >= 1.0 - 1e-9
    assert ax.get_aspect() == 1.0


@pytest.mark.exhaustive
@pytest.mark.slow
def test_left_and_right_are_alike(words):
    factors = np.ma.filled(draw_factor(Figure().add_subplot(), words).get_array(), 0.0)
    assert np.allclose(factors, factors[::-1], atol=1e-6)
    assert np.allclose(factors, factors[:, ::-1], atol=1e-6)
