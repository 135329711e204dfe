"""The list of kernels that are compiled ahead: complete, readable, and compiled as it says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import maneuver_automaton
from maneuver_automaton import _compile_all, _kernel_cache, _kernel_files, _kernel_list
from maneuver_automaton._kernel_cache import KernelCache
from maneuver_automaton._kernel_list import (
    LATER,
    USES,
    compiled_with,
    kernel_named,
    kernel_names,
    later_uses,
    module_of,
    signatures_of,
    write_list,
)

PACKAGE = Path(maneuver_automaton.__file__).parent


def test_every_kernel_is_listed():
    decorated = {
        f"{PACKAGE.name}.{'.'.join(path.relative_to(PACKAGE).with_suffix('').parts)}.{name}"
        for path in PACKAGE.rglob("_kernels*.py")
        for before, line in zip(
            path.read_text().splitlines(), path.read_text().splitlines()[1:], strict=False
        )
        if before in ("@kernel", "@bare_kernel", "@shared_kernel", "@bare_shared_kernel")
        for name in [line.removeprefix("def ").split("(")[0]]
    }
    assert set(kernel_names()) == decorated
    for name in kernel_names():
        assert kernel_named(name).__name__ == name.rsplit(".", 1)[1]


def test_a_missing_kernel_is_compiled_with_those_of_its_uses(monkeypatch):
    monkeypatch.setattr(_kernel_list, "_asked", set())
    names = kernel_names()
    assert {one for modules in USES.values() for one in modules} <= set(map(module_of, names))
    assert {use for name in names for use in later_uses(name)} == set(LATER)
    installed = [name for name in names if not later_uses(name)]
    for name in names:
        together = compiled_with(name)
        assert name in together
        if name in installed:
            assert together == installed
        else:
            assert not set(together).intersection(installed)
    (road,) = {tuple(compiled_with(name)) for name in names if module_of(name).startswith("roads.")}
    assert {module_of(name) for name in road} == set(USES["roads"])
    monkeypatch.setattr(_kernel_list, "_asked", {"lattice", "separation", "insertion"})
    (boxes,) = (name for name in names if module_of(name) == "bounds._kernels_boxes")
    together = {module_of(name) for name in compiled_with(boxes)}
    assert together == {*USES["separation"], *USES["insertion"]}  # and not those of cells


def test_the_list_is_written_as_it_was_read(tmp_path, monkeypatch):
    file = tmp_path / "kernels.json"
    monkeypatch.setattr("maneuver_automaton._kernel_list.FILE", file)
    before = {name: signatures_of(name) for name in kernel_names()}
    write_list(before)
    assert file.read_text() == (PACKAGE / "kernels.json").read_text()


def third(x: float) -> float:
    """A kernel."""
    return x / 3.0


MADE_FOR_ALL = """
import sys
from pathlib import Path
import numba
from maneuver_automaton._kernel_cache import KernelCache
from tests.test_kernel_list import third
made = numba.njit(nogil=True)(third)
made._cache = KernelCache(third, Path(sys.argv[1]))
made.compile((numba.types.float64,))
"""


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.skipif(_kernel_files.processors()[0] == "generic", reason="kinds of x86-64")
def test_kernels_that_came_compiled_are_used_where_the_processor_has_what_they_need(
    tmp_path, monkeypatch
):
    came, own = tmp_path / "came", tmp_path / "own"
    came.mkdir()
    own.mkdir()
    env = {**os.environ, "NUMBA_CPU_NAME": _kernel_files.processors()[0], "NUMBA_CPU_FEATURES": ""}
    subprocess.run([sys.executable, "-c", MADE_FOR_ALL, str(came)], env=env, check=True)
    monkeypatch.setattr(_kernel_files, "shipped_folder", lambda: came)

    def hits():
        made = numba.njit(nogil=True)(third)
        made._cache = KernelCache(third, own)
        assert made(1.5) == 0.5
        return sum(made.stats.cache_hits.values())

    assert hits() == 1
    monkeypatch.setattr(_kernel_files, "processors", lambda: ["another"])
    assert hits() == 0  # compiled for this one, into the user's folder
    assert hits() == 1


@pytest.mark.exhaustive
@pytest.mark.slow
def test_kernels_are_compiled_by_several_processes():
    names = ("collision._kernels_field.write_map", "collision._kernels_field.fill_buckets")
    few = [f"maneuver_automaton.{name}" for name in names]
    seen = []
    failed = _compile_all.compile_kernels(few, jobs=2, report=lambda *both: seen.append(both))
    assert failed == []
    assert set(seen[-1][0]) == set(seen[-1][1]) == set(few)


def test_what_compiles_is_this_package_also_in_the_folder_of_another(folder):
    (folder / "maneuver_automaton.py").write_text("raise SystemExit")
    failed = _compile_all.compile_kernels(["no.kernel"], jobs=1)
    assert failed == ["no.kernel: KeyError: 'no.kernel'"]


def test_a_build_says_which_rooms_are_done_and_what_is_left(tmp_path, monkeypatch, capsys):
    seen = []

    def compiled(names, *, jobs, report, settings):
        seen.append(names)
        report(["ma.words.a"], ["ma.words.a", "ma.search.b", "ma.words.c"])
        report(["ma.words.a", "ma.words.c"], ["ma.words.a", "ma.search.b", "ma.words.c"])
        report(["ma.words.a", "ma.words.c"], ["ma.words.a", "ma.search.b", "ma.words.c"])
        return []

    monkeypatch.setattr(_compile_all, "compile_kernels", compiled)
    monkeypatch.delenv(_compile_all.EVERY, raising=False)
    assert _compile_all.ship(tmp_path) == []
    first, room, last = capsys.readouterr().out.splitlines()
    assert f"{_compile_all.affordable()} at a time" in first
    assert room == "  compiled words (2 of 3 kernels)"
    assert last.endswith("kernels, for " + ", ".join(LATER))
    monkeypatch.setenv(_compile_all.EVERY, "1")
    assert _compile_all.ship(tmp_path) == []
    assert "left" not in capsys.readouterr().out
    some, every = seen
    assert every == kernel_names()
    assert some == [name for name in every if not later_uses(name)]


V1, V2 = "4:memory:/me\n", "0::/me\n"


@pytest.mark.parametrize(
    ("meminfo", "groups", "files", "expected"),
    [
        ("MemAvailable: 5000000 kB", "", {}, 2),
        ("MemAvailable: 500000 kB", "", {}, 1),
        ("MemAvailable: 99000000 kB", "", {}, 8),
        ("MemAvailable: 99000000 kB", V2, {"me/memory.max": "max"}, 8),
        (
            "MemAvailable: 99000000 kB",
            V2,
            {"memory.max": "7000000000", "memory.current": "2000000000", "memory.stat": "anon 5"},
            2,
        ),
        (
            "MemAvailable: 99000000 kB",
            V2,
            {
                "me/memory.max": "7000000000",
                "me/memory.current": "2000000000",
                "me/memory.stat": "anon 5\ninactive_file 1500000000\nactive_file 7",
            },
            3,
        ),
        (
            "MemAvailable: 99000000 kB",
            V1,
            {
                "memory/me/memory.limit_in_bytes": "4100000000",
                "memory/me/memory.usage_in_bytes": "0",
                "memory/me/memory.stat": "",
            },
            2,
        ),
    ],
)
def test_as_many_compile_as_memory_admits(tmp_path, monkeypatch, meminfo, groups, files, expected):
    monkeypatch.setattr(_compile_all, "cores", lambda: 8)
    stated = {"proc/meminfo": meminfo, "proc/self/cgroup": groups}
    stated |= {f"sys/fs/cgroup/{name}": text for name, text in files.items()}
    for name, text in stated.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert _compile_all.affordable(tmp_path) == expected


def test_without_a_word_of_the_system_memory_does_not_count(tmp_path, monkeypatch):
    monkeypatch.setattr(_compile_all, "cores", lambda: 3)
    monkeypatch.setattr(_compile_all.os, "sysconf", lambda name: 4e9, raising=False)
    assert _compile_all.affordable(tmp_path) == 3
    monkeypatch.delattr(_compile_all.os, "sysconf")
    assert _compile_all.affordable(tmp_path) == 3


def test_a_disk_that_is_full_ends_nothing(monkeypatch, caplog):
    def full(names):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(_kernel_cache, "compile_missing", full)
    monkeypatch.setattr("maneuver_automaton._cache_files._said", set())
    assert not _kernel_cache._compiled.__wrapped__((kernel_names()[0],))
    assert caplog.messages[-1] == "kernels are compiled one by one: No space left on device"


OWN = """
import sys
if {first!r}:
    import maneuver_automaton as ma
    robot = ma.Automaton.of_controls(ma.Unicycle(), {{"ahead": (1, 0), "left": (1, 1)}})
    ma.plan(ma.Problem(robot, [0, 0, 0], [1, 0, 0], cost=ma.Cost(effort=1.0)))
