"""Files other than scenarios, one format a file."""

from maneuver_automaton.formats.plan_json import load_plan as load_plan
from maneuver_automaton.formats.plan_json import plan_to_dict as plan_to_dict
from maneuver_automaton.formats.plan_json import read_plan_document as read_plan_document
from maneuver_automaton.formats.plan_json import save_plan as save_plan
