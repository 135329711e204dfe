"""Maps of Nav2: what a pixel means, which way is up, and what is wrong with a file."""

from __future__ import annotations

import os
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.formats.nav2_map import load_nav2_map, save_nav2_map
from tests.formats.outside import DATA, message_of, needs_data

HEADER = """\
image: room.pgm
resolution: 0.5
origin: [1.0, 2.0, 0.25]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
PIXELS = b"\x00\x59\x5a\xbf\xc0\xff"  # 0, 89, 90, 191, 192, 255


def room(folder, header=HEADER, image=b"P5 3 2 255\n" + PIXELS, name="room.pgm"):
    """A map of two rows: 0, 89, 90 above 191, 192, 255."""
    (folder / name).write_bytes(image)
    path = folder / "room.yaml"
    path.write_text(header)
    return path


def test_thresholds_and_the_way_up(tmp_path):
    path = room(tmp_path)
    strict = load_nav2_map(path)
    # 1 - 89/255 = 0.651 is blocked, 1 - 90/255 = 0.647 unknown, 1 - 191/255 = 0.251 unknown
    assert strict.blocked.tolist() == [[True, False, False], [True, True, True]]
    lenient = load_nav2_map(path, unknown="free")
    assert lenient.blocked.tolist() == [[False, False, False], [True, True, False]]
    assert strict.resolution == 0.5
    assert strict.origin.tolist() == [1.0, 2.0, 0.25]
    assert strict.name == "room.yaml"


@pytest.mark.parametrize("word", ["1", "true", "yes"])
def test_negate(tmp_path, word):
    path = room(tmp_path, HEADER.replace("negate: 0", f"negate: {word}"))
    cells = load_nav2_map(path, unknown="free")
    assert cells.blocked.tolist() == [[True, True, True], [False, False, False]]


def test_at_a_threshold(tmp_path):
    header = HEADER.replace("0.65", "1.0").replace("0.25\n", "0.0\n")
    path = room(tmp_path, header, b"P5 3 1 255\n\x00\x01\xff")
    assert load_nav2_map(path).blocked.tolist() == [[True, True, False]]
    assert load_nav2_map(path, unknown="free").blocked.tolist() == [[True, False, False]]


def test_scale_counts_as_trinary(tmp_path):
    trinary = load_nav2_map(room(tmp_path)).blocked.tolist()
    assert load_nav2_map(room(tmp_path, HEADER + "mode: scale\n")).blocked.tolist() == trinary


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_the_case_of_the_mode_does_not_count(tmp_path, mode):
    plain = load_nav2_map(room(tmp_path, HEADER + f"mode: {mode}\n")).blocked.tolist()
    for word in (mode.capitalize(), mode.upper(), mode[0] + mode[1:].upper()):
        assert load_nav2_map(room(tmp_path, HEADER + f"mode: {word}\n")).blocked.tolist() == plain


def test_raw_values_are_percent(tmp_path):
    path = room(tmp_path, HEADER + "mode: raw\n", bytes([*b"P5 5 1 255\n", 0, 30, 65, 100, 101]))
    assert load_nav2_map(path).blocked.tolist() == [[False, True, True, True, True]]
    assert load_nav2_map(path, unknown="free").blocked.tolist() == [
        [False, False, True, True, False]
    ]


@pytest.mark.parametrize(
    "image",
    [
        b"P5\n3 2\n255\n" + PIXELS,
        b"P5\r\n3 2\r\n255\r\n" + PIXELS,
        b"P5\n# CREATOR: a \xff program\n3 # wide\n2\n#\n255\n" + PIXELS,
        b"P5 3 2 65535\n" + b"".join(bytes([v, v]) for v in PIXELS),
        b"P2\n3 2 255\n0 89 90\n191 192 # bright\n255\n",
        b"P2 3 2 255 0 89 90 191 192 255",
        b"P5 3 2 255\n" + PIXELS + b"\n",
    ],
    ids=["unix", "windows", "comments", "16 bit", "text", "one line", "line end"],
)
def test_kinds_of_pgm(tmp_path, image):
    cells = load_nav2_map(room(tmp_path, image=image))
    assert cells.blocked.tolist() == [[True, False, False], [True, True, True]]


@pytest.mark.parametrize("ending", ["png", "bmp", "PNG"])
@pytest.mark.parametrize("mode", ["L", "RGB", "P"])
def test_png_and_bmp(tmp_path, ending, mode):
    name = f"room.{ending}"
    pixels = np.frombuffer(PIXELS, dtype=np.uint8).reshape(2, 3)
    Image.fromarray(pixels).convert(mode).save(tmp_path / name)
    content = (tmp_path / name).read_bytes()
    path = room(tmp_path, HEADER.replace("room.pgm", name), content, name)
    assert load_nav2_map(path).blocked.tolist() == [[True, False, False], [True, True, True]]


def test_png_of_16_bit(tmp_path):
    deep = np.array([[0, 65535]], dtype=np.uint16)
    Image.fromarray(deep).save(tmp_path / "a.png")
    path = room(tmp_path, HEADER.replace("room.pgm", "a.png"))
    assert load_nav2_map(path).blocked.tolist() == [[True, False]]


def test_transparent_pixels_are_unknown(tmp_path):
    pixels = np.array([[[255, 255, 255, 255], [255, 255, 255, 254], [0, 0, 0, 0]]], dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    path = room(tmp_path, HEADER.replace("room.pgm", "a.png"))
    assert load_nav2_map(path).blocked.tolist() == [[False, True, True]]
    assert load_nav2_map(path, unknown="free").blocked.tolist() == [[False, False, False]]


def test_the_image_is_found_from_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    (tmp_path / "maps").mkdir()
    room(tmp_path)
    path = tmp_path / "maps" / "room.yaml"
    path.write_text(HEADER.replace("room.pgm", "~/room.pgm"))
    assert load_nav2_map(path).blocked.shape == (2, 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("image: room.pgm\n", "", ":1: the key 'image' is missing: a map needs image, "
         "resolution, origin, negate, occupied_thresh, free_thresh"),
        ("negate: 0\n", "", ":1: the key 'negate' is missing: a map needs image, resolution, "
         "origin, negate, occupied_thresh, free_thresh"),
        ("room.pgm", "3", ":1: image: got 3, need the name of an image file"),
        ("room.pgm", "''", ":1: image: got '', need the name of an image file"),
        ("resolution: 0.5", "resolution: 0",
         ":2: resolution: got 0 m, need a size of 1e-06 to 1e+06 m"),
        ("resolution: 0.5", "resolution: -1",
         ":2: resolution: got -1 m, need a size of 1e-06 to 1e+06 m"),
        ("resolution: 0.5", "resolution: .nan",
         ":2: resolution: got nan, need a finite number"),
        ("resolution: 0.5", "resolution: '0.5'",
         ":2: resolution: got '0.5', need a finite number"),
        ("[1.0, 2.0, 0.25]", "[1.0, 2.0]", ":3: origin: got [1.0, 2.0], need [x, y, yaw]"),
        ("[1.0, 2.0, 0.25]", "[1.0, x, 0]", ":3: origin[1]: got 'x', need a finite number"),
        ("[1.0, 2.0, 0.25]", "[1e300, 2, 0]",
         ":3: origin[0]: got 1e+300, need at most 5e+11 in size"),
        ("negate: 0", "negate: 2", ":4: negate: got 2, need 0 or 1"),
        ("negate: 0", "negate: []", ":4: negate: got [], need 0 or 1"),
        ("0.65", "65", ":5: occupied_thresh: got 65, need a number from 0 to 1"),
        ("0.65", "0.2", ":6: free_thresh: got 0.25, need at most occupied_thresh, 0.2"),
        ("0.65\n", "0.65\nmode: quaternary\n",
         ":6: mode: got 'quaternary', need one of trinary, scale, raw"),
        ("0.65\n", "0.65\nmode: [raw]\n",
         ":6: mode: got ['raw'], need one of trinary, scale, raw"),
        (HEADER, "- 1\n", ": is no map, need YAML with the keys image, resolution, origin, negate, "
         "occupied_thresh, free_thresh"),
        (HEADER, "", ": is empty, need a map"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_the_yaml(tmp_path, old, new, message):
    path = room(tmp_path)
    assert HEADER.count(old) == 1
    assert message_of(load_nav2_map, path, HEADER.replace(old, new)) == message


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (b"", "is no image that this version reads, need PGM that begins with P2 or P5, width, "
         "height and greatest value, or PNG or BMP with that ending"),
        (b"P6 3 2 255\n" + PIXELS * 3, "is no image that this version reads, need PGM that "
         "begins with P2 or P5, width, height and greatest value, or PNG or BMP with that ending"),
        (b"P5 3 2 255\n" + PIXELS[:4], "got 4 bytes of pixels, need 6: the file is cut off"),
        (b"P5 3 2 65535\n" + PIXELS, "got 6 bytes of pixels, need 12: the file is cut off"),
        (b"P5 3 2 255\n" + PIXELS + b"abc",
         "got 9 bytes of pixels, need 6: the rest belongs to nothing"),
        (b"P5 3 0 255\n", "got 3 x 0 cells, need at least one"),
        (b"P5 100000 100000 255\n", "got 100000 x 100000 cells, need at most 50 million"),
        (b"P5 999999999 999999999 255\n",
         "got 999999999 x 999999999 cells, need at most 50 million"),
        (b"P5 3 2 0\n" + PIXELS, "got a greatest value of 0, need 1 to 65535"),
        (b"P5 3 2 70000\n" + PIXELS, "got a greatest value of 70000, need 1 to 65535"),
        (b"P5 3 2 100\n" + PIXELS,
         "got the value 255, need at most 100, the greatest that its header states"),
        (b"P2 3 2 255\n1 2 3 4 5", "got 5 pixels, need 6"),
        (b"P2 3 2 255\n1 2 3 4 5 x", "got 'x' as a pixel, need a whole number"),
        (b"P2 3 2 255\n1 2 3 4 5 -6", "got -6 as a pixel, need a whole number"),
        (b"P2 3 2 255\n1 2 3 4 5 " + b"9" * 30,
         "got '99999999999999999999' as a pixel, need a whole number"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_the_image(tmp_path, image, message):
    path = room(tmp_path, image=image)
    said = complaint(tmp_path, path, HEADER)
    assert said == f"room.pgm: {message}"


def complaint(folder, path, header):
    """What is said of the image, after the line of the YAML file that names it."""
    said = message_of(load_nav2_map, path, header)
    before = f":1: image: {folder}{os.sep}"
    assert said.startswith(before)
    return said.removeprefix(before)


@pytest.mark.parametrize("content", [b"", b"nonsense", b"\x89PNG\r\n\x1a\n", b"BM"])
@pytest.mark.parametrize("ending", ["png", "bmp"])
def test_a_damaged_picture_is_one_line(tmp_path, ending, content):
    name = f"room.{ending}"
    path = room(tmp_path, HEADER.replace("room.pgm", name), content, name)
    said = complaint(tmp_path, path, HEADER.replace("room.pgm", name))
    assert said.startswith(f"{name}: cannot be read as an image")


def test_a_picture_that_is_cut_off(tmp_path):
    Image.fromarray(np.zeros((50, 50), dtype=np.uint8)).save(tmp_path / "a.png")
    whole = (tmp_path / "a.png").read_bytes()
    header = HEADER.replace("room.pgm", "a.png")
    for n in (20, 40, len(whole) - 20):
        path = room(tmp_path, header, whole[:n], "a.png")
        said = complaint(tmp_path, path, header)
        assert said.startswith("a.png: cannot be read as an image")


def test_a_picture_with_too_many_pixels(tmp_path):
    """Its header says so; the pixels are never read."""
    header = HEADER.replace("room.pgm", "a.bmp")
    Image.fromarray(np.zeros((1, 1), dtype=np.uint8)).save(tmp_path / "a.bmp")
    small = (tmp_path / "a.bmp").read_bytes()
    for size, message in (
        ((10_000, 10_000), "got 10000 x 10000 cells, need at most 50 million"),
        ((20_000, 10_000), "has too many pixels"),
    ):
        (tmp_path / "a.bmp").write_bytes(small[:18] + struct.pack("<ii", *size) + small[26:])
        said = complaint(tmp_path, tmp_path / "room.yaml", header)
        assert said == f"a.bmp: {message}"


@pytest.mark.parametrize("name", ["nowhere.pgm", "nowhere.png", "."])
def test_a_missing_image(tmp_path, name):
    header = HEADER.replace("room.pgm", name)
    path = room(tmp_path, header)
    said = message_of(load_nav2_map, path, header)
    missing = f"{tmp_path / name}: {'is a folder, need a file' if name == '.' else 'no such file'}"
    assert said == f":1: image: {missing}"


finite = st.floats(-1e6, 1e6)


@given(
    cells=arrays(np.bool_, st.tuples(st.integers(1, 6), st.integers(1, 6))),
    resolution=st.floats(1e-6, 1e6),
    origin=st.tuples(finite, finite, finite),
    unknown=st.sampled_from(["blocked", "free"]),
)
def test_any_map_comes_back(tmp_path_factory, cells, resolution, origin, unknown):
    path = tmp_path_factory.mktemp("map") / 'a "room" \\ of ours.yaml'
    saved = OccupancyMap(cells, resolution=resolution, origin=origin)
    save_nav2_map(saved, path)
    read = load_nav2_map(path, unknown=unknown)
    assert read.blocked.tolist() == saved.blocked.tolist()
    assert (read.resolution, read.origin.tolist()) == (saved.resolution, saved.origin.tolist())


@needs_data
@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("tb3_sandbox", (384, 384)),
        ("depot", (307, 604)),
        ("depot_keepout", (307, 604)),
        ("100by100_10", (2000, 2000)),
    ],
)
def test_maps_of_nav2(name, shape):
    cells = load_nav2_map(DATA / "nav2-maps" / f"{name}.yaml")
    assert cells.blocked.shape == shape
    assert cells.resolution == 0.05
    if name == "100by100_10":  # random boxes, 10 % occupied
        assert cells.blocked.mean() == pytest.approx(0.1, abs=0.02)
    if name == "tb3_sandbox":  # mostly unknown
        assert cells.blocked.mean() > 0.5
        free = load_nav2_map(DATA / "nav2-maps" / f"{name}.yaml", unknown="free")
        assert free.blocked.mean() < 0.1
        assert cells.origin.tolist() == [-10.0, -10.0, 0.0]
        assert not cells.blocked[int(10.5 / 0.05), int(8.0 / 0.05)]  # where the robot starts
