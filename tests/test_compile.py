"""Compiled kernels: cached by their sources, and at work where nothing can be written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from maneuver_automaton import _kernel_folders
from tests.quickly import quick_are

EXAMPLE = """
from maneuver_automaton._compile import inner_kernel, kernel


@inner_kernel
def reciprocal(x):
    return 1.0 / x


@kernel
def reciprocals(x):
    for i in range(x.size):
        x[i] = reciprocal(x[i])
    return x
"""

CALL = """
import json
import numba
import numpy as np
from maneuver_automaton._kernel_folders import kernel_folder
before = numba.config.CACHE_DIR
import example_kernels
result = example_kernels.reciprocals(np.array([4.0, 0.0])).tolist()
hits = getattr(example_kernels.reciprocals, "stats", None)
print(json.dumps({
    "result": [str(x) for x in result],
    "folder": str(kernel_folder()),
    "hits": sum(hits.cache_hits.values()) if hits else 0,
    "gil": not getattr(example_kernels.reciprocals, "targetoptions", {}).get("nogil", True),
    "kept": numba.config.CACHE_DIR == before,
}))
"""

PLAN = """
import json
import maneuver_automaton as ma
robot = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1, 0), "left": (0, 1), "right": (0, -1)})
results = [
    ma.plan(ma.Problem(robot, [0, 0, 0], [1, 1, 0], horizon=ma.Horizon(max_trims=most)))
    for most in (3, None)
]
print(json.dumps([[r.plan.word, r.plan.durations.tolist(), r.audit.passed] for r in results]))
"""


def run(code, folder, **environment):
    """What a fresh Python process prints, as JSON."""
    return told(code, folder, **environment)[0]


def told(code, folder, **environment):
    """What a fresh Python process prints, as JSON, and what it complains of."""
    names = ("NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT", "MANEUVER_AUTOMATON_CACHE_DIR")
    kept = {key: value for key, value in os.environ.items() if key not in names}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=kept | {key: str(value) for key, value in environment.items()},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr


@pytest.fixture
def example(tmp_path):
    """A folder with kernels of its own."""
    (tmp_path / "example_kernels.py").write_text(EXAMPLE)
    return tmp_path


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A small package as `_compile` sees it."""
    for name, text in {
        "_compile.py": "decorators",
        "other.py": "no kernel",
        "_linking.py": "three",
        "_records.py": "four",
        "search/_kernels.py": "one",
        "search/_kernels_words.py": "two",
    }.items():
        path = tmp_path / "package" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.setattr(
        _kernel_folders, "__file__", str(tmp_path / "package" / "_kernel_folders.py")
    )
    return tmp_path / "package"


def test_the_folder_is_named_after_all_kernel_sources():
    number = _kernel_folders.source_hash()
    assert len(number) == 16
    assert int(number, 16) >= 0
    assert number == _kernel_folders.source_hash()
    assert _kernel_folders.kernel_folder().name == f"kernels-{number}"


def test_the_hash_sees_every_kernel_source_and_how_kernels_are_compiled(package):
    source_hash = _kernel_folders.source_hash.__wrapped__  # each time anew
    (package / "other.py").write_text("one")
    before = source_hash()
    (package / "other.py").write_text("changed")
    (package / "search" / "notes.txt").write_text("new")
    assert source_hash() == before
    seen = {before}
    for name in (*_kernel_folders.HOW, "search/_kernels.py", "search/_kernels_words.py"):
        (package / name).write_text("changed")
        seen.add(source_hash())
    (package / "search" / "_kernels_words.py").rename(package / "search" / "_kernels_letters.py")
    seen.add(source_hash())
    (package / "search" / "_kernels_more.py").write_text("new")
    seen.add(source_hash())
    assert len(seen) == 8


@pytest.mark.parametrize(
    ("platform", "variable", "expected"),
    [
        ("linux", "XDG_CACHE_HOME", "maneuver_automaton"),
        ("win32", "LOCALAPPDATA", "maneuver_automaton"),
        ("linux", "MANEUVER_AUTOMATON_CACHE_DIR", ""),
        ("darwin", "MANEUVER_AUTOMATON_CACHE_DIR", ""),
    ],
)
def test_where_the_user_s_cache_is(tmp_path, monkeypatch, platform, variable, expected):
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "MANEUVER_AUTOMATON_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setenv(variable, str(tmp_path))
    assert _kernel_folders.user_cache_folder() == tmp_path / expected


