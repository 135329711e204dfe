"""Maneuvers between trims: exact ends, proof by an ODE solver, reasons where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.models import CarWithTrailer, Hovercraft, SingleTrack, UserModel
from maneuver_automaton.optimal_control.maneuvers import transfer_program
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.connecting import Inputs, closed, connect, maneuver_defect
from maneuver_automaton.primitives.equilibrium import trims_of
from tests.inertia import HELICOPTER
from tests.reference_dynamics import trim_defect

CRAFT = Hovercraft(
    mass=2.0, inertia=0.1, drag=1.0, lateral_drag=3.0, turn_drag=0.1, max_force=4.0,
    max_torque=0.2, max_speed=3.0,
)  # fmt: skip
TRAILER = CarWithTrailer(
    wheelbase=2.5, hitch_length=3.0, max_steering=0.6, max_speed=3.0, min_speed=-1.0, max_hitch=1.0
)
CASES = [
    (CRAFT, {"speed": [0.0, 1.5], "turn_rate": [-0.5, 0.5]}),
    (HELICOPTER, {"speed": [0.0, 8.0], "turn_rate": [0.3], "climb": [-2.0, 1.0]}),
    (SingleTrack(), {"speed": [15.0, 20.0], "turn_rate": [0.0, 0.2]}),
    (TRAILER, {"speed": [2.0, -1.0], "hitch": [0.0, 0.5]}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("model", "grid"), CASES, ids=lambda case: getattr(case, "name", ""))
def test_every_pair_ends_in_its_target_to_rounding(model, grid):
    trims = trims_of(model, grid).trims
    program = transfer_program(model)
    low, high = model.control_limits.T
    for source, target in zip(trims, (*trims[1:], trims[0]), strict=True):
        assert trim_defect(model, source) < 1e-8
        if np.array_equal(source.reduced_state, target.reduced_state):
            continue
        found = connect(model, source, target, program=program)
        maneuver = found.maneuver
        assert maneuver is not None, found.reason
        course = maneuver.course
        assert np.abs(course.reduced_state[-1] - target.reduced_state).max() <= 1e-10
        assert found.defect < 1e-6
        assert maneuver_defect(model, maneuver, source=source, target=target) == found.defect
        assert (course.control >= low).all()
        assert (course.control <= high).all()
        inside = model.reduced_limits + np.array([-1e-8, 1e-8])
        assert (course.reduced_state >= inside[:, 0]).all()
        assert (course.reduced_state <= inside[:, 1]).all()


def test_closing_moves_little_and_hits():
    rng = np.random.default_rng(0)
    control = rng.uniform(-1.0, 1.0, size=(10, 2)) * [3.0, 0.15]
    control[3] = [4.0, 0.2]  # both at their limits
    inputs = Inputs(control=control, interval=0.1)
    end = inputs.drive(CRAFT, np.zeros(3)).reduced_state[-1] + [1e-4, -1e-4, 1e-4]
    limits = CRAFT.control_limits
    exact, _ = closed(CRAFT, np.zeros(3), end, inputs=inputs, limits=limits)
    assert np.abs(exact.drive(CRAFT, np.zeros(3)).reduced_state[-1] - end).max() < 1e-13
    assert np.abs(exact.control - control).max() < 0.01
    assert np.abs(exact.control[3] - control[3]).max() < 1e-10
    assert (np.abs(exact.control) <= limits[:, 1]).all()


def test_a_target_outside_the_limits_is_named():
    rest = trims_of(CRAFT, {"speed": [0.0], "turn_rate": [0.0]}).trims[0]
    fast = Trim(name="fast", body_velocity=[3.5, 0, 0], control=[3.5, 0], reduced_state=[3.5, 0, 0])
    found = connect(CRAFT, rest, fast)
    assert found.maneuver is None
    assert found.reason == "trim 'fast': speed = 3.5 is outside [-3, 3]"


def test_an_unreachable_target_is_named():
    sledge = UserModel(
        name="sledge", group=CRAFT.group, control_names=("push",), reduced_names=("speed", "heat"),
        velocity=lambda z, u: [z[0], 0.0, 0.0], dynamics=lambda z, u: [u[0], z[0] ** 2],
        control_limits=[[-1.0, 1.0]],
    )  # fmt: skip
    cold = Trim(name="cold", body_velocity=[0, 0, 0], control=[0], reduced_state=[0, 1.0])
    colder = Trim(name="colder", body_velocity=[0, 0, 0], control=[0], reduced_state=[0, 0.0])
    found = connect(sledge, cold, colder)
    assert found.maneuver is None
    assert found.reason.startswith("the solver ended with ")


def test_where_nothing_moves_on_the_straight_line_a_swing_helps():
    sledge = UserModel(
        name="sledge", group=CRAFT.group, control_names=("push",), reduced_names=("speed", "heat"),
        velocity=lambda z, u: [z[0], 0.0, 0.0], dynamics=lambda z, u: [u[0], z[0] ** 2],
        control_limits=[[-1.0, 1.0]],
    )  # fmt: skip
    cold = Trim(name="cold", body_velocity=[0, 0, 0], control=[0], reduced_state=[0, 0.0])
    warm = Trim(name="warm", body_velocity=[0, 0, 0], control=[0], reduced_state=[0, 1.0])
    found = connect(sledge, cold, warm)
    assert found.tries > 1
    assert found.maneuver.duration == pytest.approx(2.0 * 1.5 ** (1.0 / 3.0), rel=1e-3)


def test_trims_of_one_class_need_no_maneuver():
    rest = trims_of(CRAFT, {"speed": [0.0], "turn_rate": [0.0]}).trims[0]
    with pytest.raises(ValueError) as error:
        connect(CRAFT, rest, rest)
    assert str(error.value) == (
        "connect: trims 'speed 0, turn_rate 0' and 'speed 0, turn_rate 0' have one reduced state, "
        "so the vehicle switches between them at will; need two trims of different reduced state"
    )


def test_trims_of_another_vehicle():
    rest = trims_of(CRAFT, {"speed": [0.0], "turn_rate": [0.0]}).trims[0]
    other = Trim(name="other", body_velocity=[0, 0, 0], control=[0, 0], reduced_state=[0])
    with pytest.raises(ValueError) as error:
        connect(CRAFT, rest, other)
    assert str(error.value) == (
        "trim 'other': reduced state has 1 components, need 3 (speed, lateral_speed, turn_rate) "
        "for the hovercraft"
    )
