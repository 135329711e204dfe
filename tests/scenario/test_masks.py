"""Speed masks and keep-out masks of Nav2 in a scenario file."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from PIL import Image

import maneuver_automaton as ma
from maneuver_automaton.formats.nav2_map import Mask, load_nav2_mask
from maneuver_automaton.groups import SE2
from maneuver_automaton.scenario.writing import to_yaml
from tests.formats.outside import message_of

HEADER = """\
image: speed.png
mode: scale
resolution: 0.5
origin: [-1.0, -1.0, 0.0]
negate: 0
occupied_thresh: 1.0
free_thresh: 0.0
"""
SCENE = """\
schema: 1
vehicle: {model: unicycle, footprint: {rectangle_m: [0.4, 0.3]}}
automaton:
  trims:
    - {name: fast, control: [2.0, 0]}
    - {name: slow, control: [0.5, 0]}
    - {name: left, control: [0, 1.0]}
    - {name: right, control: [0, -1.0]}
start: {pose: [-0.5, 0, 0]}
goal: {pose: [6, 0, 0]}
obstacles:
  - {map: keepout.yaml, unknown: free}
zones:
  - {map: speed.yaml, speed_limit: {base: 100.0, multiplier: -1.0, unit: percent}}
bounds_m: {y: [-1, 1]}
search: {time_limit_s: 60, max_expansions: 2000}
"""


@pytest.fixture
def scene(tmp_path):
    """A mask of 75 % where 2 <= x <= 4, and a keep-out mask above y = 1."""
    mask = np.zeros((4, 16), dtype=np.uint8)
    mask[:, 6:10] = 75
    grey = (255 - np.round(2.55 * mask)).astype(np.uint8)
    Image.fromarray(grey).save(tmp_path / "speed.png")
    Image.fromarray(np.full((2, 16), 0, dtype=np.uint8)).save(tmp_path / "keepout.png")
    (tmp_path / "speed.yaml").write_text(HEADER)
    keepout = HEADER.replace("speed.png", "keepout.png").replace("-1.0, 0.0]", "1.0, 0.0]")
    (tmp_path / "keepout.yaml").write_text(keepout)
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def test_a_mask_slows_what_it_covers(scene):
    problem = ma.load_scenario(scene).problem
    (zone,) = problem.zones
    assert zone.max_speed == 0.5  # 25 % of 2 m/s
    assert zone.name == "zone 1, value 75"
    assert shapely.Polygon(zone.shape.corners).equals(shapely.box(2.0, -1.0, 4.0, 1.0))
    assert problem.obstacles[0].blocked.all()
    result = ma.plan(problem, time_limit=60.0)
    assert result.cost == pytest.approx(4.1 / 2.0 + 2.4 / 0.5, abs=0.1)  # the body is 0.4 m long
    for time in np.linspace(0.0, result.plan.duration, 300):
        x = result.plan.pose_at(time)[0]
        if 1.8 < x < 4.2 and time < result.plan.duration - 0.01:
            ahead = result.plan.pose_at(time + 0.005)[0]
            assert ahead - x <= 0.5 * 0.005 + 1e-9


@pytest.mark.parametrize(
    ("limit", "speed"),
    [
        ("{base: 0.0, multiplier: 0.01, unit: m_s}", 0.75),
        ("{base: 0.0, multiplier: 1.0, unit: percent}", 1.5),
        ("{base: 100.0, multiplier: -1.0}", 0.5),
        ("{base: 75.0, multiplier: -1.0}", None),  # 0 says no limit to Nav2
        ("{base: 100.0, multiplier: 1.0}", None),  # and so does more than 100 %
        ("{base: -10.0, multiplier: 0.1, unit: m_s}", None),
    ],
)
def test_what_a_value_says(scene, limit, speed):
    scene.write_text(SCENE.replace("{base: 100.0, multiplier: -1.0, unit: percent}", limit))
    zones = ma.load_scenario(scene).problem.zones
    assert [zone.max_speed for zone in zones] == ([] if speed is None else [speed])


@pytest.mark.parametrize(
    ("mode", "values"),
    [
        # occupancies of 0, 0.2, 0.5, 0.8, 1; thresholds 0.25 and 0.65
        ("trinary", [0, 0, -1, 100, 100]),
        ("Scale", [0, 0, 62, 100, 100]),
        ("RAW", [-1, -1, -1, 51, 0]),
    ],
)
def test_the_values_of_a_mask(tmp_path, mode, values):
    grey = np.array([[255, 204, 128, 51, 0]], dtype=np.uint8)
    Image.fromarray(grey).save(tmp_path / "speed.png")
    header = HEADER.replace("1.0\n", "0.65\n").replace("free_thresh: 0.0", "free_thresh: 0.25")
    path = tmp_path / "speed.yaml"
    path.write_text(header.replace("scale", mode))
    assert load_nav2_mask(path).values.tolist() == [values]


def test_transparent_cells_of_a_scale_mask_are_unknown(scene):
    pixels = np.full((4, 16, 4), 255, dtype=np.uint8)
    pixels[0, 0, 3] = 254
    Image.fromarray(pixels).save(scene.parent / "speed.png")
    said = message_of(ma.load_scenario, scene, SCENE)
    assert said.startswith(":14: zones[0].map: ")
    assert said.endswith("speed.yaml: 1 cells are unknown, need a value in every cell")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (", speed_limit: {base: 100.0, multiplier: -1.0, unit: percent}", "",
         ":14: zones[0]: map: needs speed_limit: {base, multiplier, unit}"),
        ("speed.yaml,", "nowhere.yaml,", "nowhere.yaml: no such file"),
        ("unit: percent", "unit: knots", "got 'knots', need percent or m_s"),
        ("map: speed.yaml,", "", "got none, need exactly one of polygon_m, map"),
        ("map: speed.yaml,", "map: speed.yaml, max_speed_m_s: 1,",
         "zones[0].max_speed_m_s: goes with polygon_m only"),
    ],
)  # fmt: skip
def test_bad_masks_are_told_in_one_line(scene, old, new, said):
    assert said in message_of(ma.load_scenario, scene, SCENE.replace(old, new, 1))


def test_too_many_regions_are_refused(scene):
    chess = np.where(np.indices((16, 16)).sum(axis=0) % 2, 255, 100).astype(np.uint8)
    Image.fromarray(chess).save(scene.parent / "speed.png")
    said = message_of(ma.load_scenario, scene, SCENE)
    assert said.endswith("speed.yaml: has 128 regions of one value, need at most 64")


@pytest.mark.parametrize("seed", range(6))
def test_regions_are_exactly_the_cells(seed):
    rng = np.random.default_rng(seed)
    values = rng.choice([0, 0, 20, 50], size=(9, 12))
    mask = Mask(values, 0.25, (2.0, -1.0, 0.7))
    covered = {
        value: shapely.union_all(
            [
                shapely.Polygon(polygon.corners, polygon.holes)
                for one, polygon in mask.regions()
                if one == value
            ]
        )
        for value in (20, 50)
    }
    rows, columns = np.indices(values.shape)
    middles = SE2(np.array(mask.origin)).act(
        0.25 * np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=-1)
    )
    for value, area in covered.items():
        inside = shapely.contains_xy(area, *middles.T)
        assert inside.tolist() == (values.ravel() == value).tolist()
        assert area.area == pytest.approx(0.0625 * (values == value).sum())


def test_a_zone_with_a_hole_is_written_and_read_back(scene):
    ring = np.full((4, 16), 255, dtype=np.uint8)
    ring[:, 6:10] = 64
    ring[1:3, 7:9] = 255
    Image.fromarray(ring).save(scene.parent / "speed.png")
    scenario = ma.load_scenario(scene)
    again = scene.parent / "again.yaml"
    again.write_text(to_yaml(scenario, folder=scene.parent))
    (one,), (other,) = scenario.problem.zones, ma.load_scenario(again).problem.zones
    assert [hole.tolist() for hole in one.shape.holes] == [
        hole.tolist() for hole in other.shape.holes
    ]
    assert one.max_speed == other.max_speed
