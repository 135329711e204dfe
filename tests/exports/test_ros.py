"""Messages of ROS 2 as dicts, and a bag read back by rosbags."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.exports.ros import DEFINITIONS, TYPES
from tests.exports.cases import CAR, VALUES, assert_close, ends, inertia, trailer
from tests.plotting.cases import parking_plan
from tests.plotting.fleets import crossing
from tests.plotting.loops import pushed_loop


def yaw(rotation):
    assert rotation["x"] == rotation["y"] == 0.0
    return 2.0 * np.arctan2(rotation["z"], rotation["w"])


def pose_of(message):
    place = message["position"]
    return np.array([place["x"], place["y"], yaw(message["orientation"])])


def seconds(stamp):
    return stamp["sec"] + 1e-9 * stamp["nanosec"]


@pytest.mark.parametrize("name", list(VALUES))
def test_the_path_leads_from_start_to_end(name):
    value = VALUES[name]()
    messages = ma.ros_messages(value, step=0.2, stamp=100.5, frame="odom")
    poses = messages["path"]["poses"]
    first, last = ends(value)
    for message, pose in ((poses[0], first), (poses[-1], last)):
        assert message["header"]["frame_id"] == "odom"
        assert_close(pose_of(message["pose"])[:2], pose[:2])
        assert abs(np.sin(0.5 * (pose_of(message["pose"])[2] - pose[2]))) < 1e-9
        assert_close(message["pose"]["position"]["z"], pose[3] if pose.size > 3 else 0.0)
    stamps = [seconds(one["header"]["stamp"]) for one in poses]
    assert_close(stamps[0], 100.5)
    assert_close(np.diff(stamps)[:-1], 0.2)
    points = messages["trajectory"]["points"]
    assert len(points) == len(poses) == len(messages["cmd_vel"]) == len(messages["tf"])
    assert_close(seconds(points[-1]["time_from_start"]), stamps[-1] - stamps[0], atol=1e-8)


def test_velocities_are_the_rates_of_the_poses():
    messages = ma.ros_messages(inertia(), step=0.01)
    points = messages["trajectory"]["points"]
    time = [seconds(one["time_from_start"]) for one in points]
    places = np.array([list(one["transforms"][0]["translation"].values()) for one in points])
    stated = np.array([list(one["velocities"][0]["linear"].values()) for one in points])
    inner = slice(1, -2)
    rates = np.gradient(places, time, axis=0)
    assert_close(stated[inner], rates[inner], atol=0.02)
    ahead = [one["twist"]["linear"]["x"] for one in messages["cmd_vel"]]
    assert_close(np.hypot(*stated[:, :2].T), ahead, atol=1e-9)
    assert max(ahead) == pytest.approx(2.0)


def test_accelerations_are_the_rates_of_the_velocities():
    for value in (inertia(), trailer()):
        points = ma.ros_messages(value, step=0.005)["trajectory"]["points"]
        time = np.array([seconds(one["time_from_start"]) for one in points])

        def columns(name, points=points):
            rows = [
                [one["linear"]["x"], one["linear"]["y"], one["angular"]["z"]]
                for point in points
                for one in point[name]
            ]
            return np.array(rows).reshape(len(points), -1)

        rates = np.gradient(columns("velocities"), time, axis=0)
        off = np.abs(columns("accelerations") - rates).max(axis=1)
        assert np.quantile(off, 0.9) < 0.02  # all but where a control jumps
        assert np.abs(columns("accelerations")).max() > 0.1


def test_a_car_has_ackermann_commands_and_a_unicycle_none():
    drive = ma.ros_messages(inertia(), step=0.5)["ackermann_cmd"]
    assert drive[1]["drive"]["acceleration"] == CAR.max_acceleration
    assert drive[1]["drive"]["speed"] == pytest.approx(1.0)
    bend = ma.ros_messages(trailer(), step=1.0)["ackermann_cmd"][0]["drive"]
    assert_close([bend["speed"], bend["steering_angle"]], [0.5, 0.2])
    assert "ackermann_cmd" not in ma.ros_messages(parking_plan())
    assert "ackermann_cmd" in ma.ros_messages(inertia().plan, model=CAR)


def test_a_trailer_is_a_frame_of_its_own():
    result = trailer()
    messages = ma.ros_messages(result, step=1.0, body_frame="car")
    assert messages["trajectory"]["joint_names"] == ["car", "trailer"]
    frames = messages["tf"][0]["transforms"]
    assert [one["child_frame_id"] for one in frames] == ["car", "trailer"]
    model, trim = result.problem.automaton.model, result.plan.trims[0]
    seen = model.part_poses(trim.reduced_state)[0]
    x, y, heading = result.plan.start
    place = frames[1]["transform"]["translation"]
    there = np.array([np.cos(heading) * seen[0] - np.sin(heading) * seen[1] + x,
                      np.sin(heading) * seen[0] + np.cos(heading) * seen[1] + y])  # fmt: skip
    assert_close([place["x"], place["y"]], there)


def test_a_wrong_stamp_or_step_is_told():
    with pytest.raises(ValueError) as error:
        ma.ros_messages(parking_plan(), stamp=-1.0)
    assert str(error.value) == "stamp: must not be negative, got -1.0 s"
    with pytest.raises(ValueError) as wrong:
        ma.ros_messages(parking_plan(), step=0.0)
    assert str(wrong.value) == "as_arrays: step must be positive, got 0.0 s"


def test_a_bag_needs_rosbags(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(ImportError) as error:
        ma.save_ros2_bag(parking_plan(), tmp_path / "bag")
    assert str(error.value) == (
        "ROS 2 bag: rosbags is not installed; need pip install 'maneuver-automaton[ros]'"
    )
    assert list(tmp_path.iterdir()) == []


def test_messages_need_no_pictures():
    """Within a node nothing is imported that a message has no use for."""
    code = """
