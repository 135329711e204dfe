"""Forklift, four-wheel steering, wheel loader, trailers: libraries, symmetry, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.automaton.building import build_library
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.models import (
    ArticulatedVehicle,
    FourWheelSteeringCar,
    RearSteeredCar,
    TractorWithTrailers,
)
from maneuver_automaton.primitives import trims_of
from maneuver_automaton.scenario import scenario_of_text
from tests.reference_dynamics import trim_defect

SCENARIOS = Path(__file__).parents[2] / "scenarios"
LOADER = {"front": 1.5, "rear": 1.9, "max_articulation": 0.7, "max_articulation_rate": 0.35}
TRAIN = {"wheelbase": 1.2, "hitch_length": 1.4, "max_steering": 0.8, "max_hitch": 1.2}


def test_a_single_trailer_has_a_library_in_seconds():
    model = TractorWithTrailers(**TRAIN, max_speed=1.5, hitch_offset=0.3)
    found = trims_of(model, {"speed": [1.5, -1.5], "steering": [0.0, 0.3]})
    build = build_library(model, found.trims, keep_sign=["speed"])
    assert (len(build.automaton), len(build.automaton.maneuvers)) == (4, 4)
    assert build.worst_defect < 1e-8
    assert all(trim_defect(model, trim) < 1e-8 for trim in build.automaton.trims)
    circle = build.automaton["speed 1.5, steering 0.3"]
    radius = 1.5 / circle.body_velocity[2]
    behind = math.sqrt(radius**2 + 0.3**2 - model.hitch_length**2)  # of the trailer's axle
    axle = model.part_poses(circle.reduced_state)[0, :2]
    assert math.hypot(axle[0], axle[1] - radius) == pytest.approx(behind)


@pytest.mark.parametrize("name", ["rear_steered_forklift", "wheel_loader"])
def test_a_moved_problem_has_the_moved_plan(name):
    problem = ma.load_scenario(SCENARIOS / f"{name}.yaml").problem
    problem = replace(
        problem,
        search=replace(problem.search, max_expansions=3000, improve=False),
        obstacles=(),
    )
    by = ma.SE2([7.0, -3.0, 1.1])
    goal = ma.Goal((by @ ma.SE2(problem.goals[0].pose)).pose)
    moved = replace(problem, start=(by @ ma.SE2(problem.start)).pose, goals=(goal,))
    here, there = (ma.plan(one, time_limit=60.0) for one in (problem, moved))
    assert there.cost == pytest.approx(here.cost, rel=1e-6)
    np.testing.assert_allclose(
        [there.plan.pose_at(t)[:2] for t in (0.5, 1.5)],
        [(by @ ma.SE2(here.plan.pose_at(t))).pose[:2] for t in (0.5, 1.5)],
        atol=1e-6,
    )


def test_four_wheels_go_aside_and_turn_about_their_middle():
    car = FourWheelSteeringCar(wheelbase=3.0, max_steering=1.5)
    aside, turn = car.body_velocity(np.zeros(0), np.array([[1.0, 1.5, 1.5], [1.0, 1.5, -1.5]]))
    assert math.atan2(aside[1], aside[0]) == pytest.approx(1.5)
    assert aside[2] == 0.0
    assert abs(turn[0] / turn[2]) < 0.11  # [m] from the middle to the point it turns about


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (
            ArticulatedVehicle,
            LOADER | {"max_speed": 2.0, "max_articulation": 1.6},
            "articulated_vehicle: max_articulation must be less than pi / 2, got 1.6 rad",
        ),
        (
            TractorWithTrailers,
            TRAIN | {"max_speed": 1.0, "hitch_length_3": 2.0},
            "tractor_with_trailers: hitch_length_3 needs hitch_length_2, got None",
        ),
        (
            TractorWithTrailers,
            TRAIN | {"max_speed": 1.0, "hitch_offset": math.inf},
            "tractor_with_trailers: hitch_offset must be finite, got inf",
        ),
        (
            RearSteeredCar,
            {"wheelbase": 1.5, "max_steering": 1.6},
            "rear_steered_car: max_steering must be less than pi / 2, got 1.6 rad",
        ),
        (
            FourWheelSteeringCar,
            {"wheelbase": -1.0, "max_steering": 1.0},
            "four_wheel_steering_car: wheelbase must be positive, got -1.0",
        ),
    ],
)
def test_what_is_no_vehicle_is_told(kind, values, message):
    with pytest.raises(ValueError) as error:
        kind(**values)
    assert str(error.value) == message


def test_a_trim_states_an_angle_for_each_trailer():
    text = (SCENARIOS / "two_trailers.yaml").read_text(encoding="utf-8")
    trims = "{trims: [{name: rest, state: [0, 0]}, {name: ahead, control: [1, 0.1]}]}"
    text = text.replace("{preset: tractor_with_trailers}", trims)
    automaton = scenario_of_text(text, name="x.yaml").problem.automaton
    assert automaton.trim_names == ("rest", "ahead")
    with pytest.raises(InvalidScenario, match=r"need 2: \[hitch, hitch_2\]|two|2 numbers"):
        scenario_of_text(text.replace("[0, 0]}, {", "[0, 0, 0]}, {"), name="x.yaml")


def test_a_body_of_a_trailer_that_is_not_there_is_told():
    text = (SCENARIOS / "two_trailers.yaml").read_text(encoding="utf-8")
    more = text.replace("  trailer_2: {", "  trailer_3: {rectangle_m: [1.0, 1.0]}\n  trailer_2: {")
    with pytest.raises(InvalidScenario, match="trailer_3"):
        scenario_of_text(more, name="x.yaml")
