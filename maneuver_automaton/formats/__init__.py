"""Files other than scenarios, one format a file; plans are read and written when asked for.

Those who read a map have no use for the planner that `plan_json` knows.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from maneuver_automaton.formats.plan_json import load_plan as load_plan
    from maneuver_automaton.formats.plan_json import plan_to_dict as plan_to_dict
    from maneuver_automaton.formats.plan_json import read_plan_document as read_plan_document
    from maneuver_automaton.formats.plan_json import save_plan as save_plan

_OF_PLANS = ("load_plan", "plan_to_dict", "read_plan_document", "save_plan")


def __getattr__(name: str) -> Any:
    if name not in _OF_PLANS:
        raise AttributeError(f"module 'maneuver_automaton.formats' has no attribute {name!r}")
    value = getattr(importlib.import_module("maneuver_automaton.formats.plan_json"), name)
    globals()[name] = value
    return value
