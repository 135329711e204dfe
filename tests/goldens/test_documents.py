"""Files that the commands write: their keys, types, status, and the exit code."""

from __future__ import annotations

import pytest

from tests.goldens.documents import KEYS, all_cases, answer, differences, keys, unpacked
from tests.goldens.measured import kept
from tests.quickly import quick_are
from tests.search.cases import compiled_only

CASES = all_cases()


def test_keys_are_told_with_their_types():
    document = {"a": 1, "b": [{"c": None}, {"c": "x", "d": True}], "e": [{"kind": "trim"}]}
    assert keys(document) == {
        "a": {"number"},
        "b": {"list"},
        "b[]": {"object"},
        "b[].c": {"null", "text"},
        "b[].d": {"bool"},
        "e": {"list"},
        "e[trim]": {"object"},
        "e[trim].kind": {"text"},
    }


def test_every_case_is_kept_and_no_other():
    assert [name for name in kept("documents") if not name.startswith(KEYS)] == list(CASES)


@compiled_only
@pytest.mark.parametrize(
    "name", quick_are([n for n, one in CASES.items() if one.quick], CASES, exhaustive=True)
)
def test_the_file_has_the_same_keys(name):
    before, now = unpacked(kept("documents"), name), answer(CASES[name])
    for key in ("exit", "file", "status"):
        assert now[key] == before[key], key
    assert differences(before["keys"], now["keys"]) == {}


def test_kinds_that_one_document_lacks_are_left_out():
    plan = {"p": "list", "p[trim]": "object", "p[trim].control": "list"}
    other = {"p": "list", "p[maneuver]": "object", "p[maneuver].control": "null"}
    assert differences(plan, other) == {}
    assert differences(plan, plan | {"p[trim].control": "null"}) == {
        "p[trim].control": ("list", "null")
    }
    assert differences(plan, {"p": "list", "p[trim]": "object"}) == {
        "p[trim].control": ("list", None)
    }
    assert differences({"a": "text"}, {"b": "text"}) == {"a": ("text", None), "b": (None, "text")}
