"""The page of a player: a template, its style and scripts, and the data that they draw."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from maneuver_automaton._files import write_text_atomically

SCRIPTS = ("motion.js", "view.js", "stage.js", "space.js", "charts.js", "panels.js", "player.js")
FRAME_HEIGHT = 720  # [px] in a notebook


@dataclass(frozen=True, slots=True, eq=False)
class Player:
    """A plan to play: one HTML page, drawn by the browser from the numbers in it.

    A content with ``back: {href, text}`` has a link to the page that leads here.

    Examples
    --------
    >>> page = Player({"title": "A plan & its <name>"}).html
    >>> page.startswith("<!doctype html>"), "http" in page
    (True, False)
    """

    content: Mapping[str, Any] = field(repr=False)  # what `content_of` makes of a plan, and `back`

    @property
    def html(self) -> str:
        """The whole page."""
        page = _template()
        # no text in the data can end the element that holds it
        data = json.dumps(self.content, separators=(",", ":"), allow_nan=False)
        for mark, text in (
            ("{{title}}", html.escape(str(self.content["title"]))),
            ("{{data}}", data.replace("<", "\\u003c")),
        ):
            page = page.replace(mark, text)
        return page

    def save(self, path: str | Path) -> None:
        """Write the page; the file is replaced in one step.

        Raises
        ------
        ValueError
            If the ending is not .html.
        OSError
            If the file cannot be written; an old one stays as it was.
        """
        target = Path(path)
        if target.suffix.lower() != ".html":
            raise ValueError(f"player: got the file name {target.name}, need one ending in .html")
        write_text_atomically(target, self.html)

    def _repr_html_(self) -> str:
        """The page in a frame of its own, for notebooks."""
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" width="100%" height="{FRAME_HEIGHT}" '
            'style="border:0" title="player"></iframe>'
        )


@cache
def _template() -> str:
    """The page without its data."""
    folder = resources.files("maneuver_automaton.plotting.player")

    def text(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    scripts = "\n".join(f"<script>\n{text(name)}</script>" for name in SCRIPTS)
    page = text("player.html").replace("{{style}}", text("player.css"))
    return page.replace("{{scripts}}", scripts)
