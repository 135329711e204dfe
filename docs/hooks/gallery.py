"""The gallery: every scenario with its picture, its first comment, its file and its player.

Its page holds a table of them, which ``python docs/measure.py tables`` writes; in the site there
are cards instead.
"""

from __future__ import annotations

import gzip
import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
PLANS = ROOT / "docs" / "plans"
BACK = "../gallery.html"  # as seen from a player
PLACE = re.compile(r"<!-- scenarios -->\n.*?<!-- end -->", flags=re.DOTALL)


def on_files(files: Any, *, config: Any) -> Any:
    """The files of the site, with a player for every plan that is kept."""
    from mkdocs.structure.files import File

    for kept in sorted(PLANS.glob("*.json.gz")):
        page = player_of_value(value_of(kept), kept.name.split(".")[0])
        files.append(File.generated(config, player_of(kept.name.split(".")[0]), content=page))
    return files


def scenarios() -> list[Path]:
    """The scenarios of one vehicle, then those of several."""
    folder = ROOT / "scenarios"
    return [*sorted(folder.glob("*.yaml")), *sorted(folder.glob("fleets/*.yaml"))]


class Entry(NamedTuple):
    """What the gallery says of a scenario."""

    title: str
    about: str
    command: str  # plan or mpc
    file: str  # in the folder of scenarios
    picture: str


def entry(scenario: Path) -> Entry:
    """The name of a scenario, the comment it begins with, and how it is planned."""
    text = scenario.read_text(encoding="utf-8")
    title = re.search(r"^name: (.*)$", text, flags=re.MULTILINE)
    comment = re.match(r"(?:#.*\n)*", text)
    return Entry(
        title=title[1] if title else scenario.stem,
        about=" ".join(line.lstrip("# ") for line in comment[0].splitlines()) if comment else "",
        command="mpc" if "receding_horizon:" in text else "plan",
        file=scenario.relative_to(ROOT / "scenarios").as_posix(),
        picture=f"pictures/gallery/{scenario.stem}.png",
    )


def table() -> str:
    """A row a scenario, for wherever the page is shown but in the site."""
    rows = [
        f'| [<img alt="{scenario.stem}" src="{one.picture}" width="320">](../scenarios/{one.file}) '
        f"| **{one.title}**<br>{one.about}<br>"
        f"`maneuver-automaton {one.command} scenarios/{one.file} --html` |"
        for scenario, one in ((scenario, entry(scenario)) for scenario in scenarios())
    ]
    return "\n".join(["| | |", "| --- | --- |", *rows])


def player_of(stem: str) -> str:
    """The player of a scenario, by its name in the site."""
    return f"players/{stem}.html"


def scenario_of(stem: str) -> Path:
    """The file of a scenario by its stem, of one vehicle or of several."""
    return next(path for path in scenarios() if path.stem == stem)


def player_of_value(value: Any, stem: str) -> str:
    """The page that plays a plan or closed loop, and leads back to the gallery."""
    from maneuver_automaton.plotting import Player

    content = value.player(title=entry(scenario_of(stem)).title).content
    return Player({**content, "back": {"href": BACK, "text": "Gallery"}}).html


def value_of(kept: Path) -> Any:
    """A kept plan or closed loop in its scenario."""
    from maneuver_automaton.formats.closed_loop_json import load_closed_loop
    from maneuver_automaton.formats.fleet_json import load_fleet, load_fleet_loop
    from maneuver_automaton.formats.plan_json import load_result
    from maneuver_automaton.scenario import load_scenario

    path = scenario_of(kept.name.split(".")[0])
    scenario: Any = load_scenario(path)
    fleet, loop = path.parent.name == "fleets", entry(path).command == "mpc"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plan.json"
        file.write_bytes(gzip.decompress(kept.read_bytes()))
        if fleet:
            return (load_fleet_loop if loop else load_fleet)(file, scenario.fleet)
        return (load_closed_loop if loop else load_result)(file, scenario.problem)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page, with cards in place of the table of the gallery."""
    cards = "\n".join(map(card, scenarios()))
    return PLACE.sub(lambda _: f'<div class="gallery" markdown>\n{cards}\n</div>', markdown)


def card(scenario: Path) -> str:
    """One scenario."""
    one = entry(scenario)
    return (
        f"<div markdown>\n"
        f"**{one.title}**\n\n"
        f'<a href="{player_of(scenario.stem)}" title="play it">'
        f'<img alt="{scenario.stem}" src="pictures/thumbnails/{scenario.stem}.png"></a>\n\n'
        f"{one.about}\n\n"
        f'<a href="{player_of(scenario.stem)}">play</a> · '
        f'<a href="{one.picture}">picture</a> · '
        f"`{one.command}` [`{one.file}`](scenarios/{one.file})\n"
        f"</div>\n"
    )
