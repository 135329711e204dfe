"""The gallery: every scenario with its picture, its first comment, its file and its player."""

from __future__ import annotations

import gzip
import re
import tempfile
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
PLANS = ROOT / "docs" / "plans"
PLACE = "<!-- scenarios -->"


def on_files(files: Any, *, config: Any) -> Any:
    """The files of the site, with a player for every plan that is kept."""
    for kept in sorted(PLANS.glob("*.json.gz")):
        page = player_page(kept)
        files.append(File.generated(config, player_of(kept.name.split(".")[0]), content=page))
    return files


def player_of(stem: str) -> str:
    """The player of a scenario, by its name in the site."""
    return f"players/{stem}.html"


def player_page(kept: Path) -> str:
    """The page that plays a kept plan or closed loop in its scenario."""
    from maneuver_automaton.formats.driven_json import load_closed_loop, read_closed_loop_document
    from maneuver_automaton.formats.result_json import load_result
    from maneuver_automaton.scenario import load_scenario

    scenario: Any = load_scenario(ROOT / "scenarios" / f"{kept.name.split('.')[0]}.yaml")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plan.json"
        file.write_bytes(gzip.decompress(kept.read_bytes()))
        if read_closed_loop_document(file) is None:
            return load_result(file, scenario.problem).player(title=scenario.name).html
        return load_closed_loop(file, scenario.problem).player(title=scenario.name).html


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page, with the gallery where it is asked for."""
    if PLACE not in markdown:
        return markdown
    cards = "\n".join(map(card, sorted((ROOT / "scenarios").glob("*.yaml"))))
    return markdown.replace(PLACE, f'<div class="gallery" markdown>\n{cards}\n</div>')


def card(scenario: Path) -> str:
    """One scenario."""
    lines = scenario.read_text(encoding="utf-8").splitlines()
    comment = []
    for line in lines:
        if not line.startswith("#"):
            break
        comment.append(line.lstrip("# "))
    text = "\n".join(lines)
    title = re.search(r"^name: (.*)$", text, flags=re.MULTILINE)
    command = "mpc" if "receding_horizon:" in text else "plan"
    name, picture = scenario.name, f"pictures/gallery/{scenario.stem}.png"
    return (
        f"<div markdown>\n"
        f"**{title[1] if title else scenario.stem}**\n\n"
        f'<a href="{player_of(scenario.stem)}" title="play it">'
        f'<img alt="{scenario.stem}" src="{picture}"></a>\n\n'
        f"{' '.join(comment)}\n\n"
        f'<a href="{player_of(scenario.stem)}">play</a> · '
        f'<a href="{picture}">picture</a> · `{command}` [`{name}`](scenarios/{name})\n'
        f"</div>\n"
    )
