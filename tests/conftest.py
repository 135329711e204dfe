"""What every test session gets: the user's compiled kernels, and Hypothesis without a deadline."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from maneuver_automaton._kernel_folders import kernel_folder
from tests.quickly import FEW, MANY

# Kernels are compiled once, for the tests and for the command line: their folder is named by a hash
# of all their sources, so none can be stale. It is stated, since some tests have another cache.
# Failing examples are kept beside pytest's own cache: a folder `.hypothesis` in the root, which is
# searched for tests, would be warned about, and warnings are errors.
_kept = Path(__file__).parent.parent / ".pytest_cache"
_kernels = kernel_folder()
os.environ.setdefault("NUMBA_CACHE_DIR", str(_kernels.parent if _kernels else _kept / "kernels"))
os.environ.setdefault("HYPOTHESIS_STORAGE_DIRECTORY", str(_kept / "hypothesis"))
os.environ.pop("COLUMNS", None)  # pytest's readline sets it for the processes of its workers
if _kernels is None:  # the user's cache cannot be written, or not be trusted
    kernel_folder.cache_clear()

SOME = 6  # every sixth of the slow parameters of a test is tried before a change is offered

for name, examples in (("few", FEW), ("many", MANY)):
    settings.register_profile(
        name,
        max_examples=examples,
        deadline=None,
        derandomize=bool(os.environ.get("CI")),
        suppress_health_check=[HealthCheck.too_slow],
    )


def _takes_long(config: pytest.Config) -> bool:
    return "not slow" not in config.option.markexpr


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """No further process for files that are named, -k, and -s: what a test prints is seen."""
    files = any(".py" in one for one in config.args)
    return 0 if files or config.option.keyword or config.option.capture == "no" else None


def pytest_configure(config: pytest.Config) -> None:
    """Choose how often laws are tried."""
    settings.load_profile("many" if _takes_long(config) else "few")


@pytest.hookimpl(tryfirst=True)  # before marks are chosen from
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let `-m slow` try the laws again, with more numbers, and few of many parameters."""
    several: dict[str, list[pytest.Item]] = {}
    for item in items:
        if _takes_long(config) and hasattr(getattr(item, "obj", None), "hypothesis"):
            item.add_marker("slow")
        one_by_one = item.path.name == "test_readme.py"  # each is another page
        if item.get_closest_marker("slow") and hasattr(item, "callspec") and not one_by_one:
            several.setdefault(item.nodeid.split("[")[0], []).append(item)
    for rows in several.values():
        for number, item in enumerate(rows):
            if number % SOME:
                item.add_marker("exhaustive")


@pytest.fixture
def folder(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the files of `FILES`, by name, if the tests of a module have any."""
    monkeypatch.chdir(tmp_path)
    for name, content in getattr(request.module, "FILES", {}).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        raw = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(raw)
    return tmp_path
