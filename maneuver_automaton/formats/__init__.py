"""Files other than scenarios, one format a file; plans are read and written when asked for.

Those who read a map have no use for the planner that `plan_json` knows.

Whatever reads or checks a file raises InvalidScenario where it cannot be used: one line with file,
place, value met, what would be right. Whatever writes one raises OSError where it cannot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.formats.fleet_json import fleet_to_dict as fleet_to_dict
    from maneuver_automaton.formats.fleet_json import save_fleet as save_fleet
    from maneuver_automaton.formats.plan_json import load_plan as load_plan
    from maneuver_automaton.formats.plan_json import load_plans as load_plans
    from maneuver_automaton.formats.plan_json import plan_to_dict as plan_to_dict
    from maneuver_automaton.formats.plan_json import read_plan_document as read_plan_document
    from maneuver_automaton.formats.plan_json import save_plan as save_plan

__getattr__, _ = lazily(__name__)
