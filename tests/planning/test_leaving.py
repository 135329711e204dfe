"""Plans that begin in contact: out of it by the shortest coast, never deeper, clear of all else."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import shapely

import maneuver_automaton as ma
from maneuver_automaton.cli import run
from maneuver_automaton.collision import Motion, Obstacle
from maneuver_automaton.collision.blocked import Contact
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning import PlanStatus

ROBOT = ma.Automaton.of_controls(
    ma.Unicycle(),
    {"rest": (0, 0), "ahead": (1, 0), "back": (-1, 0), "left": (0, 1), "right": (0, -1)},
)
BODY = ma.Box([0.8, 0.5])
POST = Obstacle(ma.Box([1.0, 1.0], [1.0, 0.2]), name="post")


def problem_of(*obstacles, start=(0.2, 0.0, 0.0), goal=(3.0, 3.0, 0.0), **options):
    options = {"footprint": BODY, "search": ma.SearchSettings(max_expansions=3000)} | options
    return ma.Problem(ROBOT, start, goal, obstacles=obstacles, **options)


def overlaps(problem, poses):
    """Area of the body in each obstacle (n, m), and its distance to each [m]."""
    bodies = shapely.polygons(SE2(poses[:, None, :3]).act(BODY.corners))
    solids = np.array([shapely.Polygon(one.shape.corners) for one in problem.obstacles])
    shared = shapely.intersection(bodies[:, None], solids)
    return shapely.area(shared), shapely.distance(bodies[:, None], solids)


def driven(plan, first):
    """Poses of the first so many seconds of a plan, and of the rest."""
    return (plan.pose_at(np.linspace(*span, 400)) for span in ((0, first), (first, plan.duration)))


def left_after(result):
    """Seconds after which nothing is touched any more, by its note."""
    return float(result.notes[-1].split(" in ")[1].split(" s:")[0])


def test_a_start_in_contact_is_left_backwards():
    problem = problem_of(POST)
    blocked = ma.plan(problem)
    assert blocked.status is PlanStatus.START_BLOCKED
    assert "--leave" in blocked.notes[0]
    result = ma.plan(problem, leave=True)
    assert result.status is PlanStatus.FOUND
    assert result.plan.word[0] == "back"
    assert not ma.verify(problem, result.plan, leave=False).passed
    unsaid = dataclasses.replace(result.plan, notes=())
    assert not ma.verify(problem, unsaid).passed
    for verdict in (ma.verify(problem, result.plan), ma.verify(problem, unsaid, leave=True)):
        assert verdict.passed
        assert verdict.audit.min_clearance_m == result.clearance_m
    (note,) = ma.verify(problem, result.plan).notes
    assert result.notes == (note,)
    assert note.startswith("left the start, which touches post (0.1 m deep, the margin included), ")
    assert result.audit.passed
    assert result.clearance_m > 0.0
    assert result.cost == pytest.approx(problem.cost_of(result.plan))
    assert result.terminal_error.position_m < 1e-9
    _, rest = driven(result.plan, left_after(result) + 1e-3)
    assert overlaps(problem, rest)[1].min() > 0.0


def test_no_coast_is_driven_on_once_a_shorter_one_leads_out(monkeypatch):
    driven_for = []
    coast = Contact.coast

    def counted(self, *arguments):
        for one in coast(self, *arguments):
            driven_for.append(one[1])
            yield one

    monkeypatch.setattr(Contact, "coast", counted)
    controls = {"ahead": (1, 0), "back": (-1, 0), "out": (1, -1)}
    robot = ma.Automaton.of_controls(ma.Unicycle(), controls)
    problem = problem_of(  # along a wall of 40 m, on which it leads on ahead and back
        ma.Box([0.3, 40.0]), start=(0.4, 0.0, np.pi / 2), footprint=ma.Disc(0.3)
    )
    problem = dataclasses.replace(problem, automaton=robot)
    result = ma.plan(problem, leave=True)
    assert result.plan.word[0] == "out"
    assert max(driven_for) < 0.5  # [m]; out after 0.43


@pytest.mark.parametrize(
    ("word", "times"),
    [(("ahead", "back"), (0.05, 3.0)), (("rest",), (1.0,)), (("back",), (0.05,))],
    ids=["deeper first", "stays", "not yet out"],
)
def test_what_gets_deeper_or_stays_is_refused(word, times):
    trims = {trim.name: trim for trim in ROBOT.trims}
    plan = ma.Plan([0.2, 0.0, 0.0], [trims[name] for name in word], durations=times)
    verdict = ma.verify(problem_of(POST, goal=plan.end), plan, leave=True)
    assert not verdict.passed
    assert verdict.reason.startswith("what is touched at the start is touched deeper, or still, ")


def test_a_thin_wall_is_not_driven_through():
    wall = Obstacle(ma.Box([0.04, 3.0], [0.5, 0.0]), name="wall")
    result = ma.plan(problem_of(wall, goal=(-3.0, 0.0, 0.0)), leave=True)
    assert result.plan.word[0] == "back"
    behind = Obstacle(ma.Box([0.2, 3.0], [-0.4, 0.0]), name="behind")
    result = ma.plan(problem_of(wall, behind, goal=(3.0, 0.0, 0.0)), leave=True)
    assert result.status is PlanStatus.START_BLOCKED
    assert result.reason.endswith("no coast of one trim or two leads out, clear of all else")


def test_a_margin_is_left_as_well():
    near = Obstacle(ma.Box([1.0, 1.0], [1.15, 0.0]), name="near")
    result = ma.plan(problem_of(near, margin=0.2), leave=True)
    assert result.plan.word[0] == "back"
    assert result.clearance_m > 0.2


def test_two_trims_where_one_does_not_do():
    """It stands askew between two beams, in one of them: it turns, then backs out."""
    beams = [Obstacle(ma.Box([2.0, 0.1], [0.2, y]), name=str(y)) for y in (0.33, -0.42)]
    problem = problem_of(*beams, start=(0.2, 0.0, 0.12), goal=(-3.0, 0.0, 0.0))
    result = ma.plan(problem, leave=True)
    assert result.status is PlanStatus.FOUND
    assert result.plan.word[0] == "right"
    ahead = np.linspace(0.0, result.plan.duration, 2000)
    areas, _ = overlaps(problem, result.plan.pose_at(ahead))
    assert (np.diff(areas, axis=0) <= 1e-9).all()


def test_two_trims_where_the_shortest_coast_hits_another():
    """Behind it stands a post a hand away: it turns out of the beam at its side, if not back."""
    beam = Obstacle(ma.Box([2.0, 0.1], [1.2, 0.28]), name="beam")
    behind = Obstacle(ma.Box([0.1, 0.1], [-0.3, 0.0]), name="behind")
    problem = problem_of(beam, behind, start=(0.2, 0.0, 0.0), goal=(3.0, -2.0, 0.0))
    result = ma.plan(problem, leave=True)
    assert result.status is PlanStatus.FOUND
    poses = result.plan.pose_at(np.linspace(0.0, result.plan.duration, 3000))
    areas, distances = overlaps(problem, poses)
    assert distances[:, 1].min() > 0.0
    assert areas[-1].max() == 0.0


def test_a_free_start_is_planned_as_ever():
    problem = problem_of(POST, start=(-1.0, 0.0, 0.0))
    one, other = ma.plan(problem), ma.plan(problem, leave=True)
    assert (one.cost, one.plan.word, other.notes) == (other.cost, other.plan.word, ())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"horizon": ma.Horizon(time=9.0)}, "the time is fixed"),
        (
            {"obstacles": (POST, Obstacle(ma.Disc(0.1), motion=Motion([0, 1], [[9, 9, 0]] * 2)))},
            "an obstacle moves",
        ),
    ],
)
def test_where_no_way_out_is_looked_for(change, said):
    result = ma.plan(dataclasses.replace(problem_of(POST), **change), leave=True)
    assert result.status is PlanStatus.START_BLOCKED
    assert result.reason == (
        f"at the start the vehicle touches obstacle 'post'; no way out is looked for where {said}"
    )


@pytest.mark.parametrize("seed", range(8))
def test_drawn_scenes_are_left_never_deeper_and_moved_alike(seed):
    rng = np.random.default_rng(seed)
    boxes = [
        ma.Box(rng.uniform(0.1, 1.5, 2), [x, y], rng.uniform(-3, 3))
        for x, y in rng.uniform(-2.0, 2.0, (5, 2))
    ]
    near = ma.Box(rng.uniform(0.3, 1.0, 2), rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3))
    solids = [Obstacle(box, name=str(k)) for k, box in enumerate([near, *boxes])]
    start = np.array([0.0, 0.0, rng.uniform(-3, 3)])
    problem = problem_of(*solids, start=start, goal=(4.0, 4.0, 0.0))
    _, apart = overlaps(problem, start[None])
    result = ma.plan(problem, leave=True)
    if result.plan is None or not result.notes:
        assert apart.min() > 0.0 or result.reason
        return
    touched = apart[0] == 0.0
    first, rest = driven(result.plan, left_after(result) + 1e-3)
    areas, distances = overlaps(problem, first)
    assert (areas[-1][touched] == 0.0).all()
    assert distances[:, ~touched].min(initial=np.inf) > 0.0
    assert overlaps(problem, rest)[1].min() > 0.0
    by = SE2(np.array([30.0, -20.0, 1.0]))
    moved = ma.plan(problem.moved(by), leave=True)
    assert moved.plan.word == result.plan.word
    np.testing.assert_allclose(moved.plan.durations, result.plan.durations, atol=1e-6)


SCENE = """\
schema: 1
vehicle: {model: unicycle, footprint: {rectangle_m: [0.8, 0.5]}}
automaton: {trims: [{name: ahead, control: [1, 0]}, {name: back, control: [-1, 0]},
                    {name: left, control: [0, 1]}, {name: right, control: [0, -1]}]}