import sys
import maneuver_automaton as ma

robot = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
ma.ros_messages(ma.Plan([0, 0, 0], (robot["ahead"],), durations=[1.0]), model=robot.model)
print([name for name in ("matplotlib", "rosbags", "typer") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def read_bag(folder):
    """Time [ns], topic and message of everything in a bag, by its own definitions."""
    highlevel = pytest.importorskip("rosbags.highlevel")
    with highlevel.AnyReader([folder]) as bag:
        types = {one.topic: one.msgtype for one in bag.connections}
        return types, [
            (time, connection.topic, bag.deserialize(raw, connection.msgtype))
            for connection, time, raw in bag.messages()
        ]


def same(message, fields):
    """Whether a message of rosbags holds what a dict does, field by field, and no more."""
    if isinstance(fields, dict):
        names = {name for name in vars(message) if not name.startswith("__")}
        assert names == set(fields)
        return all(same(getattr(message, name), value) for name, value in fields.items())
    if isinstance(fields, list):
        return len(message) == len(fields) and all(map(same, message, fields))
    if fields != fields:  # nan
        return message != message
    return message == fields or abs(message - fields) <= 1e-6 * abs(fields)  # float32


@pytest.mark.parametrize("name", ["pushed loop", "trailer", "flight", "inertia"])
def test_a_bag_reads_back_as_the_messages(name, tmp_path):
    value = VALUES[name]()
    pytest.importorskip("rosbags")
    ma.save_ros2_bag(value, tmp_path / "bag", step=0.5, stamp=7.0)
    types, found = read_bag(tmp_path / "bag")
    messages = ma.ros_messages(value, step=0.5, stamp=7.0)
    assert types == {f"/{topic}": TYPES[topic] for topic in messages}
    assert found[0][:2] == (7_000_000_000, "/path")
    assert [time for time, *_ in found] == sorted(time for time, *_ in found)
    for topic, wanted in messages.items():
        read = [message for _, one, message in found if one == f"/{topic}"]
        assert len(read) == (len(wanted) if isinstance(wanted, list) else 1)
        assert same(read if isinstance(wanted, list) else read[0], wanted)


def test_a_bag_is_replaced_and_other_folders_are_kept(tmp_path):
    pytest.importorskip("rosbags")
    folder = tmp_path / "bag"
    for _ in range(2):
        ma.save_ros2_bag(pushed_loop(), folder)
    assert sorted(one.name for one in folder.iterdir()) == ["bag.db3", "metadata.yaml"]
    assert [one.name for one in tmp_path.iterdir()] == ["bag"]
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.tex").write_text("")
    with pytest.raises(FileExistsError, match="is a folder with other files, need a new one"):
        ma.save_ros2_bag(parking_plan(), other)
    with pytest.raises(FileExistsError, match="is a file, need a folder for a bag"):
        ma.save_ros2_bag(parking_plan(), other / "thesis.tex")


def test_a_trajectory_of_nav_msgs_has_the_fields_of_its_release():
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_LYRICAL)
    for name in ("nav_msgs/msg/TrajectoryPoint", TYPES["nav_trajectory"]):
        ours = typesys.get_types_from_msg(DEFINITIONS[name], name)[name]
        assert [field for field, _ in ours[1]] == [field for field, _ in store.fielddefs[name][1]]
    assert set(DEFINITIONS) - set(store.types) == {
        "ackermann_msgs/msg/AckermannDrive", TYPES["ackermann_cmd"],
    }  # fmt: skip


def test_topics_and_frames_of_a_fleet_begin_with_the_name(tmp_path):
    result = crossing()  # `back` begins half a second later, `stuck` has no plan
    messages = ma.ros_messages(result, step=0.5, stamp=10.0)
    assert set(messages) == {
        f"{name}/{topic}"
        for name in ("there", "back")
        for topic in ("path", "trajectory", "nav_trajectory", "cmd_vel")
    } | {"tf"}
    assert seconds(messages["back/path"]["poses"][0]["header"]["stamp"]) == 10.5
    assert messages["back/cmd_vel"][0]["header"]["frame_id"] == "back/base_link"
    stamps = [seconds(one["transforms"][0]["header"]["stamp"]) for one in messages["tf"]]
    assert stamps == sorted(stamps)
    names = {one["transforms"][0]["child_frame_id"] for one in messages["tf"]}
    assert names == {"there/base_link", "back/base_link"}
    pytest.importorskip("rosbags")
    ma.save_ros2_bag(result, tmp_path / "bag", step=0.5, stamp=10.0)
    types, found = read_bag(tmp_path / "bag")
    assert types == {f"/{topic}": TYPES[topic.split("/")[-1]] for topic in messages}
    assert [time for time, *_ in found] == sorted(time for time, *_ in found)


def test_names_that_ros_does_not_take_are_changed():
    result = replace(crossing(), problem=replace(crossing().problem, names=("100", "a-b", "c")))
    plans = dict(zip(result.problem.names, crossing().results.values(), strict=True))
    messages = ma.ros_messages(replace(result, results=plans), step=1.0)
    assert {"vehicle_100/path", "a_b/path", "tf"} <= set(messages)
