"""The command line: parse arguments, call the rooms, print; no planning."""

from maneuver_automaton.cli.entry import main as main
from maneuver_automaton.cli.entry import run as run
