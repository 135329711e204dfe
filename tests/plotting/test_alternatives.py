from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from maneuver_automaton.plotting import draw_alternatives
from tests.plotting.cases import parking_plan, plan_of

PLANS = [
    parking_plan(),
    plan_of(["clockwise", "straight", "rest"], [1.0, 2.0, 1.0]),
    plan_of(["straight", "spin", "straight"], [1.0, 2.0, 1.0]),
]


def test_every_plan_is_a_line_and_the_best_is_on_top():
    artists = draw_alternatives(Figure().add_subplot(), PLANS, costs=[1.0, 2.0, 3.0])
    for line, plan in zip(artists.paths, PLANS, strict=True):
        np.testing.assert_allclose(line.get_xydata()[-1], plan.end[:2], atol=1e-12)
    orders = [line.get_zorder() for line in artists.paths]
    assert orders == sorted(orders, reverse=True)
    assert len({line.get_color() for line in artists.paths}) == 3


def test_the_legend_holds_cost_and_word():
    artists = draw_alternatives(Figure().add_subplot(), PLANS, costs=[1.0, 2.5, 3.0])
    text = artists.legend.get_texts()[1].get_text()
    assert text == "cost 2.5   clockwise → straight → rest"
    artists = draw_alternatives(Figure().add_subplot(), PLANS)
    assert artists.legend.get_texts()[1].get_text() == "clockwise → straight → rest"


def test_a_common_goal_is_marked_once():
    artists = draw_alternatives(Figure().add_subplot(), [PLANS[0], PLANS[0]])
    assert len(artists.ends.goals) == 1
    assert len(draw_alternatives(Figure().add_subplot(), PLANS).ends.goals) == 3


def test_bodies_stand_at_the_switching_times():
    artists = draw_alternatives(Figure().add_subplot(), PLANS, footprint={"disc_m": 0.1})
    assert [len(bodies.get_paths()) for bodies in artists.bodies] == [5, 4, 4]


def test_plans_without_motion_are_drawn():
    ax = Figure().add_subplot()
    draw_alternatives(ax, [plan_of([], [])], costs=[0.0])
    ax.figure.canvas.draw()


def test_wrong_input_is_named():
    with pytest.raises(ValueError, match="got no plan"):
        draw_alternatives(Figure().add_subplot(), [])
    with pytest.raises(ValueError, match="got 1 costs for 3 plans"):
        draw_alternatives(Figure().add_subplot(), PLANS, costs=[1.0])
