"""Every plan that is kept has a thumbnail of its size, and a player that leads back."""

from __future__ import annotations

import importlib
import json
import re
import sys
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
KEPT = sorted((ROOT / "docs" / "plans").glob("*.json.gz"))


@pytest.fixture(scope="module")
def hooks():
    """The module of that name among the hooks."""
    sys.path.insert(0, str(ROOT / "docs" / "hooks"))
    yield importlib.import_module
    sys.path.pop(0)


@pytest.mark.parametrize("kept", KEPT, ids=lambda kept: kept.name.split(".")[0])
def test_there_is_one_of_every_plan(hooks, kept):
    thumbnails = hooks("thumbnails")
    stem = kept.name.split(".")[0]
    with Image.open(ROOT / "docs" / thumbnails.FOLDER / f"{stem}.png") as picture:
        width, height = (round(side * thumbnails.DPI) for side in thumbnails.SIZE_IN)
        assert picture.size == (width, height)
        assert len(picture.convert("RGB").getcolors(width * height)) > 2


@pytest.mark.parametrize("stem", ["parking", "parking_loop"])
def test_it_is_drawn_again_and_its_player_leads_back(hooks, stem, tmp_path):
    gallery, thumbnails = hooks("gallery"), hooks("thumbnails")
    value = gallery.value_of(ROOT / "docs" / "plans" / f"{stem}.json.gz")
    thumbnails.thumbnail(value, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 1000
    page = gallery.player_of_value(value, stem)
    data = re.search(r'id="data">(.*?)</script>', page, flags=re.DOTALL)
    assert data
    assert json.loads(data[1])["back"] == {"href": "../gallery.html", "text": "Gallery"}
    assert 'id="back"' in page
    assert gallery.player_of(stem).count("/") == 1  # so that .. is where the gallery is
