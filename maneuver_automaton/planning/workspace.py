"""Arrays and tables that all plans on one map share, made once and held in the open."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import TypeAlias

from maneuver_automaton._brief import brief
from maneuver_automaton.audit import Surroundings, surroundings_around
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.collision.fcl_checker import FclChecker
from maneuver_automaton.search.prepared import RECENT, Prepared

_Map: TypeAlias = tuple[tuple[AnyObstacle, ...], tuple[float, float]]


@dataclass(frozen=True, slots=True, eq=False)
class Workspace:
    """One map, as searches, FCL and the audit see it, and what searches know of their vehicle.

    What FCL and the audit know stays as long as it is held; searches keep what was made last.

    Examples
    --------
    >>> from maneuver_automaton import Disc, Obstacle
    >>> workspace = Workspace((Obstacle(Disc(1.0)),))
    >>> one = workspace.checker((), workspace.obstacles, 0.1, (0.0, 0.0), proven=1e-3)
    >>> one is workspace.checker((), workspace.obstacles, 0.1, (0.0, 0.0), proven=1e-3)
    True
    """

    obstacles: tuple[AnyObstacle, ...]
    prepared: Prepared = field(default_factory=Prepared)  # libraries, worlds, and tables
    _checkers: dict[tuple[tuple[Shape, ...], _Map, float, float], FclChecker] = field(
        default_factory=dict, init=False
    )
    _surroundings: dict[_Map, Surroundings] = field(default_factory=dict, init=False)

    __repr__ = brief

    def on(self, obstacles: tuple[AnyObstacle, ...]) -> Workspace:
        """The workspace of these obstacles: itself if they are its own, otherwise a new one."""
        return self if obstacles == self.obstacles else Workspace(obstacles, self.prepared)

    def checker(
        self,
        footprint: tuple[Shape, ...],
        obstacles: tuple[AnyObstacle, ...],
        margin: float,
        origin: tuple[float, float],
        *,
        proven: float,
    ) -> FclChecker:
        """FCL's view of some obstacles of the map, counted from an origin [m].

        What it reports as hit comes closer than ``margin + proven`` [m].
        """
        key = (footprint, (obstacles, origin), margin, proven)
        if key not in self._checkers:
            self._checkers[key] = FclChecker(
                footprint, obstacles, margin=margin, origin=origin, proven=proven
            )
        return self._checkers[key]

    def surroundings(
        self, obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float]
    ) -> Surroundings:
        """The audit's view of some obstacles of the map, counted from an origin [m]."""
        key = (obstacles, origin)
        if key not in self._surroundings:
            self._surroundings[key] = surroundings_around(obstacles, origin)
        return self._surroundings[key]


@functools.lru_cache(maxsize=8)
def workspace_of(obstacles: tuple[AnyObstacle, ...]) -> Workspace:
    """A workspace for callers that hold none: of the last maps, each once."""
    return Workspace(obstacles, RECENT)
