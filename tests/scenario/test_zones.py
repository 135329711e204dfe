"""Zones of scenario files as values, and back."""

from __future__ import annotations

import pytest

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.scenario import scenario_of_text, to_yaml
from tests.scenario.files import SCENARIO

ZONES = """\
zones:
  - {polygon_m: [[2, -9], [4, -9], [4, 9], [2, 9]], max_speed_m_s: 0.5}
  - {polygon_m: [[6, 0], [8, 0], [8, 2]], reverse: false, max_lateral_acceleration_m_s2: 1.5}
"""


def read(text):
    return scenario_of_text(SCENARIO + text, name="x.yaml")


def test_zones_reach_the_problem():
    school, icy = read(ZONES).problem.zones
    assert school.shape.corners.tolist() == [[2, -9], [4, -9], [4, 9], [2, 9]]
    assert (school.max_speed, school.reverse, school.max_lateral_acceleration) == (0.5, True, None)
    assert (icy.max_speed, icy.reverse, icy.max_lateral_acceleration) == (None, False, 1.5)


def test_zones_are_written_as_they_were_read():
    scenario = read(ZONES)
    again = scenario_of_text(to_yaml(scenario), name="y.yaml").problem.zones
    for one, other in zip(scenario.problem.zones, again, strict=True):
        assert one.shape.corners.tolist() == other.shape.corners.tolist()
        for name in ("max_speed", "reverse", "max_lateral_acceleration", "trims"):
            assert getattr(one, name) == getattr(other, name)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("zones: [{polygon_m: [[0, 0], [1, 0], [1, 1]]}]\n", "zones[0]: forbids nothing"),
        (
            "zones: [{polygon_m: [[0, 0], [1, 0], [1, 1]], max_speed: 1}]\n",
            "did you mean 'max_speed_m_s'",
        ),
        (
            "zones: [{polygon_m: [[0, 0], [2, 2], [2, 0], [0, 2]], max_speed_m_s: 1}]\n",
            "zones[0].polygon_m",
        ),
        (
            "zones: [{polygon_m: [[0, 0], [1, 0], [1, 1]], trims: [restt]}]\n",
            "did you mean 'rest'",
        ),
    ],
)
def test_what_is_wrong_is_named(text, said):
    with pytest.raises(InvalidScenario) as error:
        read(text)
    assert said in str(error.value)
