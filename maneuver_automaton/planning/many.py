"""Many queries: over all processors, or on a Dask cluster; the same answers as one by one."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_number, as_whole, check_range
from maneuver_automaton._files import journal as opened
from maneuver_automaton._files import journal_lines
from maneuver_automaton._parallel import in_parallel
from maneuver_automaton.planning.plan import plan
from maneuver_automaton.planning.result import PlanResult
from maneuver_automaton.problem import Goal, Problem

CHUNK = 64  # queries that a process is given at a time, at most
CHUNKS = 16  # for each process, at least, so that all end at about the same time
KNOWN_PLANNERS = 4  # whose maps a process keeps ready

_T = TypeVar("_T")
Take = Callable[[PlanResult], Any]
Goals = ArrayLike | Sequence[Goal]


Keeps = contextlib.AbstractContextManager[Callable[[Sequence[str]], None] | None]
Queries = list[Problem] | tuple[Array, list[Any]]  # problems; or starts and goals of a planner


class AnyPlanner(Protocol):
    """A `Planner`, as far as queries are asked with it."""

    @property
    def stated(self) -> dict[str, Any]:
        """What it is made of, by the names of its arguments."""

    def plan(self, start: ArrayLike, goals: Any, /, *, time_limit: float) -> PlanResult:
        """The answer to one query."""


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """Everything that is asked, and how to answer it."""

    planner: AnyPlanner | None
    queries: Queries
    time_limit: float
    take: Take | None

    def __len__(self) -> int:
        return len(self.queries if isinstance(self.queries, list) else self.queries[0])

    def part(self, numbers: Sequence[int]) -> Queries:
        """Some of the queries."""
        if isinstance(self.queries, list):
            return [self.queries[k] for k in numbers]
        starts, goals = self.queries
        return starts[list(numbers)], [goals[k] for k in numbers]

    def answers(self, queries: Queries) -> list[Any]:
        """The answers to some queries, in this process."""
        take, limit = self.take or (lambda result: result), self.time_limit
        if isinstance(queries, list):
            return [take(plan(problem, time_limit=limit)) for problem in queries]
        assert self.planner is not None
        ask = functools.partial(self.planner.plan, time_limit=limit)
        return [take(ask(start, goal)) for start, goal in zip(*queries, strict=True)]

    def shared(self, queries: Queries) -> list[object]:
        """What answers name rather than hold, in the order of any copy of this."""
        if isinstance(queries, list):
            return [one for problem in queries for one in (problem, *_parts_of(problem))]
        return _parts_of(self.planner)


def plan_many(
    problems: Sequence[Problem],
    *,
    time_limit: float = 5.0,
    jobs: int = 1,
    scheduler: str | None = None,
    take: Callable[[PlanResult], _T] | None = None,
    journal: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Any]:
    """Plan for many problems; the answers come in their order, as soon as they are known.

    Each is that of `plan` to the last bit where the clock decides nothing: with
    ``search.max_expansions``, or with ``search.improve`` off. `Planner.plan_many` is faster for
    problems on one map.

    Parameters
    ----------
    problems : sequence of Problem
    time_limit : float
        [s] for each.
    jobs, scheduler
        Processes at a time; a Dask scheduler ("tcp://host:8786"), or "local"; see `in_parallel`.
    take : callable, optional
        What to keep of each answer, such as its cost: it runs where the plan was made, and what it
        returns comes back instead of the `PlanResult`.
    journal : path, optional
        A file that keeps what was taken, a line each: called again after an interruption, the
        same problems go on where they were. What is taken must then be a value of JSON.
    progress : callable, optional
        Called with the number of answers so far, and of all.

    Yields
    ------
    PlanResult, or what `take` returns.

    Raises
    ------
    ValueError
        If a limit is not positive, nothing answers at the scheduler's address, or a journal is
        that of other problems or asked for without `take`.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (1, 1)})
    >>> problems = [Problem(robot, [0, 0, 0], [x, 0, 0]) for x in (1.0, 2.0)]
    >>> [round(cost, 6) for cost in plan_many(problems, take=lambda result: result.cost)]
    [1.0, 2.0]
    """
    asked = Asked(None, list(problems), as_number("time_limit", time_limit), take)
    return answers(asked, jobs, scheduler, journal, progress)


def queries_of(planner: AnyPlanner, starts: ArrayLike, goals: Goals) -> tuple[Array, list[Any]]:
    """Starts (n, dof) and as many goals; one start or one goal serves all."""
    dof = planner.stated["automaton"].model.group.dof
    places = np.atleast_2d(as_array("starts", starts, last=dof))
    aims: list[Any]
    if isinstance(goals, Goal):
        aims = [goals]
    elif isinstance(goals, Sequence) and any(isinstance(one, Goal) for one in goals):
        aims = list(goals)
    else:
        aims = list(np.atleast_2d(as_array("goals", cast("ArrayLike", goals), last=dof)))
    n = max(len(places), len(aims))
    if {len(places), len(aims)} - {1, n} or not n:
        raise ValueError(
            f"starts, goals: got {len(places)} and {len(aims)}, need as many of each, or one of "
            "either for all"
        )
    return np.array(np.broadcast_to(places, (n, dof))), aims * (n if len(aims) == 1 else 1)


def answers(
    asked: Asked,
    jobs: int,
    scheduler: str | None,
    journal: str | Path | None,
    progress: Callable[[int, int], None] | None,
) -> Iterator[Any]:
    """The answers to all that is asked, in its order; see `plan_many`."""
    jobs = as_whole("jobs", jobs)
    check_range("time_limit", asked.time_limit, unit="s", infinite=True)
    if journal is not None and asked.take is None:
        raise ValueError("journal: keeps what is taken of the answers, need take=")
    kept: list[Any] = []
    keeps: Keeps = contextlib.nullcontext()
    if journal is not None:
        head = json.dumps({"queries": _digest(asked)})
        path, (first, *lines) = Path(journal), journal_lines(Path(journal)) or [head]
        begun = lines or not path.exists() or head.startswith(path.read_text("utf-8").strip("\n"))
        if first != head or not begun:  # a line that was cut off does not count
            raise ValueError(f"{path}: is the journal of other queries; need another file, or none")
        kept, keeps = [json.loads(line) for line in lines], opened(path, head)
    wanted = list(range(len(kept), len(asked)))
    size = max(1, min(CHUNK, math.ceil(len(wanted) / (CHUNKS * max(jobs, 1)))))
    parts = [asked.part(wanted[k : k + size]) for k in range(0, len(wanted), size)]
    if jobs == 1 and scheduler is None:
        return _handed_out(kept, in_parallel(asked.answers, parts), len(asked), keeps, progress)
    common = _dumped(asked.planner)
    rest = (asked.time_limit, asked.take)
    pieces = [(common, _dumped(part), *rest) for part in parts]
    sent = in_parallel(_answered_apart, pieces, jobs=jobs, scheduler=scheduler)
    chunks = (
        _Receiver(io.BytesIO(one), asked.shared(part)).load()
        for one, part in zip(sent, parts, strict=True)
    )
    return _handed_out(kept, chunks, len(asked), keeps, progress)


def _handed_out(
    kept: list[Any],
    chunks: Iterator[list[Any]],
    n: int,
    keeps: Keeps,
    progress: Callable[[int, int], None] | None,
) -> Iterator[Any]:
    yield from kept
    done = len(kept)
    with keeps as write:
        for found in chunks:
            try:
                if write is not None:
                    write([json.dumps(one) for one in found])
            except TypeError as error:
                raise ValueError(
                    f"journal: {error}; need numbers, texts, lists and dicts of what is taken"
                ) from error
            done += len(found)
            if progress is not None:
                progress(done, n)
            yield from found


def _answered_apart(piece: tuple[bytes, bytes, float, Take | None]) -> bytes:
    """The answers to some queries in another process: what both have already is named, not sent."""
    common, packed, time_limit, take = piece
    queries: Queries = pickle.loads(packed)
    asked = Asked(_planner_of(common), queries, time_limit, take)
    file = io.BytesIO()
    _Sender(file, asked.shared(queries)).dump(asked.answers(queries))
    return file.getvalue()


_planner_of = functools.lru_cache(maxsize=KNOWN_PLANNERS)(pickle.loads)


def _parts_of(one: Any) -> list[object]:
    """The values of a planner or a problem that its answers name."""
    if one is None:
        return []
    automaton = one.automaton
    return [
        automaton,
        automaton.model,
        *automaton.trims,
        *automaton.maneuvers,
        one.cost,
        one.obstacles,
        *one.obstacles,
        one.footprint,
        one.zones,
    ]


class _Sender(pickle.Pickler):
    """Writes values for a process that has some objects already; arrays stay read-only."""

    def __init__(self, file: io.BytesIO, shared: list[object]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self.number = {id(one): k for k, one in enumerate(shared) if type(one) is not tuple or one}

    def persistent_id(self, obj: Any) -> int | None:
        """The number of an object that is not sent."""
        return self.number.get(id(obj))

    def reducer_override(self, obj: Any) -> Any:
        """Arrays that nobody may write to stay so."""
        if type(obj) is np.ndarray and not obj.flags.writeable:
            return _read_only, (obj.copy(),)
        return NotImplemented


class _Receiver(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, shared: list[object]) -> None:
        super().__init__(file)
        self.shared = shared

    def persistent_load(self, pid: Any) -> Any:
        """The object of that number."""
        return self.shared[pid]


def _read_only(array: Array) -> Array:
    array.setflags(write=False)
    return array


def _dumped(value: Any) -> bytes:
    """A value as bytes; models may hold functions of the user's own."""
    from joblib.externals.loky.backend.reduction import dumps

    return bytes(dumps(value))


def _digest(asked: Asked) -> str:
    """What tells queries from others, here and in a later process."""
    import joblib

    try:
        return str(joblib.hash((asked.planner and asked.planner.stated, asked.queries)))
    except Exception as error:
        raise ValueError(
            f"journal: the queries cannot be told from others: {error}; need a model of the "
            "package, or functions that a module holds"
        ) from error
