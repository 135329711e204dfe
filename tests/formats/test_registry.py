"""Which format a file is in: asked in one place, which packages add to."""

from __future__ import annotations

from pathlib import Path

import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats import registry
from maneuver_automaton.scenario import load_scenario
from tests.scenario.test_loading import BESIDE

MODULE = '''
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.formats.statement import Statement


class Posts:
    """Posts of 0.1 m: a line of x and y for each."""

    name = "posts"

    def recognises(self, path, document):
        return path.suffix == ".posts"

    def read(self, path, document):
        rows = [tuple(map(float, line.split())) for line in path.read_text().splitlines()]
        posts = tuple(Obstacle(Disc(0.1, row)) for row in rows)
        return (Statement(format="posts", name=path.stem, obstacles=posts),)

    def writes(self, path):
        return path.suffix == ".posts"

    def write(self, cells, path):
        path.write_text(f"{cells.blocked.sum()} cells")


POSTS = Posts()
'''


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A small package beside, as an installer leaves it: a module and what is said of it."""
    site = tmp_path / "site"
    about = site / "posts_format-1.0.dist-info"
    about.mkdir(parents=True)
    (site / "posts_format.py").write_text(MODULE)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: posts-format\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{registry.GROUP}]\nposts = posts_format:POSTS\n")
    monkeypatch.syspath_prepend(str(site))
    registry.from_outside.cache_clear()
    yield about
    registry.from_outside.cache_clear()


def test_a_package_adds_a_format(installed, tmp_path, capsys):
    (tmp_path / "beside.yaml").write_text(BESIDE)
    (tmp_path / "yard.posts").write_text("3.0 4.0\n-3.0 4.0\n")
    scenario = load_scenario(tmp_path / "yard.posts", beside=tmp_path / "beside.yaml")
    assert [one.shape.center.tolist() for one in scenario.problem.obstacles] == [
        [3.0, 4.0],
        [-3.0, 4.0],
    ]
    folder = tmp_path / "many"
    folder.mkdir()
    (folder / "yard.posts").write_text("3.0 4.0\n")
    assert registry.states_a_problem(folder / "yard.posts", None)
    (tmp_path / "room.map").write_text("type octile\nheight 1\nwidth 2\nmap\n.@\n")
    assert run(["convert", str(tmp_path / "room.map"), str(tmp_path / "room.posts")]) == 0
    assert (tmp_path / "room.posts").read_text() == "1 cells"
    assert capsys.readouterr().err == ""


def test_a_format_that_cannot_be_loaded_is_told(installed, tmp_path):
    (installed / "entry_points.txt").write_text(f"[{registry.GROUP}]\nposts = nowhere:POSTS\n")
    with pytest.raises(InvalidScenario) as error:
        load_scenario(tmp_path / "yard.posts")
    assert str(error.value) == (
        "format 'posts': nowhere:POSTS cannot be loaded: No module named 'nowhere'"
    )


def test_a_scenario_asks_no_other_package(installed):
    (installed / "entry_points.txt").write_text(f"[{registry.GROUP}]\nposts = nowhere:POSTS\n")
    parking = Path(__file__).parents[2] / "scenarios" / "parking.yaml"
    assert load_scenario(parking).path == parking
