"""`plan` and `mpc` of one vehicle: its plan, its closed loop, statistics of many loops."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from maneuver_automaton import planning, receding_horizon
from maneuver_automaton._interrupts import stopped
from maneuver_automaton.budget import Watch
from maneuver_automaton.cli.inputs import naming
from maneuver_automaton.cli.jobs import INTERRUPTED, Job, JobResult
from maneuver_automaton.cli.terminal import counted, has_terminal, progress_bar, waiting
from maneuver_automaton.formats import closed_loop_json
from maneuver_automaton.formats.plan_json import plan_to_dict
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.recording import loops, recording_of
from maneuver_automaton.scenario import Scenario
from maneuver_automaton.scenario.scenario import disturbance_of

STEPS = 100  # of a loop, where neither file nor option says


def planned(job: Job, scenario: Scenario) -> JobResult:
    """Plan the problem of a file."""
    options, quiet = job.options, job.options.quiet
    limit = options.time_limit or scenario.time_limit_s
    shown = SoFar(watch=Watch(gap=-math.inf if options.gap is None else options.gap))
    live = not quiet and has_terminal()
    try:
        with waiting(f"planning, at most {limit:g} s", quiet=quiet, more=lambda: shown.text):
            result = planning.plan(
                scenario.problem,
                time_limit=limit,
                alternatives=options.alternatives,
                gap=options.gap,
                watch=shown.watch if live else None,
                on_better=shown.better if live else None,
                leave=options.leave,
            )
    except KeyboardInterrupt:
        if not stopped():
            raise  # in somebody else's program
        result = PlanResult(problem=scenario.problem, status=PlanStatus.OUT_OF_BUDGET, reason="")
    if stopped() and result.plan is None:
        result = replace(result, reason=INTERRUPTED)
    result = replace(result, timing_s={**scenario.timing_s, **result.timing_s})
    found, status, name = result.plan is not None, result.status.value, scenario.name
    facts = [  # the cost with the gap, too, where that was asked for and is open
        replace(one, note=f", gap {100.0 * (result.gap or 0.0):.2g} %")
        for one in (() if options.gap is None else recording_of(result).facts)
        if one.bound is not None and one.bound != one.value
    ]
    return JobResult(
        name=name,
        result=result,
        document=plan_to_dict(result, name=name),
        done=found,
        status=status,
        complaints=() if found else ("; ".join([f"{status}: {result.reason}", *result.notes]),),
        facts=tuple(facts),
        first_plan=result.timing_s.get("first_plan"),
    )


@dataclass(slots=True, kw_only=True)
class SoFar:
    """The best plan while it is being improved, for a line on the terminal."""

    watch: Watch
    best: PlanResult | None = None

    def better(self, result: PlanResult) -> None:
        """Take a plan that is better than the one before, and passed all checks."""
        self.best = result

    @property
    def text(self) -> str:
        """Cost, bound, gap if one was asked for, and clearance."""
        best = self.best
        if best is None or best.cost is None:
            return ""
        bound = max(self.watch.bound, best.lower_bound or 0.0)
        share = max(0.0, 1.0 - bound / best.cost) if best.cost > 0.0 else 0.0
        parts = [f"cost {best.cost:.6g}, proven: at least {bound:.6g}"]
        if self.watch.gap > -math.inf:
            parts.append(f"gap {100.0 * share:.2g} %")
        if best.clearance_m is not None:
            parts.append(f"clearance {best.clearance_m:.3g} m")
        return ", ".join(parts)


def driven(job: Job, scenario: Scenario) -> JobResult:
    """Close the loop of a file, once or with seed after seed."""
    part, options = scenario.receding_horizon, job.options
    assert part is not None
    noise, steps = part.disturbance, options.steps or part.steps or STEPS
    how: dict[str, Any] = {
        "step": part.step_s,
        "steps": steps,
        "margin": part.margin,
        "time_limit": options.time_limit or scenario.time_limit_s,
        "stay": part.stay,
        "retimed": part.retimed,
        "pieces": part.pieces or 0,
        "gap": options.gap,
    }
    with naming(job.path, "receding_horizon: "):
        if options.seeds is not None:
            how["disturbance"] = None if noise is None else disturbance_of(noise)
            return _statistics(job, scenario, how)
        how["disturbance"] = None if noise is None else disturbance_of(noise, seed=options.seed)
        problem, last = scenario.problem, None
        if options.resume is not None:
            done, poses = closed_loop_json.load_steps(options.resume, problem.automaton)
            if done:
                last, problem = done[-1], replace(problem, start=poses[-1])
        with progress_bar("steps", steps, quiet=options.quiet) as advance:
            how |= {"last": last, "progress": lambda _: advance()}
            loop = receding_horizon.simulate(problem, **how)
    return _driven(loop, scenario.name)


def _driven(loop: receding_horizon.ClosedLoop, name: str) -> JobResult:
    broken = [f"step {n} broke a guarantee: {one}" for n, one in loop.violations]
    disturbed = [
        f"step {n} was disturbed: {one}"
        for n, one in loop.disturbed
        if one.guarantee is not receding_horizon.Guarantee.DECREASE  # as by noise all the time
    ]
    missed = [] if loop.reached else [f"{loop.status}: {loop.reason}"]
    return JobResult(
        name=name,
        result=loop,
        document=closed_loop_json.closed_loop_to_dict(loop, name=name),
        done=loop.reached and not any(loop.collisions),
        status=loop.status,
        complaints=(*broken, *disturbed, *missed),
    )


def _statistics(job: Job, scenario: Scenario, how: dict[str, Any]) -> JobResult:
    options, count = job.options, job.options.seeds
    assert count is not None
    first = options.seed or 0
    with progress_bar("loops", count, quiet=options.quiet) as advance:
        statistics = receding_horizon.simulate_many(
            scenario.problem,
            seeds=range(first, first + count),
            **how,
            audit=bool(scenario.problem.obstacles),  # else nothing looks for collisions
            jobs=options.jobs,
            scheduler=options.scheduler,
            progress=counted(advance),
        )
    return JobResult(
        name=scenario.name,
        result=None,  # the motion of no loop is kept
        document=closed_loop_json.statistics_to_dict(statistics),
        done=all(one.reached and not any(one.collisions) for one in statistics.outcomes),
        status=f"{count} loops",
        facts=loops.statistics_facts(statistics),
        remarks=tuple(loops.causes(statistics)),
        file="statistics",
    )
