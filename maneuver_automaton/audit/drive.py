"""One integration of a plan's controls from its start: reduced states, heading, then place.

Nothing of what made the plan is used: no group formula, no closed form, no pose that it states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.frames import Frames, Spans, frames_along, frames_through
from maneuver_automaton.audit.legendre import SERIES, N, values_at
from maneuver_automaton.audit.reduced import Reduced, reduced_states
from maneuver_automaton.audit.stated import NOTHING, Stated, placed, stated_by
from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import Model

TURN = 0.8  # [rad] per element at most: the last terms of its series are rounding
EXACT = 1e-12  # [m, rad, model's units] what the last terms of a series may be
HALVINGS = 10  # of a stretch at most


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Drive:
    """A plan driven again, and how far what it states is from that.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.primitives import Trim
    >>> turn = Trim(name="turn", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])
    >>> one = driven(Plan([0, 0, 0], (turn,), durations=[np.pi]), Unicycle())
    >>> one.end.round(9).tolist(), one.off < 1e-14
    ([0.0, 2.0, 3.141592654], True)
    """

    plan: Plan
    model: Model
    frames: Frames  # of the vehicle
    twists: Array  # (e, N, dof) at the nodes of the elements
    states: Array  # (e, N, n_z) reduced states there
    end: Array  # (dof,) last pose
    off: float  # [m, rad, model's units] how far what the plan states is from where it leads
    turned: float  # [rad] the same, of the headings alone
    ends: Array  # (n,) [s] when the plan's own samples are
    pieces: IntArray  # (n,) number of the primitive that ends there
    controls: Array  # (n, n_u) until there
    sampled_states: Array  # (n + 1, n_z) reduced states at the start and there

    def part(self, name: str) -> Frames:
        """The frame of what the vehicle carries, placed by the model from the reduced state."""
        which = self.model.part_names.index(name)
        seen = np.asarray(self.model.part_poses(self.states), dtype=np.float64)[..., which, :]
        return frames_through(placed(self.frames.nodes, seen), self.frames)

    def twists_at(self, elements: IntArray, shares: Array) -> Array:
        """Twists (m, dof) at shares of elements, (m,) each."""
        return values_at(SERIES @ self.twists[elements], shares)

    def between_samples(self) -> tuple[Spans, IntArray]:
        """Stretches between the plan's own samples, and the number of the primitive of each."""
        of, begins = self.frames, self.frames.times[:-1]
        times = np.unique(np.concatenate([of.times, self.ends]))
        middles = 0.5 * (times[1:] + times[:-1])
        element = np.clip(np.searchsorted(begins, middles, side="right") - 1, 0, begins.size - 1)
        shares = [
            np.clip((at - begins[element]) / np.diff(of.times)[element], 0.0, 1.0)
            for at in (times[:-1], times[1:])
        ]
        piece = np.minimum(np.searchsorted(self.ends, middles), self.ends.size - 1)
        return Spans(element, *shares), self.pieces[piece]


class _Elements(NamedTuple):
    """How stretches are cut: an element is a run of stretches, or a part of one."""

    first: IntArray  # (e,) stretch in which each begins
    share: Array  # (e,) of that stretch, that has passed then
    lengths: Array  # (e,) [s]
    runs: IntArray  # (e,) number of the run
    run: IntArray  # (n,) number of the run of each stretch


def driven(plan: Plan, model: Model) -> Drive:
    """Drive a plan again from its start under its controls.

    The equations are solved by collocation, on all elements side by side; heading and place are
    sums over the elements. Elements are cut smaller until the last terms of all their series are
    below 1e-12, so the motion is as exact between the nodes as at them.

    Source: Hairer, Lubich, Wanner (2006), *Geometric Numerical Integration*, Sec. II.1.3.

    Raises
    ------
    ValueError
        If a maneuver has no course.
    """
    stated = stated_by(plan)
    if not stated.lengths.size:
        return _standing(plan, model, stated)
    begin_twists = model.body_velocity(stated.states, stated.controls)
    turns = np.abs(np.broadcast_to(begin_twists, stated.ends.shape)[:, 2]) * stated.lengths
    parts = np.maximum(np.ceil(turns / TURN), 1.0).astype(np.int64)
    alone = parts > 1
    for _ in range(HALVINGS):
        elements = _cut(stated, turns, parts, alone)
        found = _integrated(plan.start, model, stated, elements)
        last = np.maximum(found.reduced.error, found.frames.error)
        rough = ~(last <= EXACT * (1.0 + found.frames.length))
        if not rough.any():
            break
        again = np.isin(elements.run, elements.runs[rough])
        parts = np.where(again & alone, 2 * parts, parts)
        alone = alone | again
    return _compared(plan, model, stated, elements, found)


