"""What is worked out once and kept: with the value that it is worked out from, and with no other.

Whoever keeps, an owner, has the last `MOST` results of each function, so that owners used in turn
do not evict each other's as they would in one cache for all. Results are forgotten when others of
their function were asked for since, or together with their owner; copies of an owner, also in other
processes, begin without any.
"""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from types import MethodType
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

MOST = 16  # results of one function for one owner
LARGEST = 1 << 22  # numbers in a block of memory that is kept, 32 MiB

_Owner = TypeVar("_Owner")
_P = ParamSpec("_P")
_T = TypeVar("_T")
_Number = TypeVar("_Number", np.float64, np.int64)


class _Kept(dict[Hashable, Any]):
    """The functions that remember, by what they stand for; copies begin without any."""

    def __reduce__(self) -> tuple[type[_Kept], tuple[()]]:
        return _Kept, ()


def _kept_by(owner: Any, kind: Hashable, make: Callable[..., _T]) -> Callable[..., _T]:
    """The function that remembers results of a kind for an owner."""
    kept: dict[Hashable, Callable[..., _T]] = owner.__dict__.setdefault("_kept", _Kept())
    if kind not in kept:
        kept[kind] = functools.lru_cache(MOST)(make)
    return kept[kind]


def kept_with(owner: Any, key: Hashable, make: Callable[[], _T]) -> _T:
    """What is kept under a key with a value, made when it is first asked for."""
    kept: dict[Hashable, Any] = owner.__dict__.setdefault("_kept", _Kept())
    kind = getattr(make, "__code__", make)  # a function within another is made anew at every call
    results: dict[Hashable, _T] = kept.setdefault(("with", kind), {})
    value = results.pop(key) if key in results else make()
    results[key] = value  # the last of all that were asked for
    while len(results) > MOST:
        results.pop(next(iter(results)))
    return value


def kept_by_first(
    make: Callable[Concatenate[_Owner, _P], _T],
) -> Callable[Concatenate[_Owner, _P], _T]:
    """Call a function once for the same arguments; its first argument keeps the results.

    The arguments after it are values, and can be hashed.
    """

    @functools.wraps(make)
    def once(owner: _Owner, /, *args: _P.args, **more: _P.kwargs) -> _T:
        known: Callable[..., _T] | None = owner.__dict__.get("_kept", {}).get(once)
        return (known or _kept_by(owner, once, MethodType(make, owner)))(*args, **more)

    return once


class _Block(np.ndarray[Any, Any]):
    """Memory that is lent: an array of a kind of its own, whose parts views keep alive."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """What searches share that belongs to none of its arguments alone: libraries, worlds, tables.

    Each planner holds one of its own. What it lacks is taken from `RECENT`, which serves whoever
    holds none.
    """

    _blocks: list[_Block] = field(default_factory=list, init=False)  # that nobody uses now

    def once(self, make: Callable[_P, _T], *args: _P.args, **more: _P.kwargs) -> _T:
        """The result of `make` for these arguments, which are values: made at the first call."""
        maker = make if self is RECENT else functools.partial(RECENT.once, make)
        return _kept_by(self, make, maker)(*args, **more)

    def room(self, n: int, kind: type[_Number]) -> NDArray[_Number]:
        """An array (n,) of numbers that mean nothing, in memory that is used again after it.

        The system hands out fresh memory page by page, which for the arrays of a first plan takes
        longer than a millisecond. The memory is free again once the array and all views of it are
        gone. A number of its `kind` has 64 bits.
        """
        try:
            block = self._blocks.pop()
        except IndexError:  # asked for before, another thread might take the last one
            block = _Block(0)
        if block.size < n:
            block = _Block(n)
        lent = block[:n]
        if n <= LARGEST:
            weakref.finalize(lent, self._blocks.append, block).atexit = False
        return lent.view(np.ndarray).view(kind)


RECENT = Prepared()
