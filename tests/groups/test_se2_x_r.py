"""SE(2) x R by hand."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.groups import SE2, SE2xR, group_of, product, translations
from tests.compare import assert_same_motion


def test_helix_rises_while_it_turns():
    assert_same_motion(
        SE2xR.exp([np.pi, 0.0, np.pi, 3.0]), SE2xR([0.0, 2.0, np.pi, 3.0]), atol=1e-15
    )


def test_it_is_the_product_of_its_parts():
    rng = np.random.default_rng(2)
    pair = product(SE2, translations(1))
    a, b = rng.normal(size=(2, 5, 4))
    np.testing.assert_array_equal((SE2xR(a) @ SE2xR(b)).pose, (pair(a) @ pair(b)).pose)
    np.testing.assert_array_equal(SE2xR(a).log(), pair(a).log())
    np.testing.assert_array_equal(SE2xR(a).coadjoint(), pair(a).coadjoint())


def test_planar_motions_are_a_subgroup():
    a, b = SE2([1.0, 2.0, 0.5]), SE2([0.3, -0.2, 1.0])
    lifted = SE2xR([1.0, 2.0, 0.5, 0.0]) @ SE2xR([0.3, -0.2, 1.0, 0.0])
    assert lifted.pose[3] == 0.0
    assert_same_motion(lifted.planar, a @ b, atol=0.0)


def test_group_of_dof():
    assert group_of(3) is SE2
    assert group_of(4) is SE2xR
    with pytest.raises(ValueError, match=r"dof: got 6, need 3 \(x, y, heading\) or 4"):
        group_of(6)
