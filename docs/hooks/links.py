"""A look at the finished site: no link leads nowhere, nothing is loaded from a network."""

from __future__ import annotations

from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}
ABOUT = {"canonical", "prev", "next", "alternate"}  # kinds of <link> that load nothing


class Page(HTMLParser):
    """The links of a page, what it loads, and the names that links to it may end in."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.names: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep what a tag links to, loads, and is called."""
        values = dict(attrs)
        self.names |= {value for key in ("id", "name") if (value := values.get(key))}
        target = values.get(LOADED.get(tag, ""))
        if target and not (tag == "link" and values.get("rel") in ABOUT):
            self.loaded.append(target)
        if tag == "a" and values.get("href"):
            self.links.append(str(values["href"]))


def on_post_build(*, config: Any, **_: Any) -> None:
    """End the build with an error if a page of the site has faults."""
    found = list(faults(Path(config["site_dir"])))
    if found:
        from mkdocs.exceptions import PluginError

        raise PluginError("\n".join(found))


def faults(site: Path) -> Iterator[str]:
    """One line for each link that leads nowhere, and for all that is loaded from a network."""
    pages = {path: Page(path.read_text("utf-8")) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        here = path.relative_to(site)
        for target in page.loaded:
            if urlsplit(target).netloc:
                yield f"{here}: loads {target}"
        if here.name == "404.html":  # its links begin at the root of a server
            continue
        for target in {*page.links, *page.loaded}:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path.resolve()
            there = there / "index.html" if there.is_dir() else there
            if not there.is_file():
                yield f"{here}: no file for {target}"
            elif parts.fragment and there.suffix == ".html":
                names = next(page.names for one, page in pages.items() if one.resolve() == there)
                if unquote(parts.fragment) not in names:
                    yield f"{here}: no anchor for {target}"
