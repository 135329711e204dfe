"""Exports: whatever moves as files and messages of other programs, one a file."""

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.exports.commonroad_solution import (
        save_commonroad_solution as save_commonroad_solution,
    )
    from maneuver_automaton.exports.geojson import save_geojson as save_geojson
    from maneuver_automaton.exports.reading import ResultFile as ResultFile
    from maneuver_automaton.exports.reading import load_recording as load_recording
    from maneuver_automaton.exports.reading import open_result as open_result
    from maneuver_automaton.exports.rerun_log import save_rerun as save_rerun
    from maneuver_automaton.exports.ros import ros_messages as ros_messages
    from maneuver_automaton.exports.ros import save_ros2_bag as save_ros2_bag
    from maneuver_automaton.exports.table import save_csv as save_csv

__getattr__, __dir__ = lazily(__name__)
