"""Improvement of plans: words, smooth motions, and the pace along a path."""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.refinement.closure import PolishedMotion as PolishedMotion
    from maneuver_automaton.refinement.polish import PolishResult as PolishResult
    from maneuver_automaton.refinement.polish import PolishTask as PolishTask
    from maneuver_automaton.refinement.polish import polish_guesses as polish_guesses
    from maneuver_automaton.refinement.retiming import EffortReport as EffortReport
    from maneuver_automaton.refinement.retiming import Retiming as Retiming
    from maneuver_automaton.refinement.retiming import effort_report as effort_report
    from maneuver_automaton.refinement.retiming import retime as retime
    from maneuver_automaton.refinement.shooting import least_effort as least_effort

__getattr__, __dir__ = lazily(__name__)
