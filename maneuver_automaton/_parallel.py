"""Work in pieces: here, in processes on this machine, or on a Dask cluster."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import multiprocessing
import re
import socket
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, TypeAlias, TypeVar

from maneuver_automaton._arrays import check_range
from maneuver_automaton._interrupts import children_ignore_signals, patient, serving, stopped

LOCAL = "local"  # a cluster on this machine
PATIENCE = 0.8  # [s] until something must have answered at its address
CONNECTED = 10.0  # [s] until it must have agreed on the words to use
_PLACE = re.compile(r"(?:\w+://)?(?P<host>[^:/@\s]+|\[[^\]]+\]):(?P<port>\d{1,5})")

Piece = TypeVar("Piece")
Result = TypeVar("Result")
Gathered: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]
"""A function that does work in processes which stay."""


def in_parallel(
    function: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    order: Literal["as given", "as done"] = "as given",
    ends_early: bool = False,
) -> Iterator[Result]:
    """Results of all pieces, one by one as they come."""
    check_range("jobs", jobs, least=1)
    if scheduler is None:
        return _results(function, pieces, jobs, order, ends_early)
    client = _client(scheduler, jobs)

    def results() -> Iterator[Result]:
        with client:
            yield from _of_client(client, function, pieces, order=order)

    return results()


def _results(
    function: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    jobs: int,
    order: str,
    ends_early: bool,
) -> Iterator[Result]:
    if jobs == 1:
        with patient() if ends_early else contextlib.nullcontext():
            yield from map(function, pieces)
        return
    from joblib import Parallel, delayed

    # Where warnings are errors this one would end the thread that gathers results: a process that
    # has been idle for minutes ends by itself, and is replaced, also as new pieces come in.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs were given", UserWarning)
    lazily = "generator" if order == "as given" else "generator_unordered"
    work = Parallel(n_jobs=jobs, return_as=lazily)
    if ends_early:
        yield from _patiently(work, function, pieces)
    else:
        yield from work(delayed(function)(piece) for piece in pieces)


def _patiently(
    work: Any, function: Callable[[Piece], Result], pieces: Sequence[Piece]
) -> Iterator[Result]:
    """Results of processes that are told of a signal, and come to an end by themselves."""
    from joblib import delayed
    from joblib.externals.loky import get_reusable_executor

    with patient(_tell_children):
        with children_ignore_signals():  # the processes begin here
            results = work(delayed(_served)(function, piece) for piece in pieces)
        try:
            yield from results
        except Exception:
            if not stopped():  # told before it could listen, a process has died of it
                raise
        if stopped():
            get_reusable_executor().shutdown(kill_workers=True)  # they would end at once for ever


def _served(function: Callable[[Piece], Result], piece: Piece) -> Result:
    serving()
    return function(piece)


def _tell_children() -> None:
    for child in multiprocessing.active_children():
        child.terminate()


def check_scheduler(scheduler: str) -> None:
    """Say at once that Dask is not installed, or that nothing answers at an address."""
    if importlib.util.find_spec("distributed") is None:
        raise ValueError(
            f"scheduler: got {scheduler!r}, but Dask is not installed; need "
            "`pip install 'maneuver-automaton[distributed]'`"
        )
    if scheduler == LOCAL:
        return
    place = _PLACE.fullmatch(scheduler)
    if place is None:
        raise ValueError(
            f"scheduler: got {scheduler!r}, need an address such as tcp://host:8786, or local"
        )
    try:
        socket.create_connection((place["host"], int(place["port"])), timeout=PATIENCE).close()
    except (OSError, OverflowError) as error:
        raise ValueError(
            f"scheduler: nothing answers at {scheduler} ({error}); need the address of a running "
            "Dask scheduler, such as tcp://host:8786, or local"
        ) from error


def _of_client(
    client: Any, function: Callable[[Piece], Result], pieces: Sequence[Piece], *, order: str
) -> Iterator[Result]:
    """Results of a Dask cluster, each as it comes; what is not done when they end is called off."""
    from distributed import as_completed

    futures = client.map(function, pieces, pure=False)
    try:
        for future in futures if order == "as given" else as_completed(futures):
            yield future.result()
    finally:
        client.cancel(futures)


@contextlib.contextmanager
def gathered(*, jobs: int = 1, scheduler: str | None = None) -> Iterator[Gathered]:
    """Processes that stay together for many calls: what each call takes comes off once.

    The block is handed a function of a function and its pieces, which returns all results in
    the order of the pieces. After a signal, functions are to come to an end by themselves.
    """
    if scheduler is None:
        yield functools.partial(in_parallel, jobs=jobs, ends_early=True)
        return
    with _client(scheduler, jobs) as client:
        yield functools.partial(_of_client, client, order="as given")


def _client(scheduler: str, jobs: int) -> Any:
    """A client of a scheduler, or of a cluster on this machine."""
    check_scheduler(scheduler)
    from distributed import Client

    if scheduler == LOCAL:
        return Client(n_workers=jobs, threads_per_worker=1, dashboard_address=None)
    try:
        return Client(scheduler, timeout=CONNECTED)
    except Exception as error:  # whatever another server answers
        raise ValueError(
            f"scheduler: what answers at {scheduler} is no Dask scheduler of this version: "
            f"{' '.join(str(error).split())[:200]}"
        ) from error
