"""One step of a fleet's loop: shift all plans, rejoin, plan anew what is void, exchange, check."""

from __future__ import annotations

from maneuver_automaton.fleet.exchanges import Exchanges
from maneuver_automaton.fleet.guarantees import Before
from maneuver_automaton.fleet.joining import let_in, note_arrivals
from maneuver_automaton.fleet.log import FleetStep
from maneuver_automaton.fleet.moment import Moment
from maneuver_automaton.fleet.rejoining import rejoin
from maneuver_automaton.fleet.step_log import logged
from maneuver_automaton.fleet.void_plans import plan_anew, stop


def step_of(now: Moment, broken_down: set[int]) -> FleetStep:
    """The step from begin to end, which changes the state of its loop; some have broken down."""
    agreement, held = now.state.agreement, now.held
    for k in [k for k in held if k not in now.poses]:
        del held[k]
    refused = let_in(now)
    before = Before.of(now.vehicles, held, now.time, now.state.last)
    agreement.begin(now.number, held)
    rejoin(now)
    stop(now, broken_down & set(held))
    plan_anew(now)
    note_arrivals(now)
    exchanges = Exchanges(now)
    exchanges.exchange_what_is_due()
    exchanges.go_on()
    exchanges.exchange()
    done = now.budget.elapsed
    log = logged(now, before, exchanges, refused)
    now.state.note_end(now.budget.elapsed - min(done, now.searches.seconds))
    return log
