"""The commands on libraries of primitives: show, draw, convert."""

from __future__ import annotations

from pathlib import Path

import pytest

from maneuver_automaton.automaton.library import load_library
from maneuver_automaton.cli import run
from tests.formats.outside import DATA, needs_data
from tests.formats.test_commonroad_primitives import XML
from tests.formats.test_lattice_files import MPRIM, nav2
from tests.plotting.cases import assert_picture
from tests.scenario.files import SCENARIO

FILES = {"a.mprim": MPRIM, "a.nav2.json": nav2(), "a.xml": XML, "a.yaml": SCENARIO}


@pytest.mark.parametrize("name", ["a.mprim", "a.nav2.json", "a.xml"])
def test_show_lists_trims_and_maneuvers(folder, capsys, name):
    assert run(["automaton", "show", name, "--coverage"]) == 0
    said = capsys.readouterr().out
    assert "duration [s]" in said
    assert "maneuver" in said
    assert "dispersion" in said
    assert "stretch factor" in said


def test_draw_makes_two_pictures(folder, capsys):
    assert run(["automaton", "draw", "a.mprim", "--out", "pictures"]) == 0
    for name in ("automaton", "automaton_maneuvers"):
        alone = Path(name)
        alone.mkdir()
        (Path("pictures") / f"{name}.png").rename(alone / "a.png")
        assert_picture(alone / "a.png")
    assert len(capsys.readouterr().out.splitlines()) == 2


@pytest.mark.parametrize("name", ["a.mprim", "a.nav2.json", "a.xml"])
def test_to_a_library_and_back(folder, capsys, name):
    ending = name.removeprefix("a")
    assert run(["convert", name, "b.json"]) == 0
    library = load_library("b.json")
    assert run(["convert", "b.json", f"c{ending}"]) == 0
    assert run(["convert", f"c{ending}", "d.json"]) == 0
    again = load_library("d.json")
    assert again.trim_names == library.trim_names
    for one, other in zip(library.maneuvers, again.maneuvers, strict=True):
        assert abs(one.displacement - other.displacement).max() < 1e-9


@pytest.mark.parametrize("name", ["a.mprim", "a.nav2.json", "a.xml"])
def test_the_same_format_is_written_to_the_last_bit(folder, capsys, name):
    assert run(["convert", name, f"b{name.removeprefix('a')}"]) == 0
    assert run(["convert", f"b{name.removeprefix('a')}", f"c{name.removeprefix('a')}"]) == 0
    written = [Path(f"{word}{name.removeprefix('a')}").read_text() for word in "bc"]
    assert written[0] == written[1]


def test_what_is_left_out_is_said(folder, capsys):
    Path("a.mprim").write_text(MPRIM.replace("0.0 0.0 6.2832", "0.0 -0.5 6.2832").replace(
        "endpose_c: 0 0 -4", "endpose_c: 0 -1 -4"))  # fmt: skip
    assert run(["convert", "a.mprim", "b.json"]) == 0
    assert "cost multipliers" not in capsys.readouterr().out
    assert run(["convert", "b.json", "b.nav2.json"]) == 0
    assert "b.nav2.json: cost multipliers are left out" in capsys.readouterr().out
    assert run(["convert", "a.xml", "b.json"]) == 0
    assert "driven with controls that are constant in each step" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["convert", "a.mprim", "b.xml"],
         "b.xml: a: a file of CommonRoad primitives states speed and steering angle of a "
         "second_order_car, got an automaton of the lattice_body"),
        (["convert", "a.yaml", "b.mprim"], "b.mprim: "),
        (["convert", "a.mprim", "b.foo"], "b.foo: is in no format that this version writes"),
        (["plan", "a.mprim"], "a.mprim: holds motion primitives, need a file that states a "
         "problem"),
        (["plan", "a.xml"], "a.xml: holds motion primitives, need a file that states a problem"),
        (["automaton", "show", "missing.mprim"], "missing.mprim: "),
        (["convert", "missing.mprim", "b.json"], "missing.mprim: "),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(folder, capsys, arguments, message):
    assert run(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith(message)
    assert said.count("\n") == 1


@pytest.mark.exhaustive
@pytest.mark.slow
@needs_data
def test_every_file_of_primitives_is_shown(tmp_path, capsys):
    paths = [
        *(DATA / "sbpl" / "mprim").glob("*.mprim"),
        *(DATA / "nav2-lattice").glob("*.json"),
        *(DATA / "commonroad" / "primitives").glob("*.xml"),
    ]
    assert len(paths) == 9
    for path in paths:
        assert run(["automaton", "show", str(path)]) == 0
