"""Pictures of studies for the pages: `python docs/figures/studies.py FOLDER` writes them all.

Each function draws what a study of `maneuver_automaton.analysis` and its like has found.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

sys.path.insert(0, str(Path(__file__).parent))
from symmetry import INK, tidy

import maneuver_automaton as ma
from maneuver_automaton.analysis import (
    CertifiedHorizon,
    FeasibleSet,
    Turnpike,
    certified_horizon,
    feasible_set,
    growth_bound,
    ring_poses,
    turnpike,
)
from maneuver_automaton.optimal_control import UniformEffortExample, solve_uniform_effort_example
from maneuver_automaton.optimal_control.uniform_effort import END_NODES
from maneuver_automaton.primitives import trims_of
from maneuver_automaton.primitives.closed_form import bang_bang
from maneuver_automaton.receding_horizon import (
    FixedHorizon,
    MixedOrderCost,
    UnconstrainedProblem,
    simulate_unconstrained,
)
from maneuver_automaton.receding_horizon.unconstrained import UnconstrainedLoop

ROOT = Path(__file__).parents[2]
COLORS = ("#0062b2", "#de7210", "#009e73", "#c879a6")
PARKING_M = (0.0, 1.0, 0.0)
GROWTH_S = np.arange(1, 41) / 5.0


def feasible_figure(found: FeasibleSet) -> Figure:
    """All start poses with a plan in time, by their least time; one panel a heading."""
    panels = len(found.headings)
    figure = Figure(figsize=(2.4 * panels + 1.0, 3.4), layout="constrained")
    axes = figure.subplots(1, panels, sharey=True, squeeze=False)[0]
    levels = MaxNLocator(6).tick_values(0.0, found.within)[1:-1]
    for ax, times, heading in zip(axes, found.times, found.headings, strict=True):
        shown = np.ma.masked_array(times, ~(times <= found.within))
        cells = ax.pcolormesh(found.x, found.y, shown, cmap="Blues_r", vmin=0.0, vmax=found.within)
        capped = np.minimum(times, 2.0 * found.within)
        ax.contour(found.x, found.y, capped, levels=[found.within], colors=[COLORS[1]])
        ax.contour(found.x, found.y, capped, levels=levels, colors=["white"], linewidths=0.7)
        start, goal = found.problem.start, found.problem.goals[0].pose
        ax.plot(*goal[:2], marker="D", markersize=8.0, color=INK, markerfacecolor="white")
        if abs(heading - start[2]) < 1e-9:
            ax.plot(*start[:2], marker="o", color=INK)
        ax.set_title(f"heading {heading:.3g} rad", fontsize=9, loc="left")
        ax.set(aspect="equal", xlabel="x [m]", facecolor="#ebeae5")
        tidy(ax)
    axes[0].set_ylabel("y [m]")
    figure.colorbar(cells, ax=axes, label="least time [s]")
    share = float((found.times <= found.within).mean())
    kind = "every admitted word searched" if found.exhaustive else "best plans found"
    head(figure, f"feasible within {found.within:g} s: {share:.0%} of the grid · {kind}")
    return figure


def uniform_effort_figure(examples: Sequence[UniformEffortExample]) -> Figure:
    """The paper's Example 22, the first of some grids in full, and how even its effort is."""
    first = examples[0]
    time, pose, control = first.solution.time, first.solution.state, first.solution.control
    figure = Figure(figsize=(10.7, 6.3), layout="constrained")
    (path, states, controls), (summed, efforts, spreads) = figure.subplots(2, 3)
    path.plot(pose[:, 0], pose[:, 1], color=COLORS[0])
    path.set_aspect("equal", adjustable="datalim")
    lines(states, time, dict(zip(("x1 [m]", "x2 [m]", "x3 [rad]"), pose.T, strict=True)))
    lines(controls, time[: len(control)],
          dict(zip(("u1 [m/s]", "u2 [rad/s]"), control.T, strict=True)))  # fmt: skip
    both = {"x4, cost": first.accumulated_cost, "x5, effort": first.accumulated_effort}
    lines(summed, time, both)
    for color, one in zip(COLORS, examples, strict=False):
        at = np.linspace(0.0, one.solution.time[-1], len(one.effort))
        inner, ends = slice(END_NODES, -END_NODES), np.r_[0:END_NODES, -END_NODES:0]
        efforts.plot(at[inner], one.effort[inner], color=color, label=f"{len(at)} nodes")
        efforts.scatter(at[ends], one.effort[ends], facecolors="none", edgecolors=[color])
    nodes = [len(one.solution.time) for one in examples]
    lines(spreads, nodes, {
        "all nodes": 100.0 * np.array([one.spread for one in examples]),
        "without two at each end": 100.0 * np.array([one.inner_spread for one in examples]),
    })  # fmt: skip
    spreads.set(xscale="log", yscale="log", xlabel="nodes", ylabel="(most - least) / mean [%]")
    path.set(xlabel="x1 [m]", ylabel="x2 [m]")
    efforts.set_ylabel("effort |u|_R² [1/s]")
    for ax in (states, controls, summed, efforts):
        ax.set_xlabel("time [s]")
    for ax in (states, controls, summed, efforts, spreads):
        ax.legend(frameon=False, fontsize=8)
    for ax in figure.axes:
        tidy(ax)
    head(figure, f"uniform control effort: J = {first.cost:.6f} on {nodes[0]} nodes")
    return figure


