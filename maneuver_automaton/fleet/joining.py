"""Who joins a fleet's loop, and who has arrived."""

from __future__ import annotations

from maneuver_automaton.fleet.held import (
    given_up,
    is_over,
    leads,
    resting,
)
from maneuver_automaton.fleet.log import FleetGuarantee
from maneuver_automaton.fleet.moment import Moment
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.settings import switches_at_will


def let_in(now: Moment) -> list[int]:
    """Let in those that are new, if they keep apart from all: with their first plan, or at rest.

    Who could not be, for now.
    """
    agreement, at_first = now.state.agreement, now.state.last is None
    refused = []
    for k in [k for k in now.poses if k not in now.held]:
        vehicle, pose = now.vehicles[k], now.poses[k]
        stands = switches_at_will(vehicle.problem) or vehicle.problem.first_trim.is_rest
        choices = [resting(vehicle, pose, now.time)] if stands else []
        first = now.state.first.pop(k, None)
        if first is not None and now.offset_from(k, first) == 0.0:
            choices.insert(0, first)
        others = {(j, id(one)): (j, one) for j, one in now.held.items()}
        for j, one in agreement.everything():
            if j in now.held:
                others.setdefault((j, id(one)), (j, one))
        for found in choices:
            proven = now.is_proven(k, found, list(others.values()))
            if proven and (at_first or agreement.enter(k, found, now.held)):
                now.held[k] = found
                for count in (now.state.versions, now.state.lineage):
                    count[k] = count.get(k, -1) + 1
                now.disturbed.add(k)
                break
        else:
            refused.append(k)
    if at_first:
        agreement.start(now.held)
        for k in refused:
            now.flag(FleetGuarantee.HELD, [k], "it cannot stay where it begins")
    return refused


def note_arrivals(now: Moment) -> None:
    """Whose plan is over: at the goal, or it has none that arrives."""
    for k, found in now.held.items():
        if k in now.state.arrived or not leads(found) or not is_over(found, now.time):
            continue
        vehicle = now.vehicles[k]
        there = within(now.poses[k], vehicle.problem.goals[found.goal_index])
        # Who leaves is gone for all others once its plan is over: within its tube, it goes.
        if there or (vehicle.leaves and now.offset_from(k, found) <= now.state.settings.tube_m):
            now.state.arrived.add(k)
            continue
        # It stays where it is, or where its plan ends, and looks for another one.
        stay = resting(now.vehicles[k], now.poses[k], now.time, found)
        if not (now.is_proven(k, stay, now.expected_by(k)) and now.agreed(k, stay)):
            stay = given_up(found)
        now.hold(k, stay)
