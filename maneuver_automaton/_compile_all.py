"""Compile listed kernels in all cores: when the package is installed, or when one is missing.

Each process is handed one module after the other, from either end of the list: the kernels of a
module, and of neighbours, share functions, which each process compiles for itself.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import math
import os
import shutil
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path

from maneuver_automaton._kernel_files import processors
from maneuver_automaton._kernel_folders import KERNELS, SHIPPED, kernel_folder, source_hash
from maneuver_automaton._kernel_list import LATER, kernel_names, later_uses, module_of

FIRST = (  # modules that take longest; those of a row share kernels, and are for one process
    (
        "refinement.",
        "collision._kernels_advancement",
        "search._kernels_connection",
        "search._kernels_place",
        "words._kernels_candidates",
    ),
    ("search._kernels_begin", "search._kernels_lattice"),
    ("receding_horizon.",),
    ("search._kernels_distance",),
    ("search._kernels_waiting",),
    ("collision.",),
)
HELD = 2e9  # [bytes] that one process may come to hold; 1.6 to 1.9 GB are measured
KEPT = 8  # folders of compiled kernels, of other versions and of sources that were edited
EVERY = "MANEUVER_AUTOMATON_COMPILE_ALL"  # set where a build is to compile every kernel
LOCK = ".compiling"  # name of the lock in the folder
STALE = 20.0  # [s] after which a lock that is touched no more is nobody's
WORKER = "MANEUVER_AUTOMATON_COMPILES"  # set in the environment of the processes that compile

# Called again and again with the kernels that are compiled, and with all
Report = Callable[[Sequence[str], Collection[str]], None]


def compile_kernels(
    names: Collection[str],
    *,
    jobs: int | None = None,
    report: Report | None = None,
    settings: dict[str, str] | None = None,
) -> list[str]:
    """Compile those that are not compiled yet, in several processes; what failed, and why."""
    workers = [_worker(settings or {}) for _ in range(min(jobs or affordable(), len(names)))]
    waiting = deque(
        list(its) for _, its in itertools.groupby(sorted(sorted(names), key=_handed), _handed)
    )
    failed, done = list[str](), list[str]()

    def serve(number: int, worker: subprocess.Popen[str]) -> None:
        assert worker.stdin is not None
        assert worker.stdout is not None
        with contextlib.suppress(IndexError, OSError):
            while True:
                for name in waiting.popleft() if number % 2 == 0 else waiting.pop():
                    worker.stdin.write(f"{name}\n")
                    worker.stdin.flush()
                    answer = worker.stdout.readline().strip()
                    if answer != "done":
                        failed.append(f"{name}: {answer or 'the compiler ended'}")
                    done.append(name)

    threads = [
        threading.Thread(target=serve, args=pair, daemon=True) for pair in enumerate(workers)
    ]
    try:
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            threads[0].join(0.1)
            threads[-1].join(0.1)
            if report is not None:
                report(done, names)
    finally:
        for worker in workers:
            worker.kill()
            with contextlib.suppress(OSError):
                worker.communicate()
    return failed


def _handed(name: str) -> tuple[list[bool], str]:
    """What is handed to one process, in the order in which it is: a row of `FIRST`, or a module."""
    module = module_of(name)
    row = next((one for one in FIRST if module.startswith(one)), ())
    return [row != one for one in FIRST], "" if len(row) > 1 else module


def compile_missing(names: Collection[str], *, jobs: int | None = None) -> list[str] | None:
    """Compile kernels into the user's cache, unless another process does: then wait for it.

    What failed, and why; None where no folder can be written, or in a process that compiles itself.
    """
    folder, theirs = kernel_folder(), set[str]()
    if folder is None or os.environ.get(WORKER) or not os.access(folder, os.W_OK):
        return None
    from numba.core import event

    with event.trigger_event("numba:compile", data={}):
        while not _locked(folder / LOCK, names):
            with contextlib.suppress(OSError):
                theirs = set((folder / LOCK).read_text().split())
            time.sleep(0.2)
            if theirs.issuperset(names) and not (folder / LOCK).exists():
                return []  # the other process has compiled them
        try:
            with _bar() as bar:
                report = functools.partial(_report, folder / LOCK, bar)
                return compile_kernels(names, jobs=jobs, report=report)
        finally:
            with contextlib.suppress(OSError):
                (folder / LOCK).unlink()
                others = sorted(
                    folder.parent.glob(f"{KERNELS}*"), key=lambda one: one.stat().st_mtime
                )
                for old in others[:-KEPT]:
                    shutil.rmtree(old, ignore_errors=True)


def _report(lock: Path, bar: Report | None, done: Sequence[str], names: Collection[str]) -> None:
    """Say that this process is still at work, and how far it is."""
    with contextlib.suppress(OSError):
        os.utime(lock)
    if bar is not None:
        bar(done, names)


def ship(package: Path) -> list[str]:
    """Compile kernels into a package that is built, for every processor of its kind.

    All that first plans need, or every one where `EVERY` is set. Prints a line when it begins, one
    for each room that is done, and one of what is left.
    """
    folder, jobs, said = package / SHIPPED, affordable(), set[str]()
    names = [one for one in kernel_names() if os.environ.get(EVERY) or not later_uses(one)]

    def say(text: str) -> None:
        begin = "\r" if sys.stdout.isatty() else ""  # over the sign that pip turns there
        print(f"{begin}  {text}", flush=True)  # noqa: T201

    def report(done: Sequence[str], names: Collection[str]) -> None:
        left = {name.split(".")[1] for name in set(names).difference(done)}
        for room in sorted({name.split(".")[1] for name in names} - left - said):
            said.add(room)
            say(f"compiled {room} ({len(done)} of {len(names)} kernels)")

    say(f"compiling kernels, {jobs} at a time; this takes some minutes of processor time")
    target = {"NUMBA_CPU_NAME": processors()[0], "NUMBA_CPU_FEATURES": ""}
    settings = {"NUMBA_CACHE_DIR": str(folder), **target}
    failed = compile_kernels(names, jobs=jobs, report=report, settings=settings)
    if left := len(kernel_names()) - len(names):
        say(f"left to their first use: {left} kernels, for {', '.join(LATER)}")
    for other in folder.glob(f"{KERNELS}*"):
        if other.name != f"{KERNELS}{source_hash()}":
            for path in other.iterdir():
                path.unlink()
            other.rmdir()
    return failed


def cores() -> int:
    """How many processes this one may keep busy."""
    with contextlib.suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def affordable(root: Path = Path("/")) -> int:
    """How many processes may compile at a time: one a core, as far as memory reaches."""
    free = [math.inf]
    try:
        stated = (root / "proc/meminfo").read_text().split("MemAvailable:")[1]
        free.append(int(stated.split()[0]) * 1024)
    except (OSError, IndexError):
        with contextlib.suppress(AttributeError, OSError, ValueError):  # all there is, free or not
            free.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    with contextlib.suppress(OSError):  # a container has less
        for line in (root / "proc/self/cgroup").read_text().splitlines():
            _, kinds, path = line.split(":", 2)
            if kinds in ("", "memory"):
                top = root / "sys/fs/cgroup" / kinds
                group = top / path.lstrip("/")
                free += [
                    _left_in(one) for one in (group, *group.parents) if one.is_relative_to(top)
                ]
    return max(1, int(min(cores(), min(free) / HELD)))


def _left_in(group: Path) -> float:
    """Bytes that a control group may still use, files that can be dropped among them."""
    for most, used in (("max", "current"), ("limit_in_bytes", "usage_in_bytes")):
        with contextlib.suppress(OSError, ValueError):  # no such file, or "max": no limit
            left = int((group / f"memory.{most}").read_text())
            left -= int((group / f"memory.{used}").read_text())
            stated = (group / "memory.stat").read_text().split("inactive_file ")
            return left + (int(stated[1].split()[0]) if len(stated) > 1 else 0)
    return math.inf


def _worker(settings: dict[str, str]) -> subprocess.Popen[str]:
    # This package, and not the clone in whose folder an installed one is called.
    where = f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})"
    return subprocess.Popen(
        [sys.executable, "-c", f"{where}; from {__package__}._compile_work import work; work()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, WORKER: "1", **settings},
    )


def _locked(lock: Path, names: Iterable[str]) -> bool:
    """Whether the lock is ours now, to compile `names`: one that nobody touches is taken."""
    try:
        with contextlib.suppress(FileNotFoundError):
            if time.time() - lock.stat().st_mtime > STALE:
                lock.unlink()
        with lock.open("x") as stream:
            stream.write("\n".join(names))
    except FileExistsError:
        return False
    return True


@contextlib.contextmanager
def _bar() -> Iterator[Report | None]:
    """A bar of progress on a terminal; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("compiling kernels, once")
        yield lambda done, names: progress.update(task, completed=len(done), total=len(names))
