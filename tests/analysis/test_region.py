"""Where checks draw their samples from."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.analysis import Region
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Car, UserModel


def test_a_model_gives_its_limits():
    region = Region.of_model(Car(wheelbase=2.0, max_steering=0.6))
    assert region.controls.tolist() == [[-2.0, 2.0], [-0.6, 0.6]]
    assert region.states.tolist() == [[-10.0, 10.0], [-10.0, 10.0], [-np.pi, np.pi]]


def test_one_sided_limits_are_kept():
    model = UserModel(
        name="plane",
        group=SE2xR,
        control_names=("push", "pull"),
        velocity=lambda z, u: [u[0], 0.0, 0.0, 0.0],
        control_limits=[[15.0, np.inf], [-np.inf, -7.0]],
    )
    region = Region.of_model(model)
    assert region.controls.tolist() == [[15.0, 19.0], [-11.0, -7.0]]
    assert region.state_names == ("x", "y", "heading", "z")


def test_wrong_boxes_are_named():
    with pytest.raises(ValueError, match=r"region: states has 2 rows, need one for each of x, y,"):
        Region(group=SE2, states=np.zeros((2, 2)), controls=np.zeros((2, 2)))
    with pytest.raises(ValueError, match="region: controls must be rows of least and greatest"):
        Region(group=SE2, states=np.zeros((3, 2)), controls=[[1.0, 0.0]])
    with pytest.raises(ValueError, match="controls: got inf, need finite numbers"):
        Region(group=SE2, states=np.zeros((3, 2)), controls=[[0.0, np.inf]])
