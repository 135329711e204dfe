"""Whatever is wrong with the files of compiled kernels, the kernels work; and it is said once."""

from __future__ import annotations

import errno
import logging
import os
import stat
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from maneuver_automaton import _cache_files, _kernel_cache, _kernel_folders
from maneuver_automaton._kernel_cache import KernelCache

POSIX = pytest.mark.skipif(os.name != "posix", reason="owners and modes of files")


def third(x: float) -> float:
    """A kernel."""
    return x / 3.0


@pytest.fixture(autouse=True)
def said(monkeypatch, caplog):
    """The lines that are said, each process saying them for the first time."""
    monkeypatch.setattr(_cache_files, "_said", set())
    caplog.set_level(logging.WARNING, logger="maneuver_automaton")
    return caplog


def compiled_in(folder: Path):
    """A kernel with its cache in `folder`, called once."""
    made = numba.njit(nogil=True)(third)
    made._cache = KernelCache(third, folder)
    assert made(1.5) == 0.5
    return made


def hits(made) -> int:
    """How often the cache had what was asked for."""
    return sum(made.stats.cache_hits.values())


def test_what_was_compiled_is_loaded(tmp_path, said):
    assert hits(compiled_in(tmp_path)) == 0
    (path,) = tmp_path.iterdir()
    assert path.name.startswith(f"{__name__}.third-")
    assert hits(compiled_in(tmp_path)) == 1
    again = compiled_in(tmp_path)
    assert again(3) == 1.0  # another signature
    assert len(list(tmp_path.iterdir())) == 2
    assert not said.messages


@pytest.mark.parametrize(
    "damage", [b"", b"\x80\x04N.", "short", "flipped", "not a pickle", "other"]
)
def test_a_damaged_file_is_compiled_again_and_mended(tmp_path, said, damage):
    compiled_in(tmp_path)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    if damage == "short":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "flipped":
        path.write_bytes(whole[:900] + bytes([whole[900] ^ 4]) + whole[901:])
    elif damage == "not a pickle":
        _cache_files.write_checked(path, b"I am whole")
    elif damage == "other":
        _cache_files.write_checked(
            path, _kernel_cache.dumps(None) + _kernel_cache.dumps(((numba.int64,), {}, ()))
        )
    else:
        path.write_bytes(damage)
    assert hits(compiled_in(tmp_path)) == 0
    assert hits(compiled_in(tmp_path)) == 1
    assert len(said.messages) == (damage != "other")
    assert all(text.startswith(str(path)) for text in said.messages)


def test_a_full_disk_is_said_once(tmp_path, said, monkeypatch):
    class Full:
        def __init__(self, *_: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(_cache_files.os, "fdopen", Full)
    made = compiled_in(tmp_path)
    assert made(3) == 1.0
    assert list(tmp_path.iterdir()) == []
    place = f"{tmp_path}: compiled kernels cannot be kept here"
    assert said.messages == [f"{place}: No space left on device"]


def test_a_disk_that_is_really_full(tmp_path, said):
    """On a file system of 64 KB, where such a one can be mounted."""
    place = tmp_path / "small"
    place.mkdir()
    order = ["mount", "-t", "tmpfs", "-o", "size=64k,mode=755", "tmpfs", str(place)]
    if (
        sys.platform != "linux"
        or subprocess.run(order, capture_output=True, check=False).returncode
    ):
        pytest.skip("no file system can be mounted")
    try:
        (place / "fill").write_bytes(bytes(60_000))
        compiled_in(place)
        assert [path.name for path in place.iterdir()] == ["fill"]
        assert said.messages[0].endswith("No space left on device")
    finally:
        subprocess.run(["umount", str(place)], check=True)


@POSIX
@pytest.mark.parametrize("mode", [0o666, 0o664])
def test_a_file_that_others_can_write_is_not_unpickled(tmp_path, said, monkeypatch, mode):
    compiled_in(tmp_path)
    (path,) = tmp_path.iterdir()
    path.chmod(mode)
    monkeypatch.setattr(_kernel_cache.pickle, "load", None)
    assert hits(compiled_in(tmp_path)) == 0
    assert stat.S_IMODE(path.stat().st_mode) & 0o022 == 0  # replaced by one of our own
    assert f"writable by others (mode {mode:o})" in said.messages[0]


@POSIX
def test_a_file_of_somebody_else_is_not_unpickled(tmp_path, said, monkeypatch):
    compiled_in(tmp_path)
    monkeypatch.setattr(_kernel_cache.pickle, "load", None)
    monkeypatch.setattr(_cache_files, "distrusted", lambda *_, **__: "owned by another user (7)")
    assert hits(compiled_in(tmp_path)) == 0
    assert "owned by another user (7)" in said.messages[0]


@POSIX
@pytest.mark.parametrize("which", ["base", "kernels"])
def test_a_folder_that_others_can_write_is_not_used(tmp_path, said, monkeypatch, which):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    folder = _kernel_folders.kernel_folder.__wrapped__()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o755
    (folder if which == "kernels" else folder.parent).chmod(0o777)
    assert _kernel_folders.kernel_folder.__wrapped__() is None
    assert "writable by others (mode 777): kernels are compiled anew" in said.messages[0]
    (folder if which == "kernels" else folder.parent).chmod(0o1777)  # a sticky one, such as /tmp
    assert _kernel_folders.kernel_folder.__wrapped__() == (folder if which == "base" else None)


@POSIX
def test_whose_folders_are_trusted(tmp_path, monkeypatch):
    def status(owner: int, mode: int) -> os.stat_result:
        return os.stat_result((stat.S_IFDIR | mode, 0, 0, 1, owner, 0, 0, 0, 0, 0))

    installer = Path(_cache_files.__file__).stat().st_uid
    monkeypatch.setattr(_cache_files.os, "geteuid", lambda: 1234)
    for owner in (1234, installer, 0):
        assert _cache_files.distrusted(status(owner, 0o755)) == ""
    assert "another user (1235)" in _cache_files.distrusted(status(1235, 0o700))
    assert "writable by others" in _cache_files.distrusted(status(1234, 0o775))
    assert _cache_files.distrusted(status(1234, 0o775), shared=True) == ""


def test_what_lies_in_a_folder_that_cannot_be_written_is_read(tmp_path, said, monkeypatch):
    compiled_in(tmp_path)

    def refuse(*_: object, **__: object) -> int:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(_cache_files.os, "open", refuse)
    assert hits(compiled_in(tmp_path)) == 1
    assert not said.messages
