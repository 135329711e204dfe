"""The best pace: by hand, against a general optimiser, with limits, and moved."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Car, Unicycle, UserModel
from maneuver_automaton.primitives import Trim
from maneuver_automaton.refinement.retiming import effort_report, retime
from tests.quickly import draws

MATRIX = np.array([[4.0, -1.5], [-1.5, 1.0]])
CONTROLS = {
    "straight": (1.5, 0.0),
    "clockwise": (-0.25, -1.0),
    "anticlockwise": (-0.25, 1.0),
    "spin": (0.0, 1.0),
    "rest": (0.0, 0.0),
}
ROBOT = Automaton.of_controls(Unicycle(), CONTROLS)


def plan_of(word, durations, *, start=(0.3, -1.0, 0.7)):
    return Plan(np.array(start), tuple(ROBOT[name] for name in word), durations=durations)


def random_plan(rng):
    """A word of up to six trims with random controls, rests among them."""
    n = int(rng.integers(1, 7))
    controls = np.where(rng.random((n, 1)) < 0.2, 0.0, rng.normal(size=(n, 2)))
    controls[0] += 0.01
    trims = tuple(
        Trim(name=f"trim {k}", body_velocity=[u[0], 0.0, u[1]], control=u)
        for k, u in enumerate(controls)
    )
    return Plan(rng.normal(size=3), trims, durations=rng.uniform(0.2, 3.0, n), start_time=1.5)


plans = st.integers(0, 10_000).map(lambda seed: random_plan(np.random.default_rng(seed)))
costs = st.sampled_from(
    [
        Cost(effort=1.0),
        Cost(effort=2.0, norm=0.5, effort_matrix=MATRIX),
        Cost(effort=1.0, norm=0.3, norm_order=1.0, time=0.2, length=0.1),
    ]
)


def lengths_of(plan, matrix):
    controls = np.array([trim.control for trim in plan.trims])
    return np.sqrt(np.einsum("ni,ij,nj->n", controls, matrix, controls)) * plan.durations


@given(plan=plans, cost=costs)
def test_without_limits_the_effort_becomes_uniform(plan, cost):
    found = retime(plan, Unicycle(), cost=cost)
    matrix = np.eye(2) if cost.effort_matrix is None else cost.effort_matrix
    before, after = (effort_report(one, cost.effort_matrix) for one in (plan, found.after))
    assert after.uniform
    assert not any(found.at_limit)
    assert found.after.duration == pytest.approx(plan.duration, rel=1e-13)
    assert found.after.start_time == plan.start_time
    np.testing.assert_allclose(found.after.end, plan.end, atol=1e-9)
    quadratic = lengths_of(plan, matrix).sum() ** 2 / plan.duration
    assert after.cost == pytest.approx(quadratic, rel=1e-12)
    assert before.uniform_cost == pytest.approx(quadratic, rel=1e-12)
    assert found.saving >= -1e-12
    # nothing but the effort changes
    assert found.saving == pytest.approx(cost.effort * before.saving, abs=1e-9)


@given(plan=plans, cost=costs, seed=st.integers(0, 1000))
def test_a_moved_plan_has_the_moved_retiming(plan, cost, seed):
    by = SE2(np.random.default_rng(seed).normal(size=3) * [50.0, 50.0, 4.0])
    here, there = retime(plan, Unicycle(), cost=cost), retime(plan.moved(by), Unicycle(), cost=cost)
    np.testing.assert_allclose(there.after.durations, here.after.durations, rtol=1e-13)
    np.testing.assert_allclose(there.after.end, (by @ SE2(here.after.end)).pose, atol=1e-9)
    assert there.cost_after == pytest.approx(here.cost_after, rel=1e-13)


@settings(max_examples=draws(40))
@given(plan=plans, cost=costs, room=st.floats(1.02, 2.0), seed=st.integers(0, 1000))
def test_with_limits_a_general_optimiser_finds_the_same(plan, cost, room, seed):
    rng = np.random.default_rng(seed)
    controls = np.array([trim.control for trim in plan.trims])
    greatest = np.abs(controls).max(axis=0) * room * rng.uniform(0.9, 1.5, 2)
    greatest = np.maximum(greatest, 1e-3)
    limits = np.stack([-greatest, greatest], axis=-1)
    moving = controls.any(axis=1)
    matrix = np.eye(2) if cost.effort_matrix is None else cost.effort_matrix
    lengths = lengths_of(plan, matrix)[moving]
    least = (plan.durations[:, None] * np.abs(controls) / greatest).max(axis=1)[moving]
    if least.sum() > plan.duration:
        with pytest.raises(ValueError, match="the path takes at least"):
            retime(plan, Unicycle(), cost=cost, limits=limits)
        return
    found = retime(plan, Unicycle(), cost=cost, limits=limits)
    np.testing.assert_allclose(found.after.end, plan.end, atol=1e-9)
    assert found.after.duration == pytest.approx(plan.duration, rel=1e-12)
    driven = np.array([trim.control for trim in found.after.trims])
    assert (np.abs(driven) <= greatest).all()
    reference = minimize(
        lambda times: float((lengths**2 / times).sum()),
        least + (plan.duration - least.sum()) / len(least),
        jac=lambda times: -((lengths / times) ** 2),
        bounds=[(low, plan.duration) for low in least],
        constraints={
            "type": "eq",
            "fun": lambda times: times.sum() - plan.duration,
            "jac": lambda times: np.ones(len(times)),
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    mine = float((lengths**2 / found.after.durations).sum())
    assert mine <= reference.fun * (1.0 + 1e-9)
    assert mine == pytest.approx(reference.fun, rel=1e-6)
    # the optimality conditions, whatever the optimiser says: one level, the others at their limit
    efforts = effort_report(found.after, cost.effort_matrix).efforts
    level = efforts.max()
    unlimited = (greatest**2 / np.diag(np.linalg.inv(matrix))).min()  # Cor. 19
    for effort, stuck in zip(efforts, found.at_limit, strict=True):
        assert effort == pytest.approx(level, rel=1e-9) or (stuck and effort < level)
        assert effort >= min(level, unlimited) * (1.0 - 1e-9)


def test_water_filling_by_hand():
    # straight is held at 1.5 m/s; spin takes what is left
    plan = plan_of(["straight", "spin", "rest"], [2.0, 1.0, 2.0])
    found = retime(plan, Unicycle(max_speed=0.75, max_turn_rate=4.0))
    assert found.at_limit == (True, False)
    np.testing.assert_allclose(found.after.durations, [4.0, 1.0])
    np.testing.assert_allclose(found.paces, [0.5, 1.0])
    assert found.after.word == ("straight x0.5", "spin")
    assert found.cost_before == 5.5
    assert found.cost_after == 4 * 0.75**2 + 1.0


def test_rests_give_their_time_and_leave():
    found = retime(plan_of(["rest", "spin", "rest"], [1.0, 2.0, 1.0]), Unicycle())
    assert found.after.word == ("spin x0.5",)
    assert (found.cost_before, found.cost_after, found.saving) == (2.0, 1.0, 1.0)
    for still in (plan_of(["rest"], [3.0]), plan_of([], [])):
        found = retime(still, Unicycle())
        assert found.after is still
        assert found.saving == 0.0


def test_a_uniform_plan_stays_as_it_is():
    plan = plan_of(["anticlockwise", "clockwise"], [1.0, 2.0])
    found = retime(plan, Unicycle())
    assert found.after.word == plan.word
    np.testing.assert_allclose(found.after.durations, plan.durations, rtol=1e-14)


def test_scaled_trims_keep_what_limits_their_path():
    trim = dataclasses.replace(ROBOT["spin"], max_duration=3.0)
    plan = Plan(np.zeros(3), (trim, ROBOT["rest"]), durations=[2.0, 2.0])
    (scaled,) = retime(plan, Unicycle()).after.trims
    assert scaled.max_duration == 6.0
    np.testing.assert_array_equal(scaled.body_velocity, [0.0, 0.0, 0.5])


def test_a_plan_too_fast_for_its_limits_is_slowed_if_there_is_time():
    plan = plan_of(["straight", "rest"], [1.0, 1.0])
    found = retime(plan, Unicycle(max_speed=1.0))
    np.testing.assert_allclose(found.after.durations, [2.0])
    with pytest.raises(ValueError) as error:
        retime(plan, Unicycle(max_speed=0.5))
    assert str(error.value) == (
        "retime: the path takes at least 3 s within the limits on the controls, the plan lasts "
        "2 s; need wider limits or a longer plan"
    )


def test_a_path_that_takes_all_the_time_runs_at_its_limits():
    plan = plan_of(["straight", "spin"], [1.0, 2.0])
    found = retime(plan, Unicycle(max_speed=1.5, max_turn_rate=1.0))
    assert found.after.word == plan.word
    np.testing.assert_allclose(found.after.durations, [1.0, 2.0])
    assert all(found.at_limit)


def test_the_car_scales_on_straights_only():
    car = Car(wheelbase=2.5, max_steering=0.6)
    library = Automaton.of_controls(car, {"ahead": (2.0, 0.0), "left": (2.0, 0.5), "rest": (0, 0)})
    straight = Plan(np.zeros(3), (library["ahead"], library["rest"]), durations=[1.0, 1.0])
    assert retime(straight, car).cost_after == 2.0
    curved = Plan(np.zeros(3), (library["ahead"], library["left"]), durations=[1.0, 1.0])
    with pytest.raises(ValueError) as error:
        retime(curved, car)
    assert str(error.value) == (
        "retime: at 0.5 times the control of trim 'left' the car moves with (1, 0, 0.1021), not "
        "(1, 0, 0.2185), so it leaves the path; need a vehicle whose body velocity scales with "
        "its control"
    )


def test_inertia_and_drift_and_other_vehicles_are_refused():
    plan = plan_of(["straight", "rest"], [1.0, 1.0])
    boat = UserModel(
        name="boat", group=SE2, control_names=("push", "turn"), reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, u[1]], dynamics=lambda z, u: [u[0] - z[0]],
    )  # fmt: skip
    with pytest.raises(ValueError, match="the boat has the reduced state speed, so it cannot"):
        retime(plan, boat)
    raft = UserModel(
        name="raft", group=SE2, control_names=("speed", "turn"),
        velocity=lambda z, u: [u[0], 0.2, u[1]],
    )  # fmt: skip
    with pytest.raises(ValueError) as error:
        retime(plan, raft)
    assert str(error.value) == (
        "retime: trim 'straight' moves with (1.5, 0, 0), but at its control the raft moves with "
        "(1.5, 0.2, 0); need the vehicle of the plan"
    )
    drifting = Automaton.of_controls(raft, {"go": (1.0, 0.0)}).trims
    with pytest.raises(ValueError, match=r"the raft moves with \(0.5, 0.2, 0\), not \(0.5, 0.1, 0"):
        retime(Plan(np.zeros(3), drifting, durations=[1.0]), raft)


def test_costs_and_limits_are_checked():
    plan = plan_of(["straight", "rest"], [1.0, 1.0])
    with pytest.raises(ValueError) as error:
        retime(plan, Unicycle(), cost=Cost(time=1.0))
    assert (
        str(error.value) == "retime: the cost has no effort, need one whose terms() have effort > 0"
    )
    with pytest.raises(ValueError, match=r"limits: got shape \(2,\), need \(2, 2\): least and"):
        retime(plan, Unicycle(), limits=[-1.0, 1.0])
    with pytest.raises(ValueError) as error:
        retime(plan, Unicycle(), limits=[[0.5, 2.0], [-1.0, 1.0]])
    assert str(error.value) == ("retime: limits: speed needs least <= 0 <= greatest, got (0.5, 2)")
    with pytest.raises(ValueError) as error:
        retime(plan, Unicycle(), limits=[[-1.0, 0.0], [-1.0, 1.0]])
    assert str(error.value) == (
        "retime: trim 'straight' needs speed, whose limit is 0; need a wider one"
    )
