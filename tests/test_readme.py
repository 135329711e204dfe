"""README.md and the pages in docs/: their Python and commands run, their tables know every key.

What a page says that its code prints is compared; so are the numbers of docs/paper.md, and the
tables of the reference, which ``python docs/measure.py`` writes. Notebooks are executed while the
site is built; here their links and outputs are looked at.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from maneuver_automaton.cli import run
from maneuver_automaton.fleet import plan_fleet, simulate_fleet, verify_driven
from maneuver_automaton.formats.fleet_json import fleet_loop_to_dict, fleet_to_dict
from maneuver_automaton.formats.plan_json import plan_to_dict
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.scenario import json_schema, load_scenario, scenario_of_text

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import measure  # noqa: E402

PAGES = (
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted(DOCS.rglob("*.md")),
    *sorted(DOCS.rglob("*.ipynb")),
)


def text_of(page: Path) -> str:
    """The text of a page, of a notebook that of its cells of text."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".md":
        return text
    cells = json.loads(text)["cells"]
    return "\n\n".join("".join(one["source"]) for one in cells if one["cell_type"] == "markdown")


TEXTS = {page: text_of(page) for page in PAGES}
EXPLAINED = [text for page, text in TEXTS.items() if page.parent.name != "reference"]
TEXT = "\n".join(EXPLAINED)
OF_FILES = "\n".join([TEXT, TEXTS[DOCS / "reference" / "documents.md"]])  # keys of result files
LONG = {  # pages whose code, and words in commands that, take seconds
    "best_so_far",
    "exact_pose",
    "gear_changes",
    "keep_away",
    "on_the_way",
    "primitives",
    "replanning",
    "smoothing",
    "tight_aisle",
    "trailers",
    "tune",
    "wind",
    "turn_on_the_spot",
    "why_no_plan",
}
LONGEST = {"gear_changes", "primitives", "replanning", "tight_aisle", "wind"}


