"""Calls in a process of their own: what crashes or hangs there is a finding, and no more."""

from __future__ import annotations

import functools
import multiprocessing
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any


class Lost(Exception):
    """The call gave no answer: it raised, crashed or hung; the message says which."""


def call(function: Callable[..., Any], *arguments: object, patience: float) -> Any:
    """What a function of a module returns for arguments that can be pickled.

    Parameters
    ----------
    function : callable
    patience : float
        [s] after which the process is killed; the next call starts another one.

    Raises
    ------
    Lost
        If there is no answer.
    """
    process, pipe = _helper()
    pipe.send((function, arguments))
    if not pipe.poll(patience):
        process.kill()
        _helper.cache_clear()
        raise Lost(f"hung: no answer after {patience:g} s, killed")
    try:
        answered, answer = pipe.recv()
    except EOFError:
        process.join()
        _helper.cache_clear()
        raise Lost(f"crashed: exit code {process.exitcode}") from None
    if not answered:
        raise Lost(f"raised: {answer}")
    return answer


@functools.cache
def _helper() -> tuple[multiprocessing.process.BaseProcess, Connection]:
    """The process that answers, and the pipe to it."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs,), daemon=True)
    process.start()
    theirs.close()  # so that the pipe ends when the process does
    return process, ours


def _serve(pipe: Connection) -> None:
    """Answer calls, one after another, until the other side is gone."""
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = (True, function(*arguments))
        except Exception:  # noqa: BLE001  it is reported where it was asked
            answer = (False, traceback.format_exc(limit=-3))
        pipe.send(answer)
