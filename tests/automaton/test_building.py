"""Libraries by optimal control: all pairs, mirror images, parallel, killed and gone on with."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.automaton.building import (
    build_library,
    journal_path,
    read_journal,
)
from maneuver_automaton.automaton.library import automaton_hash, load_library
from maneuver_automaton.errors import UnknownTrim
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import CarWithTrailer, Hovercraft, UserModel
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.connecting import maneuver_defect
from maneuver_automaton.primitives.equilibrium import trims_of

CRAFT = Hovercraft(
    mass=2.0, inertia=0.1, drag=1.0, lateral_drag=3.0, turn_drag=0.1, max_force=4.0,
    max_torque=0.2, max_speed=3.0, max_lateral_speed=1.5,
)  # fmt: skip
TRIMS = trims_of(CRAFT, {"speed": [0.0, 1.5], "turn_rate": [-0.5, 0.0, 0.5]}).trims
SOME = [(TRIMS[1].name, TRIMS[k].name) for k in (4, 5, 3)]  # rest to ahead, left, right

BUILD = """
import sys
from maneuver_automaton.automaton.building import build_library
from tests.automaton.test_building import CRAFT, TRIMS
print("begun", flush=True)
build_library(CRAFT, TRIMS, path=sys.argv[1], jobs=int(sys.argv[2]))
"""


@pytest.mark.slow
def test_all_pairs_with_their_proof():
    build = build_library(CRAFT, TRIMS)
    assert build.failures == ()
    assert len(build.automaton.maneuvers) == 30 == build.solved + build.mirrored
    assert build.mirrored >= 13
    assert build.worst_defect < 1e-6
    for maneuver in build.automaton.maneuvers:
        source, target = build.automaton[maneuver.source], build.automaton[maneuver.target]
        assert maneuver_defect(CRAFT, maneuver, source=source, target=target) < 1e-6


def test_images_are_what_solving_finds():
    with_images = build_library(CRAFT, TRIMS, pairs=SOME)
    without = build_library(CRAFT, TRIMS, pairs=SOME, mirror=False)
    assert (with_images.mirrored, without.mirrored) == (1, 0)
    for a, b in zip(with_images.automaton.maneuvers, without.automaton.maneuvers, strict=True):
        assert (a.name, a.source, a.target) == (b.name, b.source, b.target)
        assert a.duration == pytest.approx(b.duration, rel=1e-5)
        assert a.displacement == pytest.approx(b.displacement, abs=1e-3)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_killed_build_goes_on_and_comes_to_the_same_file(tmp_path):
    whole, killed = tmp_path / "whole.json", tmp_path / "killed.json"
    build_library(CRAFT, TRIMS, path=whole)
    command = [sys.executable, "-c", BUILD, str(killed), "1"]
    root = Path(__file__).parents[2]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(root), *sys.path])}
    with subprocess.Popen(command, cwd=root, env=environment) as process:
        journal = journal_path(killed)
        while process.poll() is None and len(read_journal(journal)) < 4:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    assert not killed.exists()
    before = len(read_journal(journal))
    assert before >= 4
    done = []
    build = build_library(
        CRAFT, TRIMS, path=killed, jobs=2, progress=lambda n, total: done.append((n, total))
    )
    assert build.resumed == before
    assert build.solved + build.resumed + build.mirrored == 30
    assert len(done) == build.solved
    assert done[-1] == (30, 30)
    assert sorted(done) == done
    assert killed.read_bytes() == whole.read_bytes()
    assert not journal.exists()


def test_what_fails_is_named_and_the_rest_is_kept():
    fast = Trim(name="fast", body_velocity=[3.5, 0, 0], control=[3.5, 0], reduced_state=[3.5, 0, 0])
    pairs = [(TRIMS[1].name, "fast"), SOME[0]]
    build = build_library(CRAFT, [*TRIMS, fast], pairs=pairs)
    (failure,) = build.failures
    assert (failure.source, failure.target) == pairs[0]
    assert failure.reason == "trim 'fast': speed = 3.5 is outside [-3, 3]"
    assert [m.target for m in build.automaton.maneuvers] == [SOME[0][1]]


def test_a_trailer_goes_one_way():
    model = CarWithTrailer(
        wheelbase=2.5, hitch_length=3.0, max_steering=0.6, max_speed=3.0, min_speed=-1.0,
        max_hitch=1.0,
    )  # fmt: skip
    trims = trims_of(model, {"speed": [3.0, -1.0], "hitch": [0.0, 0.4]}).trims
    pairs = [(trims[0].name, trims[1].name), (trims[2].name, trims[3].name)]
    ahead, back = build_library(model, trims, pairs=pairs, keep_sign=("speed",)).automaton.maneuvers
    assert ahead.course.control[:, 0].min() >= 0.0
    assert back.course.control[:, 0].max() <= 0.0
    rests = [trim for trim in trims if not trim.reduced_state.any()]
    every = build_library(model, trims, keep_sign=("speed",), mirror=False).automaton
    assert len(rests) == 2
    assert {m.source.split(",")[0] for m in every.maneuvers} == {"speed 3", "speed -1"}
    assert all(m.source.split(",")[0] == m.target.split(",")[0] for m in every.maneuvers)


@pytest.mark.parametrize(
    ("error", "make", "message"),
    [
        (
            ValueError,
            lambda: build_library(CRAFT, TRIMS, pairs=[(TRIMS[0].name, TRIMS[0].name)]),
            "pair ('speed 0, turn_rate -0.5', 'speed 0, turn_rate -0.5'): has one reduced state, "
            "so the vehicle switches at will; need trims of different reduced state",
        ),
        (
            UnknownTrim,
            lambda: build_library(CRAFT, TRIMS[:2], pairs=[("x", TRIMS[0].name)]),
            "no trim 'x' among speed 0, turn_rate -0.5, speed 0, turn_rate 0",
        ),
        (
            ValueError,
            lambda: build_library(CRAFT, TRIMS, pairs=SOME, keep_sign=["speed"]),
            "keep_sign: the hovercraft has no control 'speed', need some of force, torque",
        ),
        (
            ValueError,
            lambda: build_library(CRAFT, TRIMS, pairs=SOME, jobs=0),
            "jobs must be at least 1, got 0",
        ),
    ],
)
def test_what_is_wrong_is_said(error, make, message):
    with pytest.raises(error) as raised:
        make()
    assert str(raised.value) == message


def test_the_library_of_a_users_own_model(tmp_path):
    cart = UserModel(
        name="cart", group=SE2, control_names=("push",), reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, 0.0], dynamics=lambda z, u: [u[0]],
        control_limits=[[-1.0, 1.0]],
    )  # fmt: skip
    trims = [
        Trim(name=f"{v}", body_velocity=[v, 0, 0], control=[0], reduced_state=[v]) for v in (0, 1)
    ]
    path = tmp_path / "cart.json"
    library = build_library(cart, trims, path=path).automaton
    assert len(library.maneuvers) == 2
    assert automaton_hash(load_library(path, model=cart)) == automaton_hash(library)


def test_the_file_reads_back(tmp_path):
    path = tmp_path / "craft.json"
    build = build_library(CRAFT, TRIMS, pairs=SOME, path=path, name="craft")
    read = load_library(path)
    assert read.name == "craft"
    assert read.model == CRAFT
    for a, b in zip(build.automaton.maneuvers, read.maneuvers, strict=True):
        assert np.array_equal(a.displacement, b.displacement)
        # intervals of equal control are one in the file, so samples may lie elsewhere
        same = np.abs(a.course.time[:, None] - b.course.time) < 1e-12
        one, other = np.nonzero(same)
        assert {0, a.course.time.size - 1} <= set(one.tolist())
        assert b.course.pose[other] == pytest.approx(a.course.pose[one], abs=1e-12)
        states = a.course.reduced_state[one]
        assert b.course.reduced_state[other] == pytest.approx(states, abs=1e-12)
