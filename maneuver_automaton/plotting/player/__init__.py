"""The player: whatever moves as one HTML file that needs nothing else."""

from maneuver_automaton.plotting.player.content import Player as Player
from maneuver_automaton.plotting.player.content import player_of as player_of
from maneuver_automaton.plotting.player.content import player_of_file as player_of_file
