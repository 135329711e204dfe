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
    AcceleratingCar,
    ArticulatedVehicle,
    Car,
    FourWheelSteeringCar,
    LatticeBody,
    Omnidirectional,
    RearSteeredCar,
    SingleTrack,
    TractorWithTrailers,
    Unicycle,
    UserModel,
    equivariance_defect,
    moved_rates,
    moved_state,
    rollout,
    vector_field,
)
from tests.inertia import CAR, HELICOPTER, HOVERCRAFT, ROBOT, TRAILER
from tests.quickly import quick_are


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
MODELS = [
    Unicycle(),
    Car(wheelbase=2.0, max_steering=1.0),
    ROBOT,
    CAR,
    TRAILER,
    SingleTrack(),
    HOVERCRAFT,
    HELICOPTER,
    AcceleratingCar(wheelbase=2.3, max_steering=0.8, max_speed=3.0, max_acceleration=2.0),
    LatticeBody(resolution=0.1),
    Omnidirectional(max_speed=1.0, max_lateral_speed=0.5, max_turn_rate=2.0),
    RearSteeredCar(wheelbase=1.5, max_steering=1.2),
    FourWheelSteeringCar(wheelbase=3.0, max_steering=1.2),
    ArticulatedVehicle(
        front=1.5, rear=1.9, max_articulation=0.7, max_articulation_rate=0.35, max_speed=2.0
    ),
    TractorWithTrailers(
        wheelbase=1.2,
        hitch_length=1.4,
        hitch_offset=0.4,
        hitch_length_2=1.4,
        hitch_offset_2=-0.2,
        hitch_length_3=2.0,
        max_steering=0.8,
        max_hitch=1.2,
        max_speed=1.5,
    ),
    BOAT,
    BALLOON,
]
KINEMATIC = [model for model in MODELS if not model.reduced_names]
QUICK = ("balloon", "car", "car_with_trailer", "helicopter", "single_track")  # of every kind
every_model = pytest.mark.parametrize(
    "model",
    quick_are([model for model in MODELS if model.name in QUICK], MODELS),
    ids=lambda model: model.name,
)
SHARES = st.floats(-1.0, 1.0)


def sizes(model):
    return model.group.dof, len(model.reduced_names), len(model.control_names)


def within(limits, shares):
    """Values in the middle half of the limits, up to 1.5 where there are none."""
    low, high = np.clip(limits.T, -3.0, 3.0) if np.isinf(limits).any() else limits.T
    return (low + high) / 2.0 + np.asarray(shares) * (high - low) / 4.0


def states_of(model, shares):
    dof = model.group.dof
    shares = np.asarray(shares)
    reduced = within(model.reduced_limits, shares[..., dof:])
    return np.concatenate([1.5 * shares[..., :dof], reduced], axis=-1)


def drawn(model, data):
    dof, n_z, n_u = sizes(model)
    state = states_of(model, data.draw(arrays(np.float64, dof + n_z, elements=SHARES)))
    shares = data.draw(arrays(np.float64, n_u, elements=SHARES))
    return state, within(model.control_limits, shares)


@every_model
@given(data=st.data())
def test_vector_fields_are_equivariant(model, data):
    by = model.group(
        data.draw(arrays(np.float64, model.group.dof, elements=st.floats(-100.0, 100.0)))
    )
    state, control = drawn(model, data)
    rates = vector_field(model)(state, control)
    defect = equivariance_defect(vector_field(model), by, state=state, control=control)
    assert np.abs(defect).max() < 1e-11 * max(1.0, np.abs(rates).max())


@every_model
@settings(max_examples=10)
@given(data=st.data())
def test_a_moved_start_has_the_moved_motion(model, data):
    by = model.group(
        data.draw(arrays(np.float64, model.group.dof, elements=st.floats(-10.0, 10.0)))
    )
    state, control = drawn(model, data)
    times = np.linspace(0.0, 0.4, 5)
    here = rollout(model, state, control=control, times=times)
    there = rollout(model, moved_state(by, state), control=control, times=times)
    np.testing.assert_allclose(there, moved_state(by, here), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("model", KINEMATIC, ids=lambda model: model.name)
@settings(max_examples=10)
@given(data=st.data())
def test_kinematic_models_coast_along_one_parameter_groups(model, data):
    state, control = drawn(model, data)
    start = model.group(state)
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
    states = states_of(model, rng.uniform(-1, 1, (3, 1, dof + n_z)))
    controls = within(model.control_limits, rng.uniform(-1, 1, (4, n_u)))
    f, z = vector_field(model), states[..., dof:]
    table = f(states, controls)
    assert table.shape == (3, 4, dof + n_z)
    for i, j in np.ndindex(3, 4):
        np.testing.assert_allclose(
            table[i, j], f(states[i, 0], controls[j]), rtol=1e-14, atol=1e-15
        )
    many = np.broadcast_to(z[:1, 0], (7, n_z)), np.broadcast_to(controls[0], (7, n_u))
    assert model.body_velocity(z[:, 0], controls[0]).shape == (3, dof)
    assert model.reduced_dynamics(*many).shape == (7, n_z)
    assert model.body_velocity(*many).shape == (7, dof)
    assert model.part_poses(z[:, 0]).shape == (3, len(model.part_names), 3)


@every_model
@given(data=st.data())
def test_components_are_the_arrays(model, data):
    dof, n_z, _ = sizes(model)
    state, control = drawn(model, data)
    z, u = state[dof:].tolist(), control.tolist()
    np.testing.assert_array_equal(model.body_velocity(state[dof:], control), model.velocity(z, u))
    expected = np.array(model.dynamics(z, u)).reshape(n_z)
    np.testing.assert_allclose(
        model.reduced_dynamics(state[dof:], control), expected, rtol=1e-14, atol=1e-14
    )


@every_model
def test_symbols_are_the_numbers(model):
    import casadi

    from maneuver_automaton.optimal_control.ipopt import numpy_on_symbols

    dof, n_z, n_u = sizes(model)
    rng = np.random.default_rng(6)
    z, u = casadi.SX.sym("z", n_z), casadi.SX.sym("u", n_u)
    with numpy_on_symbols(casadi):
        parts = casadi.vertsplit(z) if n_z else [], casadi.vertsplit(u)
        velocity = casadi.vertcat(*model.velocity(*parts))
        dynamics = casadi.vertcat(*model.dynamics(*parts))
    f = casadi.Function("f", [z, u], [velocity, dynamics])
    for _ in range(5):
        state = states_of(model, rng.uniform(-1, 1, dof + n_z))[dof:]
        control = within(model.control_limits, rng.uniform(-1, 1, n_u))
        twist, rates = (np.array(value).ravel() for value in f(state, control))
        np.testing.assert_allclose(
            twist, model.body_velocity(state, control), rtol=1e-13, atol=1e-13
        )
        np.testing.assert_allclose(
            rates, model.reduced_dynamics(state, control), rtol=1e-13, atol=1e-13
        )


@every_model
def test_limits_have_a_row_for_each_name(model):
    _, n_z, n_u = sizes(model)
    assert model.control_limits.shape == (n_u, 2)
    assert model.reduced_limits.shape == (n_z, 2)


def test_names_and_limits_of_a_user_model_can_be_replaced():
    limited = dataclasses.replace(BOAT, control_limits=[[-1.0, 1.0], [-np.inf, np.inf]])
    assert limited.control_limits[0].tolist() == [-1.0, 1.0]
    assert BOAT.control_limits[0].tolist() == [-np.inf, np.inf]
