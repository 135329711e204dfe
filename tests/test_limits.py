"""What no vehicle does is refused where it enters, and the message says what would be right."""

import sys

import numpy as np
import pytest

from maneuver_automaton import Automaton, Problem, Unicycle
from maneuver_automaton._limits import FARTHEST, FASTEST
from maneuver_automaton.collision import Box, Disc, Motion, OccupancyMap, Polygon
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.models import SecondOrderCar
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.closed_form import from_rest
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.problem import Goal, Horizon
from maneuver_automaton.receding_horizon import simulate
from maneuver_automaton.scenario.scenario import scenario_of_text
from tests.inertia import CAR

ROBOT = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (0.0, 1.0)})
FAR = 1.5 * FARTHEST
SCENARIO = """\
schema: 1
name: far
vehicle: {{model: unicycle}}
automaton: {{trims: [{{name: ahead, control: [1.0, 0.0]}}, {{name: left, control: [0.0, 1.0]}}]}}
start: {{pose: [{start}, 0.0, 0.0]}}
goal: {{pose: [5.0, 0.0, 0.0]}}
obstacles:
  - {obstacle}
"""


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: Disc(FAR), "disc: radius: got 1.5e\\+10 m"),
        (lambda: Disc(1.0, [0.0, -FAR]), "disc: center: got -1.5e\\+10 m"),
        (lambda: Box([FAR, 1.0]), "box: size"),
        (lambda: Box([1.0, 1.0], [FAR, 0.0]), "box: center"),
        (lambda: Polygon([[0, 0], [FAR, 0], [0, 1]]), "polygon: corners"),
        (lambda: OccupancyMap(np.eye(2) > 0, resolution=1.0, origin=[FAR, 0, 0]), "map: origin"),
        (lambda: OccupancyMap(np.eye(2) > 0, resolution=FAR, origin=[0, 0, 0]), "map: size"),
        (lambda: Motion([0.0], [[FAR, 0, 0]]), "motion: pose"),
        (lambda: Goal(pose=[FAR, 0.0, 0.0]), "goal: pose"),
        (lambda: Problem(ROBOT, [FAR, 0, 0], [0, 0, 0]), "start: pose"),
        (lambda: Problem(ROBOT, [0, 0, 0], [1, 0, 0], margin=FAR), "margin"),
    ],
)
def test_what_is_too_far_or_too_large_is_refused(make, what):
    with pytest.raises(ValueError, match=f"{what}.*need at most 1e\\+10 m in size"):
        make()


def test_what_is_as_far_as_can_be_is_taken():
    assert Box([FARTHEST, 1.0], [-FARTHEST, 0.0]).size[0] == FARTHEST


def test_a_track_that_jumps_names_its_pose_and_its_time():
    with pytest.raises(ValueError, match=r"pose 3 at 2[.]001 s is 10 m from pose 2, 0[.]001 s"):
        Motion([0.0, 2.0, 2.001], [[0, 0, 0], [1, 0, 0], [11, 0, 0]])
    with pytest.raises(ValueError, match="rad/s, need at most 10000"):
        Motion([0.0, 1e-6], [[0, 0, 0], [0, 0, 1]])
    assert Motion([0.0, 1.0], [[0, 0, 0], [FASTEST, 0, 0]]).time.size == 2


def test_a_trim_that_nothing_drives_is_refused():
    with pytest.raises(
        ValueError, match="trim 'on': body_velocity holds 1e\\+07 m/s, need at most"
    ):
        Trim(name="on", body_velocity=[1e7, 0.0, 0.0], control=[1e7, 0.0])
    with pytest.raises(ValueError, match="turns at 1e\\+09 rad/s, need at most 1000 rad/s"):
        Trim(name="on", body_velocity=[0.0, 0.0, -1e9], control=[1e9])
    with pytest.raises(ValueError, match="'on': its twist holds 1e-120, need 0 or at least 1e-100"):
        Automaton.of_controls(Unicycle(), {"on": (1.0, -1e-120)})


