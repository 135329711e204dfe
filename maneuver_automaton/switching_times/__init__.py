"""Coasting times of a fixed word: where it ends, and which times are best."""

from maneuver_automaton.switching_times.end_pose import end_pose as end_pose
from maneuver_automaton.switching_times.end_pose import end_twists as end_twists
from maneuver_automaton.switching_times.solve import SwitchingTimes as SwitchingTimes
from maneuver_automaton.switching_times.solve import TimesStatus as TimesStatus
from maneuver_automaton.switching_times.solve import (
    solve_switching_times as solve_switching_times,
)
from maneuver_automaton.switching_times.with_maneuvers import (
    solve_times_with_maneuvers as solve_times_with_maneuvers,
)
