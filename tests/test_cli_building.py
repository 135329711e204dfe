"""What a terminal shows while a library is built; elsewhere there is silence."""

from __future__ import annotations

import subprocess
import sys

from tests.test_cli_terminal import on_a_terminal

ROBOT = """schema: 1
library: robots
model: {kind: second_order_unicycle, max_speed: 1.0, max_turn_rate: 1.0, max_acceleration: 1.0,
  max_angular_acceleration: 2.0}
trims: {speed: [-0.5, 0.0, 0.5], turn_rate: [-1.0, 0.0, 1.0]}
"""


def test_a_terminal_shows_that_something_goes_on(tmp_path):
    (tmp_path / "a.yaml").write_text(ROBOT)
    assert "joining the trims" in on_a_terminal("automaton", "build", "a.yaml", cwd=tmp_path)
    arguments = [sys.executable, "-m", "maneuver_automaton", "automaton", "build", "a.yaml"]
    alone = subprocess.run(arguments, cwd=tmp_path, capture_output=True, check=True)
    assert alone.stderr == b""