@pytest.mark.parametrize(
    ("platform", "expected"),
    [
        ("linux", ".cache/maneuver_automaton"),
        ("darwin", "Library/Caches/maneuver_automaton"),
        ("win32", "AppData/Local/maneuver_automaton"),
    ],
)
def test_without_a_word_it_is_in_the_home_folder(tmp_path, monkeypatch, platform, expected):
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "MANEUVER_AUTOMATON_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    assert _kernel_folders.user_cache_folder() == tmp_path / expected


@pytest.mark.parametrize(
    "variable", quick_are(["NUMBA_CACHE_DIR"], ["NUMBA_CACHE_DIR", "MANEUVER_AUTOMATON_CACHE_DIR"])
)
def test_kernels_are_compiled_once_and_kept_where_it_is_said(example, variable):
    first = run(CALL, example, **{variable: example / "cache"})
    again = run(CALL, example, **{variable: example / "cache"})
    folder = example / "cache" / f"kernels-{_kernel_folders.source_hash()}"
    assert first["folder"] == again["folder"] == str(folder)
    assert (first["hits"], again["hits"]) == (0, 1)
    assert first["result"] == again["result"] == ["0.25", "inf"]  # division is IEEE's
    assert not first["gil"]
    assert first["kept"]  # the caller's own cache is left as it was
    assert len(list(folder.rglob("*.nbc"))) == 1
    assert not list(example.rglob("__pycache__/*.nb?"))


@pytest.mark.parametrize(
    "variable", quick_are(["NUMBA_CACHE_DIR"], ["NUMBA_CACHE_DIR", "MANEUVER_AUTOMATON_CACHE_DIR"])
)
def test_kernels_work_where_nothing_can_be_written(example, variable):
    (example / "file").write_text("in the way")
    ran = run(CALL, example, **{variable: example / "file" / "cache"})
    assert ran["folder"] == "None"
    assert ran["result"] == ["0.25", "inf"]
    assert ran["hits"] == 0
    assert not list(example.rglob("*.nb?"))


def test_kernels_work_without_a_home_folder(monkeypatch):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "MANEUVER_AUTOMATON_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(Path, "home", nowhere)
    assert _kernel_folders.kernel_folder.__wrapped__() is None


@pytest.mark.exhaustive
@pytest.mark.slow
def test_kernels_of_an_interactive_session_work(tmp_path):
    code = "from maneuver_automaton._compile import kernel\nexec(compile('def f(x): return 2 * x', "
    code += "'<stdin>', 'exec'))\nprint(kernel(f)(1.5))"
    assert run(code, tmp_path, NUMBA_CACHE_DIR=tmp_path) == 3.0


LATER = """
import json, pickle, sys
import example_kernels
from example_kernels import reciprocals
before = "numba" in sys.modules
same = pickle.loads(pickle.dumps(reciprocals)) is reciprocals
import numpy as np
print(json.dumps({
    "numba": [before, "numba" in sys.modules, reciprocals(np.array([4.0])).tolist() == [0.25]
              and "numba" in sys.modules],
    "same": same, "name": reciprocals.__name__, "signatures": len(reciprocals.signatures),
}))
"""


def test_numba_is_imported_when_a_kernel_is_called(example):
    assert run(LATER, example, NUMBA_CACHE_DIR=example / "cache") == {
        "numba": [False, False, True],
        "same": True,
        "name": "reciprocals",
        "signatures": 1,
    }


UNKNOWN_NUMBA = {
    "another version": (
        "from maneuver_automaton import _compile; _compile.LINKED = (0, 1), (0, 2)",
        "known are 0.1 to 0.2",
    ),
    "a part is gone": (
        "from numba.core import compiler_machinery as one; del one.register_pass",
        "ImportError: cannot import name 'register_pass'",
    ),
    "a part has another name": (
        """
from numba.core.codegen import JITCodeLibrary
known = JITCodeLibrary._raise_if_finalized
def for_itself(self):
    if type(self) is not JITCodeLibrary:
        raise AttributeError("no attribute '_raise_if_finalized'")
    known(self)
JITCodeLibrary._raise_if_finalized = for_itself
""",
        "AttributeError: no attribute '_raise_if_finalized'",
    ),
    "a part of records is gone": (
        "from numba.core.base import BaseContext as one; del one.make_tuple",
        "AttributeError: type object 'BaseContext' has no attribute 'make_tuple'",
    ),
    "a part does something else": (
        """
import numba, types
numba._dynfunc = types.SimpleNamespace(make_function=lambda *parts: 1)
""",
        "TypeError: must be builtin_function_or_method",
    ),
}


