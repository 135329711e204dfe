"""What a terminal shows while a plan is being improved; elsewhere there is silence."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pty = pytest.importorskip("pty")  # a terminal to write to, where the system has them

SCENARIOS = Path(__file__).parent.parent / "scenarios"
SHOWN = re.compile(
    r"cost ([\d.]+), proven: at least ([\d.]+)(?:, gap ([\d.]+) %)?, clearance ([\d.]+) m"
)


def on_a_terminal(*arguments, cwd, run=("-m", "maneuver_automaton")):
    """What the command writes to a terminal of 80 columns."""
    reads, writes = pty.openpty()
    command = [sys.executable, *run, *map(str, arguments)]
    process = subprocess.Popen(
        command,
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=writes,
        env={**os.environ, "COLUMNS": "80", "TERM": "xterm"},
    )
    os.close(writes)
    seen = b""
    while True:
        try:
            piece = os.read(reads, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        seen += piece
    os.close(reads)
    assert process.wait() == 0
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", seen.decode())


def test_cost_bound_gap_and_clearance_are_shown_in_place(tmp_path):
    scenario, gap = SCENARIOS / "cluttered_room.yaml", ("--gap", "0.001")
    text = on_a_terminal("plan", scenario, "--no-plot", "--time-limit", 1, *gap, cwd=tmp_path)
    shown = SHOWN.findall(text)
    assert shown
    costs = [float(cost) for cost, *_ in shown]
    assert costs == sorted(costs, reverse=True)
    for cost, (_, bound, gap, _) in zip(costs, shown, strict=True):
        assert float(bound) <= cost
        assert float(gap) == pytest.approx(100.0 * (1.0 - float(bound) / cost), abs=0.6)
    assert "\n" not in text.strip()  # one line, written again and again


@pytest.mark.slow
def test_quiet_is_quiet_on_a_terminal_too(tmp_path):
    scenario = SCENARIOS / "parking.yaml"
    assert on_a_terminal("plan", scenario, "--no-plot", "--quiet", cwd=tmp_path) == ""


COMPILES = """
import time
from numba.core import event
from maneuver_automaton._compile import _meet_numba
from maneuver_automaton._compile_all import _bar
from maneuver_automaton.cli.terminal import announced, progress_bar, waiting

_meet_numba()
with announced(), progress_bar("files", 2, quiet=False), waiting("planning", quiet=False):
    time.sleep(0.3)
    with event.trigger_event("numba:compile", data={}), _bar() as bar:
        for count in range(3):
            bar(["a", "b"][:count], ["a", "b"])
            time.sleep(0.3)
    time.sleep(0.3)
"""


def test_two_bars_are_never_shown_at_once(tmp_path):
    text = on_a_terminal(cwd=tmp_path, run=("-c", COMPILES))
    assert "planning" not in text  # a bar is there already
    before, after = text.split("compiling kernels, once, at", 1)
    meanwhile = after[after.index("compiling") : after.rindex("compiling")]
    assert "files" in before
    assert "files" not in meanwhile
    assert "files" in after[after.rindex("compiling") :]
