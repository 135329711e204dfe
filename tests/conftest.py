"""What every test session gets: a numba cache of its own, and Hypothesis without a deadline."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Set before anything imports numba; a caller who set it keeps compiled kernels between sessions.
_own_cache: str | None = None
if "NUMBA_CACHE_DIR" not in os.environ:
    _own_cache = tempfile.mkdtemp(prefix="maneuver-automaton-kernels-")
    os.environ["NUMBA_CACHE_DIR"] = _own_cache

# Failing examples are kept beside pytest's own cache: a folder `.hypothesis` in the root, which is
# searched for tests, would be warned about, and warnings are errors.
_root = Path(__file__).parent.parent
os.environ.setdefault("HYPOTHESIS_STORAGE_DIRECTORY", str(_root / ".pytest_cache" / "hypothesis"))

settings.register_profile(
    "maneuver_automaton",
    deadline=None,
    derandomize=bool(os.environ.get("CI")),
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("maneuver_automaton")


def pytest_unconfigure(config: pytest.Config) -> None:
    if _own_cache is not None:
        shutil.rmtree(_own_cache, ignore_errors=True)
