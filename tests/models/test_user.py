"""Models made of a user's own functions."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.errors import BrokenSymmetry
from maneuver_automaton.groups import SE2, SE2xR, translations
from maneuver_automaton.models import UserModel, model_of_vector_field, vector_field


def skater(x, u):
    return np.array([x[3] * np.cos(x[2]), x[3] * np.sin(x[2]), u[1], u[0] - 0.1 * x[3]])


def windy(x, u):
    return [u[0] * np.cos(x[2]), u[0] * np.sin(x[2]) + 0.5, u[1]]


def test_plain_field_becomes_a_model_and_back():
    model = model_of_vector_field(skater, group=SE2, n_controls=2, reduced_names=["speed"])
    rng = np.random.default_rng(5)
    states, controls = rng.normal(size=(6, 4)), rng.normal(size=(6, 2))
    expected = [skater(x, u) for x, u in zip(states, controls, strict=True)]
    np.testing.assert_allclose(vector_field(model)(states, controls), expected, atol=1e-14)
    assert model.name == "skater"
    assert model.control_names == ("u1", "u2")
    assert model.reduced_names == ("speed",)
    import casadi

    speed, push = casadi.SX.sym("speed"), casadi.SX.sym("push")
    x, y, turn = model.velocity([speed], [push, 0.5])
    assert (str(x), y, turn) == ("speed", 0.0, 0.5)
    assert str(model.dynamics([speed], [push, 0.5])[0]) == "(push-(0.1*speed))"


def test_field_with_height():
    def drone(x, u):
        return [u[0] * np.cos(x[2]), u[0] * np.sin(x[2]), u[1], u[2]]

    model = model_of_vector_field(drone, group=SE2xR, n_controls=3)
    assert model.body_velocity(np.zeros(0), np.array([1.0, 2.0, 3.0])).tolist() == [1, 0, 2, 3]


def test_wind_is_refused_with_the_rate_that_shows_it():
    with pytest.raises(
        BrokenSymmetry, match=r"windy: .* moving the heading by .* rate of [xy] by .* without wind"
    ):
        model_of_vector_field(windy, group=SE2, n_controls=2)
    unchecked = model_of_vector_field(windy, group=SE2, n_controls=2, check=False)
    assert unchecked.body_velocity(np.zeros(0), np.array([1.0, 0.0])).tolist() == [1.0, 0.5, 0.0]


def test_friction_that_depends_on_the_place_is_refused():
    def icy(x, u):
        return [x[3] * np.cos(x[2]), x[3] * np.sin(x[2]), u[1], u[0] - np.exp(-x[0]) * x[3]]

    with pytest.raises(BrokenSymmetry, match=r"icy: .* moving the x by .* rate of z1"):
        model_of_vector_field(icy, group=SE2, n_controls=2, reduced_names=["speed"])


def user_model(**changes):
    arguments = {
        "name": "cart",
        "group": SE2,
        "control_names": ("speed", "turn_rate"),
        "velocity": lambda z, u: [u[0], 0.0, u[1]],
    }
    return UserModel(**(arguments | changes))


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match=r"cart: control: got shape \(3,\), need 2 components"):
        user_model().body_velocity(np.zeros(0), np.zeros(3))
    flat = user_model(velocity=lambda z, u: [u[0], u[1]])
    with pytest.raises(ValueError, match=r"cart: velocity returned shape \(2,\), need \(3,\)"):
        flat.body_velocity(np.zeros(0), np.zeros(2))
    with pytest.raises(ValueError, match="cart: has the reduced state speed but no dynamics"):
        user_model(reduced_names=("speed",))


def test_wrong_limits_are_named():
    with pytest.raises(
        ValueError, match=r"cart: control_limits: got shape \(1, 2\), need \(2, 2\)"
    ):
        user_model(control_limits=[[0.0, 1.0]])
    with pytest.raises(ValueError, match=r"speed needs least <= greatest, got \(1, -1\)"):
        user_model(control_limits=[[1.0, -1.0], [0.0, 1.0]])
    with pytest.raises(ValueError, match="speed needs least <= greatest, got"):
        user_model(control_limits=[[np.nan, 1.0], [0.0, 1.0]])


def test_a_state_of_more_numbers_than_stated_is_told():
    said = r"the state has 2 numbers, x, y, .* need reduced_names"
    with pytest.raises(ValueError, match=said):
        model_of_vector_field(windy, group=translations(2), n_controls=2)
    model = model_of_vector_field(windy, group=translations(2), n_controls=2, check=False)
    with pytest.raises(ValueError, match=said):
        model.body_velocity(np.zeros(0), np.zeros(2))
