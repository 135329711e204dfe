from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import SecondOrderCar
from maneuver_automaton.plotting import draw_maneuvers, save_maneuvers_figure
from maneuver_automaton.primitives import Maneuver
from tests.plotting.cases import ROBOT

CAR = SecondOrderCar(
    wheelbase=2.0, max_steering=0.6, max_speed=2.0, max_acceleration=1.0, max_steering_rate=0.5
)
SMALL = Automaton.of_model(CAR, {"speed": [0.0, 2.0], "steering": [-0.5, 0.0, 0.5]})


def test_paths_are_to_scale_and_within_the_frame():
    ax = Figure().add_subplot()
    artists = draw_maneuvers(ax, SMALL.maneuvers)
    segments = artists["paths"].get_segments()
    assert len(segments) == len(SMALL.maneuvers)
    for segment, one in zip(segments, SMALL.maneuvers, strict=True):
        np.testing.assert_allclose(segment[-1], one.displacement[:2], atol=1e-12)
        assert (np.abs(segment[:, 0] - np.mean(ax.get_xlim())) < np.ptp(ax.get_xlim()) / 2).all()
    assert len(artists["darts"].get_paths()) == 1 + len(SMALL.maneuvers)


def test_left_and_right_differ_in_colour():
    turns = [
        Maneuver(name="", source="a", target="b", displacement=[1.0, turn, turn])
        for turn in (-1.0, 0.0, 1.0)
    ]
    colors = draw_maneuvers(Figure().add_subplot(), turns)["paths"].get_colors()
    assert colors[0][2] > colors[0][0]
    assert colors[2][0] > colors[2][2]
    assert len({tuple(color) for color in colors}) == 3


def test_without_maneuvers_there_is_no_picture(tmp_path):
    with pytest.raises(ValueError, match="has no maneuver to draw"):
        save_maneuvers_figure(ROBOT, tmp_path / "maneuvers.png")
