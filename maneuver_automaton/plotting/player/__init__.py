"""What shows values in notebooks: a player, one HTML file that needs nothing else, and pictures."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.plotting.automata import save_automaton_figure
from maneuver_automaton.plotting.pictures import save_picture
from maneuver_automaton.plotting.player.content import Player as Player
from maneuver_automaton.plotting.player.content import player_of as player_of
from maneuver_automaton.plotting.player.content import player_of_file as player_of_file


def picture_of(value: Any) -> bytes:
    """The picture of a value as a PNG."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "picture.png"
        if isinstance(value, Automaton):
            save_automaton_figure(value, file)
        else:
            save_picture(value, file)
        return file.read_bytes()