import numba

@numba.njit
def own(values):
    total = 0.0
    for value in values:
        total += value * value
    return total

own.compile((numba.types.float64[::1],))
names = [name for name in dir(numba.config) if name.isupper()]
print({{name: getattr(numba.config, name) for name in names}})
print(own.inspect_asm(own.signatures[0]).count("ymm"), type(own._cache).__name__)
"""


@pytest.mark.slow
def test_numba_functions_of_a_user_are_compiled_as_without_the_package():
    answers = {
        subprocess.run(
            [sys.executable, "-c", OWN.format(first=first)],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for first in (False, True)
    }
    assert len(answers) == 1


def test_the_lock_of_a_process_that_is_gone_is_taken(tmp_path):
    lock = tmp_path / "lock"
    assert _compile_all._locked(lock, [])
    assert not _compile_all._locked(lock, [])
    os.utime(lock, (0.0, 0.0))
    _compile_all._report(lock, None, ["one"], ["one", "other"])  # its process is at work
    assert not _compile_all._locked(lock, [])
    os.utime(lock, (0.0, 0.0))
    assert _compile_all._locked(lock, [])


def test_kernels_that_another_process_compiles_are_waited_for(tmp_path, monkeypatch):
    lock, compiled = tmp_path / _compile_all.LOCK, []
    monkeypatch.setattr(_compile_all, "kernel_folder", lambda: tmp_path)
    monkeypatch.setattr(_compile_all, "compile_kernels", lambda names, **_: compiled.append(names))
    monkeypatch.setattr(_compile_all.time, "sleep", lambda _: lock.unlink())  # the other is done
    monkeypatch.delenv(_compile_all.WORKER, raising=False)
    for others, own in (("ab", "ab"), ("abc", "b"), ("ab", "bc")):
        assert _compile_all._locked(lock, others)
        _compile_all.compile_missing(own)
        assert not lock.exists()
    assert compiled == ["bc"]
