"""The maneuver automaton, and the plans that are its words."""

from maneuver_automaton.automaton.automaton import Automaton as Automaton
from maneuver_automaton.automaton.plan import Plan as Plan
from maneuver_automaton.automaton.plan import Primitive as Primitive
from maneuver_automaton.automaton.same_motion import same_motion as same_motion
from maneuver_automaton.primitives import Trajectory as Trajectory
