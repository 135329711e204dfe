"""Compiled kernels run without numba, the same to the last bit; numba takes over at any time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from maneuver_automaton import _kernel_cache, _kernel_files, _kernel_folders
from maneuver_automaton._compile import LINKED
from tests.quickly import quick_are
from tests.test_compile import run

pytestmark = pytest.mark.skipif(
    not LINKED[0] <= numba.version_info.short <= LINKED[1], reason="numba compiles as it does"
)

EXAMPLE = """
import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_shared_kernel, by_value, kernel


@by_value
class Pair(NamedTuple):
    values: object
    factor: float


@bare_shared_kernel
def sine(x):
    return math.sin(x) ** 3


@kernel
def waves(pair, flat):
    if pair.factor < 0.0:
        raise ValueError("a negative factor")
    values = np.empty((pair.values.size, 2))
    for k, x in enumerate(pair.values):
        values[k] = sine(x), math.exp(x) % pair.factor
    return Pair(values.T if flat else values[:, 0].copy().reshape((1, -1)), pair.factor), flat
"""

CALL = """
import json, sys
import numpy as np
import example
from maneuver_automaton._compile import bound, called_again

pair = example.Pair(np.linspace(0.0, 3.0, 5), 0.7)
results = [example.waves(pair, True), bound(example.waves, pair, False)()]
results.append(called_again(example.waves)(pair, True))
try:
    example.waves(example.Pair(pair.values, -1.0), True)
except ValueError as error:
    results.append(str(error))
told = [repr([results, results[0][0].values.tobytes()]), "numba" in sys.modules]
"""

THEN = """
import numba

own = numba.njit(lambda x: np.arange(x) + np.sin(x))
told += [repr(example.waves(pair, True)) == repr(results[0]), len(example.waves.signatures)]
told += [own(3).tolist() == (np.arange(3) + np.sin(3)).tolist(), numba._helperlib.__name__]
"""
LAST = "\nprint(json.dumps(told))"


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """A folder with kernels, compiled in `cache` beside them, and what they return."""
    folder = tmp_path_factory.mktemp("example")
    (folder / "example.py").write_text(EXAMPLE)
    result, imported = run(CALL + LAST, folder, NUMBA_CACHE_DIR=folder / "cache")
    assert imported
    assert "a negative factor" in result
    return folder, result


def test_what_was_compiled_runs_without_numba_and_then_with_it(example):
    folder, result = example
    told = run(CALL + THEN + LAST, folder, NUMBA_CACHE_DIR=folder / "cache")
    assert told[:2] == [result, False]
    assert told[2:] == [True, 1, True, "numba._helperlib"]


OFTEN = """
from maneuver_automaton._kernel_list import expect_many_calls
expect_many_calls()
told += ["numba" in sys.modules, repr(example.waves(pair, True)) == repr(results[0])]
told += [len(example.waves.signatures)]
"""


def test_what_will_call_kernels_often_goes_over_to_numba(example):
    folder, result = example
    told = run(CALL + OFTEN + LAST, folder, NUMBA_CACHE_DIR=folder / "cache")
    assert told == [result, False, True, True, 1]


FILES = """
from pathlib import Path
files = sorted(Path("cache").rglob("*.nbc"))
last = [files[k - 1].read_bytes() for k in range(len(files))]
for file, other in zip(files, last):
    """
PATCH = "from maneuver_automaton import _kernel_files as one; one."
OTHERWISE = {
    "numba is there": ("import numba\n", {}),
    "a setting of numba": ("", {"NUMBA_DEVELOPER_MODE": 0}),
    "a part of numba is gone": (f"{PATCH}Engine._part = None\n", {}),
    "another version": (f"{PATCH}FORMAT = 0\n", {}),
    "cut short": (f"{FILES}file.write_bytes(other[:-9])\n", {}),
    "of another kernel": (f"{FILES}file.write_bytes(other)\n", {}),
    "others can write it": (f"{FILES}file.chmod(0o666)\n", {}),
}


@pytest.mark.parametrize("kind", quick_are(["numba is there", "of another kernel"], OTHERWISE))
def test_numba_is_asked_where_files_do_not_fit(example, kind):
    if kind == "others can write it" and os.name != "posix":
        pytest.skip("owners and modes of files")
    folder, result = example
    before, environment = OTHERWISE[kind]
    told = run(before + CALL + LAST, folder, NUMBA_CACHE_DIR=folder / "cache", **environment)
    assert told == [result, True]


class Two(NamedTuple):
    """A record."""

    first: Any
    second: Any


class AsFloat(float):
    """A number of a class of one's own."""


GRID = np.zeros((3, 4))
READ = np.zeros(2)
READ.flags.writeable = False
VALUES = [
    *(1, 2.5, True, None, 1j, np.float64(1.0), np.int64(1), np.bool_(True), AsFloat(2.0)),
    *(np.float32(1.0), np.uint8(1), "text", 1 << 40, {}, np.int64, len),
    *(GRID, GRID.T, GRID[:, ::2], GRID[0], GRID[:, 0], GRID[:1, :1], np.zeros(()), READ),
    *(np.zeros(2, kind) for kind in ("bool", "int8", "int32", "uint64", "float32", "complex64")),
    *(np.zeros(2, kind) for kind in (">f8", "M8[s]", [("x", float)], "float16")),
    *((), (1, 2.0), (1, 2), ((1,), 2), Two(1, 2.0), Two(1, 1), Two(GRID, (GRID.T, True))),
    np.zeros(17, np.uint8)[1:].view(float),
]


def test_kinds_of_arguments_are_told_as_finely_as_numba_tells_types():
    known: dict[Any, Any] = {}
    for value in VALUES:
        try:
            kinds = _kernel_files.kinds_of((value,))
        except (AttributeError, KeyError):
            continue
        kind = numba.typeof(value)
        assert kinds == _kernel_cache._kinds_of((kind,)), value
        assert known.setdefault(kinds, kind) == kind
        assert known.setdefault(_kernel_files.types_of((value,)), kinds) == kinds
    assert sum(isinstance(one, str) for one in known) == 25


def test_records_are_told_apart_by_their_fields():
    class Other(NamedTuple):
        second: Any
        first: Any

    Other.__module__, Other.__qualname__ = Two.__module__, Two.__qualname__
    assert _kernel_files.kinds_of((Two(1, 2),)) != _kernel_files.kinds_of((Other(1, 2),))
    assert _kernel_files.types_of((Two(1, 2),)) != _kernel_files.types_of((Other(1, 2),))


PLAN = """
import json, sys
from maneuver_automaton.cli.entry import main
sys.argv = ["maneuver-automaton", "plan", sys.argv[1], "--quiet", "--no-plot"]
try:
    main()
except SystemExit as end:
    print(json.dumps([end.code, "numba" in sys.modules]))
"""


def test_a_plan_of_the_command_line_does_not_import_numba(tmp_path):
    scenario = Path(__file__).parents[1] / "scenarios" / "parking.yaml"
    code = PLAN.replace("sys.argv[1]", repr(str(scenario)))
    kept = {"NUMBA_CACHE_DIR": _kernel_folders.kernel_base()}
    assert run(code, tmp_path, **kept)[0] == 0  # what is missing is compiled now
    assert run(code, tmp_path, **kept) == [0, False]
