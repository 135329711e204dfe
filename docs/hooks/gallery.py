"""The gallery: every scenario with its picture, its first comment and its file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PLACE = "<!-- scenarios -->"


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
    name = scenario.name
    return (
        f"<div markdown>\n"
        f"**{title[1] if title else scenario.stem}**\n\n"
        f"[![{scenario.stem}](pictures/gallery/{scenario.stem}.png)](pictures/gallery/{scenario.stem}.png)\n\n"
        f"{' '.join(comment)}\n\n"
        f"`{command}` [`scenarios/{name}`](scenarios/{name})\n"
        f"</div>\n"
    )
