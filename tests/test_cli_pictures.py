"""Pictures drawn beside the planning are those drawn after it; what fails beside is drawn here."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from maneuver_automaton.cli import pictures
from maneuver_automaton.cli.pictures import Draughtsman, draughtsman

linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux alone")
DRAWING = """
import sys
from pathlib import Path
from maneuver_automaton._interrupts import listening
from maneuver_automaton.cli.pictures import draughtsman

def write(path, text):
    Path(path).write_text(text)

def fail(path):
    raise RuntimeError("no picture")

with listening(), draughtsman(wanted=True) as one:
    assert one.begin({what})
    print(one.is_done())
"""


def plan(folder, processors):
    """The files of the parking scenario, planned on so many processors."""
    subprocess.run(
        [sys.executable, "-m", "maneuver_automaton", "plan", "scenarios/parking.yaml", "--quiet",
         "--out", str(folder)],
        check=True,
        preexec_fn=lambda: os.sched_setaffinity(0, processors),
    )  # fmt: skip
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.exhaustive
@linux
@pytest.mark.slow
def test_pictures_are_the_same_wherever_they_are_drawn(tmp_path):
    there = os.sched_getaffinity(0)
    if len(there) < 2:
        pytest.skip("one processor alone")
    beside, after = plan(tmp_path / "beside", there), plan(tmp_path / "after", {min(there)})
    assert set(beside) == set(after) == {"plan.json", "plan.png"}
    assert beside["plan.png"] == after["plan.png"]


@linux
@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("write, {path!r}, 'drawn'", "True"),
        pytest.param("fail, {path!r}", "False", marks=[pytest.mark.slow, pytest.mark.exhaustive]),
    ],
)
def test_what_fails_is_told(what, said, tmp_path):
    if len(os.sched_getaffinity(0)) < 2:
        pytest.skip("one processor alone")
    path = tmp_path / "picture"
    program = DRAWING.replace("{what}", what.format(path=str(path)))
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    )
    assert done.stdout.split() == [said]
    assert path.exists() == (said == "True")


def test_nobody_draws_beside_another_program_or_on_one_processor(monkeypatch):
    for wanted in (True, False):
        with draughtsman(wanted=wanted) as one:
            assert one is None
    monkeypatch.setattr(pictures, "is_main_program", lambda: True)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0})
    with draughtsman(wanted=True) as one:
        assert one is None


@linux
def test_what_cannot_be_sent_is_drawn_here():
    read, write = os.pipe()
    one = Draughtsman(process=-1, pipe=write)
    assert not one.begin(print, lambda: None)
    one.dismiss()
    os.close(read)