@pytest.mark.parametrize("kind", quick_are([], UNKNOWN_NUMBA))
def test_a_numba_with_unknown_insides_compiles_as_it_does(example, kind):
    code, said = UNKNOWN_NUMBA[kind]
    first, complaint = told(code + CALL, example, NUMBA_CACHE_DIR=example / "cache")
    again = run(code + CALL, example, NUMBA_CACHE_DIR=example / "cache")
    assert first["result"] == again["result"] == ["0.25", "inf"]
    assert (first["hits"], again["hits"]) == (0, 1)
    (line,) = complaint.splitlines()
    assert line.startswith("kernels are compiled as numba does by itself, which takes longer: ")
    assert said in line


SHARING = """
import json
import sys
import numpy as np
from maneuver_automaton._compile import bare_kernel, bare_shared_kernel, inner_kernel, kernel
from maneuver_automaton._linking import Tried


@bare_shared_kernel
def product(tried):
    return tried.values[0] * tried.factor


@bare_kernel
def of_two(first, second):
    swapped = Tried(second.values, first.factor)
    return product(first) + 10.0 * product(swapped)


@inner_kernel
def squared(tried):
    return product(tried) ** 2


@kernel
def square(tried):
    sums = np.zeros(2)
    for _ in range(3):
        sums = sums + squared(tried)
    return sums[1] / 3.0


@kernel
def made(factor):
    return product(Tried(np.array([1.0]), factor))


if __name__ == "__main__":
    import example_sharing as one

    records = Tried(np.array([2.0]), 3.0), Tried(np.array([5.0]), 7.0)
    results = [one.of_two(*records), one.square(records[1])]
    try:
        one.made(2.0)
    except TypeError as error:
        results.append(str(error).splitlines()[-1])
    kernels = one.product, one.of_two, one.square
    hits = [sum(kernel.stats.cache_hits.values()) for kernel in kernels]
    print(json.dumps([results, hits]))
"""


@pytest.mark.slow
def test_what_kernels_share_is_compiled_once_and_handed_records_by_their_address(tmp_path):
    (tmp_path / "example_sharing.py").write_text(SHARING)
    code = "import runpy; runpy.run_module('example_sharing', run_name='__main__')"
    sooner = "from maneuver_automaton._compile_work import compile_sooner; compile_sooner();"
    first, again = (run(code, tmp_path, NUMBA_CACHE_DIR=tmp_path / "cache") for _ in range(2))
    alike = run(sooner + code, tmp_path, NUMBA_CACHE_DIR=tmp_path / "sooner")
    refused = "Tried: made where references are counted: decorate it as by_value"
    assert first[0] == again[0] == alike[0] == [2.0 * 3.0 + 10.0 * 5.0 * 3.0, 35.0**2, refused]
    assert (first[1], again[1]) == ([0, 0, 0], [1, 1, 1])


KERNEL_IN_KERNEL = """
from numba import types


@kernel
def twice(x):
    return reciprocals(reciprocals(x))


@inner_kernel
def inside(x):
    return reciprocals(x)


@kernel
def around(x):
    return inside(x)


nowhere = types.ExternalFunction("_ZN7nowhere", types.float64(types.float64))


@kernel
def lost(x):
    return nowhere(x[0])
"""

REFUSED = """
import json
import numpy as np
import example_kernels
example_kernels.reciprocals(np.array([4.0]))
said = []
for one in (example_kernels.twice, example_kernels.around, example_kernels.lost):
    try:
        one(np.array([4.0]))
    except (AssertionError, TypeError) as error:
        said.append(str(error))
print(json.dumps(said))
"""


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_kernel_that_calls_a_kernel_is_refused_compiled_now_or_before(example):
    with (example / "example_kernels.py").open("a") as file:
        file.write(KERNEL_IN_KERNEL)
    for _ in range(2):
        assert run(REFUSED, example, NUMBA_CACHE_DIR=example / "cache") == [
            "twice: calls reciprocals, which is for Python to call",
            "inside: calls reciprocals, which is for Python to call",
            "lost: nothing defines _ZN7nowhere",
        ]


def test_plans_are_the_same_without_a_compiler_and_without_a_cache(tmp_path):
    (tmp_path / "file").write_text("in the way")
    words = run(PLAN, tmp_path, NUMBA_DISABLE_JIT=1, NUMBA_CACHE_DIR=tmp_path / "file")
    for word, durations, passed in words:
        assert word == ["left", "ahead", "right"]
        assert durations == pytest.approx([0.785398163397, 1.414213562373, 0.785398163397])
        assert passed
