"""The player: a plan, a closed loop or a drive as one HTML file that needs nothing else."""

from maneuver_automaton.plotting.player.page import Player as Player
from maneuver_automaton.plotting.player.sources import player_of as player_of
from maneuver_automaton.plotting.player.sources import player_of_file as player_of_file
