"""Pages and files outside of docs/ belong to the site: README.md is its start, scenarios its files.

Links in the pages lead through the repository, so that they work wherever the files are shown;
here they are turned into links through the site.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")
FILES = (
    "LICENSE",
    "CITATION.cff",
    "scenarios/*.yaml",
    "scenarios/fleets/*.yaml",
    "scenarios/maps/*",
    "scenarios/pictures/*",
)
LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)")


def on_files(files: Any, *, config: Any) -> Any:
    """The files of docs/, and those of the repository that its pages show."""
    for pattern in (*PAGES, *FILES):
        for path in sorted(ROOT.glob(pattern)):
            name = path.relative_to(ROOT).as_posix()
            files.append(File.generated(config, name, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """The text of a page, its links relative to the site."""
    here = page.file.src_uri
    return site_links(markdown, page=here, home="" if here in PAGES else "docs")


def site_links(markdown: str, *, page: str, home: str) -> str:
    """The text of `page`, named as in the site; it lies in the folder `home` of the repository."""

    def turned(match: re.Match[str]) -> str:
        folder = posixpath.join(home, posixpath.dirname(page))
        target = posixpath.normpath(posixpath.join(folder, match[1])).removeprefix("docs/")
        target = target.replace(".ipynb", ".md")  # the page made of it, see tutorials.py
        return f"]({posixpath.relpath(target, posixpath.dirname(page) or '.')}"

    pieces = re.split(r"(^```.*?^```)", markdown, flags=re.DOTALL | re.MULTILINE)
    return "".join(
        piece if piece.startswith("```") else LINK.sub(turned, piece) for piece in pieces
    )
