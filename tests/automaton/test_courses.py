"""Courses in library files: inputs that lead along them, or samples where nothing else does."""

from __future__ import annotations

import json

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.courses import even_times
from maneuver_automaton.automaton.library import automaton_hash, load_library, save_library
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import SecondOrderUnicycle
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.primitives.driving import drive

ROBOT = SecondOrderUnicycle(
    max_speed=2.0, max_turn_rate=2.0, max_acceleration=1.0, max_angular_acceleration=1.0
)
REST = Trim(name="rest", body_velocity=[0, 0, 0], control=[0, 0], reduced_state=[0, 0])
AHEAD = Trim(name="ahead", body_velocity=[1, 0, 0], control=[0, 0], reduced_state=[1, 0])


def speeding_up(durations, name="go"):
    control = [[1.0, 0.0], [0.6, 0.0], [0.2, 0.0]]
    shares = np.array(durations) / np.dot(np.array(control)[:, 0], durations)
    course = drive(ROBOT, REST.reduced_state, control=control, durations=shares)
    return Maneuver(
        name=name, source="rest", target="ahead", displacement=course.pose[-1],
        duration=float(course.time[-1]), course=course,
    )  # fmt: skip


def entry_of(path, k=0):
    return json.loads(path.read_text())["maneuvers"][k]


def edit(path, **changes):
    document = json.loads(path.read_text())
    document.pop("hash")
    document["maneuvers"][0] |= changes
    entry = document["maneuvers"][0]
    document["maneuvers"][0] = {k: v for k, v in entry.items() if v is not None}
    path.write_text(json.dumps(document))


@pytest.mark.parametrize(("durations", "stated"), [((1, 1, 1), False), ((1, 2, 0.5), True)])
def test_inputs_lead_along_the_course(tmp_path, durations, stated):
    path = tmp_path / "robot.json"
    robot = Automaton(ROBOT, (REST, AHEAD), (speeding_up(durations),))
    save_library(robot, path)
    entry = entry_of(path)
    assert ("until" in entry) == stated
    assert len(entry["control"]) == 3
    read = load_library(path)
    (before,), (after,) = robot.maneuvers, read.maneuvers
    assert after.course.pose == pytest.approx(before.course.pose, abs=1e-12)
    assert np.array_equal(after.course.control, before.course.control)
    assert automaton_hash(read) == automaton_hash(robot)
    again = tmp_path / "again.json"
    save_library(read, again)
    assert again.read_text() == path.read_text()


def test_a_course_from_elsewhere_keeps_its_samples(tmp_path):
    path = tmp_path / "robot.json"
    time = np.linspace(0.0, 1.0, 5)
    course = Trajectory(
        time=time,
        pose=np.stack([time**2, 0.1 * time, 0.0 * time], axis=-1),
        reduced_state=np.stack([time, 0.0 * time], axis=-1),
        control=np.tile([1.0, 0.0], (5, 1)),
    )
    odd = Maneuver(
        name="odd", source="rest", target="ahead", displacement=course.pose[-1], duration=1.0,
        course=course,
    )  # fmt: skip
    save_library(Automaton(ROBOT, (REST, AHEAD), (odd, speeding_up((1, 1, 1)))), path)
    assert "samples" in entry_of(path)
    assert "samples" not in entry_of(path, 1)
    read = load_library(path)
    for name in ("time", "pose", "reduced_state", "control"):
        assert np.array_equal(getattr(read.maneuvers[0].course, name), getattr(course, name))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"control": []}, "maneuvers[0]: control: got [], need a list of rows of numbers"),
        ({"control": [[1.0]]}, "maneuvers[0]: control[0]: got 1 numbers, need 2"),
        (
            {"until": [0.1, 0.2]},
            "maneuvers[0]: until: got [0.1, 0.2], need 3 rising times, one for each control",
        ),
        (
            {"until": [0.1, 0.2, 0.3]},
            "maneuvers[0]: until: ends with 0.3 s, need the duration {duration} s",
        ),
        (
            {"samples": {"time": [0.0]}},
            "maneuvers[0]: samples: the key 'pose' is missing",
        ),
        (
            {"samples": {"time": [0.0], "pose": [[0, 0, 0]], "control": [[0, 0]],
                         "reduced_state": [[0, 0], [0, 0]]}},
            "maneuvers[0]: samples: reduced_state: got 2 rows, need one for each of 1 times, and "
            "at least one",
        ),
        (
            {"displacement": [9.0, 0.0, 0.0]},
            "maneuver 'go': its course must run from the identity and time 0 to its displacement "
            "and duration, got a difference of 7.92",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(tmp_path, changes, message):
    path = tmp_path / "robot.json"
    save_library(Automaton(ROBOT, (REST, AHEAD), (speeding_up((1, 1, 1)),)), path)
    message = message.replace("{duration}", str(entry_of(path)["duration"]))
    edit(path, **changes)
    with pytest.raises(InvalidLibrary) as error:
        load_library(path)
    assert str(error.value) == f"{path}: {message}"


def test_equal_intervals_end_with_the_duration_itself():
    rng = np.random.default_rng(0)
    for duration in rng.uniform(0.01, 9.0, size=200):
        for count in (3, 7, 10, 12, 20):
            assert even_times(float(duration), count)[-1] == duration
