"""A second opinion on a finished plan, which shares no code with what made it.

The model's equations are integrated once under the plan's controls, from its start. What the plan
states is compared with that, and the distance of that motion to the obstacles is bounded from
below, between samples too.
"""

from __future__ import annotations

from maneuver_automaton.audit.clearance import Least as Least
from maneuver_automaton.audit.judge import Audit as Audit
from maneuver_automaton.audit.judge import StatedPrices as StatedPrices
from maneuver_automaton.audit.judge import TerminalError as TerminalError
from maneuver_automaton.audit.judge import audit_plan as audit_plan
from maneuver_automaton.audit.judge import closest_to as closest_to
from maneuver_automaton.audit.judge import terminal_error as terminal_error
from maneuver_automaton.audit.outlines import Surroundings as Surroundings
from maneuver_automaton.audit.outlines import surroundings_around as surroundings_around
