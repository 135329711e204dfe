"""What is written for other programs, and what pages show, is what it was."""

from __future__ import annotations

import pytest

from tests.goldens.digest import differences, digest
from tests.goldens.exports import EXPORTS, PAGES, exported, paged
from tests.goldens.measured import kept
from tests.search.cases import compiled_only

NEEDS = {"ros bag": "rosbags.highlevel", "commonroad": "commonroad.common.solution"}


def test_every_case_is_kept_and_no_other():
    assert list(kept("exports")) == [f"{form}: {name}" for form, name in EXPORTS]
    assert list(kept("pages")) == PAGES


def test_what_moved_or_is_called_otherwise_is_told():
    rows = {"bodies": [{"kind": "body", "ring": [[0.0, 1.0], [2.0, 1.0]], "name": "car"}] * 3}
    moved = {"bodies": [*rows["bodies"][1:], {"kind": "body", "ring": [[0.0, 1.0], [2.0, 1.01]],
                                              "name": "van"}]}  # fmt: skip
    assert differences(digest(rows), digest(rows)) == []
    assert differences(digest(rows), digest(moved)) == [
        "/bodies/3 x body/ring[4]: 12.01, was 12.0",
        "/bodies/3 x body/name: [3, 'car', 'van'], was [3, 'car']",
    ]
    assert differences({"a": 1}, {"b": 1}) == ["/a: is gone", "/b: is new"]


@compiled_only
@pytest.mark.parametrize(("form", "name"), EXPORTS)
def test_an_export_is_the_same(form, name):
    if form in NEEDS:
        pytest.importorskip(NEEDS[form])
    assert differences(kept("exports")[f"{form}: {name}"], exported(form, name)) == []


@compiled_only
@pytest.mark.parametrize("name", PAGES)
def test_a_page_shows_the_same(name):
    assert differences(kept("pages")[name], paged(name)) == []
