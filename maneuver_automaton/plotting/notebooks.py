"""What notebooks show of a value: its player, and its picture where no page can be shown."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.plotting.automata import save_automaton_figure
from maneuver_automaton.plotting.pictures import save_picture
from maneuver_automaton.plotting.player import player_of as player_of
from maneuver_automaton.recording import recording_of


def picture_of(value: Any) -> bytes:
    """The picture of a value as a PNG."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "picture.png"
        if isinstance(value, Automaton):
            save_automaton_figure(value, file)
        else:
            save_picture(recording_of(value), file)
        return file.read_bytes()
