"""Laws that hold for every model: a moved start has the moved motion."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import (
    Car,
    Unicycle,
    UserModel,
    equivariance_defect,
    moved_rates,
    moved_state,
    rollout,
    vector_field,
)


def boat_velocity(z, u):
    return [z[0], 0.1 * z[0], u[1]]


def boat_dynamics(z, u):
    return [u[0] - z[0]]


def balloon_velocity(z, u):
    return [u[0], 0.0, u[1], u[2]]


BOAT = UserModel(
    name="boat",
    group=SE2,
    control_names=("push", "turn"),
    reduced_names=("speed",),
    velocity=boat_velocity,
    dynamics=boat_dynamics,
)
BALLOON = UserModel(
    name="balloon",
    group=SE2xR,
    control_names=("speed", "turn_rate", "climb"),
    velocity=balloon_velocity,
)
MODELS = [Unicycle(), Car(wheelbase=2.0, max_steering=1.0), BOAT, BALLOON]
KINEMATIC = [model for model in MODELS if not model.reduced_names]
every_model = pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
NUMBERS = st.floats(-1.5, 1.5)


def sizes(model):
    return model.group.dof, len(model.reduced_names), len(model.control_names)


@every_model
@given(data=st.data())
def test_vector_fields_are_equivariant(model, data):
    dof, n_z, n_u = sizes(model)
    by = model.group(data.draw(arrays(np.float64, dof, elements=st.floats(-100.0, 100.0))))
    state = data.draw(arrays(np.float64, dof + n_z, elements=NUMBERS))
    control = data.draw(arrays(np.float64, n_u, elements=NUMBERS))
    defect = equivariance_defect(vector_field(model), by, state=state, control=control)
    assert np.abs(defect).max() < 1e-11


@every_model
@settings(max_examples=10)
@given(data=st.data())
def test_a_moved_start_has_the_moved_motion(model, data):
    dof, n_z, n_u = sizes(model)
    by = model.group(data.draw(arrays(np.float64, dof, elements=st.floats(-10.0, 10.0))))
    state = data.draw(arrays(np.float64, dof + n_z, elements=NUMBERS))
    control = data.draw(arrays(np.float64, n_u, elements=NUMBERS))
    times = np.linspace(0.0, 2.0, 5)
    here = rollout(model, state, control=control, times=times)
    there = rollout(model, moved_state(by, state), control=control, times=times)
    np.testing.assert_allclose(there, moved_state(by, here), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("model", KINEMATIC, ids=lambda model: model.name)
@settings(max_examples=10)
@given(data=st.data())
def test_kinematic_models_coast_along_one_parameter_groups(model, data):
    dof, _, n_u = sizes(model)
    start = model.group(data.draw(arrays(np.float64, dof, elements=NUMBERS)))
    control = data.draw(arrays(np.float64, n_u, elements=NUMBERS))
    times = np.array([0.0, 0.7, 3.0])
    twist = model.body_velocity(np.zeros(0), control)
    coasted = start @ model.group.exp(np.multiply.outer(times, twist))
    solved = rollout(model, start.pose, control=control, times=times, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(solved, coasted.pose, rtol=0.0, atol=1e-9)


@every_model
def test_moving_twice_is_moving_once(model):
    dof, n_z, _ = sizes(model)
    rng = np.random.default_rng(3)
    a, b = model.group(rng.normal(size=dof)), model.group(rng.normal(size=dof))
    state, rates = rng.normal(size=(2, dof + n_z))
    np.testing.assert_allclose(
        moved_state(a @ b, state), moved_state(a, moved_state(b, state)), atol=1e-14
    )
    once = moved_rates(a @ b, state, rates=rates)
    twice = moved_rates(a, moved_state(b, state), rates=moved_rates(b, state, rates=rates))
    np.testing.assert_allclose(once, twice, atol=1e-14)


@every_model
def test_batches_are_loops(model):
    dof, n_z, n_u = sizes(model)
    rng = np.random.default_rng(4)
    states, controls = rng.uniform(-1, 1, (3, 1, dof + n_z)), rng.uniform(-1, 1, (4, n_u))
    f, z = vector_field(model), states[..., dof:]
    table = f(states, controls)
    assert table.shape == (3, 4, dof + n_z)
    for i, j in np.ndindex(3, 4):
        np.testing.assert_allclose(table[i, j], f(states[i, 0], controls[j]), atol=1e-15)
    assert model.body_velocity(z[:, 0], controls[0]).shape[-1] == dof
    assert model.reduced_dynamics(np.zeros((7, n_z)), np.zeros((7, n_u))).shape == (7, n_z)
    assert model.body_velocity(np.zeros((7, n_z)), np.zeros((7, n_u))).shape == (7, dof)


@every_model
def test_limits_have_a_row_for_each_name(model):
    _, n_z, n_u = sizes(model)
    assert model.control_limits.shape == (n_u, 2)
    assert model.reduced_limits.shape == (n_z, 2)


def test_names_and_limits_of_a_user_model_can_be_replaced():
    limited = dataclasses.replace(BOAT, control_limits=[[-1.0, 1.0], [-np.inf, np.inf]])
    assert limited.control_limits[0].tolist() == [-1.0, 1.0]
    assert BOAT.control_limits[0].tolist() == [-np.inf, np.inf]
