"""Plans anew for those whose plans are void, or a stop."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

from maneuver_automaton.fleet.held import leads, rejoined, rest_of_plan, stopping
from maneuver_automaton.fleet.log import FleetGuarantee
from maneuver_automaton.fleet.moment import Moment
from maneuver_automaton.fleet.questions import search
from maneuver_automaton.fleet.vehicle import LONG, Found

EASED = (1.0, 0.5, 0.0)  # shares of the margin, where a void plan has none that keeps all of it
LEAST = 1e-3  # [m] kept even then


def stop(now: Moment, broken_down: set[int]) -> None:
    """Who breaks down stops as soon as it can; plans that would hit it are void.

    Who did so before, and is beside where it was to stop, stops there.
    """
    new = broken_down - now.state.broken
    tube = now.state.settings.tube_m
    beyond = {k for k in now.state.broken & set(now.held) if now.off[k] > tube}
    for k in sorted(new | beyond):
        now.hold(k, stopping(now.vehicles[k], now.held[k], now.time, now.begin_of(k)))
    now.state.broken |= new
    now.void = [k for k in now.void if k not in now.state.broken]
    for k, found in now.held.items():
        if k in now.state.broken or k in now.void:
            continue
        stopped = [(j, now.held[j]) for j in sorted(new | beyond) if now.knows(k, j)]
        if now.first_meeting(k, found, stopped) < math.inf:
            now.make_void(k)


def plan_anew(now: Moment) -> None:
    """Plans for those whose plans are void, the most urgent first; the next in its order."""
    waiting = list(now.void)
    if len(waiting) > 1:
        waiting.sort(
            key=lambda k: now.first_meeting(k, now.held[k], now.expected_by(k, but=waiting))
        )
    stopped, anew = set(now.state.broken), set[int]()
    while waiting:
        k = waiting.pop(0)
        stop = stopping(now.vehicles[k], now.held[k], now.time, now.begin_of(k))
        found = None if k in anew or k in now.state.silent else _another(now, k, waiting)
        anew.add(k)
        if found is None:
            if leads(held := now.held[k]):
                left = rest_of_plan(now.vehicles[k], held, now.time)
                now.state.stopped[k] = replace(held, plan=left)
            found = _stopped(now, k, stop, stopped)
            stopped.add(k)
        now.hold(k, found)
        now.state.arrived.discard(k)
        for j, other in now.held.items():
            if j in stopped or j in waiting or j == k:
                continue
            if now.first_meeting(j, other, [(k, found)]) == math.inf:
                continue
            if now.knows(j, k):
                waiting.append(j)
                now.make_void(j)
            else:
                when = now.first_meeting(j, other, [(k, found)])
                reason = f"at {when:.6g} s it meets a vehicle that did not receive its new plan"
                now.flag(FleetGuarantee.SAFETY, [k, j], reason)


def _another(now: Moment, k: int, waiting: Sequence[int]) -> Found | None:
    """A plan for a vehicle whose plan is void; None if none is found.

    Past all that others may drive, or else past those whose plans are not void and past where
    the others stop.
    """
    vehicle, pose = now.vehicles[k], now.begin_of(k)
    everyone = now.expected_by(k)
    for one in rejoined(vehicle, now.held[k], now.time, pose, now.tube):
        if now.is_proven(k, one, everyone):
            return one
    past = everyone
    for _ in range(2 if waiting else 1):
        found = search(now, k, now.from_here(k, pose), past, math.inf, most=LONG)[0]
        if found is not None and now.is_proven(k, found, past):
            return found
        stops = [
            (j, stopping(now.vehicles[j], now.held[j], now.time, now.begin_of(j))) for j in waiting
        ]
        past = [*now.expected_by(k, but=waiting), *stops]
    return None


def _stopped(now: Moment, k: int, stop: Found, stopped: Collection[int]) -> Found:
    """The plan of a vehicle that comes to rest, past those that do so already.

    Whoever would hit it is planned anew after it: this ends, at the latest, with all at rest.
    """
    last = [(j, one) for j, one in now.held.items() if j in stopped and j != k]
    for share in EASED:
        keep = max(share * now.keep, LEAST)
        if now.first_meeting(k, stop, last, keep) < math.inf:
            continue
        if share < 1.0:
            reason = f"no plan was found that keeps more than {keep:.3g} m"
            now.flag(FleetGuarantee.APART, [k], reason)
        return stop
    motions = (stop, now.held[k])
    times = [now.first_meeting(k, one, last, LEAST) for one in motions]
    reason = f"unavoidable: at {max(times):.6g} s it meets another vehicle"
    now.flag(FleetGuarantee.SAFETY, [k], reason)
    return motions[times.index(max(times))]