def _cut(stated: Stated, turns: Array, parts: IntArray, alone: NDArray[np.bool_]) -> _Elements:
    """Runs of one control within a primitive that turn by no more than `TURN`, or equal parts."""
    controls, pieces = stated.controls, stated.pieces
    turned = np.floor((np.cumsum(turns) - turns) / TURN)
    breaks = np.ones(pieces.size, dtype=np.bool_)
    breaks[1:] = (pieces[1:] != pieces[:-1]) | alone[1:] | alone[:-1] | (turned[1:] != turned[:-1])
    breaks[1:] |= (controls[1:] != controls[:-1]).any(axis=1)
    run = np.cumsum(breaks) - 1
    begins = np.flatnonzero(breaks)
    count = parts[begins]
    of = np.repeat(np.arange(begins.size), count)
    number = np.arange(of.size) - (np.cumsum(count) - count)[of]
    lengths = np.add.reduceat(stated.lengths, begins) / count
    return _Elements(begins[of], number / count[of], lengths[of], of, run)


class _Integrated(NamedTuple):
    reduced: Reduced
    twists: Array  # (e, N, dof) at the nodes
    frames: Frames


def _integrated(start: Array, model: Model, stated: Stated, elements: _Elements) -> _Integrated:
    """Reduced states on all elements, then the poses."""
    first, share = elements.first, elements.share[:, None]
    guess = stated.states[first] + share * (stated.end_states[first] - stated.states[first])
    controls = stated.controls[first]
    reduced = reduced_states(model, controls, elements.lengths, guess, elements.share == 0.0)
    twists = model.body_velocity(reduced.nodes, controls[:, None])
    twists = np.broadcast_to(twists, (first.size, N, start.size))
    return _Integrated(reduced, twists, frames_along(start, twists, elements.lengths))


def _compared(
    plan: Plan, model: Model, stated: Stated, elements: _Elements, found: _Integrated
) -> Drive:
    """The drive, and the greatest difference to what the plan states of it."""
    reduced, frames = found.reduced, found.frames
    # What a reduced state is off moves the vehicle for as long as it is driven.
    has_states = bool(reduced.series.shape[2])
    if has_states:
        doubt = reduced.error + reduced.jumps / reduced.error.size
        frames = replace(frames, error=frames.error + (1.0 + float(frames.times[-1])) * doubt)
    ends = np.cumsum(stated.lengths)
    at = np.searchsorted(elements.first, np.arange(ends.size), side="right") - 1
    share = np.maximum((ends - frames.times[at]) / elements.lengths[at], 0.0)
    inner = np.flatnonzero(share < 1.0)
    poses, states = frames.series.sum(axis=1)[at], reduced.series.sum(axis=1)[at]
    if inner.size:
        poses[inner] = frames.at(at[inner], share[inner])
    if inner.size and has_states:
        states[inner] = values_at(reduced.series[at[inner]], share[inner])
    off_poses = np.abs(poses - stated.ends)
    off_twists = np.abs(found.twists - stated.twists[elements.first][:, None])
    off_twists *= elements.lengths[:, None, None]
    # Of the twists of maneuvers nothing is stated: those are not numbers, and do not count.
    off = np.maximum(off_poses.max(), np.fmax.reduce(off_twists, axis=None, initial=0.0))
    if has_states:
        off = np.maximum(off, np.abs(states - stated.end_states).max())
        begun_anew = np.abs(states[:-1] - stated.states[1:]).max(initial=0.0)
        off = np.maximum(off, begun_anew)
    return Drive(
        plan=plan,
        model=model,
        frames=frames,
        twists=found.twists,
        states=reduced.nodes,
        end=poses[-1],
        off=float(off) + reduced.jumps,
        turned=float(off_poses[:, 2].max()),
        ends=ends,
        pieces=stated.pieces,
        controls=stated.controls,
        sampled_states=np.concatenate([stated.states[:1], states]),
    )


def _standing(plan: Plan, model: Model, stated: Stated) -> Drive:
    """Of a plan that lasts no time: one element of rest."""
    still = np.zeros((1, N, plan.start.size))
    # Without a trim it rests, with all at zero.
    states = plan.trims[0].reduced_state if plan.trims else np.zeros(len(model.reduced_names))
    return Drive(
        plan=plan,
        model=model,
        frames=frames_along(plan.start, still, np.full(1, NOTHING)),
        twists=still,
        states=np.tile(states, (1, N, 1)),
        end=plan.start,
        off=0.0,
        turned=0.0,
        ends=np.zeros(0),
        pieces=stated.pieces,
        controls=stated.controls,
        sampled_states=stated.states,
    )
