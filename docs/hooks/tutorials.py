"""Notebooks become pages: each is executed while the site is built, two at a time.

An error in a cell ends the build, and so does a cell that prints another thing than its file says,
unless it has the tag `measured`. What a cell prints and draws is shown below it. Nothing is
written into the repository; ``python docs/measure.py notebooks`` keeps the outputs.
"""

from __future__ import annotations

import base64
import html
import logging
import posixpath
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import printed

ROOT = Path(__file__).parents[2]
LOG = logging.getLogger("mkdocs.hooks.tutorials")
SECONDS = 300  # [s] of one cell, compilation included
PLAYER = re.compile(r'<iframe srcdoc="(?P<page>[^"]*)"')  # a page of its own in the site
PLAYED = "a page that plays it: it is shown where the cell runs, and in the site"  # kept instead
_executed: dict[str, Any] = {}  # by text: a site that is served is built again and again


def on_files(files: Any, *, config: Any) -> Any:
    """The files of the site, with a page beside every notebook."""
    from mkdocs.exceptions import PluginError
    from mkdocs.structure.files import File

    notebooks = [file for file in files if file.src_uri.endswith(".ipynb")]
    LOG.info("executing %d notebooks, two at a time: this takes some minutes", len(notebooks))
    with ThreadPoolExecutor(2) as pool:
        made = pool.map(lambda file: _timed(Path(file.abs_src_path)), notebooks)
        for file, notebook in zip(notebooks, made, strict=True):
            kept = Path(file.abs_src_path).read_text("utf-8")
            if wrong := list(differences(kept, notebook)):
                how = f"`python docs/measure.py notebooks {Path(file.src_uri).stem}` writes it"
                raise PluginError("\n".join([*(f"{file.src_uri}: {one}" for one in wrong), how]))
            for name, content in page_of(notebook, file.src_uri).items():
                files.append(File.generated(config, name, content=content))
    return files


def _timed(path: Path) -> Any:
    """An executed notebook, and a line that says so."""
    began = time.perf_counter()
    notebook = executed(path.read_text("utf-8"))
    LOG.info("executed %s in %.1f s", path.name, time.perf_counter() - began)
    return notebook


def executed(text: str) -> Any:
    """A notebook with its outputs, executed in a folder beside a copy of the scenarios."""
    import nbclient
    import nbformat

    if text in _executed:
        return _executed[text]
    notebook = nbformat.reads(text, as_version=4)
    metadata = dict(notebook.metadata)
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "scenarios", Path(folder) / "scenarios")
        place = Path(folder) / "docs" / "tutorials"
        place.mkdir(parents=True)
        client = nbclient.NotebookClient(
            notebook,
            timeout=SECONDS,
            kernel_name="python3",
            record_timing=False,
            extra_arguments=["--IPKernelApp.log_level=ERROR"],
            resources={"metadata": {"path": str(place)}},
        )
        client.execute()
    notebook.metadata.clear()
    notebook.metadata.update(metadata)
    _executed[text] = notebook
    return notebook


def differences(kept: str, notebook: Any) -> Iterator[str]:
    """A line for every cell that prints another thing than its file says."""
    import nbformat

    for before, now in zip(nbformat.reads(kept, as_version=4).cells, notebook.cells, strict=True):
        if now.cell_type == "code" and "measured" not in now.metadata.get("tags", ()):
            said, says = ("".join(map(_words_of, cell.outputs)).strip() for cell in (before, now))
            if printed.differs(said, says):
                yield f"{now.id} says {said!r}, and prints {says!r}"


def _words_of(output: Any) -> str:
    """What an output says in words: no picture, no player, no name of an object."""
    data = output.get("data", {})
    text = str(output.get("text") or data.get("text/plain", ""))
    if "image/png" in data or PLAYER.match(str(data.get("text/html", ""))):
        return ""
    return "" if text == PLAYED or text.startswith("<") else text


def page_of(notebook: Any, uri: str) -> dict[str, str | bytes]:
    """The page of an executed notebook, and its pictures, by their names in the site."""
    stem = uri.removesuffix(".ipynb")
    made: dict[str, str | bytes] = {}
    parts: list[str] = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            data = output.get("data", {})
            picture, player = data.get("image/png"), PLAYER.match(str(data.get("text/html", "")))
            if player and not picture:
                name = f"{stem}_{len(made)}.html"
                made[name] = html.unescape(player["page"])
                parts.append(
                    f'<iframe src="{posixpath.basename(name)}" class="player" loading="lazy" '
                    'title="player"></iframe>'
                )
            elif picture:
                name = f"{stem}_{len(made)}.png"
                made[name] = base64.b64decode(picture)
                parts.append(f"![Output of the cell above]({posixpath.basename(name)})")
            else:
                parts.append(text_of(output))
    name = posixpath.basename(uri)
    parts.append(f'<a href="{name}" download>This page as a notebook</a>')
    return {**made, f"{stem}.md": "\n\n".join(parts)}


def text_of(output: Any) -> str:
    """What a cell printed, or the value of its last line."""
    data = output.get("data", {})
    if "text/html" in data:
        return str(data["text/html"])
    text = output.get("text") or data.get("text/plain", "")
    return f"```text\n{text.rstrip()}\n```" if text else ""