def unconstrained_figure(
    loops: Mapping[str, UnconstrainedLoop], certified: Mapping[str, CertifiedHorizon]
) -> Figure:
    """Closed loops to the origin without terminal constraint, and what is certified of them."""
    figure = Figure(figsize=(9.6, 7.4), layout="constrained")
    (path, apart), (growth, index) = figure.subplots(2, 2)
    for color, (name, loop) in zip(COLORS, loops.items(), strict=False):
        x, y, _ = loop.poses.T
        path.plot(x, y, color=color, marker=".", label=name)
        apart.semilogy(np.maximum(np.hypot(x, y), 1e-5), color=color, label=name)
        apart.semilogy(np.maximum(np.abs(y), 1e-5), "--", color=color)
    for color, one in zip(COLORS, certified.values(), strict=False):
        growth.plot(one.growth.times, one.growth.bounds, color=color)
        index.plot(one.horizons, np.maximum(one.indices, -0.5), color=color)
        if one.horizon is not None:
            index.plot(one.horizon, one.index_at(one.horizon), "o", color=color)
    growth.axline((0.0, 0.0), slope=1.0, color=INK, linestyle=":", linewidth=0.9)
    index.axhline(0.0, color=INK, linewidth=0.8)
    path.set_aspect("equal", adjustable="datalim")
    path.set(xlabel="x [m]", ylabel="y [m]", title="paths")
    apart.set(xlabel="step", ylabel="[m]", title="distance to the goal; dashed: sideways only")
    growth.set(xlabel="time t [s]", ylabel="B(t) [s]", title="growth bound; dotted: resting")
    index.set(xlabel="horizon T [s]", ylabel="α", title="suboptimality index; dot: certified")
    path.legend(frameon=False)
    for ax in figure.axes:
        tidy(ax)
    head(figure, "parking without terminal constraint")
    return figure


def turnpike_figure(study: Turnpike) -> Figure:
    """A trim over longer and longer paths: speeds, costs, and time away from the trim."""
    figure = Figure(figsize=(10.7, 3.6), layout="constrained")
    speeds, costs, away = figure.subplots(1, 3)
    for color, case in zip(COLORS, study.cases, strict=False):
        values = case.optimum.state[:, case.goal.size]
        speeds.plot(case.optimum.time, values, color=color, label=f"{case.duration:.3g} s")
    speeds.axhline(float(study.trim.reduced_state[0]), color=INK, linestyle="--", linewidth=1.0)
    coast = np.array([one.coast for one in study.cases])
    duration = np.array([one.duration for one in study.cases])
    beyond = {
        "automaton": np.array([one.automaton_cost for one in study.cases]),
        "optimum": np.array([one.optimum.cost for one in study.cases]),
    }
    lines(costs, coast, {name: cost - study.unit_cost * coast for name, cost in beyond.items()})
    lines(away, duration, {"all of it": duration, "away": [one.away for one in study.cases]})
    speeds.set(xlabel="time [s]", ylabel="speed [m/s]")
    costs.set(xlabel="time in the trim [s]", ylabel="cost beyond the trim's")
    away.set(xlabel="duration [s]", ylabel=f"time farther than {study.distance:g} [s]")
    for ax in figure.axes:
        ax.legend(frameon=False, fontsize=8)
        tidy(ax)
    last = study.cases[-1]
    head(figure, f"turnpike at {study.trim.name}: away {last.away:.3g} s of {last.duration:.3g} s")
    return figure


