"""Words: trims, how long each lasts, and the transitions between them, for every vehicle."""

from maneuver_automaton.words.closing import steer as steer
from maneuver_automaton.words.switching_times import SwitchingTimes as SwitchingTimes
from maneuver_automaton.words.switching_times import TimesStatus as TimesStatus
from maneuver_automaton.words.switching_times import solve_switching_times as solve_switching_times
from maneuver_automaton.words.word import Word as Word
