"""A browser without a window, where the machine has one, for the tests of the player."""

from __future__ import annotations

import contextlib
import functools
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")


@functools.cache
def executable() -> str:
    """Path of a browser; the test is skipped where there is none, or nothing to drive it."""
    pytest.importorskip("playwright", reason="needs playwright")
    found = [path for name in NAMES if (path := shutil.which(name))]
    if not found:
        pytest.skip(f"needs one of {', '.join(NAMES)}")
    return found[0]


@contextlib.contextmanager
def browser() -> Iterator:
    """A browser that `opened` opens pages with."""
    path = executable()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield running
        running.close()


@contextlib.contextmanager
def opened(running, file: Path) -> Iterator:
    """The page of a file; afterwards it must have said nothing, and loaded nothing."""
    page = running.new_page(viewport={"width": 1200, "height": 800})
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda one: said.append(one.url) if one.url[:5] != "data:" else None)
    page.goto(file.resolve().as_uri())
    yield page
    page.wait_for_timeout(50)
    page.close()
    assert said == [file.resolve().as_uri()]


def poses(page, times) -> list[list[float]]:
    """Poses that a page shows at times."""
    return page.evaluate("times => times.map(player.poseAt)", list(map(float, times)))
