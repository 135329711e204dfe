from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.formats.plan_json import plan_of_document
from maneuver_automaton.plotting.colors import trim_colors
from maneuver_automaton.plotting.track import track_of_plan
from tests.plotting.cases import document_of, flight_plan, parking_plan, plan_of, plan_of_trims


@pytest.mark.parametrize("plan", [parking_plan(), flight_plan(), plan_of_trims(12)])
def test_a_file_gives_the_track_of_its_plan(plan):
    of_plan, of_file = track_of_plan(plan), track_of_plan(plan_of_document(document_of(plan)))
    assert [piece.name for piece in of_file.pieces] == [piece.name for piece in of_plan.pieces]
    np.testing.assert_allclose(of_file.switching_times, of_plan.switching_times)
    np.testing.assert_allclose(of_file.switching_poses, plan.switching_poses, atol=1e-12)
    assert of_file.size == pytest.approx(of_plan.size, rel=1e-3)
    for piece, trim in zip(of_file.pieces, plan.trims, strict=True):
        np.testing.assert_allclose(piece.twist, trim.body_velocity, atol=1e-10)
        np.testing.assert_array_equal(
            piece.control, np.broadcast_to(trim.control, (len(piece.time), trim.control.size))
        )
    colors = trim_colors(of_plan.twists)
    for name, color in trim_colors(of_file.twists).items():
        np.testing.assert_allclose(color, colors[name], atol=2e-4)


def test_trims_of_no_duration_are_left_out():
    plan = plan_of(["straight", "spin", "straight"], [1.0, 0.0, 2.0])
    assert [piece.name for piece in track_of_plan(plan).pieces] == ["straight", "straight"]
    assert [piece.name for piece in track_of_plan(plan_of_document(document_of(plan))).pieces] == [
        "straight",
        "straight",
    ]


def test_the_origin_of_a_file_is_added():
    document = document_of(parking_plan())
    document["trajectory"]["origin"] = [4e6, -5.0]
    track = track_of_plan(plan_of_document(document))
    np.testing.assert_allclose(track.start, [4e6, -4.0, 0.0])


def test_a_maneuver_in_a_file_keeps_its_varying_control():
    document = document_of(plan_of(["straight"], [1.0]), rate=4.0)
    document["primitives"][0] |= {"kind": "maneuver", "source": "rest", "target": "rest"}
    document["trajectory"]["control"] = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [9.0, 0.0]]
    (piece,) = track_of_plan(plan_of_document(document)).pieces
    assert piece.control[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 3.0]


def maneuver_of(plan, *, name):
    """The file of a plan in which all of it is one maneuver."""
    document = document_of(plan, rate=50.0)
    ends = {"source": "rest", "target": "rest"}
    entry = {"kind": "maneuver", "name": name, "duration_s": plan.duration}
    document["primitives"] = [entry | ends]
    return track_of_plan(plan_of_document(document))


def test_a_long_motion_is_told_apart_by_gear_and_turn():
    word = ["straight", "clockwise", "anticlockwise", "straight"]
    plan = plan_of(word, [1.0, 0.8, 1.2, 1.0])
    track = maneuver_of(plan, name="polished")
    ahead, left, right = (
        "polished, ahead", "polished, back, turning left", "polished, back, turning right",
    )  # fmt: skip
    assert [piece.name for piece in track.pieces] == [ahead, right, left, ahead]
    np.testing.assert_allclose(track.switching_times, [0.0, 1.0, 1.8, 3.0, 4.0], atol=0.05)
    np.testing.assert_allclose(track.end, plan.end, atol=1e-9)


def test_a_maneuver_of_one_turn_is_one_piece():
    (piece,) = maneuver_of(plan_of(["clockwise"], [1.0]), name="to a curve").pieces
    assert piece.name == "to a curve"
    (piece,) = maneuver_of(plan_of(["straight"], [1.0]), name="polished").pieces
    assert piece.name == "polished, ahead"  # never alone: it says little


def test_what_takes_next_to_no_time_is_not_seen():
    track = track_of_plan(plan_of(["spin", "straight", "rest"], [1e-3, 4.0, 1.0]))
    assert track.seen == {"straight", "rest"}
