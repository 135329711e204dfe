"""A second opinion on a finished plan, which shares no code with the search that found it.

The model's equations are integrated under the plan's controls, and every pose of the plan is
compared with them. The distance to the obstacles is measured by another library than the one that
checked the motions.
"""

from maneuver_automaton.audit.clearance import closest_to as closest_to
from maneuver_automaton.audit.judge import audit_plan as audit_plan
from maneuver_automaton.audit.values import Audit as Audit
from maneuver_automaton.audit.values import TerminalError as TerminalError
from maneuver_automaton.audit.values import terminal_error as terminal_error
