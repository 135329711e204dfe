"""The part of a scenario that says how to close the loop."""

from __future__ import annotations

import json

import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.scenario import scenario_of_text, to_yaml
from tests.scenario.files import SCENARIO

FULL = """\
receding_horizon:
  step_s: 0.5
  steps: 12
  margin: 0.1
  stay: true
  retimed: false
  disturbance:
    position_m: 0.02
    heading_rad: 0.03
    measured_position_m: 0.01
    measured_heading_rad: 0.04
    twist_scale: [0.9, 1.0, 1.1]
    pushes: [{after_step: 2, by: [0.1, 0.2, 0.3]}, {after_step: 0, by: [1, 0, 0]}]
    delay_steps: 1
    seed: 7
"""
KEYS = "step_s, steps, margin, retimed, pieces, stay, disturbance"
OF_DISTURBANCE = (
    "position_m, heading_rad, measured_position_m, measured_heading_rad, reduced_state, "
    "twist_scale, pushes, "
    "delay_steps, seed"
)


def part_of(text: str):
    return scenario_of_text(SCENARIO + text, name="x.yaml").receding_horizon


def test_all_of_it():
    part = part_of(FULL)
    assert part is not None
    assert (part.step_s, part.steps, part.margin, part.stay) == (0.5, 12, 0.1, True)
    upset = part.disturbance
    assert (upset.position_m, upset.heading_rad) == (0.02, 0.03)
    assert (upset.measured_position_m, upset.measured_heading_rad) == (0.01, 0.04)
    assert upset.twist_scale == (0.9, 1.0, 1.1)
    assert [(push.after_step, push.by) for push in upset.pushes] == [
        (2, (0.1, 0.2, 0.3)),
        (0, (1.0, 0.0, 0.0)),
    ]
    assert (upset.delay_steps, upset.seed) == (1, 7)


def test_what_is_left_out():
    part = part_of("receding_horizon: {step_s: 1}\n")
    assert part is not None
    assert (part.step_s, part.steps, part.margin) == (1.0, None, 0.0)
    assert (part.stay, part.retimed, part.disturbance) == (False, False, None)
    assert part_of("") is None


@pytest.mark.parametrize("text", [FULL, "receding_horizon: {step_s: 1e-1}\n", ""])
def test_there_and_back(text):
    scenario = scenario_of_text(SCENARIO + text, name="x.yaml")
    again = scenario_of_text(to_yaml(scenario), name="y.yaml")
    assert again.receding_horizon == scenario.receding_horizon
    assert to_yaml(again) == to_yaml(scenario)


MALFORMED = {
    "no step": (
        "receding_horizon: {}",
        ":14: receding_horizon: the key 'step_s' is missing, need step_s: time between two plans",
    ),
    "no mapping": ("receding_horizon: 1.0", ":14: receding_horizon: got 1.0, need a mapping"),
    "step of zero": (
        "receding_horizon: {step_s: 0}",
        ":14: receding_horizon.step_s: got 0, need a positive number",
    ),
    "step of nan": (
        "receding_horizon: {step_s: .nan}",
        ":14: receding_horizon.step_s: got nan, need a positive number",
    ),
    "step in words": (
        "receding_horizon: {step_s: 1 s}",
        ":14: receding_horizon.step_s: got '1 s', need a positive number",
    ),
    "half a step": (
        "receding_horizon: {step_s: 1, steps: 2.5}",
        ":14: receding_horizon.steps: got 2.5, need a whole number of at least 1",
    ),
    "no steps": (
        "receding_horizon: {step_s: 1, steps: 0}",
        ":14: receding_horizon.steps: got 0, need a whole number of at least 1",
    ),
    "margin": (
        "receding_horizon: {step_s: 1, margin: -0.1}",
        ":14: receding_horizon.margin: got -0.1, need a finite number of at least 0",
    ),
    "unknown key": (
        "receding_horizon:\n  step_s: 1\n  stpes: 3",
        f":16: receding_horizon.stpes: unknown key; did you mean 'steps'? Known keys: {KEYS}",
    ),
    "unknown key of the disturbance": (
        "receding_horizon:\n  step_s: 1\n  disturbance:\n    positon_m: 3",
        ":17: receding_horizon.disturbance.positon_m: unknown key; did you mean 'position_m'? "
        f"Known keys: {OF_DISTURBANCE}",
    ),
    "negative noise": (
        "receding_horizon: {step_s: 1, disturbance: {position_m: -1}}",
        ":14: receding_horizon.disturbance.position_m: got -1, need a finite number of at least 0",
    ),
    "delay": (
        "receding_horizon: {step_s: 1, disturbance: {delay_steps: 2}}",
        ":14: receding_horizon.disturbance.delay_steps: got 2, need 0 or 1",
    ),
    "seed": (
        "receding_horizon: {step_s: 1, disturbance: {seed: -1}}",
        ":14: receding_horizon.disturbance.seed: got -1, need a whole number of at least 0",
    ),
    "scale": (
        "receding_horizon: {step_s: 1, disturbance: {twist_scale: 0.9}}",
        ":14: receding_horizon.disturbance.twist_scale: got 0.9, need a pose [x, y, heading], a "
        "list of 3 numbers",
    ),
    "push without a step": (
        "receding_horizon: {step_s: 1, disturbance: {pushes: [{by: [1, 0, 0]}]}}",
        ":14: receding_horizon.disturbance.pushes[0]: the key 'after_step' is missing",
    ),
    "push before the first step": (
        "receding_horizon: {step_s: 1, disturbance: {pushes: [{after_step: -1, by: [1, 0, 0]}]}}",
        ":14: receding_horizon.disturbance.pushes[0].after_step: got -1, need a whole number of "
        "at least 0",
    ),
    "push of two numbers": (
        "receding_horizon: {step_s: 1, disturbance: {pushes: [{after_step: 1, by: [1, 0]}]}}",
        ":14: receding_horizon.disturbance.pushes[0].by: got [1, 0], need a pose [x, y, heading]",
    ),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed(case):
    text, message = MALFORMED[case]
    with pytest.raises(InvalidScenario) as caught:
        scenario_of_text(f"{SCENARIO}{text}\n", name="x.yaml")
    assert str(caught.value).startswith(f"x.yaml{message}")
    assert "\n" not in str(caught.value)


def test_two_pushes_after_one_step():
    push = "{after_step: 1, by: [1, 0, 0]}"
    text = f"receding_horizon: {{step_s: 1, disturbance: {{pushes: [{push}, {push}]}}}}\n"
    with pytest.raises(InvalidScenario):
        part_of(text)


def test_editors_know_the_keys(capsys):
    assert run(["schema"]) == 0
    definitions = json.loads(capsys.readouterr().out)["$defs"]
    assert ", ".join(definitions["RecedingHorizonPart"]["properties"]) == KEYS
    assert ", ".join(definitions["Disturbance"]["properties"]) == OF_DISTURBANCE
