"""Folders of files: several at a time, each told as it comes, and going on after a kill."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from maneuver_automaton.cli import folder_runs, jobs, run
from tests.scenario.files import SCENARIO, but

LOOP = SCENARIO + "receding_horizon: {step_s: 1.0, steps: 12}\n"
AHEAD_ONLY = but("    - {name: spin, control: [0.0, 1.0]}\n", "")
QUICK = ("--no-plot", "--time-limit", "5")
FILES = {"many/a.yaml": LOOP, "many/b.yaml": AHEAD_ONLY, "many/c.yaml": LOOP}


def killed_after(count, monkeypatch):
    """Make the program die, as by a kill, after so many files."""
    one, done = jobs._row, []

    def row(problem, **settings):
        if len(done) == count:
            raise KeyboardInterrupt
        done.append(problem[0].name)
        return one(problem, **settings)

    monkeypatch.setattr(jobs, "_row", row)
    return done


@pytest.mark.parametrize(
    ("command", "names"), [("plan", ["a.yaml", "b.yaml", "c.yaml"]), ("mpc", ["a.yaml", "c.yaml"])]
)
def test_what_is_finished_is_not_done_again(folder, monkeypatch, capsys, command, names):
    with monkeypatch.context() as first:
        done = killed_after(1, first)
        assert run([command, "many", *QUICK]) == 130
        assert done == ["a.yaml"]
    assert len((folder / "out" / folder_runs.JOURNAL).read_text().splitlines()) == 1
    capsys.readouterr()
    with monkeypatch.context() as second:
        done = killed_after(9, second)
        run([command, "many", *QUICK])
        assert done == names[1:]
    printed = capsys.readouterr().out
    assert printed.startswith(f"1 of {len(names)} were done by a run before\n")
    assert all(name in printed.split("were done")[1] for name in names)  # in the table
    assert not (folder / "out" / folder_runs.JOURNAL).exists()
    with monkeypatch.context() as third:  # all were done: a new run begins anew
        done = killed_after(9, third)
        run([command, "many", *QUICK])
        assert done == names


@pytest.mark.parametrize("change", ["file", "options", "result"])
def test_what_has_changed_is_done_again(folder, monkeypatch, change):
    with monkeypatch.context() as first:
        killed_after(1, first)
        assert run(["plan", "many", *QUICK]) == 130
    options = QUICK
    if change == "file":
        Path("many/a.yaml").write_text(LOOP + "# another line\n")
    elif change == "options":
        options = ("--no-plot", "--time-limit", "6")
    else:
        Path("out/a/plan.json").unlink()
    done = killed_after(9, monkeypatch)
    run(["plan", "many", *options])
    assert done == ["a.yaml", "b.yaml", "c.yaml"]


def test_a_line_that_was_cut_off_does_not_count(folder, monkeypatch):
    Path("out").mkdir()
    Path("out/.journal").write_text('{"key": "abc", "na')
    done = killed_after(9, monkeypatch)
    assert run(["plan", "many", *QUICK, "--quiet"]) == 1
    assert len(done) == 3


def test_results_come_one_by_one_and_then_as_a_table(folder, capsys):
    assert run(["plan", "many", *QUICK]) == 1
    lines = capsys.readouterr().out.splitlines()
    cost = json.loads(Path("out/a/plan.json").read_text())["cost"]
    assert lines[0] == f"a.yaml: found, cost {cost:.6g}"
    assert lines[1] == "b.yaml: unreachable"
    assert any("clearance [m]" in line for line in lines[3:])


@pytest.mark.slow  # two processes that import everything
def test_loops_run_several_at_a_time(folder, capsys):
    Path("many/b.yaml").write_text(LOOP.replace("    - {name: spin, control: [0.0, 1.0]}\n", ""))
    assert run(["mpc", "many", *QUICK, "--jobs", "2"]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith("many/b.yaml: no_plan: ")
    assert sorted(path.name for path in Path("out").iterdir()) == ["a", "b", "c"]
    assert json.loads(Path("out/c/closed_loop.json").read_text())["reached"] is True
    assert "c.yaml: reached, cost " in printed.out


@pytest.mark.parametrize("command", ["plan", "mpc"])
def test_a_wrong_address_is_told(folder, monkeypatch, capsys, command):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: True)
    monkeypatch.setattr(folder_runs, "problems_in", None)  # no file is read before
    assert run([command, "many", *QUICK, "--dask", "nowhere"]) == 2
    assert capsys.readouterr().err == (
        "--dask: got 'nowhere', need an address such as tcp://host:8786, or local\n"
    )
