"""`plan` and `mpc` of a file of several vehicles: plans of them all, and their closed loop."""

from __future__ import annotations

from dataclasses import replace

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.cli.inputs import naming
from maneuver_automaton.cli.jobs import INTERRUPTED, Job, JobResult
from maneuver_automaton.cli.single import STEPS
from maneuver_automaton.cli.terminal import progress_bar, waiting
from maneuver_automaton.fleet import (
    FleetLog,
    FleetResult,
    FleetStatus,
    plan_fleet,
    simulate_fleet,
    verify_driven,
)
from maneuver_automaton.fleet.held import fleet_with_room, tube_of
from maneuver_automaton.formats.fleet_json import (
    fleet_loop_to_dict,
    fleet_to_dict,
    load_fleet_loop,
    reason_of,
)
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.recording.fleets import judged_facts
from maneuver_automaton.scenario import FleetScenario


def planned(job: Job, scenario: FleetScenario) -> JobResult:
    """Plan them all."""
    options, said = job.options, scenario.settings
    limit, best = options.time_limit or scenario.time_limit_s, [""]

    def better(seconds: float, value: float) -> None:
        best[0] = f"{said.objective} {value:.6g}, found after {seconds:.3g} s"

    try:
        with waiting(f"planning, at most {limit:g} s", quiet=options.quiet, more=lambda: best[0]):
            result = plan_fleet(
                scenario.fleet,
                time_limit=limit,
                objective=said.objective,
                orders=said.orders,
                on_better=better,
                jobs=options.jobs,
                scheduler=options.scheduler,
            )
    except KeyboardInterrupt:
        if not stopped():
            raise  # in somebody else's program
        result = given_up(scenario)
    result = replace(result, timing_s={**scenario.timing_s, **result.timing_s})
    name, whole = scenario.name, result.status is FleetStatus.FOUND
    why = "interrupted before all had a plan: " if stopped() else ""
    return JobResult(
        name=name,
        result=result,
        document=fleet_to_dict(result, name=name),
        done=whole,
        status=result.status.value,
        complaints=() if whole else (f"{result.status.value}: {why}{reason_of(result)}",),
        first_plan=result.timing_s.get("first_plan"),
    )


def given_up(scenario: FleetScenario) -> FleetResult:
    """The result if a signal came before there was a plan."""
    fleet, status = scenario.fleet, PlanStatus.OUT_OF_BUDGET
    return FleetResult(
        problem=fleet,
        status=FleetStatus.NO_PLAN,
        results={
            name: PlanResult(problem=problem, status=status, reason=INTERRUPTED)
            for name, problem in zip(fleet.names, fleet.problems, strict=True)
        },
        objective=scenario.settings.objective,
        reasons=dict.fromkeys(fleet.names, INTERRUPTED),
    )


def driven(job: Job, scenario: FleetScenario) -> JobResult:
    """Close the loop of them all."""
    log = _loop(job, scenario)
    verdict, name = verify_driven(log), scenario.name
    broken = list(log.violations)
    complaints = [f"step {number} broke a guarantee: {one}" for number, one in broken]
    complaints += list(verdict.collisions)
    complaints += [
        f"{name} did not drive as its model says: {said}" for name, said in verdict.defects.items()
    ]
    if not log.reached:
        when = ", when the loop was interrupted" if stopped() else ""
        complaints.append(f"{log.status}: {log.reason}{when}")
    return JobResult(
        name=name,
        result=log,
        document=fleet_loop_to_dict(log, verdict, name=name),
        done=log.reached and verdict.passed and not broken,
        status=log.status,
        complaints=tuple(complaints),
        facts=judged_facts(verdict, log.problem.margin),
        measured=(verdict,),
    )


def _loop(job: Job, scenario: FleetScenario) -> FleetLog:
    """The closed loop, from plans with room for noise."""
    part, options = scenario.receding_horizon, job.options
    assert part is not None
    steps, seed = options.steps or part.steps or STEPS, options.seed
    if seed is None:
        seed = 0 if part.disturbance is None else part.disturbance.seed
    log = None if options.resume is None else load_fleet_loop(options.resume, scenario.fleet)
    first = _first_plans(job, scenario, part.tube_m) if log is None else None
    named = naming(job.path, "receding_horizon: ")
    with progress_bar("steps", steps, quiet=options.quiet) as advance, named:
        return simulate_fleet(
            scenario.fleet,
            step=part.step_s,
            steps=steps,
            disturbance=scenario.disturbances,
            seed=seed,
            first=first,
            log=log,
            margin=part.margin,
            tube_m=part.tube_m,
            time_limit=options.time_limit or part.time_limit_s,
            swaps_per_step=part.swaps_per_step,
            group_size=part.group_size,
            delay_steps=part.delay_steps,
            joins_s=scenario.joins_s,
            breaks_s=scenario.breaks_s,
            progress=lambda _: advance(),
        )


def _first_plans(job: Job, scenario: FleetScenario, tube_m: float | None) -> FleetResult | None:
    """Plans of those that are there from the begin on, if there are any, as a loop needs them."""
    fleet = scenario.fleet
    there = [name for name in fleet.names if name not in scenario.joins_s]
    if not there:
        return None
    limit = scenario.time_limit_s
    with waiting(f"planning, at most {limit:g} s", quiet=job.options.quiet):
        return plan_fleet(
            fleet_with_room(fleet.only(there), tube_of(fleet, tube_m)),
            time_limit=limit,
            objective=scenario.settings.objective,
            orders=scenario.settings.orders,
        )
