"""Messages of ROS 2 as plain dicts, which need no ROS, and a bag of them, written by rosbags."""

from __future__ import annotations

import math
import re
import shutil
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import PART
from maneuver_automaton.automaton.plan_arrays import PlanArrays
from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.exports.table import accelerations, component, twist_rates
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.models import Model
from maneuver_automaton.recording import Mover, recording_to_write
from maneuver_automaton.words.library import four_columns

TYPES = {  # by topic
    "path": "nav_msgs/msg/Path",
    "trajectory": "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "nav_trajectory": "nav_msgs/msg/Trajectory",
    "cmd_vel": "geometry_msgs/msg/TwistStamped",
    "ackermann_cmd": "ackermann_msgs/msg/AckermannDriveStamped",
    "tf": "tf2_msgs/msg/TFMessage",
}
SINGLE = ("path", "trajectory", "nav_trajectory")  # topics of one message, at the beginning
STEP = 0.1  # [s]
NANO = 1_000_000_000
METADATA, STORED = "metadata.yaml", (".db3", ".mcap")  # what is in a bag
VERSION: Literal[8] = 8  # of metadata.yaml: Humble cannot read the profiles of 9
# What Humble does not have. Sources: ackermann_msgs, by J. O'Quin, the one package among these that
# is not part of ROS itself; nav_msgs since common_interfaces 5.9 (its issue 275, pull request 296).
DEFINITIONS = {
    "ackermann_msgs/msg/AckermannDrive": """
float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
""",
    "ackermann_msgs/msg/AckermannDriveStamped": """
std_msgs/Header header
ackermann_msgs/AckermannDrive drive
""",
    "nav_msgs/msg/TrajectoryPoint": """
std_msgs/Header header
geometry_msgs/Pose pose
geometry_msgs/Twist velocity
geometry_msgs/Accel acceleration
geometry_msgs/Wrench effort
""",
    "nav_msgs/msg/Trajectory": """
std_msgs/Header header
nav_msgs/TrajectoryPoint[] points
""",
}
UNKNOWN = dict.fromkeys("xyz", math.nan)  # how nav_msgs says that a value is not set

Message = dict[str, Any]


