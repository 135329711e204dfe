"""`plan(problem)`: choose, search, refine, check, audit."""

from maneuver_automaton.planning.many import plan_many as plan_many
from maneuver_automaton.planning.plan import plan as plan
from maneuver_automaton.planning.plan import plans as plans
from maneuver_automaton.planning.planner import Planner as Planner
from maneuver_automaton.planning.result import Alternative as Alternative
from maneuver_automaton.planning.result import LowerBound as LowerBound
from maneuver_automaton.planning.result import PlanResult as PlanResult
from maneuver_automaton.planning.result import PlanStatus as PlanStatus
