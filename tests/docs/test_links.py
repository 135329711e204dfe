"""The checker of the finished site: it finds links that lead nowhere, and loads from a network."""

from __future__ import annotations

import importlib.util
from pathlib import Path

HOOK = Path(__file__).parents[2] / "docs" / "hooks" / "links.py"


def faults(site):
    spec = importlib.util.spec_from_file_location("links", HOOK)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return sorted(module.faults(site))


def test_a_site_without_faults(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "index.html").write_text(
        '<h1 id="top">x</h1><a href="a/b.html#here">b</a><a href="https://example.org/">far</a>'
    )
    (tmp_path / "a" / "b.html").write_text('<p id="here"></p><a href="../index.html#top">up</a>')
    assert faults(tmp_path) == []


def test_each_fault_is_named(tmp_path):
    (tmp_path / "b.html").write_text("<p id='here'></p>")
    (tmp_path / "index.html").write_text(
        '<a href="c.html">no file</a><a href="b.html#there">no anchor</a><img src="lost.png">'
        '<script src="https://example.org/a.js"></script>'
        '<link rel="stylesheet" href="//example.org/a.css"><link rel="canonical" href="//e.org">'
    )
    assert faults(tmp_path) == [
        "index.html: loads //example.org/a.css",
        "index.html: loads https://example.org/a.js",
        "index.html: no anchor for b.html#there",
        "index.html: no file for c.html",
        "index.html: no file for lost.png",
    ]