def test_a_body_far_from_its_pose_is_refused():
    for shape in (Box([1.0, 1.0], [1e9, 0.0]), Disc(1e8), Polygon([[0, 0], [1, 0], [1, 2e8]])):
        with pytest.raises(ValueError, match=r"footprint: reaches .* m from the pose"):
            Problem(ROBOT, [0, 0, 0], [1, 0, 0], footprint=shape)


def test_a_heading_without_digits_is_refused():
    with pytest.raises(ValueError, match=r"goal: pose: got the heading 1e\+10 rad, need at most"):
        Goal(pose=[0.0, 0.0, 1e10])
    with pytest.raises(ValueError, match=r"start: pose: got the heading -1e\+10 rad"):
        Problem(ROBOT, [0, 0, -1e10], [1, 0, 0])


def test_a_fixed_time_of_turns_without_number_is_refused():
    with pytest.raises(ValueError, match=r"time is 1e\+09 s, in which the 1[.]59e\+08 whole"):
        Problem(ROBOT, [0, 0, 0], [1, 0, 0], horizon=Horizon(time=1e9))
    assert Problem(ROBOT, [0, 0, 0], [1, 0, 0], horizon=Horizon(time=1e3)).horizon.time == 1e3


def test_a_step_of_a_loop_far_shorter_than_its_plan_takes_no_memory():
    loop = simulate(Problem(ROBOT, [0, 0, 0], [5, 0, 0]), step=1e-9, steps=2)
    assert len(loop.steps) == 2


def test_rides_that_need_elements_without_number_are_refused_together(monkeypatch):
    monkeypatch.setattr("maneuver_automaton.primitives.driving.MOST_ELEMENTS", 1000)
    car = SecondOrderCar(
        wheelbase=2.8, max_steering=0.75, max_speed=9.0, max_acceleration=1.0, max_steering_rate=0.5
    )
    control = np.zeros((30, 1, 2))
    control[:, 0, 1] = 60.0
    with pytest.raises(ValueError, match=r"the motion under control .* cannot be followed"):
        drive_all(car, np.tile([9.0, -1.5], (30, 1)), control=control, durations=np.ones((30, 1)))


def test_a_library_of_maneuvers_without_number_is_refused(monkeypatch):
    model = CAR
    monkeypatch.setattr(sys.modules["maneuver_automaton.primitives.closed_form"], "MOST", 100)
    trims = {"speed": np.linspace(0.0, 2.0, 6), "steering": [0.0, 0.1]}
    with pytest.raises(ValueError, match="got 132 maneuvers between 12 trims, need at most 100"):
        Automaton.of_model(model, trims, pairs="all")


@pytest.mark.parametrize(
    ("start", "obstacle", "says"),
    [
        ("1e200", "{disc_m: {center: [3, 3], radius: 0.5}}", "1e\\+200"),
        ("0.0", "{disc_m: {center: [1e12, 3], radius: 0.5}}", "need a number of at most 1e\\+10"),
        ("0.0", "{disc_m: {center: [3, 3], radius: 1e15}}", "need a number of at most 1e\\+10"),
        (
            "0.0",
            "{disc_m: {center: [0, 0], radius: 0.5}, motion: [[0, 0, 5, 0], [0.001, 9, 5, 0]]}",
            "file:8: obstacles.*motion.*pose 2 at 0.001 s is 9 m from pose 1",
        ),
    ],
)
def test_a_scenario_file_says_where_it_is_beyond_a_limit(start, obstacle, says):
    text = SCENARIO.format(start=start, obstacle=obstacle)
    with pytest.raises(InvalidScenario, match=says) as error:
        scenario_of_text(text, name="file")
    assert str(error.value).startswith("file:")


def test_a_stroke_that_is_sampled_without_end_is_refused():
    car = SecondOrderCar(
        wheelbase=2.8,
        max_steering=0.7,
        max_speed=2.5,
        max_acceleration=1.0,
        max_steering_rate=0.5,
    )
    rest = Trim(name="rest", body_velocity=np.zeros(3), control=np.zeros(2), reduced_state=[0, 0])
    with pytest.raises(ValueError, match=r"stroke: got 1e[+]15, need at most 10000 in size"):
        from_rest(car, [rest], [1e15], "speed")
