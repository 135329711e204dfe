"""Improvement of plans: words, smooth motions, and the pace along a path."""

from maneuver_automaton.refinement.effort import EffortReport as EffortReport
from maneuver_automaton.refinement.effort import effort_report as effort_report
from maneuver_automaton.refinement.polish import PolishedMotion as PolishedMotion
from maneuver_automaton.refinement.polish import PolishResult as PolishResult
from maneuver_automaton.refinement.polish import PolishTask as PolishTask
from maneuver_automaton.refinement.polish import polish_guesses as polish_guesses
from maneuver_automaton.refinement.retiming import Retiming as Retiming
from maneuver_automaton.refinement.retiming import retime as retime
