"""`check` of result files: every kind is proven or looked at again, or it says why not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from maneuver_automaton.cli import run
from tests.formats.test_documents import WRITERS

SCENARIOS = Path(__file__).parents[1] / "scenarios"
LOOP = str(SCENARIOS / "parking_loop.yaml")


@pytest.fixture(scope="module")
def loop(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("loop")
    assert run(["mpc", LOOP, "--quiet", "--no-plot", "--out", str(folder)]) == 0
    return folder / "closed_loop.json"


def changed(loop: Path, folder: Path, change) -> str:
    document = json.loads(loop.read_text())
    change(document)
    (folder / "x.json").write_text(json.dumps(document))
    return str(folder / "x.json")


def test_a_loop_of_one_vehicle_is_looked_at_again(loop, capsys):
    assert run(["check", str(loop), "--with", LOOP]) == 0
    said = capsys.readouterr().out
    assert "vehicle: driven               yes" in said
    assert "reached at 4 s" in said
    assert "hold in every step" in said


@pytest.mark.parametrize(
    ("change", "what", "why"),
    [
        (lambda d: d.update(cost=d["cost"] + 1.0), "vehicle: driven", "but the file says"),
        (lambda d: d["steps"][0].update(vehicle_pose=[0.5, 1.0, 0.0]), "vehicle: driven",
         "beside its start"),
        (lambda d: d["steps"][-1].update(vehicle_pose=[0.5, 1.0, 0.0]), "vehicle: goal",
         "the file says so, but it is elsewhere"),
        (lambda d: d.update(broken_guarantees=[
            {"step": 1, "guarantee": "value decrease", "reason": "it rose"}]),
         "guarantees: as the file says", "broken in 1 steps"),
        (lambda d: d.update(reached=False, status="steps_spent"), "vehicle: goal", "steps_spent"),
    ],
)  # fmt: skip
def test_what_does_not_hold_of_a_loop_is_told(loop, tmp_path, capsys, change, what, why):
    assert run(["check", changed(loop, tmp_path, change), "--with", LOOP]) == 1
    rows = capsys.readouterr().out.splitlines()
    (row,) = [row for row in rows if row.strip().startswith(what)]
    assert " NO " in row
    assert why in row


def test_a_loop_alone_says_what_it_needs(loop, capsys):
    assert run(["check", str(loop)]) == 2
    assert capsys.readouterr().err == (
        f"{loop}: is a closed loop, which does not state its problem; need --with FILE, the "
        "scenario that it was driven in\n"
    )
    assert run(["check", str(loop), "--with", str(SCENARIOS / "car_slot.yaml")]) == 2
    assert "planned with another library" in capsys.readouterr().err


def test_statistics_say_why_they_cannot_be_checked(tmp_path, capsys):
    WRITERS["statistics"](tmp_path, tmp_path / "statistics.json")
    assert run(["check", str(tmp_path / "statistics.json")]) == 2
    assert "holds statistics, which do not say what was driven" in capsys.readouterr().err