def lines(ax: Axes, x: Sequence[float] | np.ndarray, rows: Mapping[str, Sequence[float]]) -> None:
    """A line for each row, with its name."""
    for color, (name, values) in zip(COLORS, rows.items(), strict=False):
        ax.plot(x, values, color=color, label=name, marker="o" if len(values) < 9 else "")


def head(figure: Figure, text: str) -> None:
    """A line above all."""
    figure.suptitle(text, fontsize=10, fontweight="bold", x=0.01, ha="left")


def feasible() -> Figure:
    """The feasible set of the paper's parking in 4 s."""
    problem = ma.load_scenario(ROOT / "scenarios" / "parking.yaml").problem
    headings = [0.0, np.pi / 2.0, np.pi, -np.pi / 2.0]
    window = ((-4.0, 4.0), (-4.0, 4.0))
    return feasible_figure(
        feasible_set(problem, 4.0, window=window, headings=headings, resolution=0.25)
    )


def uniform_effort() -> Figure:
    """The paper's Example 22 on three grids."""
    return uniform_effort_figure([solve_uniform_effort_example(n) for n in (50, 200, 1000)])


def unconstrained() -> Figure:
    """Parking by mixed orders, which arrives, and by a quadratic cost, which does not."""
    steps = [-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0]
    robot = ma.Automaton.of_grid(ma.Unicycle(), [steps, steps])
    weights = {"pose_weights": (1.0, 1.0, 0.1), "control_weights": (1.0, 0.1)}
    costs = {
        "mixed": MixedOrderCost(**weights),
        "quadratic": MixedOrderCost(**weights, pose_orders=(2, 2, 2), control_orders=(2, 2)),
    }
    loops, certified = {}, {}
    for name, cost in costs.items():
        horizon = FixedHorizon(interval=0.5, intervals=8)
        problem = UnconstrainedProblem(robot, [0.0, 0.0, 0.0], cost=cost, horizon=horizon)
        loops[name] = simulate_unconstrained(problem, PARKING_M, steps=26)
        poses = ring_poses(cost, levels=[0.01], parts=2)
        growth = growth_bound(robot, cost, poses=poses, times=GROWTH_S)
        certified[name] = certified_horizon(growth, step=0.5)
    return unconstrained_figure(loops, certified)


def turnpikes() -> Figure:
    """A second-order unicycle whose effort is priced, over paths of up to 50 s."""
    robot = ma.SecondOrderUnicycle(
        max_speed=2.0, max_turn_rate=2.0, max_acceleration=1.0, max_angular_acceleration=1.0
    )
    rest, ahead = trims_of(robot, {"speed": [0.0, 1.0], "turn_rate": [0.0]}).trims
    study = turnpike(
        robot, source=rest, up=bang_bang(robot, rest, ahead), trim=ahead,
        down=bang_bang(robot, ahead, rest), target=rest, coasts=[6.0, 12.0, 24.0, 48.0],
        stage_cost=lambda z, u: z[0] ** 2 + z[1] ** 2 + u[0] ** 2 + u[1] ** 2,
    )  # fmt: skip
    return turnpike_figure(study)


PICTURES = {
    "feasible.png": feasible,
    "uniform_effort.png": uniform_effort,
    "unconstrained.png": unconstrained,
    "turnpike.png": turnpikes,
}

if __name__ == "__main__":
    for name, drawn in PICTURES.items():
        drawn().savefig(Path(sys.argv[1]) / name, dpi=130)
