"""Notebooks become pages: each is executed while the site is built, two at a time.

An error in a cell ends the build. What a cell prints and draws is shown below it.
"""

from __future__ import annotations

import base64
import html
import posixpath
import re
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import nbclient
import nbformat
from mkdocs.structure.files import File

SECONDS = 300  # [s] of one cell, compilation included
PLAYER = re.compile(r'<iframe srcdoc="(?P<page>[^"]*)"')  # a page of its own in the site


def on_files(files: Any, *, config: Any) -> Any:
    """The files of the site, with a page beside every notebook."""
    notebooks = [file for file in files if file.src_uri.endswith(".ipynb")]
    with ThreadPoolExecutor(2) as pool:
        texts = pool.map(
            lambda file: executed(Path(file.abs_src_path).read_text("utf-8")), notebooks
        )
        for file, notebook in zip(notebooks, texts, strict=True):
            for name, content in page_of(notebook, file.src_uri).items():
                files.append(File.generated(config, name, content=content))
    return files


@cache
def executed(text: str) -> Any:
    """A notebook with its outputs."""
    notebook = nbformat.reads(text, as_version=4)
    folder = str(Path(__file__).parents[1] / "tutorials")
    client = nbclient.NotebookClient(
        notebook,
        timeout=SECONDS,
        kernel_name="python3",
        extra_arguments=["--IPKernelApp.log_level=ERROR"],
        resources={"metadata": {"path": folder}},
    )
    return client.execute()


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
