"""Files of any format, damaged at random: a problem, or one line that names the file."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.scenario import load_scenario
from tests.formats import (
    test_cl_cbs,
    test_dynobench,
    test_movingai,
    test_nav2_map,
    test_poses_csv,
    test_sbpl_cfg,
    test_tpcap,
)
from tests.quickly import draws
from tests.scenario import test_fleet
from tests.scenario.files import SCENARIO
from tests.scenario.test_loading import BESIDE
from tests.scenario.test_obstacles import WORLD

WORDS = [
    b"", b" ", b"\n", b"\r\n", b"\t", b"\x00", b"\xff", b",", b":", b"[", b"{}", b"#", b"&a", b"*a",
    b"<", b'"', b"/", b"..", b"x", b"nan", b"inf", b"null", b"true", b"-1", b"0", b"1e999",
    b"1e308", b"-1e300", b"1e-320", b"99999999999999999999", b"50000 50000", b"1_0", b"0x10",
    "\u0663".encode(), "\u2028".encode(),
]  # fmt: skip


def picture(ending: str) -> bytes:
    pixels = np.arange(42, dtype=np.uint8).reshape(6, 7)
    content = io.BytesIO()
    Image.fromarray(pixels).convert("RGBA" if ending == "PNG" else "L").save(content, ending)
    return content.getvalue()


NAV2 = test_nav2_map.HEADER
# The damaged file, its content, and the file that is loaded.
FILES = {
    "Case0.csv": (test_tpcap.CASE.encode(), "Case0.csv"),
    "poses.csv": (test_poses_csv.TABLE.encode(), "poses.csv"),
    "yard.yaml": (test_dynobench.PROBLEM.encode(), "yard.yaml"),
    "models/unicycle1_v0.yaml": (test_dynobench.MODEL.encode(), "yard.yaml"),
    "room.cfg": (test_sbpl_cfg.NAV3D.encode(), "room.cfg"),
    "flat.env": (test_sbpl_cfg.NAV2D.encode(), "flat.env"),
    "room.map": (test_movingai.MAP.encode(), "room.map"),
    "room.map.scen": (test_movingai.SCEN.encode(), "room.map.scen"),
    "room.pgm": (b"P5 3 2 255\n" + test_nav2_map.PIXELS, "nav.yaml"),
    "text.pgm": (b"P2\n# x\n3 2 255\n1 2 3\n4 5 6\n", "text.yaml"),
    "a.png": (picture("PNG"), "png.yaml"),
    "a.bmp": (picture("BMP"), "bmp.yaml"),
    "nav.yaml": (NAV2.encode(), "nav.yaml"),
    "text.yaml": (NAV2.replace("room.pgm", "text.pgm").encode(), "text.yaml"),
    "png.yaml": (NAV2.replace("room.pgm", "a.png").encode(), "png.yaml"),
    "bmp.yaml": (NAV2.replace("room.pgm", "a.bmp").encode(), "bmp.yaml"),
    "world.yaml": ((SCENARIO + WORLD).encode(), "world.yaml"),
    "fleet.yaml": (test_fleet.FLEET.encode(), "fleet.yaml"),
    "cars.yaml": (test_cl_cbs.PROBLEM.encode(), "cars.yaml"),
    "robots.yaml": ((test_dynobench.PROBLEM + test_dynobench.SECOND_ROBOT).encode(), "robots.yaml"),
}
ALONE = ("Case0.csv", "yard.yaml", "world.yaml", "fleet.yaml", "cars.yaml", "robots.yaml")


@st.composite
def damages(draw, content: bytes) -> bytes:
    """The content with one to three passages cut out, cut off, replaced or repeated."""
    for _ in range(draw(st.integers(1, 3))):
        begin = draw(st.integers(0, len(content)))
        end = min(begin + draw(st.integers(0, 6)), len(content))
        tail = draw(st.sampled_from([content[end:], content[begin:], b""]))
        content = content[:begin] + draw(st.sampled_from(WORDS)) + tail
    return content


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("damaged")
    for name in ("models", "worlds"):
        (root / name).mkdir()
    (root / "beside.yaml").write_text(BESIDE)
    for name, (content, _) in FILES.items():
        (root / name).write_bytes(content)
    return root


@pytest.mark.parametrize("name", FILES)
def test_it_is_a_problem_or_one_line(folder, name):
    content, loaded = FILES[name]
    beside = None if loaded in ALONE else folder / "beside.yaml"
    case = 0 if loaded.endswith("scen") else None

    @settings(max_examples=draws(60))
    @given(damages(content))
    def tried(damaged: bytes) -> None:
        (folder / name).write_bytes(damaged)
        try:
            said = str(load_scenario(folder / loaded, beside=beside, case=case).path)
        except InvalidScenario as error:
            said = str(error)
        assert said.startswith(str(folder))
        assert "\n" not in said

    try:
        tried()
    finally:
        (folder / name).write_bytes(content)
    again = load_scenario(folder / loaded, beside=beside, case=case)
    assert again.problems[0].start.size == 3
