"""Run the code of the pages of questions and how-tos, and draw the gallery.

``python docs/measure.py``: the code of each page runs in a folder with the scenarios; what it
prints is written below it, and its picture, named after the page, into docs/pictures.
``python docs/measure.py gallery`` draws every scenario for the gallery, and keeps its plan, which
the site plays; names of pages or scenarios may follow, to do no more than these.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np
from PIL import Image

from maneuver_automaton.cli import run

ROOT = Path(__file__).parents[1]
PICTURES, PLANS = ROOT / "docs" / "pictures", ROOT / "docs" / "plans"
LARGE = {  # pictures of the README and of pages, by their scenarios
    "parking": ("plan.png", "parking.png"),
    "parking_loop": ("closed_loop.png", "closed_loop.png"),
    "parallel_parking": ("plan.png", "parallel_parking.png"),
    "crossing_traffic": ("plan.png", "crossing_traffic.png"),
    "cluttered_room": ("plan.png", "cluttered_room.png"),
    "tpcap_full": ("plan.png", "tpcap_full.png"),
    "trailer": ("plan.png", "trailer.png"),
    "helicopter_city": ("plan_3d.png", "helicopter_city.png"),
}
CODE = re.compile(r"```python\n(?P<code>.*?)```\n(?:\n```text\n.*?```\n)?", flags=re.DOTALL)
WHOLE, WIDE, SMALL = 1248, 1000, 720  # [pixels] at most: as drawn, in a page, in the gallery


def run_page(page: Path) -> None:
    """Write what the code of a page prints, and its picture."""
    text = page.read_text(encoding="utf-8")
    page.write_text(CODE.sub(lambda match: with_output(match["code"]), text), encoding="utf-8")
    shrink(Path(f"{page.stem}.png"), PICTURES / f"{page.stem}.png", most=WIDE)


def with_output(code: str) -> str:
    """A block of code, and below it what it prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "page", "exec"), {"__name__": "__main__"})
    output = f"\n```text\n{printed.getvalue()}```\n" if printed.getvalue() else ""
    return f"```python\n{code}```\n{output}"


def draw_scenario(scenario: Path) -> None:
    """Plan a scenario, or drive it in closed loop, and keep its picture and its file."""
    loop = "receding_horizon:" in scenario.read_text(encoding="utf-8")
    run(["mpc" if loop else "plan", str(scenario), "--out", "out", "--quiet"])
    made = Path("out") / ("closed_loop" if loop else "plan")
    shrink(made.with_suffix(".png"), PICTURES / "gallery" / f"{scenario.stem}.png", most=SMALL)
    if scenario.stem in LARGE:
        drawn, name = LARGE[scenario.stem]
        shrink(Path("out") / drawn, ROOT / "scenarios" / "pictures" / name, most=WHOLE)
    PLANS.mkdir(exist_ok=True)
    kept = PLANS / f"{scenario.stem}.json.gz"
    kept.write_bytes(gzip.compress(shortened(made.with_suffix(".json")), mtime=0))
    shutil.rmtree("out", ignore_errors=True)


def shortened(file: Path) -> bytes:
    """A plan.json whose samples have no more digits than a player shows."""
    document = json.loads(file.read_text(encoding="utf-8"))
    samples = document.get("trajectory", {})
    for key, digits in (("time_s", 12), ("pose", 9), ("reduced_state", 6), ("control", 6)):
        if samples.get(key):
            samples[key] = np.round(np.array(samples[key]), digits).tolist()
    return json.dumps(document).encode()


def shrink(picture: Path, to: Path, *, most: int) -> None:
    """Keep a picture in few colours, at most so many pixels wide."""
    if not picture.exists():
        return
    to.parent.mkdir(parents=True, exist_ok=True)
    image = Image.open(picture).convert("RGB")
    image.thumbnail((most, 2 * most))
    # by coverage: thin lines keep their colours
    image.quantize(256, method=Image.Quantize.MAXCOVERAGE).save(to, optimize=True)


def main(names: Collection[str]) -> None:
    """Run what is named, or everything."""
    pages = [*(ROOT / "docs" / "questions").glob("*.md"), *(ROOT / "docs" / "howto").glob("*.md")]
    work: dict[str, Callable[[], None]] = {
        page.stem: lambda page=page: run_page(page) for page in pages
    }
    if "gallery" in names:
        names = set(names) - {"gallery"}
        scenarios = (ROOT / "scenarios").glob("*.yaml")
        work = {one.stem: lambda one=one: draw_scenario(one) for one in scenarios}
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "scenarios", Path(folder) / "scenarios")
        os.chdir(folder)
        for name in sorted(names or work):
            print(name, flush=True)
            work[name]()
        os.chdir(ROOT)


if __name__ == "__main__":
    main(sys.argv[1:])
