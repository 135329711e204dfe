"""Several vehicles that share a world: each has a problem of its own, and all keep apart."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton._arrays import check_fields, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton._limits import check_size
from maneuver_automaton.collision.motion import planar
from maneuver_automaton.groups import LieGroup, SE2xR
from maneuver_automaton.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class FleetProblem:
    """Problems of several vehicles, of any kind mixed, whose bodies keep apart at all times.

    Every vehicle stands at its start until it leaves, at its problem's `start_time` or later, and
    stays at its goal once it is there, unless it `leaves`. One that cannot switch at will therefore
    ends at rest, or leaves, and if it is under way at its start, nobody starts before it. Obstacles
    and bounds of a problem are those of its vehicle alone; times are of one clock. What flies
    passes above or below another one by the `body_height` of both; one in the plane that states
    none counts at all heights.

    Parameters
    ----------
    problems : sequence of Problem
        One for each vehicle, with a free final time.
    names : sequence of str, optional
        Names of the vehicles; their numbers, from 1, if omitted.
    margin : float
        Distance [m] that any two bodies keep.
    leaves : sequence of bool, optional
        Whether a vehicle is gone once it has arrived; none is if omitted.
    priority : sequence of float, optional
        Who is more important plans first: the greater the sooner; all alike if omitted.

    Raises
    ------
    ValueError
        If there is no vehicle, names are not distinct, a number is out of its range, or a vehicle
        with inertia would have to stand where it is in motion.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> body = {"footprint": Disc(0.3)}
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], **body)
    >>> back = Problem(robot, [4, 0, 3.14], [0, 0, 3.14], **body)
    >>> FleetProblem([there, back], names=["a", "b"]).names
    ('a', 'b')
    """

    problems: tuple[Problem, ...]
    names: tuple[str, ...] = field(default=(), kw_only=True)
    margin: float = field(default=0.0, kw_only=True)  # [m]
    leaves: tuple[bool, ...] = field(default=(), kw_only=True)
    priority: tuple[float, ...] = field(default=(), kw_only=True)

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self,
            problems: Sequence[Problem],
            *,
            names: Sequence[str] = (),
            margin: float = 0.0,
            leaves: Sequence[bool] = (),
            priority: Sequence[float] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        n = len(self.problems)
        if not n:
            raise ValueError("fleet: there is no vehicle, need at least one")
        numbered = tuple(str(k + 1) for k in range(n))
        object.__setattr__(self, "problems", tuple(self.problems))
        for one in self.problems:
            if not isinstance(one, Problem):
                raise ValueError(f"fleet: got {one!r:.60}, need a Problem for each vehicle")
        object.__setattr__(self, "names", tuple(self.names) or numbered)
        object.__setattr__(self, "leaves", tuple(self.leaves) or (False,) * n)
        object.__setattr__(self, "priority", tuple(map(float, self.priority)) or (0.0,) * n)
        for name in ("names", "leaves", "priority"):
            if len(getattr(self, name)) != n:
                raise ValueError(
                    f"fleet: got {len(getattr(self, name))} {name}, need one for each of "
                    f"{n} vehicles"
                )
        twice = [name for name in self.names if self.names.count(name) > 1]
        if twice:
            raise ValueError(f"fleet: two vehicles have the name {twice[0]!r}, need distinct names")
        check_size("fleet: margin", self.margin)
        check_fields("fleet", self, "margin", least=0, unit="m")
        for name, problem in zip(self.names, self.problems, strict=True):
            if problem.horizon.time is not None:
                raise ValueError(
                    f"fleet: vehicle {name!r} has a fixed time, need a free final time"
                )
            if problem.via:
                raise ValueError(
                    f"fleet: vehicle {name!r} has poses on its way, which several vehicles cannot "
                    "plan together; need none, or a plan of that vehicle alone"
                )
        self._check_ends()

    def _check_ends(self) -> None:
        """Who cannot switch at will stands only in a trim at rest."""
        first = min(problem.start_time for problem in self.problems)
        for name, problem, leaves in zip(self.names, self.problems, self.leaves, strict=True):
            if not problem.has_inertia:
                continue
            begin, ends = problem.first_trim, [problem.last_trim(goal) for goal in problem.goals]
            moving = next((one.name for one in ends if not one.is_rest), None)
            if moving is not None and not leaves:
                raise ValueError(
                    f"fleet: vehicle {name!r} is to stay at its goal, where its trim {moving!r} "
                    "moves; need a goal at rest, or leaves: true"
                )
            if not begin.is_rest and problem.start_time > first:
                raise ValueError(
                    f"fleet: vehicle {name!r} starts at {problem.start_time:g} s in the trim "
                    f"{begin.name!r}, which moves, and would have to stand there from {first:g} s "
                    "on; need a start at rest, or no vehicle that starts before it"
                )

    def __len__(self) -> int:
        """How many vehicles there are."""
        return len(self.problems)

    def only(self, names: Collection[str]) -> FleetProblem:
        """The fleet without all vehicles but those that are named.

        Raises
        ------
        ValueError
            If none of them is left.
        """
        kept = [k for k, name in enumerate(self.names) if name in names]
        return replace(
            self,
            problems=tuple(self.problems[k] for k in kept),
            names=tuple(self.names[k] for k in kept),
            leaves=tuple(self.leaves[k] for k in kept),
            priority=tuple(self.priority[k] for k in kept),
        )

    def moved(self, by: LieGroup) -> FleetProblem:
        """The fleet moved by a group element, all around it too; bounds must be open.

        Where some vehicles fly and others do not, those of the plane move with it, and rise.

        Raises
        ------
        ValueError
            If there are bounds, or a vehicle does not look the same after a rotation in `by`.
        """
        return replace(self, problems=tuple(_moved(one, by) for one in self.problems))


def _moved(problem: Problem, by: LieGroup) -> Problem:
    """A problem moved by a pose in the plane or in space, whichever it is in itself."""
    size = by.pose.size
    if problem.start.size == size or "heading" not in by.coordinates:
        return problem.moved(by)
    if problem.start.size > size:
        return problem.moved(SE2xR(np.append(by.pose, 0.0)))
    there, rise = problem.moved(planar(by)), float(by.pose[3])
    low, high = problem.body_height
    return replace(
        there,
        obstacles=tuple(one.moved(by) for one in problem.obstacles),
        body_height=(low + rise, high + rise) if low < high else (low, high),
    )
