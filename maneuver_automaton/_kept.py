"""Keep what is worked out from a value with that value, and with no other."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable
from typing import Any, Concatenate, ParamSpec, TypeVar

MOST = 16  # results of one function for one owner

_Owner = TypeVar("_Owner")
_P = ParamSpec("_P")
_T = TypeVar("_T")


def kept_by_first(
    make: Callable[Concatenate[_Owner, _P], _T],
) -> Callable[Concatenate[_Owner, _P], _T]:
    """Call a function once for the same arguments; its first argument keeps the results.

    They live as long as that argument does, so that others used in turn do not evict them, as they
    would in a cache that all share. The arguments after it are values, and can be hashed.

    Examples
    --------
    >>> class Library:
    ...     trims = (3.0, 4.0)
    >>> @kept_by_first
    ... def rates(library: Library, price: float) -> list[float]:
    ...     return [price * trim for trim in library.trims]
    >>> one, other = Library(), Library()
    >>> rates(one, 2.0) is rates(one, 2.0), rates(one, 2.0) is rates(other, 2.0)
    (True, False)
    """

    @functools.wraps(make)
    def once(owner: _Owner, /, *args: _P.args, **more: _P.kwargs) -> _T:
        kept: _Kept = owner.__dict__.setdefault("_kept", _Kept())
        if once not in kept:
            kept[once] = functools.lru_cache(MOST)(functools.partial(make, owner))
        made: _T = kept[once](*args, **more)
        return made

    return once


def kept_with(owner: Any, key: Hashable, make: Callable[[], _T]) -> _T:
    """What is kept under a key with a value, made when it is first asked for; lives as long as it.

    Examples
    --------
    >>> class Library:
    ...     pass
    >>> one = Library()
    >>> kept_with(one, "spare", list).append(3)
    >>> kept_with(one, "spare", list), kept_with(Library(), "spare", list)
    ([3], [])
    """
    values: _Kept = owner.__dict__.setdefault("_values", _Kept())
    if key not in values:
        for old in list(values)[: 1 - MOST]:
            values.pop(old, None)
    made: _T = values[key] if key in values else values.setdefault(key, make())
    return made


class _Kept(dict[Hashable, Any]):
    """What is kept, by its key; copies and other processes begin without any."""

    def __reduce__(self) -> tuple[type[_Kept], tuple[()]]:
        return _Kept, ()
