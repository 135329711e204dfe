"""Arc length, curvature, accelerations and jerk, against derivatives of an ODE solver's motion."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from maneuver_automaton import (
    Car,
    Hovercraft,
    Omnidirectional,
    Plan,
    SecondOrderCar,
    SecondOrderUnicycle,
    Unicycle,
    save_csv,
)
from maneuver_automaton.models import CarWithTrailer, SingleTrack
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from tests.quickly import quick_are

SECOND_ORDER = SecondOrderCar(
    wheelbase=2.0, max_steering=0.7, max_speed=5.0, max_acceleration=2.0, max_steering_rate=1.0
)
ROBOT = SecondOrderUnicycle(
    max_speed=3.0, max_turn_rate=3.0, max_acceleration=2.0, max_angular_acceleration=3.0
)
HOVERCRAFT = Hovercraft(
    mass=1.0, inertia=0.1, max_force=2.0, max_torque=0.5, drag=0.5, lateral_drag=2.0,
    turn_drag=0.2, max_speed=5.0, max_turn_rate=3.0,
)  # fmt: skip
SEGMENT, DENSE, H = 0.6, 30, 1e-3  # [s] a control, samples in it, [s] of differences


class Driven:
    """A model driven from a state by controls that hold for `SEGMENT` each, by an ODE solver."""

    def __init__(self, model, state, controls):
        self.model, self.controls = model, np.array(controls, dtype=float)
        self.pieces, at = [], np.concatenate([np.zeros(model.group.dof), state])
        for k, control in enumerate(self.controls):
            span = (k * SEGMENT, (k + 1) * SEGMENT)
            run = solve_ivp(
                self.rates(control), span, at, rtol=1e-12, atol=1e-13, dense_output=True
            )
            self.pieces.append(run.sol)
            at = run.y[:, -1]
        self.duration = SEGMENT * len(controls)

    def rates(self, control):
        dof = self.model.group.dof

        def rates(_, x):
            v = self.model.body_velocity(x[dof:], control)
            cos, sin = np.cos(x[2]), np.sin(x[2])
            pose = [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], *v[2:]]
            return np.concatenate([pose, self.model.reduced_dynamics(x[dof:], control)])

        return rates

    def at(self, times):
        k = np.minimum((times / SEGMENT + 1e-9).astype(int), len(self.pieces) - 1)
        return np.array([self.pieces[i](t) for i, t in zip(k, times, strict=True)])

    def plan(self):
        times = np.linspace(0.0, self.duration, DENSE * len(self.controls) + 1)
        states, dof = self.at(times), self.model.group.dof
        held = np.repeat(self.controls, DENSE, axis=0)
        course = Trajectory(
            time=times, pose=states[:, :dof], reduced_state=states[:, dof:],
            control=np.concatenate([held, held[-1:]]),
        )  # fmt: skip
        trims = [
            Trim(name=name, body_velocity=np.zeros(dof), control=np.zeros(held.shape[1]),
                 reduced_state=np.zeros(states.shape[1] - dof))
            for name in ("a", "b")
        ]  # fmt: skip
        one = Maneuver.along(course, name="driven", source="a", target="b")
        return Plan(np.zeros(dof), tuple(trims), durations=[0.0, 0.0], maneuvers=(one,))

    def differences(self, times):
        """Speed ahead, path's curvature, acceleration and jerk in the body's axes, from places."""
        x = np.array([self.at(times + k * H) for k in range(-3, 4)])
        place, heading = x[:, :, :2], x[3, :, 2]
        velocity = (place[4] - place[2]) / (2 * H)
        second = (place[2:5:2].sum(axis=0) - 2 * place[3]) / H**2
        ahead, _ = _axes(heading)
        felt = []
        for k in (2, 3, 4):
            there = (place[k - 1] + place[k + 1] - 2 * place[k]) / H**2
            felt.append([np.sum(there * axis, axis=1) for axis in _axes(x[k, :, 2])])
        jerk = (np.array(felt[2]) - np.array(felt[0])) / (2 * H)
        cross = velocity[:, 0] * second[:, 1] - velocity[:, 1] * second[:, 0]
        speed = np.sum(velocity * ahead, axis=1)
        return speed, cross / np.linalg.norm(velocity, axis=1) ** 3, np.array(felt[1]), jerk


def _axes(heading):
    return (np.stack([np.cos(heading), np.sin(heading)], axis=-1),
            np.stack([-np.sin(heading), np.cos(heading)], axis=-1))  # fmt: skip


def table(path):
    with Path(path).open() as stream:
        rows = list(csv.DictReader(stream))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]
            if key != "primitive"}  # fmt: skip


def random_controls(model, seed, count=5):
    limits = np.clip(model.control_limits, -2.0, 2.0)
    return np.random.default_rng(seed).uniform(*limits.T, size=(count, len(limits)))


CASES = [
    (SECOND_ORDER, [0.5, 0.1], 0),
    (ROBOT, [-0.5, 0.3], 0),
    (HOVERCRAFT, [0.8, -0.2, 0.4], 1),
]


@pytest.mark.parametrize(("model", "state", "seed"), CASES)
@pytest.mark.parametrize("rate", quick_are([7.3], [100.0 / 3.0, 7.3]))
def test_they_are_the_derivatives_of_the_motion(model, state, seed, rate, tmp_path):
    driven = Driven(model, np.array(state), random_controls(model, seed))
    save_csv(driven.plan(), tmp_path / "a.csv", step=1.0 / rate, model=model)
    found = table(tmp_path / "a.csv")
    times = found["time_s"]
    x = driven.at(np.linspace(0.0, driven.duration, 6001))
    upto = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(x[:, :2], axis=0), axis=1)))
    length = np.interp(times, np.linspace(0.0, driven.duration, 6001), upto)
    np.testing.assert_allclose(found["arc_length_m"], length, atol=2e-4)
    inside = np.abs((times / SEGMENT + 0.5) % 1.0 - 0.5) > 0.01  # away from jumps of the control
    speed, bend, felt, jerk = driven.differences(times[inside])
    near = {"rtol": 2e-3, "atol": 2e-3}
    np.testing.assert_allclose(found["acceleration_m_s2"][inside], felt[0], **near)
    np.testing.assert_allclose(found["lateral_acceleration_m_s2"][inside], felt[1], **near)
    np.testing.assert_allclose(found["jerk_m_s3"][inside], jerk[0], rtol=1e-2, atol=1e-2)
    np.testing.assert_allclose(found["lateral_jerk_m_s3"][inside], jerk[1], rtol=1e-2, atol=1e-2)
    fast = np.abs(speed) > 0.2
    signed = bend if model is HOVERCRAFT else bend * np.sign(speed)  # a car's, by its wheel
    np.testing.assert_allclose(found["curvature_1_m"][inside][fast], signed[fast], **near)


def test_of_the_second_order_car_they_are_exact(tmp_path):
    driven = Driven(SECOND_ORDER, np.array([-0.4, 0.2]), [(1.5, -0.5), (-1.0, 0.5)])
    save_csv(driven.plan(), tmp_path / "a.csv", step=0.037, model=SECOND_ORDER)
    found = table(tmp_path / "a.csv")
    t = found["time_s"]
    first = t < SEGMENT - 1e-9
    speed = np.where(first, -0.4 + 1.5 * t, 0.5 - 1.0 * (t - SEGMENT))
    steering = np.where(first, 0.2 - 0.5 * t, -0.1 + 0.5 * (t - SEGMENT))
    bend = np.tan(steering) / 2.0
    np.testing.assert_allclose(found["steering_rad"], steering, atol=1e-10)
    np.testing.assert_allclose(found["curvature_1_m"], bend, atol=1e-9)
    np.testing.assert_allclose(found["lateral_acceleration_m_s2"], speed**2 * bend, atol=1e-9)
    np.testing.assert_allclose(found["acceleration_m_s2"], np.where(first, 1.5, -1.0), atol=1e-12)
    a, rate = np.where(first, 1.5, -1.0), np.where(first, -0.5, 0.5)
    jerk = 2.0 * speed * a * bend + speed**2 * rate / (2.0 * np.cos(steering) ** 2)
    np.testing.assert_allclose(found["lateral_jerk_m_s3"], jerk, atol=1e-8)
    turned = 0.4 / 1.5  # it stops and sets off the other way
    length = np.where(t < turned, 0.4 * t - 0.75 * t**2,
                      0.4**2 / 3.0 + 0.75 * (t - turned) ** 2)  # fmt: skip
    np.testing.assert_allclose(found["arc_length_m"][first], length[first], atol=1e-10)


def test_columns_are_those_that_the_vehicle_has(tmp_path):
    turns = {"control": [1.0, 0.2], "body_velocity": [1.0, 0.0, 0.1]}
    plan = Plan([0, 0, 0], (Trim(name="left", **turns),), durations=[1.0])
    extra = ["arc_length_m", "curvature_1_m"]
    for model, expected in (
        (None, extra),
        (Unicycle(), [*extra, "lateral_acceleration_m_s2"]),
        (Car(wheelbase=2.0), [*extra, "steering_rad", "lateral_acceleration_m_s2"]),
    ):
        save_csv(plan, tmp_path / "a.csv", step=0.5, model=model)
        header = (tmp_path / "a.csv").read_text().splitlines()[0].split(",")
        assert header[header.index("arc_length_m") :] == [*expected, "primitive"]


@pytest.mark.parametrize(
    ("model", "state", "has"),
    [
        (
            CarWithTrailer(wheelbase=2.0, hitch_length=3.0, max_steering=0.6, max_speed=2.0),
            [0.1],
            False,
        ),
        (SingleTrack(), None, True),
        (SECOND_ORDER, [1.0, 0.1], True),
    ],
)
def test_acceleration_is_of_what_has_inertia(model, state, has, tmp_path):
    if state is None:
        state = np.zeros(len(model.reduced_names))
        state[0] = 8.0
    driven = Driven(model, np.array(state), [(0.5, 0.1), (-0.3, -0.1)])
    save_csv(driven.plan(), tmp_path / "a.csv", step=0.02, model=model)
    found = table(tmp_path / "a.csv")
    assert ("acceleration_m_s2" in found) == ("jerk_m_s3" in found) == has
    assert "steering_rad" in found


def test_at_rest_and_on_the_spot(tmp_path):
    spin = Trim(name="spin", body_velocity=[0.0, 0.0, 1.0], control=[0.0, 1.0])
    rest = Trim(name="rest", body_velocity=[0.0, 0.0, 0.0], control=[0.0, 0.0])
    plan = Plan([0, 0, 0], (spin, rest), durations=[1.0, 1.0])
    save_csv(plan, tmp_path / "a.csv", step=0.5, model=Unicycle())
    found = table(tmp_path / "a.csv")
    assert np.isnan(found["curvature_1_m"]).tolist() == [True, True, False, False, False]
    assert found["arc_length_m"].tolist() == [0.0] * 5
    still = Trim(name="still", body_velocity=[0, 0, 0], control=[0, 0.3])
    save_csv(Plan([0, 0, 0], (still,), durations=[1.0]), tmp_path / "a.csv", step=0.5,
             model=Car(wheelbase=2.0))  # fmt: skip
    np.testing.assert_allclose(table(tmp_path / "a.csv")["curvature_1_m"], np.tan(0.3) / 2.0)
    aside = Trim(name="aside", body_velocity=[0.0, 1.0, 0.5], control=[0.0, 1.0, 0.5])
    save_csv(Plan([0, 0, 0], (aside,), durations=[1.0]), tmp_path / "a.csv", step=0.5,
             model=Omnidirectional(max_speed=1.0, max_turn_rate=1.0))  # fmt: skip
    np.testing.assert_allclose(table(tmp_path / "a.csv")["curvature_1_m"], 0.5)
