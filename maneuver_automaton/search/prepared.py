"""Values that searches share: made once, and kept by whoever holds them."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

MOST = 16  # values of each kind
LARGEST = 1 << 22  # numbers in a block of memory that is kept, 32 MiB

_T = TypeVar("_T")
_P = ParamSpec("_P")
_Number = TypeVar("_Number", np.float64, np.int64)


class _Block(np.ndarray[Any, Any]):
    """Memory that is lent: an array of a kind of its own, whose parts views keep alive."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """The values of each kind that were made last, by the arguments of their making.

    Each planner holds one of its own, so that planners used in turn do not evict each other. What
    it lacks is taken from `RECENT`, which serves whoever holds none.

    Examples
    --------
    >>> def square(number: int) -> list[int]:
    ...     return [number * number]
    >>> prepared = Prepared()
    >>> prepared.once(square, 3) is prepared.once(square, 3)
    True
    """

    _makers: dict[Callable[..., Any], Callable[..., Any]] = field(default_factory=dict, init=False)
    _blocks: list[_Block] = field(default_factory=list, init=False)  # that nobody uses now

    def once(self, make: Callable[_P, _T], *args: _P.args, **more: _P.kwargs) -> _T:
        """The result of `make` for these arguments, which are values: made at the first call."""
        if make not in self._makers:
            maker = make if self is RECENT else functools.partial(RECENT.once, make)
            self._makers[make] = functools.lru_cache(MOST)(maker)
        made: _T = self._makers[make](*args, **more)
        return made

    def room(self, n: int, kind: type[_Number]) -> NDArray[_Number]:
        """An array (n,) of numbers that mean nothing, in memory that is used again after it.

        The system hands out fresh memory page by page, which for the arrays of a first plan takes
        longer than a millisecond. The memory is free again once the array and all views of it are
        gone. A number of its `kind` has 64 bits.

        Examples
        --------
        >>> prepared = Prepared()
        >>> one = prepared.room(1000, np.float64)
        >>> where = one.ctypes.data
        >>> del one
        >>> prepared.room(500, np.int64).ctypes.data == where
        True
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
