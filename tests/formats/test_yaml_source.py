"""Numbers and words are those of YAML 1.2; every value has its line."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.formats.yaml_source import parse


def value_of(text: str) -> object:
    return parse(f"a: {text}\n", name="x").value["a"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-6", 1e-6),
        ("1E6", 1e6),
        (".5", 0.5),
        ("5.", 5.0),
        ("+3", 3),
        ("-0.0", -0.0),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        (".inf", math.inf),
        ("-.inf", -math.inf),
        ("9" * 30, 1e30),
        ("9" * 400, math.inf),
        # words, though YAML 1.1 or Python might take them for something else
        ("no", "no"),
        ("on", "on"),
        ("yes", "yes"),
        ("1_000", "1_000"),
        ("12:30:45", "12:30:45"),
        ("2024-01-01", "2024-01-01"),
        ("inf", "inf"),
        ("nan", "nan"),
        ("1e", "1e"),
        ("0b11", "0b11"),
        ("'1'", "1"),
        ('"true"', "true"),
        ("=", "="),
    ],
)
def test_scalars(text, value):
    got = value_of(text)
    assert got == value
    assert type(got) is type(value)


def test_not_a_number():
    got = value_of(".nan")
    assert isinstance(got, float)
    assert math.isnan(got)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_read_back_to_the_last_bit(number):
    assert value_of(repr(number)) == number


def test_lines_are_those_of_keys_and_items():
    document = parse("a:\n  - {b: 1}\n  -\n    c: [1,\n       2]\n", name="x")
    assert document.line_of(("a",)) == 1
    assert document.line_of(("a", 0, "b")) == 2
    assert document.line_of(("a", 1)) == 4
    assert document.line_of(("a", 1, "c", 1)) == 5
    assert document.line_of(("a", 1, "missing")) == 4


def test_an_alias_stands_for_its_value():
    document = parse("a: &trim {name: x}\nb: *trim\n", name="x")
    assert document.value == {"a": {"name": "x"}, "b": {"name": "x"}}


def test_utf_8_with_a_mark_and_windows_line_ends(tmp_path):
    from maneuver_automaton.formats.text_source import read_text

    path = tmp_path / "x.yaml"
    path.write_bytes("\ufeffname: Größe\r\nb: 1\r\n".encode())
    document = parse(read_text(path), name="x")
    assert document.value == {"name": "Größe", "b": 1}
    path.write_bytes("name: Größe\n".encode("utf-16"))
    assert parse(read_text(path), name="x").value == {"name": "Größe"}
