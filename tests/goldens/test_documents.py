"""Files that the commands write: their keys, types, status, and the exit code."""

from __future__ import annotations

import pytest

from tests.goldens.documents import KEYS, all_cases, answer, keys, unpacked
from tests.goldens.measured import kept, params
from tests.search.cases import compiled_only

CASES = all_cases()


def test_keys_are_told_with_their_types():
    document = {"a": 1, "b": [{"c": None}, {"c": "x", "d": True}], "e": []}
    assert keys(document) == {
        "a": {"number"},
        "b": {"list"},
        "b[]": {"object"},
        "b[].c": {"null", "text"},
        "b[].d": {"bool"},
        "e": {"list"},
    }


def test_every_case_is_kept_and_no_other():
    assert [name for name in kept("documents") if not name.startswith(KEYS)] == list(CASES)


@compiled_only
@pytest.mark.parametrize("name", params({name: case.quick for name, case in CASES.items()}))
def test_the_file_has_the_same_keys(name):
    before, now = unpacked(kept("documents"), name), answer(CASES[name])
    for key in ("exit", "file", "status"):
        assert now[key] == before[key], key
    gone = {key: kind for key, kind in before["keys"].items() if now["keys"].get(key) != kind}
    new = {key: kind for key, kind in now["keys"].items() if before["keys"].get(key) != kind}
    assert (gone, new) == ({}, {})
