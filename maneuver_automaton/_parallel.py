"""Work in pieces: here, in processes on this machine, or on a Dask cluster."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, TypeVar

from maneuver_automaton._interrupts import patient, serving, stopped, unheard

Piece = TypeVar("Piece")
Result = TypeVar("Result")


def in_parallel(
    function: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    order: Literal["as given", "as done"] = "as given",
    ends_early: bool = False,
) -> Iterator[Result]:
    """Results of all pieces, one by one as they come.

    Parameters
    ----------
    function : callable
        What to do with a piece.
    pieces : sequence
        The work.
    jobs : int
        Processes at a time; 1 means none beside this one.
    scheduler : str, optional
        Address of a Dask scheduler ("tcp://host:8786"), or "local" for a cluster on this machine:
        the same work is sent there. Needs the package ``distributed``.
    order : str
        Results in the order of the pieces, or as they are done.
    ends_early : bool
        `function` asks `stopped`, here and in other processes: after a signal it comes to an end
        by itself, and all results are waited for.

    Raises
    ------
    ValueError
        If `jobs` is no positive number, or Dask is asked for and not installed.

    Examples
    --------
    >>> list(in_parallel(abs, [-1, 2]))
    [1, 2]
    """
    if jobs < 1:
        raise ValueError(f"jobs must be at least 1, got {jobs}")
    return _results(function, pieces, jobs, scheduler, order, ends_early)


def _results(
    function: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    jobs: int,
    scheduler: str | None,
    order: str,
    ends_early: bool,
) -> Iterator[Result]:
    if jobs == 1 and scheduler is None:
        with patient() if ends_early else contextlib.nullcontext():
            yield from map(function, pieces)
        return
    from joblib import Parallel, delayed

    with _backend(scheduler, jobs):
        lazily = "generator" if order == "as given" else "generator_unordered"
        returned = lazily if scheduler is None else "list"
        work = Parallel(n_jobs=jobs if scheduler is None else -1, return_as=returned)
        if ends_early and scheduler is None:
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
        with unheard():  # the processes begin here
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


@contextlib.contextmanager
def _backend(scheduler: str | None, jobs: int) -> Iterator[None]:
    """Where joblib sends the work: processes on this machine, or a Dask cluster."""
    if scheduler is None:
        yield
        return
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise ValueError(
            f"scheduler: got {scheduler!r}, but Dask is not installed; need `pip install "
            "distributed`"
        ) from error
    from joblib import parallel_config

    local = {"n_workers": jobs, "threads_per_worker": 1, "dashboard_address": None}
    with Client(**local) if scheduler == "local" else Client(scheduler), parallel_config("dask"):
        yield