start: {pose: [0.2, 0, 0]}
goal: {pose: [-2, 0, 0]}
obstacles: [{map: keepout.yaml, unknown: free}]
search: {time_limit_s: 1}
"""


def test_a_start_in_a_keep_out_mask_on_the_command_line(tmp_path, capsys):
    (tmp_path / "keepout.pgm").write_bytes(b"P5 8 4 255\n" + (b"\xff" * 4 + b"\x00" * 4) * 4)
    (tmp_path / "keepout.yaml").write_text(
        "image: keepout.pgm\nmode: Scale\nresolution: 0.25\norigin: [-0.5, -0.5, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    (tmp_path / "scene.yaml").write_text(SCENE)
    command = ["plan", str(tmp_path / "scene.yaml"), "--no-plot", "--out", str(tmp_path / "out")]
    assert run(command) == 1
    assert "start_blocked: at the start the vehicle touches map keepout.yaml" in (
        capsys.readouterr().err
    )
    assert run([*command, "--leave"]) == 0
    document = json.loads((tmp_path / "out" / "plan.json").read_text())
    (note,) = document["notes"]
    assert note.startswith("left the start, which touches keepout.yaml (0.1 m deep, ")
    assert note in " ".join(capsys.readouterr().out.split())  # it is folded
    assert [one["name"] for one in document["primitives"]] == ["back"]
    assert document["audit"]["passed"] is True
    check = ["check", str(tmp_path / "out" / "plan.json"), "--with", str(tmp_path / "scene.yaml")]
    assert run(check) == 0
    assert note in " ".join(capsys.readouterr().out.split())
    document["notes"] = []
    (tmp_path / "out" / "plan.json").write_text(json.dumps(document))
    assert (run(check), run([*check, "--leave"])) == (1, 0)


@pytest.mark.parametrize("name", ["fleets/airfield.yaml", "road.xml"])
def test_the_option_is_for_one_vehicle_off_the_road(name, capsys):
    path = Path(__file__).parents[2] / "scenarios" / name
    assert run(["plan", str(path), "--leave"]) == 2
    assert capsys.readouterr().err.startswith("--leave: is for one vehicle off the road, but ")
