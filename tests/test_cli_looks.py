"""`--title`, `--size` and `--style` on the command line."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from maneuver_automaton.cli.app import run
from maneuver_automaton.plotting.pages import DPI

SCENARIOS = Path(__file__).parents[1] / "scenarios"
PAPER = ["--style", "paper", "--size", "3.5x4", "--title", "Parking"]


def test_a_plan_and_its_file_are_drawn_in_the_size_of_a_column(tmp_path):
    plan = ["plan", str(SCENARIOS / "parking.yaml"), "--out", str(tmp_path), "--quiet"]
    assert run([*plan, *PAPER]) == 0
    plan, again = tmp_path / "plan.json", tmp_path / "again.png"
    assert run(["plot", str(plan), "--out", str(again), *PAPER]) == 0
    for path in (tmp_path / "plan.png", again):
        with Image.open(path) as picture:
            assert picture.size == (3.5 * DPI, 4 * DPI)
    assert run(["plot", str(plan), "--out", str(tmp_path / "plan.svg"), *PAPER]) == 0
    drawn = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert ">Parking</text>" in drawn
    assert "terminal error" not in drawn  # that is for the caption


def test_a_picture_carries_the_name_of_its_scenario_unless_told_otherwise(tmp_path, monkeypatch):
    from maneuver_automaton import plotting

    looks = []
    monkeypatch.setattr(plotting, "save_picture", lambda *_, look: looks.append(look))
    loop = ["mpc", str(SCENARIOS / "parking_loop.yaml"), "--out", str(tmp_path), "--quiet"]
    for more in ([], ["--title", "A loop"], ["--style", "paper"]):
        assert run([*loop, *more]) == 0
    assert [look.title for look in looks] == ["Parallel parking in closed loop", "A loop", ""]
