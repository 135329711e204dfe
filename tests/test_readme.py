"""README.md and the pages in docs/: their Python and commands run, their tables know every key."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.formats.plan_json import plan_to_dict
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.scenario import json_schema, load_scenario, scenario_of_text

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
TEXTS = {page: page.read_text(encoding="utf-8") for page in PAGES}
TEXT = "\n".join(TEXTS.values())


def blocks(language: str) -> list[str]:
    """The fenced blocks of a language, those of README.md first."""
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, flags=re.DOTALL | re.MULTILINE)


def first_words(text: str) -> str:
    """What names a block in the list of tests."""
    return next(line for line in text.splitlines() if "import" not in line and line)[:40]


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the scenarios and libraries in it, as in a clone; the current one."""
    for folder in ("scenarios", "maneuver_automaton/libraries"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("code", blocks("python"), ids=first_words)
def test_python_runs(clone, code):
    exec(compile(code, "README.md", "exec"), {"__name__": "__main__"})


def test_the_first_plan_is_short_and_prints_what_it_says(clone, capsys):
    code = blocks("python")[0]
    assert len(code.splitlines()) <= 15
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert f"# {printed[0]}" in code.splitlines()


def test_the_first_plan_among_obstacles_is_short():
    code = next(code for code in blocks("python") if "obstacles=" in code)
    assert len(code.splitlines()) <= 15


COMMANDS = [
    line
    for block in blocks("sh")
    for line in block.splitlines()
    if line.startswith("maneuver-automaton ")
]


def test_commands_run(clone):
    assert len(COMMANDS) >= 4
    for line in COMMANDS:
        assert run(shlex.split(line, comments=True)[1:]) == 0, line
    for name in ("plan.png", "alternatives.png", "plan.gif"):
        assert (Path("out") / name).exists() == (name != "alternatives.png")


def test_the_yaml_is_that_of_the_scenario():
    text, obstacles = blocks("yaml")
    assert (ROOT / "scenarios" / "parking.yaml").read_text(encoding="utf-8").endswith(text)
    assert len(scenario_of_text(text + obstacles, name="README").problem.obstacles) == 4


def keys_of(schema: Any) -> set[str]:
    """Names of all properties in a JSON Schema."""
    if isinstance(schema, list):
        return set().union(*map(keys_of, schema))
    if not isinstance(schema, dict):
        return set()
    return set(schema.get("properties", {})).union(*map(keys_of, schema.values()))


def test_every_key_of_a_scenario_is_explained():
    words = set(re.findall(r"[a-z_0-9]+", " ".join(re.findall(r"`[^`\n]+`", TEXT))))
    assert keys_of(json_schema()) <= words


def test_every_key_of_a_plan_and_every_status_is_explained():
    document = plan_to_dict(plan(load_scenario(ROOT / "scenarios" / "parking.yaml").problem))
    for key in [*document, *document["trajectory"], *(status.value for status in PlanStatus)]:
        assert f"`{key}`" in TEXT


def anchors(page: Path) -> set[str]:
    """The names by which GitHub links to the headings of a page."""
    text = re.sub(r"^```.*?^```", "", TEXTS[page], flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^a-z0-9 _-]", "", one.lower()).replace(" ", "-") for one in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)]+)\)", TEXTS[page]):
        name, _, anchor = target.partition("#")
        there = (page.parent / name).resolve() if name else page
        assert there.is_file(), target
        assert not anchor or anchor in anchors(there), target


def test_every_page_can_be_found_and_every_picture_is_shown():
    for page in PAGES[1:]:
        assert f"](docs/{page.name})" in TEXTS[PAGES[0]]
    for picture in (ROOT / "scenarios" / "pictures").iterdir():
        assert picture.stat().st_size < 120_000
        assert picture.name in TEXT
