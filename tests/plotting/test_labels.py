from __future__ import annotations

import pytest

from maneuver_automaton.models.kinds import KINDS
from maneuver_automaton.plotting.style import control_labels


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_every_state_and_control_of_our_vehicles_has_a_unit(kind):
    for label in control_labels([*kind.reduced_names, *kind.control_names]):
        assert label.endswith("]"), label
