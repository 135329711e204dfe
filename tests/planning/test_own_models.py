"""Vehicles and libraries that users make themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.planning import PlanStatus
from maneuver_automaton.planning.polishing import NUMBERS_ALONE, _body_parts, why_not_polished

LENGTH, HITCH = 2.5, 3.0
RIG = ma.UserModel(
    name="rig",
    group=ma.SE2,
    control_names=("speed", "steering"),
    reduced_names=("hitch",),
    velocity=lambda z, u: [u[0], 0.0, u[0] * np.tan(u[1]) / LENGTH],
    dynamics=lambda z, u: [u[0] * np.tan(u[1]) / LENGTH - u[0] * np.sin(z[0]) / HITCH],
    control_limits=[[-1, 3], [-0.6, 0.6]],
    reduced_limits=[[-1, 1]],
    part_names=("trailer",),
    part_poses=lambda z: np.stack(
        [-HITCH * np.cos(z[..., 0]), HITCH * np.sin(z[..., 0]), -z[..., 0]], -1
    )[..., None, :],
)


def test_parts_of_a_users_model_are_polished():
    casadi = pytest.importorskip("casadi")
    assert RIG.part_frames([0.5]) == tuple(map(tuple, RIG.part_poses(np.array([0.5])).tolist()))
    rest = ma.trims_of(RIG, {"speed": [0.0, 1.0], "hitch": [0.0]}).trims
    problem = ma.Problem(
        ma.Automaton(RIG, rest), [0, 0, 0], [9, 0, 0], parts={"trailer": ma.Box([3.2, 1.7])}
    )
    (part,) = _body_parts(problem)
    hitch = casadi.SX.sym("hitch")
    seen = casadi.Function("seen", [hitch], list(part.pose([hitch])))
    assert [float(one) for one in seen(0.5)] == pytest.approx(RIG.part_poses(np.array([0.5]))[0])


def test_parts_that_take_numbers_alone_are_left_out_of_polishing():
    def seen(z):
        poses = np.zeros((*z.shape[:-1], 1, 3))
        poses[..., 0, 0] = -HITCH * np.cos(np.asarray(z[..., 0], dtype=np.float64))
        return poses

    rig = replace(RIG, part_poses=seen)
    trims = ma.trims_of(rig, {"speed": [0.0, 1.0], "hitch": [0.0]}).trims
    problem = ma.Problem(
        ma.Automaton(rig, trims), [0, 0, 0], [9, 0, 0], parts={"trailer": ma.Box([3.2, 1.7])}
    )
    assert why_not_polished(problem) == NUMBERS_ALONE


def test_trims_without_maneuvers_coast():
    robot = ma.SecondOrderUnicycle(
        max_speed=1, max_turn_rate=1, max_acceleration=1, max_angular_acceleration=1
    )
    library = ma.Automaton(robot, ma.trims_of(robot, {"speed": [0, 1], "turn_rate": [0]}).trims)
    (ahead,) = (trim.name for trim in library.trims if not trim.is_rest)
    problem = ma.Problem(library, [0, 0, 0], ma.Goal([5, 0, 0], trim=ahead), start_trim=ahead)
    result = ma.plan(problem)
    assert result.cost == pytest.approx(5.0, abs=1e-9)
    assert result.plan.word == (ahead,)


def test_trims_without_maneuvers_say_why_they_do_not_lead_there():
    robot = ma.SecondOrderUnicycle(
        max_speed=1, max_turn_rate=1, max_acceleration=1, max_angular_acceleration=1
    )
    library = ma.Automaton(robot, ma.trims_of(robot, {"speed": [0, 1], "turn_rate": [0]}).trims)
    rest, ahead = library.trim_names

    def asked(pose, last, **more):
        goal = ma.Goal(pose, trim=last)
        return ma.plan(ma.Problem(library, [0, 0, 0], goal, start_trim=ahead, **more))

    for pose, last, why in (
        ([5, 0, 0], rest, f"no maneuvers of the library lead from trim {ahead!r} to {rest!r}"),
        ([5, 1, 0], ahead, f"has no maneuvers, and to coast in trim {ahead!r} leads to no goal"),
    ):
        result = asked(pose, last)
        assert (result.status, why in result.reason) == (PlanStatus.NO_PLAN, True)
    hit = asked([5, 0, 0], ahead, obstacles=[ma.Disc(0.5, [2, 0])], footprint=ma.Disc(0.2))
    assert hit.status is PlanStatus.NO_PLAN
    assert hit.reason.endswith("leads to no goal or meets an obstacle")


def crane(n):
    model = ma.UserModel(
        name="crane",
        group=ma.translations(n),
        control_names=("v_x", "v_y", "v_z", "v_a")[:n],
        velocity=lambda z, u: [*u],
    )
    axes = np.concatenate([np.eye(n), -np.eye(n)])
    return ma.Automaton.of_controls(model, {str(row): row for row in axes})


@pytest.mark.parametrize("goal", [[1, 2, 3], [0, 0, -2], [1, 0, 3]])
def test_a_vehicle_that_rises_on_the_spot(goal):
    """By hand: the sum of the ways along the axes at 1 m/s."""
    problem = ma.Problem(crane(3), [0, 0, 0], goal)
    assert ma.plan(problem).cost == pytest.approx(np.abs(goal).sum(), abs=1e-9)
    assert ma.lower_bound(problem, time_limit=1.0).value <= np.abs(goal).sum()


def test_other_groups_are_not_planned_in():
    with pytest.raises(ValueError, match="the crane moves in Translations4, and plans are for SE2"):
        ma.Problem(crane(4), [0, 0, 0, 0], [1, 2, 3, 4])


def test_a_vehicle_without_inertia_is_not_polished_beyond_its_library():
    trims = [
        ma.Trim(name=name, body_velocity=[speed, 0, turn], control=[speed, turn], max_duration=60)
        for name, speed, turn in (("rest", 0, 0), ("ahead", 1, 0), ("left", 1, 1))
    ]
    problem = ma.Problem(ma.Automaton(ma.Unicycle(), tuple(trims)), [0, 0, 0], [5, 0, 0])
    assert ma.plan(problem).cost == pytest.approx(5.0, abs=1e-9)


def test_no_bound_forgets_how_fast_a_vehicle_climbs():
    plane = ma.UserModel(
        name="plane",
        group=ma.SE2xR,
        control_names=("speed", "turn_rate", "climb"),
        velocity=lambda z, u: [u[0], 0.0 * u[0], u[1], u[2]],
    )
    controls = {"level": (1, 0, 0), "left": (1, 1, 0), "up": (1, 0, 0.5), "down": (1, 0, -0.25)}
    library = ma.Automaton.of_controls(plane, controls)
    for height, least in ((10.0, 20.0), (-10.0, 40.0), (1.0, 10.0)):
        problem = ma.Problem(library, [0, 0, 0, 0], [10, 0, 0, height])
        assert ma.lower_bound(problem, time_limit=0.1).value >= least * (1.0 - 1e-12)
    helicopter = ma.load_stock_library("helicopter")
    fastest = helicopter.model.max_climb
    problem = ma.Problem(helicopter, [0, 0, 0, 0], [10, 0, 0, 20])
    assert ma.lower_bound(problem, time_limit=0.1).value >= 20.0 / fastest * (1.0 - 1e-12)
