"""The command line: parse arguments, call the rooms, print; no planning."""

from maneuver_automaton.cli.app import main as main
from maneuver_automaton.cli.app import run as run
