"""Messages of ROS 2 as plain dicts, which need no ROS: for a node of one's own, and for bags."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton.plan_arrays import PlanArrays
from maneuver_automaton.exports.driven import Driven, driven_of
from maneuver_automaton.exports.kinematics import accelerations, twist_rates
from maneuver_automaton.groups import SE2

if TYPE_CHECKING:
    from maneuver_automaton.exports.driven import Exportable
    from maneuver_automaton.models import Model

TYPES = {  # by topic
    "path": "nav_msgs/msg/Path",
    "trajectory": "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "cmd_vel": "geometry_msgs/msg/TwistStamped",
    "ackermann_cmd": "ackermann_msgs/msg/AckermannDriveStamped",
    "tf": "tf2_msgs/msg/TFMessage",
}
STEP = 0.1  # [s]
NANO = 1_000_000_000

Message = dict[str, Any]


def ros_messages(
    value: Exportable,
    *,
    step: float = STEP,
    stamp: float = 0.0,
    frame: str = "map",
    body_frame: str = "base_link",
    model: Model | None = None,
) -> dict[str, Any]:
    """A plan, a closed loop or a drive as messages of ROS 2: fields by name, nested.

    ``set_message_fields`` of `rosidl_runtime_py` fills a message with such a dict.

    Parameters
    ----------
    value : Plan, PlanResult, ClosedLoop, RoadPlanResult or RoadDrive
        A Plan alone knows no model.
    step : float
        Time between poses [s]; the last one is the end.
    stamp : float
        Time of the first pose on the clock of ROS [s]: that of the plan counts from there.
    frame, body_frame : str
        Names of the frames of the world and the vehicle.
    model : Model, optional
        The vehicle of a Plan.

    Returns
    -------
    dict
        By topic: `path`, a nav_msgs/Path with a stamp for every pose; `trajectory`, a
        trajectory_msgs/MultiDOFJointTrajectory of the vehicle and the parts that it carries, its
        velocities and accelerations in `frame`, by the model's equations where it is known,
        otherwise by differences, as of the parts; and lists of one message for every pose:
        `cmd_vel`, of geometry_msgs/TwistStamped in `body_frame`; `tf`, of tf2_msgs/TFMessage; and
        for a model with a steering angle `ackermann_cmd`, of ackermann_msgs/AckermannDriveStamped.

    Raises
    ------
    ValueError
        If a result has no plan, `step` is not positive, or `stamp` is not finite or negative.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> messages = ros_messages(Plan([0, 0, 0], (ahead,), durations=[2.0]), step=1.0)
    >>> messages["path"]["poses"][1]["header"]
    {'stamp': {'sec': 1, 'nanosec': 0}, 'frame_id': 'map'}
    >>> messages["path"]["poses"][1]["pose"]["position"]
    {'x': 1.0, 'y': 0.0, 'z': 0.0}
    """
    if not (math.isfinite(stamp) and stamp >= 0.0):
        raise ValueError(f"stamp: must not be negative, got {stamp} s")
    driven = driven_of(value, model=model)
    rows = driven.rows(step=step)
    since = rows.time - rows.time[0]
    begin = round(stamp * NANO)  # whole: today's seconds leave a float no nanoseconds
    stamps = [_time(one, begin) for one in since.tolist()]
    headers = [{"stamp": one, "frame_id": frame} for one in stamps]
    frames = [(body_frame, rows.pose), *_carried(driven, rows)]
    poses, twists = _poses(rows.pose), _twists(rows.twist)
    messages: dict[str, Any] = {
        "path": {
            "header": headers[0],
            "poses": [
                {"header": header, "pose": pose}
                for header, pose in zip(headers, poses, strict=True)
            ],
        },
        "trajectory": _trajectory(frames, rows, since, headers[0], driven.model),
        "cmd_vel": [
            {"header": {"stamp": one, "frame_id": body_frame}, "twist": twist}
            for one, twist in zip(stamps, twists, strict=True)
        ],
        "tf": _frames(frames, headers),
    }
    steering = _column(rows, "steering")
    if steering is not None:
        messages["ackermann_cmd"] = _ackermann(rows, steering, stamps, body_frame)
    return messages


def _trajectory(
    frames: Sequence[tuple[str, Array]],
    rows: PlanArrays,
    since: Array,
    header: Message,
    model: Model | None,
) -> Message:
    """Transforms, velocities and accelerations of all frames, seen from the world."""
    transforms = [_transforms(poses) for _, poses in frames]
    velocity = _in_world(rows.pose, rows.twist)
    if model is None:
        acceleration = _rates(rows.time, velocity)
    else:
        acceleration = twist_rates(model, rows.reduced_state, rows.control)
        acceleration[:, :2] = accelerations(rows.twist, acceleration)
        acceleration = _in_world(rows.pose, acceleration)
    carried = [_rates(rows.time, poses) for _, poses in frames[1:]]
    velocities = list(map(_twists, (velocity, *carried)))
    changes = (acceleration, *(_rates(rows.time, one) for one in carried))
    accelerations_of = list(map(_twists, changes))
    return {
        "header": header,
        "joint_names": [name for name, _ in frames],
        "points": [
            {
                "transforms": [one[k] for one in transforms],
                "velocities": [one[k] for one in velocities],
                "accelerations": [one[k] for one in accelerations_of],
                "time_from_start": _time(time),
            }
            for k, time in enumerate(since.tolist())
        ],
    }


def _frames(frames: Sequence[tuple[str, Array]], headers: Sequence[Message]) -> list[Message]:
    """Transforms from the world to all frames, one message an instant."""
    transforms = [_transforms(poses) for _, poses in frames]
    return [
        {
            "transforms": [
                {"header": header, "child_frame_id": name, "transform": one[k]}
                for (name, _), one in zip(frames, transforms, strict=True)
            ]
        }
        for k, header in enumerate(headers)
    ]


def _ackermann(
    rows: PlanArrays, steering: Array, stamps: Sequence[Message], frame: str
) -> list[Message]:
    """Speed and steering angle; a rate of zero asks for the change at once."""
    nothing = np.zeros(len(rows.time))
    rate, acceleration = (_column(rows, name) for name in ("steering_rate", "acceleration"))
    fields = {
        "steering_angle": steering,
        "steering_angle_velocity": nothing if rate is None else rate,
        "speed": rows.twist[:, 0],
        "acceleration": nothing if acceleration is None else acceleration,
        "jerk": nothing,
    }
    return [
        {
            "header": {"stamp": stamp, "frame_id": frame},
            "drive": {name: float(values[k]) for name, values in fields.items()},
        }
        for k, stamp in enumerate(stamps)
    ]


def _column(rows: PlanArrays, name: str) -> Array | None:
    """A component (n,) of the reduced state or the control; None if the model has none."""
    for names, values in (
        (rows.reduced_names, rows.reduced_state),
        (rows.control_names, rows.control),
    ):
        if name in names:
            return np.asarray(values[:, names.index(name)])
    return None


def _carried(driven: Driven, rows: PlanArrays) -> list[tuple[str, Array]]:
    """Names and poses (n, dof) of the parts that the vehicle carries."""
    model = driven.model
    if model is None or not model.part_names:
        return []
    seen = np.asarray(model.part_poses(rows.reduced_state))
    vehicle = SE2(rows.pose[:, :3])
    return [
        (name, np.concatenate([(vehicle @ SE2(seen[:, k, :3])).pose, rows.pose[:, 3:]], axis=1))
        for k, name in enumerate(model.part_names)
    ]


def _in_world(pose: Array, twist: Array) -> Array:
    """Twists (n, dof) of the body frame, turned into that of the world."""
    turned = twist.copy()
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    turned[:, 0] = cos * twist[:, 0] - sin * twist[:, 1]
    turned[:, 1] = sin * twist[:, 0] + cos * twist[:, 1]
    return turned


def _rates(time: Array, pose: Array) -> Array:
    """Rates (n, dof) of poses, by differences."""
    if len(time) < 2:
        return np.zeros_like(pose)
    return np.asarray(np.gradient(pose, time, axis=0))


def _poses(pose: Array) -> list[Message]:
    return [
        {"position": one["translation"], "orientation": one["rotation"]}
        for one in _transforms(pose)
    ]


def _transforms(pose: Array) -> list[Message]:
    """Transforms of poses (n, dof): a quaternion about z."""
    altitude = pose[:, 3] if pose.shape[1] > 3 else np.zeros(len(pose))
    half = 0.5 * np.remainder(pose[:, 2] + np.pi, 2.0 * np.pi) - 0.5 * np.pi
    table = zip(*(column.tolist() for column in (
        pose[:, 0], pose[:, 1], altitude, np.sin(half), np.cos(half)
    )), strict=True)  # fmt: skip
    return [
        {
            "translation": {"x": x, "y": y, "z": z},
            "rotation": {"x": 0.0, "y": 0.0, "z": sin, "w": cos},
        }
        for x, y, z, sin, cos in table
    ]


def _twists(twist: Array) -> list[Message]:
    climb = twist[:, 3] if twist.shape[1] > 3 else np.zeros(len(twist))
    table = zip(*(c.tolist() for c in (*twist[:, :3].T, climb)), strict=True)
    return [
        {"linear": {"x": x, "y": y, "z": z}, "angular": {"x": 0.0, "y": 0.0, "z": turn}}
        for x, y, turn, z in table
    ]


def _time(seconds: float, begin: int = 0) -> Message:
    """A builtin_interfaces/Time or Duration: seconds since `begin` [ns]."""
    sec, nanosec = divmod(begin + round(seconds * NANO), NANO)
    return {"sec": sec, "nanosec": nanosec}