def ros_messages(
    value: Any,
    *,
    step: float = STEP,
    stamp: float = 0.0,
    frame: str = "map",
    body_frame: str = "base_link",
    model: Model | None = None,
) -> dict[str, Any]:
    """A plan, a closed loop, a fleet or a drive as messages of ROS 2: fields by name, nested.

    ``set_message_fields`` of `rosidl_runtime_py` fills a message with such a dict.

    Parameters
    ----------
    value : any result, or a Recording
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
        otherwise by differences, as of the parts; `nav_trajectory`, a nav_msgs/Trajectory of the
        vehicle, whose velocities and accelerations are those ahead, to the left and about the
        vertical (the message leaves that open), and whose efforts, and accelerations where the
        model is not known, are nan, which says that they are not set; and lists of one message for
        every pose: `cmd_vel`, of geometry_msgs/TwistStamped in `body_frame`; `tf`, of
        tf2_msgs/TFMessage; and
        for a model with a steering angle `ackermann_cmd`, of ackermann_msgs/AckermannDriveStamped.
        Of several vehicles all topics but `tf`, and the frames of their bodies, begin with the name
        of the vehicle and a slash.

    Raises
    ------
    TypeError
        If nobody moves in the value.
    ValueError
        If nobody has a plan, `step` is not positive, or `stamp` is not finite or negative.

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
    recording = recording_to_write(value, model=model)
    start = round(stamp * NANO)  # whole: today's seconds leave a float no nanoseconds
    found: dict[str, Any] = {}
    frames: list[Message] = []
    for mover in recording.drivers:
        begin = start + round((mover.start_time - recording.begin) * NANO)
        name = ""
        if len(recording.movers) > 1:  # ROS takes letters, digits and underscores
            name = re.sub(r"[^A-Za-z0-9_]", "_", mover.name) + "/"
            name = name if name[0].isalpha() else f"vehicle_{name}"
        messages = _messages(
            mover, step=step, begin=begin, frame=frame, body_frame=name + body_frame, prefix=name
        )
        frames += messages.pop("tf")
        found |= {name + topic: messages[topic] for topic in messages}
    return found | {"tf": sorted(frames, key=_stamp_of)}


def _messages(
    mover: Mover, *, step: float, begin: int, frame: str, body_frame: str, prefix: str
) -> dict[str, Any]:
    """The messages of one vehicle, whose first pose is at `begin` [ns]."""
    rows = mover.rows(step=step)
    since = rows.time - rows.time[0]
    stamps = [_time(one, begin) for one in since.tolist()]
    headers = [{"stamp": one, "frame_id": frame} for one in stamps]
    parts = [(prefix + name, poses) for name, poses in _carried(mover, rows)]
    frames = [(body_frame, rows.pose), *parts]
    poses = [
        {"header": header, "pose": {"position": at["translation"], "orientation": at["rotation"]}}
        for header, at in zip(headers, _transforms(rows.pose), strict=True)
    ]
    twists, felt = _twists(rows.twist), None
    if mover.model is not None:  # accelerations in the frame of the body
        felt = twist_rates(mover.model, rows.reduced_state, rows.control)
        felt[:, :2] = accelerations(rows.twist, felt)
    not_set = [{"linear": UNKNOWN, "angular": UNKNOWN}] * len(since)
    changes = not_set if felt is None else _twists(felt)
    messages: dict[str, Any] = {
        "path": {"header": headers[0], "poses": poses},
        "trajectory": _trajectory(frames, rows, since, headers[0], felt),
        "nav_trajectory": {
            "header": headers[0],
            "points": [
                {
                    **pose,
                    "velocity": twist,
                    "acceleration": change,
                    "effort": {"force": UNKNOWN, "torque": UNKNOWN},
                }
                for pose, twist, change in zip(poses, twists, changes, strict=True)
            ],
        },
        "cmd_vel": [
            {"header": {"stamp": one, "frame_id": body_frame}, "twist": twist}
            for one, twist in zip(stamps, twists, strict=True)
        ],
    }
    steering = component(rows, "steering")
    if steering is not None:
        messages["ackermann_cmd"] = _ackermann(rows, steering, stamps, body_frame)
    return messages | {"tf": _frames(frames, headers)}


def _trajectory(
    frames: Sequence[tuple[str, Array]],
    rows: PlanArrays,
    since: Array,
    header: Message,
    felt: Array | None,
) -> Message:
    """Transforms, velocities and accelerations of all frames, seen from the world."""
    transforms = [_transforms(poses) for _, poses in frames]
    turned = group_of(rows.pose.shape[1])(rows.pose).pose_rates  # from the body to the world
    velocity = turned(rows.twist)
    acceleration = _rates(rows.time, velocity) if felt is None else turned(felt)
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
    rate, acceleration = (component(rows, name) for name in ("steering_rate", "acceleration"))
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


def _carried(mover: Mover, rows: PlanArrays) -> list[tuple[str, Array]]:
    model = mover.model
    if model is None or not model.part_names:
        return []
    seen = np.asarray(model.part_poses(rows.reduced_state))
    vehicle = SE2(rows.pose[:, :3])
    return [
        (name, np.concatenate([(vehicle @ SE2(seen[:, k, :3])).pose, rows.pose[:, 3:]], axis=1))
        for k, name in enumerate(model.part_names)
    ]


def _rates(time: Array, pose: Array) -> Array:
    if len(time) < 2:
        return np.zeros_like(pose)
    return np.asarray(np.gradient(pose, time, axis=0))


def _transforms(pose: Array) -> list[Message]:
    """Transforms of poses (n, dof): a quaternion about z."""
    x, y, heading, z = four_columns(pose).T
    half = 0.5 * np.remainder(heading + np.pi, 2.0 * np.pi) - 0.5 * np.pi
    return [
        {
            "translation": {"x": x, "y": y, "z": z},
            "rotation": {"x": 0.0, "y": 0.0, "z": sin, "w": cos},
        }
        for x, y, z, sin, cos in np.column_stack([x, y, z, np.sin(half), np.cos(half)]).tolist()
    ]


def _twists(twist: Array) -> list[Message]:
    return [
        {"linear": {"x": x, "y": y, "z": z}, "angular": {"x": 0.0, "y": 0.0, "z": turn}}
        for x, y, turn, z in four_columns(twist).tolist()
    ]


def _time(seconds: float, begin: int = 0) -> Message:
    """A builtin_interfaces/Time or Duration: seconds since `begin` [ns]."""
    sec, nanosec = divmod(begin + round(seconds * NANO), NANO)
    return {"sec": sec, "nanosec": nanosec}


def save_ros2_bag(
    value: Any,
    path: Path | str,
    *,
    step: float = STEP,
    stamp: float = 0.0,
    frame: str = "map",
    body_frame: str = "base_link",
    model: Model | None = None,
) -> None:
    """Write a plan, a closed loop, a fleet or a drive as a bag of ROS 2, a folder with SQLite.

    ``ros2 bag play`` and Foxglove play it. The topics are those of `ros_messages`, each with a
    slash before its name; `/path`, `/trajectory` and `/nav_trajectory` come first, and are latched.

    Parameters
    ----------
    value : any result, or a Recording
        A Plan alone knows no model.
    path : Path or str
        The folder; a bag that is there already is replaced.
    step, stamp, frame, body_frame, model : optional
        See `ros_messages`.

    Raises
    ------
    MissingExtra
        If rosbags is not installed.
    TypeError, ValueError
        As `ros_messages`.
    OSError
        If the folder cannot be written, or is there and no bag.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> folder = getfixture("tmp_path") / "bag"
    >>> save_ros2_bag(Plan([0, 0, 0], (ahead,), durations=[2.0]), folder)
    >>> sorted(file.name for file in folder.iterdir())
    ['bag.db3', 'metadata.yaml']
    """
    messages = ros_messages(
        value, step=step, stamp=stamp, frame=frame, body_frame=body_frame, model=model
    )
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise FileExistsError(17, "is a file, need a folder for a bag", str(folder))
    if folder.exists() and any(
        one.name != METADATA and one.suffix not in STORED for one in folder.iterdir()
    ):
        raise FileExistsError(17, "is a folder with other files, need a new one", str(folder))
    beside = folder.parent / f"{PART}{uuid.uuid4().hex}"
    beside.mkdir(parents=True)
    try:
        _write(messages, beside / folder.name)
        if there := folder.exists():
            folder.rename(beside / "old")
        try:
            (beside / folder.name).rename(folder)
        except OSError:
            if there:  # the old one stays
                (beside / "old").rename(folder)
            raise
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _write(messages: dict[str, Any], folder: Path) -> None:
    try:
        from rosbags.rosbag2 import Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtra(
            "ROS 2 bag: rosbags is not installed; need pip install 'maneuver-automaton[ros]'"
        ) from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    with Writer(folder, version=VERSION) as bag:
        kinds = {topic: TYPES[topic.rpartition("/")[2]] for topic in messages}
        connections = {
            topic: bag.add_connection(
                f"/{topic}",
                kind,
                typestore=store,
                offered_qos_profiles=_latched() if _is_single(topic) else (),
            )
            for topic, kind in kinds.items()
        }
        single_first = sorted(messages, key=lambda topic: not _is_single(topic))
        timed = [
            (_stamp_of(one), topic, one)
            for topic in single_first
            for one in ([messages[topic]] if _is_single(topic) else messages[topic])
        ]
        for time, topic, message in sorted(timed, key=lambda row: row[0]):
            built = _built(store, kinds[topic], message)
            bag.write(connections[topic], time, store.serialize_cdr(built, kinds[topic]))


def _is_single(topic: str) -> bool:
    return topic.rpartition("/")[2] in SINGLE


def _stamp_of(message: Message) -> int:
    """The time of a message, or of the first transform in it [ns]."""
    header = message["header"] if "header" in message else message["transforms"][0]["header"]
    stamp = header["stamp"]
    return int(stamp["sec"] * NANO + stamp["nanosec"])


def _built(store: Any, name: str, value: dict[str, Any]) -> Any:
    """A message of rosbags from the fields of a dict."""
    _, fields = store.fielddefs[name]
    return store.types[name](**{field: _field(store, kind, value[field]) for field, kind in fields})


def _field(store: Any, kind: Any, value: Any) -> Any:
    from rosbags.interfaces import Nodetype

    node, inner = kind
    if node == Nodetype.NAME:
        return _built(store, inner, value)
    if node == Nodetype.SEQUENCE:
        return [_field(store, inner[0], one) for one in value]
    return value


def _latched() -> list[Any]:
    """Who subscribes later gets the last message too."""
    from rosbags import interfaces as ros

    never = ros.QosTime(0, 0)
    return [
        ros.Qos(
            history=ros.QosHistory.KEEP_LAST,
            depth=1,
            reliability=ros.QosReliability.RELIABLE,
            durability=ros.QosDurability.TRANSIENT_LOCAL,
            deadline=never,
            lifespan=never,
            liveliness=ros.QosLiveliness.SYSTEM_DEFAULT,
            liveliness_lease_duration=never,
            avoid_ros_namespace_conventions=False,
        )
    ]
