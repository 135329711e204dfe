"""`automaton design`: what it writes, says, and refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from maneuver_automaton.automaton.library import load_library, load_stock_library, save_library
from maneuver_automaton.cli import run
from maneuver_automaton.scenario import load_scenario

EXAMPLE = Path(__file__).parents[1] / "docs" / "howto" / "city_car.yaml"
FILE = """\
schema: 1
library: robots
vehicle: {model: unicycle}
trims: {speed: [-1, 0, 1], turn_rate: [-1, -0.5, 0, 0.5, 1]}
design: {cost: {time: 1}, within: 1.05}
"""
pytestmark = pytest.mark.usefixtures("folder")


def design(text, *options, name="d.yaml"):
    Path(name).write_text(text)
    return run(["automaton", "design", name, "-o", "d.json", *options])


def test_the_library_is_written_and_plans(capsys):
    assert design(FILE) == 0
    said = capsys.readouterr().out
    assert "words of any length: factor 1, every start and goal" in said
    assert "d.json: 6 of 14 candidates, hash " in said
    assert load_library("d.json").name == "robots"
    Path("s.yaml").write_text(
        "schema: 1\nvehicle: {model: unicycle}\nautomaton: {file: d.json}\n"
        "start: {pose: [0, 0, 0]}\ngoal: {pose: [1, 1, 0]}\n"
    )
    assert len(load_scenario("s.yaml").problem.automaton) == 6
    assert design(FILE, "--quiet") == 0
    assert capsys.readouterr().out == ""


def test_what_is_proven_of_short_words_is_said(capsys):
    assert design(FILE, "--max-trims", "4", "--radius", "2.4", "--quiet") == 0
    assert design(FILE, "--max-trims", "4", "--radius", "2.4") == 0
    said = capsys.readouterr().out
    assert "words of at most 4 trims: factor 1 proven on " in said
    assert (
        "goals within 2.4 m, at all headings, to which the shortest path is at least 0.5 m" in said
    )


@pytest.mark.slow
def test_the_factor_is_drawn(capsys):
    options = ("--max-trims", "4", "--radius", "2", "--plot")
    assert design(FILE, *options) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "d.png"
    assert Path("d.png").read_bytes().startswith(b"\x89PNG")
    assert design(FILE, "--plot") == 0
    assert "not drawn: the factor of words of any length" in capsys.readouterr().err


def test_a_factor_that_is_not_kept_is_said(capsys):
    assert design(FILE, "--most", "4") == 1
    said = capsys.readouterr()
    assert said.err.startswith("d.yaml: asked for a factor within 1.05, proven is 2: allow more")
    assert len(load_library("d.json")) == 4
    assert design(FILE, "--most", "4", "--within", "2") == 0


def test_the_page_shows_the_example():
    page = EXAMPLE.with_name("library.md").read_text(encoding="utf-8")
    assert f"```text\n{EXAMPLE.read_text(encoding='utf-8')}```" in page


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_example_of_the_help(capsys):
    assert run(["automaton", "design", str(EXAMPLE), "-o", "city_car.json"]) == 0
    assert "words of at most 4 trims: factor 1.04674 proven" in capsys.readouterr().out
    assert len(load_library("city_car.json")) == 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("within: 1.05", "within: 0.5"),
            ":5: design.within: got 0.5, need a factor of at least 1",
        ),
        (("within: 1.05", "witin: 1.05"), ":5: design.witin: unknown key; did you mean 'within'?"),
        (("cost: {time: 1}", "cost: {switch: 1}"), "prices of switch and direction_change"),
        (
            ("cost: {time: 1}", "cost: {tim: 1}"),
            "design.cost.tim: unknown key; did you mean 'time'?",
        ),
        (("cost: {time: 1}", "max_trims: 4"), "moves and costs nothing"),
        (("within: 1.05", "max_trims: 4"), "design: radius: max_trims needs a radius of goals"),
        (("within: 1.05", "max_trims: 2, radius_m: 3"), "max_trims must be at least 3"),
        (
            ("within: 1.05", "max_trims: 4, tasks: [[[0, 0], [1, 1, 0]]]"),
            "design.tasks[0][0]: got [0, 0], need a pose [x, y, heading], three numbers",
        ),
        (("design: {cost: {time: 1}, within: 1.05}", ""), "misses the key design"),
        (("[-1, 0, 1], turn_rate: [-1, -0.5, 0, 0.5, 1]", "[0], turn_rate: [0]"), "all candidates"),
    ],
)
def test_bad_files_are_refused_in_one_line(change, message, capsys):
    assert design(FILE.replace(*change)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("d.yaml:")
    assert message in said
    assert not Path("d.json").exists()


def test_a_library_with_maneuvers_is_thinned(capsys):
    save_library(load_stock_library("second_order_car"), "car.json")
    assert run(["automaton", "design", "car.json", "--most", "150", "-o", "small.json"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("small.json: 150 of 438 maneuvers, hash ")
    assert "no choice of as many has less than " in said
    assert len(load_library("small.json").maneuvers) == 150
    assert run(["automaton", "design", "car.json", "--most", "20", "-o", "few.json"]) == 2
    assert "car.json: disperse: 20 maneuvers cannot lead" in capsys.readouterr().err
    for options in ([], ["--most", "150", "--within", "1.1"]):
        assert run(["automaton", "design", "car.json", *options]) == 2
        assert "--most says how many are kept, and nothing else" in capsys.readouterr().err


def test_a_file_that_is_not_there(capsys):
    assert run(["automaton", "design", "none.yaml"]) == 2
    assert "none.yaml" in capsys.readouterr().err
