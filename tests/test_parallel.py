"""Work in pieces: the same results, here or in processes."""

from __future__ import annotations

import importlib.util
import inspect
import re
import socket
import warnings

import pytest
from joblib.externals.loky import process_executor

from maneuver_automaton._parallel import in_parallel


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_order_or_as_they_are_done(jobs):
    pieces = list(range(-4, 5))
    assert list(in_parallel(abs, pieces, jobs=jobs)) == [abs(piece) for piece in pieces]
    done = in_parallel(abs, pieces, jobs=jobs, order="as done")
    assert sorted(done) == sorted(abs(piece) for piece in pieces)


def test_an_idle_process_that_ends_as_pieces_come_in_is_no_error():
    """Raised in joblib's own thread it left everybody waiting for ever."""
    (said,) = re.findall(r'"(A worker stopped [^"]*)"', inspect.getsource(process_executor))
    assert list(in_parallel(abs, [-1, 2], jobs=2)) == [1, 2]
    warnings.warn(said, UserWarning, stacklevel=1)


def test_nothing_to_do():
    assert list(in_parallel(abs, [], jobs=2)) == []


def test_no_jobs():
    with pytest.raises(ValueError) as error:
        in_parallel(abs, [1], jobs=0)
    assert str(error.value) == "jobs must be at least 1, got 0"


def test_without_dask(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ValueError) as error:
        list(in_parallel(abs, [1], scheduler="local"))
    assert str(error.value) == (
        "scheduler: got 'local', but Dask is not installed; need "
        "`pip install 'maneuver-automaton[distributed]'`"
    )


@pytest.fixture
def free_port():
    """A port of this machine at which nothing answers."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.mark.parametrize("prefix", ["tcp://", ""])
def test_a_wrong_address_is_said_before_any_work(monkeypatch, free_port, prefix):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: True)
    with pytest.raises(ValueError) as error:
        in_parallel(abs, [1], scheduler=f"{prefix}127.0.0.1:{free_port}")
    said = str(error.value)
    assert said.startswith(f"scheduler: nothing answers at {prefix}127.0.0.1:{free_port} (")
    assert said.endswith("need the address of a running Dask scheduler, such as tcp://host:8786, "
                         "or local")  # fmt: skip


@pytest.mark.parametrize("address", ["here", "tcp://host", "", "tcp://host:port"])
def test_what_is_no_address_is_said(monkeypatch, address):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: True)
    with pytest.raises(ValueError) as error:
        in_parallel(abs, [1], scheduler=address)
    assert str(error.value) == (
        f"scheduler: got {address!r}, need an address such as tcp://host:8786, or local"
    )


@pytest.mark.slow
def test_dask_gives_the_same_results_as_they_come():
    pytest.importorskip("distributed")
    pieces = list(range(-4, 5))
    assert list(in_parallel(abs, pieces, scheduler="local")) == [abs(piece) for piece in pieces]
    done = in_parallel(abs, pieces, jobs=2, scheduler="local", order="as done")
    assert sorted(done) == sorted(abs(piece) for piece in pieces)
