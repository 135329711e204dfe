"""A file is whole or not there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from maneuver_automaton._files import stem_of, write_bytes_atomically, write_text_atomically


def test_makes_folders_and_replaces(tmp_path):
    path = tmp_path / "a" / "b" / "x.txt"
    write_text_atomically(path, "Größe\n")
    assert path.read_bytes() == "Größe\n".encode()
    path.chmod(0o640)
    write_bytes_atomically(path, b"2")
    assert path.read_bytes() == b"2"
    assert path.stat().st_mode & 0o777 == 0o640
    assert [file.name for file in path.parent.iterdir()] == ["x.txt"]


def test_a_failure_leaves_the_old_file(tmp_path):
    path = tmp_path / "x.txt"
    path.write_text("old")
    with pytest.raises(TypeError):
        write_bytes_atomically(path, "no bytes")  # type: ignore[arg-type]
    assert path.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_link_stays_a_link(tmp_path):
    path, link = tmp_path / "x.txt", tmp_path / "link.txt"
    path.write_text("old")
    link.symlink_to(path)
    write_text_atomically(link, "new")
    assert link.is_symlink()
    assert path.read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_a_pipe_stays_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "plan.json").symlink_to("pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text_atomically(tmp_path / "plan.json", "{}")
    assert os.read(reader, 8) == b"{}"
    os.close(reader)


def test_a_name_that_is_not_utf_8_is_spelled_out():
    assert stem_of(Path("folder/x\udcff.yaml")) == "x\\udcff"
