"""A bag of ROS 2, written by rosbags: no ROS is needed."""

from __future__ import annotations

import shutil
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from maneuver_automaton._files import PART
from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.exports.messages import NANO, STEP, TYPES, ros_messages

if TYPE_CHECKING:
    from maneuver_automaton.exports.driven import Exportable
    from maneuver_automaton.models import Model

SINGLE = ("path", "trajectory")  # topics of one message, at the beginning
METADATA, STORED = "metadata.yaml", (".db3", ".mcap")  # what is in a bag
VERSION: Literal[8] = 8  # of metadata.yaml: Humble cannot read the profiles of 9
# Source: ackermann_msgs, by J. O'Quin; the one package among these that is not part of ROS itself.
ACKERMANN = {
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
}


def save_ros2_bag(
    value: Exportable,
    path: Path | str,
    *,
    step: float = STEP,
    stamp: float = 0.0,
    frame: str = "map",
    body_frame: str = "base_link",
    model: Model | None = None,
) -> None:
    """Write a plan, a closed loop or a drive as a bag of ROS 2, a folder with SQLite inside.

    ``ros2 bag play`` and Foxglove play it. The topics are those of `ros_messages`, each with a
    slash before its name; `/path` and `/trajectory` come first, and are latched.

    Parameters
    ----------
    value : Plan, PlanResult, ClosedLoop, RoadPlanResult or RoadDrive
        A Plan alone knows no model.
    path : Path or str
        The folder; a bag that is there already is replaced.
    step, stamp, frame, body_frame, model : optional
        See `ros_messages`.

    Raises
    ------
    MissingExtra
        If rosbags is not installed.
    ValueError
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
    _check_free(folder)
    beside = folder.parent / f"{PART}{uuid.uuid4().hex}"
    beside.mkdir(parents=True)
    try:
        _write(messages, beside / folder.name)
        _replace(folder, by=beside / folder.name, old=beside / "old")
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _check_free(folder: Path) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise FileExistsError(17, "is a file, need a folder for a bag", str(folder))
    if any(one.name != METADATA and one.suffix not in STORED for one in folder.iterdir()):
        raise FileExistsError(17, "is a folder with other files, need a new one", str(folder))


def _replace(folder: Path, *, by: Path, old: Path) -> None:
    """Put a folder in the place of another; where that fails, the old one stays."""
    there = folder.exists()
    if there:
        folder.rename(old)
    try:
        by.rename(folder)
    except OSError:
        if there:
            old.rename(folder)
        raise


def _write(messages: dict[str, Any], folder: Path) -> None:
    try:
        from rosbags.rosbag2 import Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtra(
            "ROS 2 bag: rosbags is not installed; need pip install 'maneuver-automaton[ros]'"
        ) from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in ACKERMANN.items():
        store.register(get_types_from_msg(text, name))
    with Writer(folder, version=VERSION) as bag:
        connections = {
            topic: bag.add_connection(
                f"/{topic}",
                TYPES[topic],
                typestore=store,
                offered_qos_profiles=_latched() if topic in SINGLE else (),
            )
            for topic in messages
        }
        for time, topic, message in _in_time(messages):
            built = _built(store, TYPES[topic], message)
            bag.write(connections[topic], time, store.serialize_cdr(built, TYPES[topic]))


def _in_time(messages: dict[str, Any]) -> list[tuple[int, str, dict[str, Any]]]:
    """Time [ns], topic and message, in the order of the times."""
    begin = _nanoseconds(messages["path"]["header"]["stamp"])
    stamps = [_nanoseconds(one["header"]["stamp"]) for one in messages["cmd_vel"]]
    timed = [(begin, topic, messages[topic]) for topic in SINGLE]
    for topic in messages:
        if topic not in SINGLE:
            timed += [(at, topic, one) for at, one in zip(stamps, messages[topic], strict=True)]
    return sorted(timed, key=lambda one: one[0])


def _nanoseconds(stamp: dict[str, int]) -> int:
    return stamp["sec"] * NANO + stamp["nanosec"]


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
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    never = QosTime(0, 0)
    return [
        Qos(
            history=QosHistory.KEEP_LAST,
            depth=1,
            reliability=QosReliability.RELIABLE,
            durability=QosDurability.TRANSIENT_LOCAL,
            deadline=never,
            lifespan=never,
            liveliness=QosLiveliness.SYSTEM_DEFAULT,
            liveliness_lease_duration=never,
            avoid_ros_namespace_conventions=False,
        )
    ]
