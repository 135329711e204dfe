"""The maneuver automaton: trims as nodes, maneuvers as edges."""

from __future__ import annotations

import difflib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array, vector_text
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Drawn
from maneuver_automaton._limits import SMALLEST
from maneuver_automaton.errors import InvalidAutomaton, UnknownTrim
from maneuver_automaton.models import Model, OnLattice, OnlyTranslated, in_world
from maneuver_automaton.models.model import check_model
from maneuver_automaton.models.speeds import is_too_sharp, lateral_acceleration, lateral_limit
from maneuver_automaton.primitives import Maneuver, Trim, trims_of
from maneuver_automaton.primitives.closed_form import Pairs, has_limited_rates, quickest_maneuvers
from maneuver_automaton.primitives.symmetry import maneuver_in_world, trim_in_world
from maneuver_automaton.primitives.turning import turns_between

FITS = 1e-9  # between a course's ends and the reduced states of its trims, over their size or 1


@dataclass(frozen=True, eq=False)
class Automaton(Drawn):
    """Trims of one vehicle, and the maneuvers that join them.

    Trims of equal reduced state form one class; a vehicle switches between them at will, by
    an *identity maneuver* that is not stored: a kinematic vehicle has one class. `maneuvers`
    hold what leads from class to class.

    A vehicle that translations alone move is given the pose of the others (see `InWorld`), and
    its trims and maneuvers, stated along the world's axes, are seen from its body.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.5, 0), "spin": (0, 1)})
    >>> robot.trim_names
    ('ahead', 'spin')
    >>> robot["ahead"].body_velocity.tolist()
    [1.5, 0.0, 0.0]
    """

    model: Model
    trims: tuple[Trim, ...]
    maneuvers: tuple[Maneuver, ...] = ()
    name: str = field(default="", kw_only=True)

    __repr__ = brief

    def __post_init__(self) -> None:
        object.__setattr__(self, "trims", tuple(self.trims))
        object.__setattr__(self, "maneuvers", tuple(self.maneuvers))
        if not self.trims:
            raise InvalidAutomaton("automaton: got no trim, need at least one")
        if twice := [name for name, n in Counter(self.trim_names).items() if n > 1]:
            raise InvalidAutomaton(f"trim {twice[0]!r}: the name is used twice")
        check_model(self.model)
        object.__setattr__(self, "model", in_world(self.model))
        if self.translated is not None:  # what is along the world's axes gets headings
            trims = tuple(trim_in_world(self.translated, trim) for trim in self.trims)
            maneuvers = tuple(maneuver_in_world(self.translated, one) for one in self.maneuvers)
            object.__setattr__(self, "trims", trims)
            object.__setattr__(self, "maneuvers", maneuvers)
        dof, n_controls = self.model.group.dof, len(self.model.control_names)
        n_states = len(self.model.reduced_names)
        for trim in self.trims:
            if trim.body_velocity.shape != (dof,) or trim.control.shape != (n_controls,):
                raise InvalidAutomaton(
                    f"trim {trim.name!r}: got twist {trim.body_velocity.shape} and control "
                    f"{trim.control.shape}, need ({dof},) and ({n_controls},) for the "
                    f"{self.model.name}"
                )
            if trim.reduced_state.shape != (n_states,):
                raise InvalidAutomaton(
                    f"trim {trim.name!r}: got reduced state {trim.reduced_state.shape}, need "
                    f"({n_states},) for the {self.model.name}"
                )
        sizes = np.abs(self.body_velocities)
        for k, axis in np.argwhere((sizes > 0.0) & (sizes < SMALLEST)).tolist():
            raise InvalidAutomaton(
                f"trim {self.trim_names[k]!r}: its twist holds {sizes[k, axis]:g}, need 0 or at "
                f"least {SMALLEST:g} in size"
            )
        for maneuver in self.maneuvers:
            _check_fit(maneuver, self[maneuver.source], self[maneuver.target])
        if math.isfinite(lateral_limit(self.model)):
            self._check_lateral()

    def within_lateral(self, model: Model) -> Automaton:
        """The part of it that a vehicle can do which differs by a lower lateral acceleration."""
        trims = tuple(one for one in self.trims if not is_too_sharp(model, one.body_velocity))
        names = {trim.name for trim in trims}
        maneuvers = tuple(
            one
            for one in self.maneuvers
            if {one.source, one.target} <= names
            and one.course is not None
            and not is_too_sharp(model, one.course.twists(model)).any()
        )
        return replace(self, model=model, trims=trims, maneuvers=maneuvers)

    def _check_lateral(self) -> None:
        """Refuse what exceeds the lateral acceleration of the vehicle."""
        named = [(f"trim {one.name!r}", one.body_velocity) for one in self.trims]
        named += [
            (f"maneuver {one.name!r}", one.course.twists(self.model))
            for one in self.maneuvers
            if one.course is not None
        ]
        for what, twists in named:
            if is_too_sharp(self.model, twists).any():
                raise InvalidAutomaton(
                    f"{what}: has a lateral acceleration of "
                    f"{float(lateral_acceleration(twists).max()):.4g} m/s^2, need at most the "
                    f"vehicle's max_lateral_acceleration {lateral_limit(self.model):g} m/s^2"
                )

    @classmethod
    def of_controls(cls, model: Model, controls: Mapping[str, ArrayLike]) -> Automaton:
        """Automaton of a kinematic `model`, one trim per name and control (n_u,).

        Raises
        ------
        InvalidAutomaton
            If there is no control, or the model has a reduced state.
        ValueError
            If a control has the wrong length, is not finite, or exceeds the model's limits.
        """
        check_model(model)
        n_controls = len(model.control_names)
        if model.reduced_names:
            raise InvalidAutomaton(
                f"{model.name}: has the reduced state {', '.join(model.reduced_names)}, "
                "so a control alone makes no trim"
            )
        values = [
            _checked_control(model, name, as_array(f"trim {name!r}: control", control))
            for name, control in controls.items()
        ]
        table = np.array(values).reshape(len(values), n_controls)
        twists = model.body_velocity(np.zeros((len(values), 0)), table)
        return cls(
            model,
            tuple(
                Trim(name=name, body_velocity=twist, control=control)
                for name, twist, control in zip(controls, twists, table, strict=True)
            ),
        )

    @classmethod
    def of_model(
        cls,
        model: Model,
        grid: Mapping[str, ArrayLike],
        *,
        pairs: Pairs = "neighbours",
        late: bool = False,
        strokes: Sequence[float] = (),
        turns: Sequence[float] = (),
        max_lateral_acceleration: float | None = None,
        leave_out: bool = False,
    ) -> Automaton:
        """Automaton of the trims that a model has on a grid, joined where that needs no solver.

        A vehicle whose control is the rate of its reduced state, such as the second-order car,
        gets bang-bang maneuvers; one that translations alone move, turns between its headings at
        the greatest turn rate (see `turns_between`); any other one, trims alone.

        Parameters
        ----------
        model : Model
            The vehicle.
        grid : mapping of str to (n,) arrays
            Values of speed [m/s], turn_rate [rad/s], climb [m/s], or of components of the reduced
            state; see `trims_of`.
        pairs : "all", "neighbours" or a sequence of pairs of int
            Which trims maneuvers lead between; see `connect_bang_bang`.
        late : bool
            Whether to add, where it differs, the maneuver that is as quick but changes late what
            has time.
        strokes, turns : sequences of float
            Lengths of strokes [m] and angles of turns on the spot [rad], from rest to rest; see
            `quickest_maneuvers`.
        max_lateral_acceleration : float, optional
            Greatest speed times turn rate of a trim [m/s^2]; no limit if None.
        leave_out : bool
            Whether points without a trim are left out; otherwise they are refused. Those beyond
            the lateral acceleration of the vehicle itself always are.

        Raises
        ------
        InvalidAutomaton
            If no point has a trim, or one has none and is not to be left out: it is named, with
            the limit it breaks and by how much.
        ValueError
            If the grid names what the model does not have.

        Examples
        --------
        >>> from maneuver_automaton.models import SecondOrderCar
        >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5,
        ...                      max_acceleration=1.0, max_steering_rate=0.5)
        >>> grid = {"speed": [-2.5, 0.0, 2.5], "steering": [-0.75, 0.0, 0.75]}
        >>> library = Automaton.of_model(car, grid, strokes=[-0.5, 0.5])
        >>> len(library), len(library.maneuvers)
        (9, 46)
        """
        found = trims_of(model, grid, max_lateral_acceleration=max_lateral_acceleration)
        missing = [one for one in found.missing if not (one.sharp and found.trims)]
        if missing and not (leave_out and found.trims):
            first, n = missing[0], len(found.trims) + len(found.missing)
            raise InvalidAutomaton(
                f"grid: {len(missing)} of {n} points have no trim, such as "
                f"{first.name!r}: {first.reason}"
            )
        if isinstance(in_world(model), OnlyTranslated):
            alone = cls(model, found.trims)
            return replace(alone, maneuvers=turns_between(alone.model, alone.trims, pairs=pairs))
        if not has_limited_rates(model):
            return cls(model, found.trims)
        maneuvers = quickest_maneuvers(
            model, found.trims, pairs=pairs, late=late, strokes=strokes, turns=turns
        )
        return cls(model, found.trims, maneuvers)

    @classmethod
    def of_grid(cls, model: Model, axes: Sequence[ArrayLike]) -> Automaton:
        """Automaton with one trim per point of the grid of controls spanned by `axes`.

        Trims are named after their controls: ``"speed 0.5, turn_rate -1"``. Points beyond the
        lateral acceleration of the vehicle are left out.

        Examples
        --------
        >>> from maneuver_automaton.models import Unicycle
        >>> Automaton.of_grid(Unicycle(), [[0, 1], [-1, 0, 1]]).trim_names[:2]
        ('speed 0, turn_rate -1', 'speed 0, turn_rate 0')
        """
        check_model(model)
        if len(axes) != len(model.control_names):
            raise ValueError(
                f"grid: got {len(axes)} axes, need {len(model.control_names)} for the controls "
                f"{', '.join(model.control_names)} of the {model.name}"
            )
        rows = [as_array(f"grid: axis {k}", axis).ravel() + 0.0 for k, axis in enumerate(axes)]
        points = np.array([*product(*(row.tolist() for row in rows))])
        if math.isfinite(lateral_limit(model)):
            for k, row in enumerate(points):
                _checked_control(model, f"grid point {k}", row)
            sharp = is_too_sharp(model, model.body_velocity(points[:, :0], points))
            points = points if sharp.all() else points[~sharp]  # if all are, one is refused by name
        return cls.of_controls(
            model,
            {
                ", ".join(
                    f"{what} {value:.10g}"
                    for what, value in zip(model.control_names, point, strict=True)
                ): point
                for point in points.tolist()
            },
        )

    def __len__(self) -> int:
        return len(self.trims)

    def __contains__(self, name: str) -> bool:
        return name in self._index

    def __getitem__(self, name: str) -> Trim:
        return self.trims[self.index_of(name)]

    @cached_property
    def translated(self) -> OnlyTranslated | None:
        """The model, if translations alone move it; None otherwise. Asked once: it takes long."""
        return self.model if isinstance(self.model, OnlyTranslated) else None

    @cached_property
    def lattice(self) -> OnLattice | None:
        """The model, if its maneuvers lead along a lattice; None otherwise."""
        return self.model if isinstance(self.model, OnLattice) else None

    @cached_property
    def trim_names(self) -> tuple[str, ...]:
        """Names of the trims, in order."""
        return tuple(trim.name for trim in self.trims)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: k for k, name in enumerate(self.trim_names)}

    def index_of(self, name: str) -> int:
        """Position of a trim; raises UnknownTrim (a LookupError)."""
        if name in self._index:
            return self._index[name]
        near = difflib.get_close_matches(name, self.trim_names, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        shown = ", ".join(self.trim_names[:12]) + (", ..." if len(self) > 12 else "")
        raise UnknownTrim(f"no trim {name!r} among {shown}{hint}")

    @cached_property
    def body_velocities(self) -> Array:
        """Twists of the trims (m, dof), [m/s, m/s, rad/s(, m/s)]."""
        return _frozen(np.array([trim.body_velocity for trim in self.trims]))

    @cached_property
    def controls(self) -> Array:
        """Controls of the trims (m, n_u), the model's units."""
        return _frozen(np.array([trim.control for trim in self.trims]))

    @cached_property
    def trim_classes(self) -> IntArray:
        """Class of each trim (m,): trims of equal reduced state switch freely."""
        states = np.array([trim.reduced_state for trim in self.trims])
        if states.shape[1] == 0:
            return np.zeros(len(self), dtype=np.int64)
        _, classes = np.unique(states.round(12), axis=0, return_inverse=True)
        return np.asarray(classes.ravel(), dtype=np.int64)

    @cached_property
    def maneuver_classes(self) -> IntArray:
        """Classes of trims that each maneuver leaves and reaches (n, 2)."""
        ends = [(self.index_of(one.source), self.index_of(one.target)) for one in self.maneuvers]
        return self.trim_classes[np.array(ends, dtype=np.int64).reshape(-1, 2)]

    @cached_property
    def twist_groups(self) -> IntArray:
        """Which trims have equal twists (m,): equal numbers, the first trim's index."""
        order = np.lexsort(self.body_velocities.T[::-1])
        sorted_twists = self.body_velocities[order]
        new = np.append(True, (sorted_twists[1:] != sorted_twists[:-1]).any(axis=1))
        groups = np.empty(len(self), dtype=np.int64)
        groups[order] = np.minimum.reduceat(order, np.flatnonzero(new))[np.cumsum(new) - 1]
        return groups

    @cached_property
    def rest(self) -> int | None:
        """Index of the trim that stands still with the least reduced state; None if there is none.

        Of several, the first.
        """
        still = np.flatnonzero(~self.body_velocities.any(axis=1))
        if not still.size:
            return None
        sizes = [float(np.abs(self.trims[k].reduced_state).sum()) for k in still]
        return int(still[int(np.argmin(sizes))])

    @property
    def has_inertia(self) -> bool:
        """Whether the vehicle cannot switch at will between the trims that it needs."""
        return bool(self.model.reduced_names) or not self.is_kinematic

    @cached_property
    def is_kinematic(self) -> bool:
        """Whether its trims can be combined at will: one class, no maneuvers, no longest time."""
        limited = any(trim.max_duration < np.inf for trim in self.trims)
        return not (self.trim_classes.any() or self.maneuvers or limited)

    def graph(self) -> Any:
        """The automaton as a ``networkx.MultiDiGraph``: trims as nodes, all maneuvers as edges.

        Identity maneuvers too, of which a class of m trims has m (m - 1): ask for it only where
        that is small.
        """
        import networkx

        graph: networkx.MultiDiGraph[str] = networkx.MultiDiGraph(name=self.name)
        for trim in self.trims:
            graph.add_node(trim.name, trim=trim)
        for a, b in product(range(len(self)), repeat=2):
            if a != b and self.trim_classes[a] == self.trim_classes[b]:
                graph.add_edge(self.trim_names[a], self.trim_names[b], maneuver=self.switch(a, b))
        for maneuver in self.maneuvers:
            graph.add_edge(maneuver.source, maneuver.target, maneuver=maneuver)
        return graph

    def switch(self, source: int, target: int) -> Maneuver:
        """The identity maneuver between two trims of one class."""
        return Maneuver(
            name="switch",
            source=self.trim_names[source],
            target=self.trim_names[target],
            displacement=np.zeros(self.model.group.dof),
        )


def same_state(one: Array, other: Array) -> bool:
    """Whether two reduced states (n_z,) are the same to within rounding."""
    return bool((np.abs(one - other) <= FITS * np.maximum(1.0, np.abs(other))).all())


def _check_fit(maneuver: Maneuver, source: Trim, target: Trim) -> None:
    """A maneuver moves poses of the vehicle, and its course leads from trim to trim."""
    if maneuver.displacement.shape != source.body_velocity.shape:
        raise InvalidAutomaton(
            f"maneuver {maneuver.name!r}: got a displacement of {maneuver.displacement.size} "
            f"numbers, need {source.body_velocity.size}, as the trims have"
        )
    if maneuver.course is None:
        return
    ends = (maneuver.course.reduced_state[0], maneuver.course.reduced_state[-1])
    for word, state, trim in zip(("begins", "ends"), ends, (source, target), strict=True):
        fits = state.shape == trim.reduced_state.shape
        if not fits or not same_state(state, trim.reduced_state):
            raise InvalidAutomaton(
                f"maneuver {maneuver.name!r}: {word} at the reduced state {vector_text(state)}, "
                f"but trim {trim.name!r} has {vector_text(trim.reduced_state)}"
            )


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array


def _checked_control(model: Model, name: str, control: Array) -> Array:
    if control.shape != (len(model.control_names),):
        raise ValueError(
            f"trim {name!r}: control has shape {control.shape}, need {len(model.control_names)} "
            f"numbers ({', '.join(model.control_names)})"
        )
    for value, what, (low, high) in zip(
        control, model.control_names, model.control_limits, strict=True
    ):
        slack = 1e-12 * max(1.0, abs(value))
        if not low - slack <= value <= high + slack:
            raise ValueError(
                f"trim {name!r}: {what} = {value:.6g} is outside the limits "
                f"[{low:.6g}, {high:.6g}] of the {model.name}"
            )
    return control
