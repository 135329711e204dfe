"""Help of every command, the version, completion, and the scenarios that come along."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer.main

import maneuver_automaton as ma
from maneuver_automaton.cli import run
from maneuver_automaton.cli.app import EXAMPLES, app

SCENARIOS = Path(__file__).parents[1] / "scenarios"
ROOT = typer.main.get_command(app)


def commands(command=ROOT, path=()):
    yield path, command
    for name, one in getattr(command, "commands", {}).items():
        yield from commands(one, (*path, name))


COMMANDS = dict(commands())


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_every_help_has_exit_codes_and_an_example(path, capsys):
    assert run([*path, "-h"]) == 0
    short = capsys.readouterr().out
    assert run([*path, "--help"]) == 0
    assert capsys.readouterr().out == short
    assert "Exit codes: 0 " in short
    assert re.search(r"Examples:\n +maneuver-automaton ", short)


@pytest.mark.parametrize("example", sum(EXAMPLES.values(), ()))
def test_examples_are_commands_with_options_that_exist(example):
    words = example.split(" > ")[0].split()[1:]
    command = ROOT
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words.pop(0)]
    known = {text for parameter in command.params for text in parameter.opts}
    assert {word for word in words if word.startswith("-")} <= known
    for word in words:
        if word.startswith("scenarios"):
            assert (SCENARIOS.parent / word).exists()


@pytest.mark.parametrize("example", EXAMPLES["convert"])
def test_examples_of_conversions_run(example, folder):
    words = example.split()[1:]
    (folder / "scenarios").symlink_to(SCENARIOS)
    if Path(words[1]).exists():
        assert run(words) == 0


def test_the_version_is_printed(capsys):
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"maneuver-automaton {ma.__version__}\n"


def test_the_shell_completes(capsys, monkeypatch):
    monkeypatch.setenv("_MANEUVER_AUTOMATON_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "maneuver-automaton pl")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert run([]) == 0
    assert capsys.readouterr().out.split() == ["plan", "plot"]


def test_examples_are_listed_with_a_line_each(capsys):
    assert run(["example"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == sorted(
        p.stem for p in (*SCENARIOS.glob("*.yaml"), *SCENARIOS.glob("fleets/*.yaml"))
    )
    assert "parking_loop                mpc   Parallel parking in closed loop" in lines


def test_an_example_comes_with_what_it_refers_to(folder, capsys):
    assert run(["example", "warehouse"]) == 0
    assert capsys.readouterr().out == (
        "warehouse.yaml: Warehouse; next: maneuver-automaton plan warehouse.yaml\n"
    )
    written = sorted(str(p.relative_to(folder)) for p in folder.rglob("*.*"))
    assert written == ["maps/warehouse.pgm", "maps/warehouse.yaml", "warehouse.yaml"]
    assert ma.load_scenario("warehouse.yaml").problem.obstacles[0].blocked.any()
    assert run(["example", "warehouse"]) == 0  # the same again


def test_every_example_loads_where_it_was_written(tmp_path):
    for path in SCENARIOS.glob("*.yaml"):
        assert run(["example", path.stem, "--out", str(tmp_path)]) == 0
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()
    ma.load_scenario(tmp_path / "warehouse.yaml")


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["parkin"], "example: no scenario 'parkin'; did you mean 'parking'? `maneuver-automaton "
         "example` lists them"),
        (["../x"], "example: no scenario '../x'; `maneuver-automaton example` lists them"),
        (["parking", "--out", "b.yaml"],
         "b.yaml: exists already, with other content; need --out with another name"),
    ],
)  # fmt: skip
def test_what_is_no_example_is_told(argv, said, folder, capsys):
    Path("b.yaml").write_text("mine")
    assert run(["example", *argv]) == 2
    assert capsys.readouterr().err == f"{said}\n"
    assert Path("b.yaml").read_text() == "mine"
