"""`mpc` of a file of several vehicles: plan them all, close their loop, write, draw and tell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written
from maneuver_automaton.cli.mpc_command import STEPS, Settings, draw_loop
from maneuver_automaton.cli.progress import announced, progress_bar, waiting
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.fleet import DrivenVerdict, FleetLog, FleetResult
    from maneuver_automaton.scenario import FleetScenario


def drive(
    path: Path, scenario: FleetScenario, out: Path, *, settings: Settings, parts: Parts
) -> int:
    """Close the loop of a fleet into the folder `out`, print it, return the exit code."""
    from maneuver_automaton.fleet import verify_driven

    for option, given in (
        ("--seeds", settings.seeds is not None),
        ("--resume", settings.resume is not None),
        ("--gap", settings.gap is not None),
    ):
        if given:
            raise InvalidScenario(
                f"{option}: is for one vehicle, but {path} states several; leave it out"
            )
    make_folder(out)
    log = driven_loop(path, scenario, settings)
    driven = verify_driven(log)
    try:
        _write(log, driven, scenario.name, out, settings, {"file": path, "with": parts.beside,
               "case": parts.case})  # fmt: skip
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    if not settings.quiet:
        from maneuver_automaton.cli.fleet_loop_tables import print_fleet_loop

        print_fleet_loop(scenario.name, log, driven, folder=str(out))
    return _judged(path, log, driven)


def _judged(path: Path, log: FleetLog, driven: DrivenVerdict) -> int:
    """Complain of what went wrong; the exit code."""
    broken = list(log.violations)
    for number, violation in broken:
        complain(f"{path}: step {number} broke a guarantee: {violation}")
    for said in driven.collisions:
        complain(f"{path}: {said}")
    for name, said in driven.defects.items():
        complain(f"{path}: {name} did not drive as its model says: {said}")
    if not log.reached:
        when = ", when the loop was interrupted" if stopped() else ""
        complain(f"{path}: {log.status}: {log.reason}{when}")
    return FOUND if log.reached and driven.passed and not broken else NO_PLAN


def driven_loop(path: Path, scenario: FleetScenario, settings: Settings) -> FleetLog:
    """The closed loop of a file of several vehicles, from plans with room for noise."""
    from maneuver_automaton.fleet import simulate_fleet

    part = scenario.receding_horizon
    assert part is not None
    steps = settings.steps or part.steps or STEPS
    with announced(quiet=settings.quiet):
        first = _first_plans(scenario, quiet=settings.quiet)
        with progress_bar("steps", steps, quiet=settings.quiet) as advance:
            try:
                return simulate_fleet(
                    scenario.fleet,
                    step=part.step_s,
                    steps=steps,
                    disturbance=scenario.disturbances,
                    seed=_seed(scenario, settings),
                    first=first,
                    margin=part.margin,
                    tube_m=part.tube_m,
                    time_limit=settings.time_limit or part.time_limit_s,
                    swaps_per_step=part.swaps_per_step,
                    group_size=part.group_size,
                    delay_steps=part.delay_steps,
                    joins_s=scenario.joins_s,
                    breaks_s=scenario.breaks_s,
                    progress=lambda _: advance(),
                )
            except ValueError as error:
                raise _in_file(path, error) from error


def _seed(scenario: FleetScenario, settings: Settings) -> int:
    if settings.seed is not None:
        return settings.seed
    part = scenario.receding_horizon
    return 0 if part is None or part.disturbance is None else part.disturbance.seed


def _first_plans(scenario: FleetScenario, *, quiet: bool) -> FleetResult | None:
    """Plans of those that are there from the begin on, if there are any, as a loop needs them."""
    from maneuver_automaton.fleet import plan_fleet
    from maneuver_automaton.fleet.held import fleet_with_room, tube_of

    part = scenario.receding_horizon
    assert part is not None
    there = [name for name in scenario.fleet.names if name not in scenario.joins_s]
    if not there:
        return None
    limit = scenario.time_limit_s
    with waiting(f"planning, at most {limit:g} s", quiet=quiet):
        return plan_fleet(
            fleet_with_room(scenario.fleet.only(there), tube_of(scenario.fleet, part.tube_m)),
            time_limit=limit,
            objective=scenario.settings.objective,
            orders=scenario.settings.orders,
        )


def _in_file(path: Path, error: ValueError) -> InvalidScenario:
    if isinstance(error, InvalidScenario):
        return error
    said = str(error).removeprefix("fleet horizon: ").removeprefix("fleet: ")
    return InvalidScenario(f"{path}: receding_horizon: {said}")


def _write(
    log: FleetLog,
    driven: DrivenVerdict,
    name: str,
    out: Path,
    settings: Settings,
    source: Mapping[str, object],
) -> None:
    from maneuver_automaton.formats.fleet_loop_json import save_fleet_loop

    save_fleet_loop(
        log,
        out / "closed_loop.json",
        driven=driven,
        name=name,
        source=source,
        interrupted=stopped(),
    )
    draw_loop(log, name, out, settings, figure="save_fleet_loop_figure", film="animate_fleet_loop")
