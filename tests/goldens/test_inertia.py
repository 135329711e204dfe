"""Vehicles with inertia: at most 0.1 % dearer than the cheapest of five runs of the past."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.goldens.inertia import all_with_inertia
from tests.goldens.measured import LONGER, RUNS, answer, dearer, kept, share_dearer
from tests.quickly import quick_are
from tests.search.cases import compiled_only

SCENES = all_with_inertia()
SHARE = 1e-3


def test_every_scene_is_kept_and_no_other():
    assert list(kept("inertia")) == list(SCENES)


def test_what_is_kept_is_the_cheapest_of_its_runs():
    for name, one in kept("inertia").items():
        if "cost" in one:
            assert one["cost"] == one["costs"][0] == min(one["costs"]), name
            assert len(one["costs"]) >= RUNS, name


@compiled_only
@pytest.mark.parametrize(
    "name", quick_are([n for n, one in SCENES.items() if one.quick], SCENES, exhaustive=True)
)
def test_the_plan_is_not_much_dearer(name):
    before, scene = kept("inertia")[name], SCENES[name]
    most = max(SHARE, dearer().get(name, {"share": 0.0})["share"])
    said = ""
    for longer in LONGER:
        result = answer(replace(scene, time_limit=longer * scene.time_limit))
        if before["status"] != "found":
            assert result.status.value in (before["status"], "found")
            return
        if result.cost is None:
            said = f"{name}: {result.status.value}: {result.reason}"
            continue
        share = share_dearer(result.cost, before["cost"])
        if share <= most:
            return
        said = f"{name}: cost {result.cost} is {share:.3g} dearer than {before['cost']}"
    pytest.fail(said)