def blocks(language: str, text: str = TEXT) -> list[str]:
    """The fenced blocks of a language, those of README.md first."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def code_of_pages() -> list[Any]:
    """Every block of Python and its output, if one is shown; named by its page and first line."""
    return [
        pytest.param(
            match["code"],
            match["output"],
            id=f"{page.stem}: {first_words(match['code'])}",
            marks=marks_of(page, match["code"]),
        )
        for page, text in TEXTS.items()
        for match in measure.CODE.finditer(text)
    ]


def marks_of(page: Path, code: str) -> list[pytest.MarkDecorator]:
    """How long a block takes that goes through many scenarios, or starts processes."""
    several = "for name" in code
    long = [pytest.mark.slow] if several or page.stem in LONG or "distributed" in code else []
    return [*long, pytest.mark.exhaustive] if several or page.stem in LONGEST else long


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


@pytest.mark.parametrize(("code", "output"), code_of_pages())
def test_python_runs_and_prints_what_is_shown(clone, capsys, code, output):
    if "distributed" in code:
        pytest.importorskip("distributed")
    exec(compile(code, "README.md", "exec"), {"__name__": "__main__"})
    now = capsys.readouterr().out
    assert output is None or not measure.printed.differs(output, now), now


@pytest.mark.parametrize("command", dict.fromkeys(measure.ROW.findall(TEXTS[DOCS / "paper.md"])))
def test_the_numbers_beside_those_of_the_paper_are_those_of_the_commands(clone, command):
    row = "| " + " | ".join(
        cell if k not in (1, 2) else f"`{cell}`" for k, cell in enumerate(command)
    )
    assert measure.with_numbers(f"{row} |") == f"{row} |"


@pytest.mark.parametrize("page", measure.TABLES)
def test_the_tables_are_generated_from_the_package_as_it_is(page):
    # `python docs/measure.py tables` writes them
    assert (DOCS / page).read_text(encoding="utf-8") == measure.with_table(page)


@pytest.mark.parametrize(
    ("said", "now", "other"),
    [
        ("cost 7.60 m", "cost 7.60  m", False),
        ("cost 7.60 m", "cost 7.61 m", False),
        ("cost 7.60 m", "cost 7.62 m", True),
        ("3 plans", "4 plans", True),
        ("[0.541 1.944]", "[0.542 1.944]", False),
        ("cost 7.60", "price 7.60", True),
        ("at most 2e-15 m", "at most 3e-15 m", False),
        ("at most 2e-15 m", "at most 2e-12 m", True),
        ("(measured on 2 cores of X)\n0.12 s", "0.35 s", False),
    ],
)
def test_outputs_are_compared_to_their_printed_digits(said, now, other):
    assert measure.printed.differs(said, now) == other


def test_the_first_plan_is_short_and_prints_what_it_says(clone, capsys):
    code = blocks("python")[0]
    assert len(code.splitlines()) <= 15
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert f"# {printed[0]}" in code.splitlines()


def test_the_first_plan_among_obstacles_is_short():
    code = blocks("python", TEXTS[DOCS / "obstacles.md"])[0]
    assert "obstacles=" in code
    assert len(code.splitlines()) <= 15


COMMANDS = [
    line
    for block in blocks("sh")
    for line in block.splitlines()
    if line.startswith("maneuver-automaton ")
]


@pytest.mark.exhaustive
@pytest.mark.slow
def test_commands_run(clone):
    for line in COMMANDS:
        assert run(shlex.split(line, comments=True)[1:]) == 0, line
    for name in ("plan.png", "alternatives.png", "plan.gif"):
        assert (Path("out") / name).exists() == (name != "alternatives.png")


def test_the_yaml_is_that_of_the_scenario():
    page = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    text, on_the_way, obstacles = blocks("yaml", page)
    assert (ROOT / "scenarios" / "parking.yaml").read_text(encoding="utf-8").endswith(text)
    assert len(scenario_of_text(text + obstacles, name="README").problem.obstacles) == 4
    free = text.replace("horizon: {time_s: 8.0, max_trims: 4}\n", "")
    assert len(scenario_of_text(free + on_the_way, name="README").problem.via) == 4


def test_several_vehicles_are_a_scenario(tmp_path):
    (text,) = blocks("yml")
    (tmp_path / "x.yaml").write_text(text)
    assert load_scenario(tmp_path / "x.yaml").fleet.names == ("east", "west")


def test_every_key_of_the_plans_of_a_fleet_is_explained():
    fleet = load_scenario(ROOT / "scenarios/fleets/intersection.yaml").fleet
    document = fleet_to_dict(plan_fleet(fleet, time_limit=0.5))
    for key in [*document, *document["clearance_m"], *document["timing_s"], *document["counts"]]:
        assert f"`{key}`" in OF_FILES


def test_every_key_of_the_loop_of_a_fleet_is_explained():
    fleet = load_scenario(ROOT / "scenarios/fleets/alcove.yaml").fleet
    log = simulate_fleet(fleet, step=0.5, steps=2, first_time_limit=0.5)
    document = fleet_loop_to_dict(log, verify_driven(log))
    vehicle = document["vehicles"]["east"]
    for key in [*document, *vehicle, *vehicle["steps"][0], *document["steps"][0]]:
        if key not in ("schema", "version", "name"):
            assert f"`{key}`" in TEXT


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
        assert f"`{key}`" in OF_FILES


def anchors(page: Path) -> set[str]:
    """The names by which GitHub links to the headings of a page."""
    text = re.sub(r"^```.*?^```", "", TEXTS[page], flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^a-z0-9 _-]", "", one.lower()).replace(" ", "-") for one in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)]+)\)", TEXTS[page]):
        name, _, anchor = target.partition("#")
        if name.startswith("https://"):
            continue
        there = (page.parent / name).resolve() if name else page
        assert there.is_file(), target
        assert not anchor or anchor in anchors(there), target


def test_what_inside_names_is_where_it_says():
    """Every file, and every function or class named behind one."""
    text = re.sub(r"^```.*?^```", "", TEXTS[DOCS / "inside.md"], flags=re.DOTALL | re.MULTILINE)
    files = {path: f"/{path.relative_to(ROOT).as_posix()}" for path in ROOT.glob("*/**/*.*")}
    for name, what in re.findall(r"`([\w/]+\.(?:py|json))`(?:, `(?:\w+\.)?(\w+)`)?", text):
        named = [path for path, full in files.items() if full.endswith(f"/{name}")]
        assert named, name
        kind = rf"\b(?:def|class) {what}\b"
        assert not what or any(re.search(kind, path.read_text()) for path in named), (name, what)


def in_navigation(part: Any) -> set[str]:
    """The pages that the navigation of the site lists."""
    if isinstance(part, str):
        return {part}
    return set().union(*map(in_navigation, part.values() if isinstance(part, dict) else part))


def test_every_page_is_in_the_navigation():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = {page.relative_to(DOCS).with_suffix(".md") for page in PAGES if DOCS in page.parents}
    pages |= {Path(measure.reference.page_of(title)) for title in measure.reference.topics()}
    outside = {"README.md", "CONTRIBUTING.md", "CHANGELOG.md"}
    assert in_navigation(yaml.safe_load(text)["nav"]) == outside | {one.as_posix() for one in pages}


def test_the_readme_is_short_and_leads_to_every_page_of_the_first_level():
    assert len(TEXTS[ROOT / "README.md"].splitlines()) <= 150
    for page in DOCS.glob("*.md"):
        assert f"](docs/{page.name})" in TEXTS[ROOT / "README.md"]


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.ipynb")), ids=lambda page: page.stem)
def test_notebooks_are_kept_with_outputs_but_players(page):
    text = page.read_text(encoding="utf-8")
    cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    assert all(cell["execution_count"] == number for number, cell in enumerate(cells, 1))
    assert sum(bool(cell["outputs"]) for cell in cells) >= 2
    assert "<iframe" not in text
    assert len(text) < 300_000


def test_every_picture_is_small_and_shown():
    for picture in [*(ROOT / "scenarios" / "pictures").iterdir(), *DOCS.glob("pictures/*.png")]:
        assert picture.stat().st_size < (1_500_000 if picture.suffix == ".gif" else 120_000)
        assert picture.name in TEXT


def test_every_scenario_is_in_the_gallery():
    drawn = {picture.stem for picture in DOCS.glob("pictures/gallery/*.png")}
    assert drawn == {scenario.stem for scenario in measure.gallery.scenarios()}
