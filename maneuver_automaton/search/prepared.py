"""Values that searches share: made once, and kept by whoever holds them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ParamSpec, TypeVar

MOST = 16  # values of each kind

_T = TypeVar("_T")
_P = ParamSpec("_P")


@dataclass(frozen=True, slots=True, eq=False)
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

    def once(self, make: Callable[_P, _T], *args: _P.args, **more: _P.kwargs) -> _T:
        """The result of `make` for these arguments, which are values: made at the first call."""
        if make not in self._makers:
            maker = make if self is RECENT else functools.partial(RECENT.once, make)
            self._makers[make] = functools.lru_cache(MOST)(maker)
        made: _T = self._makers[make](*args, **more)
        return made


RECENT = Prepared()
