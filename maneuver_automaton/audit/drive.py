"""One integration of a plan's controls from its start: reduced states, heading, then place.

Nothing of what made the plan is used: no group formula, no closed form, no pose that it states.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit import _kernels_drive as kernels
from maneuver_automaton.audit.arrays import Spans, Stated
from maneuver_automaton.audit.frames import (
    INTEGRAL,
    RULES,
    SERIES,
    SLOPE,
    TO_END,
    TO_NODES,
    FrameMotion,
    N,
    placed,
    values_at,
)
from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trim

TURN = 0.8  # [rad] per element at most: the last terms of its series are rounding
EXACT = 1e-12  # [m, rad, model's units] what the last terms of a series may be
HALVINGS = 10  # of a stretch at most
NOTHING = 1e-12  # [s] shorter pieces lead nowhere
ITERATIONS = 40  # of Picard; an element that needs more is cut
SWEEPS = 8  # until each element begins where the one before it ends
SAME = 1e-14  # relative, two states that are the same but for rounding
FOLLOWED = 1e-9  # relative: a vehicle whose deviations grow is followed to that far from the plan
EXPLODED = 1e9  # off the guess: no motion is followed there
NUDGE = 1e-6  # [model's units] for a derivative


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DrivenPlan:
    """A plan driven again, and how far what it states is from that."""

    plan: Plan
    model: Model
    frames: FrameMotion  # of the vehicle
    twists: Array  # (e, N, dof) at the nodes of the elements
    states: Array  # (e, N, n_z) reduced states there
    end: Array  # (dof,) last pose
    off: float  # [m, rad, model's units] how far what the plan states is from where it leads
    turned: float  # [rad] the same, of the headings alone
    ends: Array  # (n,) [s] when the plan's own samples are
    pieces: IntArray  # (n,) number of the primitive that ends there
    controls: Array  # (n, n_u) until there
    sampled_states: Array  # (n + 1, n_z) reduced states at the start and there

    def part(self, name: str) -> FrameMotion:
        """The frame of what the vehicle carries, placed by the model from the reduced state."""
        which = self.model.part_names.index(name)
        seen = np.asarray(self.model.part_poses(self.states), dtype=np.float64)[..., which, :]
        poses = placed(self.frames.nodes, seen)
        poses[..., 2] = np.unwrap(poses[..., 2], axis=1)
        series, lengths = SERIES @ poses, np.diff(self.frames.times)
        rates = SLOPE @ poses / lengths[:, None, None]
        cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        twists = rates.copy()
        twists[..., 0] = cosine * rates[..., 0] + sine * rates[..., 1]
        twists[..., 1] = cosine * rates[..., 1] - sine * rates[..., 0]
        last = self.frames.error + np.abs(series[:, -2:]).max(axis=(1, 2))
        return kernels.bounded(series, poses, last, twists, lengths, RULES)

    def twists_at(self, elements: IntArray, shares: Array) -> Array:
        """Twists (m, dof) at shares of elements, (m,) each."""
        return values_at((SERIES @ self.twists)[elements], shares)

    def may_stand(self, elements: IntArray, shares: Array) -> NDArray[np.bool_]:
        """Whether (m,) no control, if there may be none, is a rest at shares of elements."""
        low, high = self.model.control_limits.T
        if (low > 0.0).any() or (high < 0.0).any():
            return np.zeros(shares.shape, dtype=np.bool_)
        states = values_at((SERIES @ self.states)[elements], shares)
        none = np.zeros((shares.size, low.size))
        return np.asarray(np.abs(self.model.body_velocity(states, none)).max(axis=1) == 0.0)

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


def driven(plan: Plan, model: Model) -> DrivenPlan:
    """Drive a plan again from its start under its controls.

    The equations are solved by collocation, on all elements side by side; heading and place are
    sums over the elements. Elements are cut smaller until the last terms of all their series are
    below 1e-12, so the motion is as exact between the nodes as at them.

    Source: Hairer, Lubich, Wanner (2006), *Geometric Numerical Integration*, Sec. II.1.3.
    """
    stated = stated_by(plan)
    if stated is None:
        return _standing(plan, model)
    begin_twists = model.body_velocity(stated.states, stated.controls)
    rough = np.zeros(stated.lengths.size, dtype=np.int64)
    has_states = bool(stated.states.shape[1])
    for _ in range(HALVINGS):
        elements, twists = kernels.cut(stated, begin_twists, rough, TURN, N)
        first, reduced = elements.first, WITHOUT
        if has_states:
            begins, controls = stated.states[first], stated.controls[first]
            guess = begins + elements.share[:, None] * (stated.end_states[first] - begins)
            begun = elements.share == 0.0
            reduced = reduced_states(model, controls, elements.lengths, guess, begun)
            twists[:] = model.body_velocity(reduced.nodes, controls[:, None])
        frames, there = kernels.followed(plan.start.copy(), twists, stated, elements, RULES)
        fine = np.maximum(reduced.error, frames.error) <= EXACT * (1.0 + frames.length)
        if fine.all():
            break
        rough += np.isin(elements.run, elements.runs[~fine])
    off, states = there.off, stated.end_states
    if has_states:
        # What a reduced state is off moves the vehicle for as long as it is driven.
        doubt = reduced.error + reduced.jumps / reduced.error.size
        frames = frames._replace(error=frames.error + (1.0 + float(frames.times[-1])) * doubt)
        states = values_at(reduced.series[there.element], np.minimum(there.share, 1.0))
        begun_anew = np.abs(states[:-1] - stated.states[1:]).max(initial=0.0)
        off = float(np.max([off, np.abs(states - stated.end_states).max(), begun_anew]))
    return DrivenPlan(
        plan=plan,
        model=model,
        frames=frames,
        twists=twists,
        states=reduced.nodes,
        end=there.poses[-1],
        off=off + reduced.jumps,
        turned=there.turned,
        ends=there.time,
        pieces=stated.pieces,
        controls=stated.controls,
        sampled_states=np.concatenate([stated.states[:1], states]),
    )


def _standing(plan: Plan, model: Model) -> DrivenPlan:
    """Of a plan that lasts no time: one element of rest."""
    still, here = np.zeros((1, N, plan.start.size)), np.zeros((1, N + 1, plan.start.size))
    here[0, 0] = plan.start
    # Without a trim it rests, with all at zero.
    states = plan.trims[0].reduced_state if plan.trims else np.zeros(len(model.reduced_names))
    return DrivenPlan(
        plan=plan,
        model=model,
        frames=kernels.bounded(
            here, still + plan.start, np.zeros(1), still, np.full(1, NOTHING), RULES
        ),
        twists=still,
        states=np.tile(states, (1, N, 1)),
        end=plan.start,
        off=0.0,
        turned=0.0,
        ends=np.zeros(0),
        pieces=np.zeros(0, dtype=np.int64),
        controls=np.zeros((0, len(model.control_names))),
        sampled_states=np.zeros((0, states.size)),
    )


def stated_by(plan: Plan) -> Stated | None:
    """The stretches of a plan, trims whole, maneuvers from sample to sample; None of no time."""
    poses, lengths = plan.switching_poses, plan.primitive_durations
    lasting = (lengths > NOTHING).nonzero()[0].tolist()
    rows: list[Stated] = []
    # Trims that follow each other are one run; every maneuver stands alone.
    kinds = [-1 if isinstance(one, Trim) else k for k, one in enumerate(plan.primitives)]
    for _, run in groupby(lasting, key=kinds.__getitem__):
        numbers = list(run)
        trims: list[Any] = [plan.primitives[k] for k in numbers]
        if isinstance(trims[0], Maneuver):
            rows.append(_maneuver(trims[0], numbers[0], poses[numbers[0]]))
            continue
        controls, which = np.array([one.control for one in trims]), np.array(numbers)
        states, whole = np.array([one.reduced_state for one in trims]), len(which) == len(kinds)
        ends, twists = (poses[1:], plan.twists) if whole else (poses[which + 1], plan.twists[which])
        rows.append(Stated(lengths[which], controls, states, states, ends, twists, which))
    if len(rows) < 2:
        return rows[0] if rows else None
    return Stated(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _maneuver(maneuver: Maneuver, number: int, begin: Array) -> Stated:
    course = maneuver.course
    if course is None:
        raise ValueError(f"maneuver {maneuver.name!r}: has no course, so it cannot be audited")
    lengths = np.diff(course.time)
    lasting = lengths > 0.0
    poses = placed(begin, course.pose[1:])
    return Stated(
        lengths[lasting],
        course.control[:-1][lasting],
        course.reduced_state[:-1][lasting],
        course.reduced_state[1:][lasting],
        poses[lasting],
        np.full_like(poses[lasting], np.nan),
        np.full(int(lasting.sum()), number),
    )


class Reduced(NamedTuple):
    """Reduced states over elements."""

    nodes: Array  # (e, N, n_z)
    series: Array  # (e, N + 1, n_z) Legendre series over the share of an element
    error: Array  # (e,) what the last terms of a series are; inf where there is none
    jumps: float  # what is left between elements, added up


WITHOUT = Reduced(np.zeros((1, 1, 0)), np.zeros((1, N + 1, 0)), np.zeros(1), 0.0)


def reduced_states(
    model: Model, controls: Array, lengths: Array, guess: Array, stated: NDArray[np.bool_]
) -> Reduced:
    """Reduced states from the first of `guess` (e, n_z) on, under controls (e, n_u).

    Every element is driven from a guess of where it begins. The differences that remain between
    elements are then carried forward by the linearised flow, and all are driven again, until each
    begins where the one before ends: that is the integration from the start, by Newton's method.
    A vehicle that amplifies deviations (a trailer pushed backwards) cannot be followed so for
    long, by nobody: where it is 1e-9 from what the plan states, it goes on there, and the jump
    counts. `stated` (e,) is where the guesses are what the plan states.
    """
    begins, h = guess.copy(), lengths[:, None, None]
    restarted = np.zeros(len(lengths) - 1, dtype=np.bool_)
    for sweep in range(SWEEPS):
        nodes, rates, failed = _solved(model, begins, controls, lengths)
        if failed.any():
            return Reduced(nodes, nodes, np.where(failed, np.inf, 0.0), np.inf)
        jumps = begins[:-1] + lengths[:-1, None] * (TO_END @ rates[:-1]) - begins[1:]
        scale = 1.0 + np.abs(begins).max(axis=1)
        open_ = np.abs(jumps).max(axis=1, initial=0.0) > SAME * scale[1:]
        if not (open_ & ~restarted).any() or sweep == SWEEPS - 1:
            break
        flow = _flow(model, nodes[:, N // 2], controls, lengths)
        begins, restarted = _carried_on(begins, jumps, flow, guess, FOLLOWED * scale * stated)
    series = h * (INTEGRAL @ rates)
    series[:, 0] += begins
    error = np.abs(SERIES[-2:] @ rates).max(axis=(1, 2)) * lengths
    return Reduced(nodes, series, error, float(np.abs(jumps).max(axis=1, initial=0.0).sum()))


def _solved(
    model: Model, begins: Array, controls: Array, lengths: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """States and rates (e, N, n_z) at the nodes, and which elements are too long to be solved."""
    nodes = np.repeat(begins[:, None], N, axis=1)
    rates = np.empty_like(nodes)
    size = 1.0 + np.abs(begins).max(axis=1)
    failed = np.zeros(len(begins), dtype=np.bool_)
    open_: IntArray = np.arange(len(begins))
    for _ in range(ITERATIONS):
        rates[open_] = model.reduced_dynamics(nodes[open_], controls[open_, None])
        new = begins[open_, None] + lengths[open_, None, None] * (TO_NODES @ rates[open_])
        change = np.abs(new - nodes[open_]).max(axis=(1, 2))
        wild = ~(change < 1e3 * size[open_])
        failed[open_[wild]] = True
        nodes[open_[~wild]] = new[~wild]
        open_ = open_[(change > 0.1 * SAME * size[open_]) & ~wild]
        if not open_.size:
            return nodes, rates, failed
    failed[open_] = True
    return nodes, rates, failed


def _flow(model: Model, middles: Array, controls: Array, lengths: Array) -> Array:
    """How the end of each element depends on its begin: (e, n_z, n_z), to first order."""
    n_z = middles.shape[1]
    off = middles[:, None] + NUDGE * np.eye(n_z)
    slopes = model.reduced_dynamics(off, controls[:, None])
    slopes = (slopes - model.reduced_dynamics(middles, controls)[:, None]) / NUDGE
    generator = lengths[:, None, None] * np.swapaxes(slopes, 1, 2)
    flow = np.broadcast_to(np.eye(n_z), generator.shape)
    for k in range(8, 0, -1):  # the exponential, by Horner
        flow = np.eye(n_z) + generator @ flow / k
    return np.asarray(flow)


def _carried_on(
    begins: Array, jumps: Array, flow: Array, guess: Array, followed: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Where elements begin once the jumps are carried forward, and where that starts anew."""
    new = begins.copy()
    restarted = np.zeros(len(jumps), dtype=np.bool_)
    most = np.where(followed > 0.0, followed, EXPLODED)
    for k, jump in enumerate(jumps):
        new[k + 1] += jump + flow[k] @ (new[k] - begins[k])
        if not np.abs(new[k + 1] - guess[k + 1]).max() <= most[k + 1]:
            new[k + 1], restarted[k] = guess[k + 1], True
    return new, restarted
