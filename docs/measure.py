"""Measure what the pages print and show, and write it into them.

``python docs/measure.py`` does everything below, in this order, and says how long each took; names
after a word do no more than these.

``tables``: the reference and the gallery's table, by the package and the scenarios; takes no plan.
``pages``: the code of questions and how-tos, what it prints and its picture, named after the page;
the numbers of a table whose rows have a command of ``maneuver-automaton`` and what to read of the
file that it writes. Only what has an output below it gets one; outputs that begin with
"(measured on" depend on the clock or the machine.
``notebooks``: their outputs, but players (extra docs).
``figures``: the pictures of studies, by docs/figures.
``gallery``: each scenario by its own command: pictures, plan, and for the README its film.
"""

from __future__ import annotations

import base64
import contextlib
import gzip
import io
import json
import os
import re
import shlex
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "docs" / "hooks"), str(ROOT / "docs" / "figures")]

import gallery  # noqa: E402
import printed  # noqa: E402
import reference  # noqa: E402
import thumbnails  # noqa: E402

from maneuver_automaton.cli import run  # noqa: E402

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
FILMED = "parallel_parking"
FIGURES = ("inside", "symmetry", "feasible", "uniform_effort", "unconstrained", "turnpike")
TABLES = {  # between a line <!-- word --> and <!-- end -->
    "reference/keys.md": ("keys", reference.keys),
    "reference/documents.md": ("documents", reference.documents),
    "reference/options.md": ("options", reference.options),
    "reference/python.md": ("names", reference.names),
    "gallery.md": ("scenarios", gallery.table),
}
CODE = re.compile(
    r"```python\n(?P<code>.*?)```\n(?:\n```text\n(?P<output>.*?)```\n)?", flags=re.DOTALL
)
ROW = re.compile(  # what the paper has, command, expression, its number, ours
    r"^\| (?P<what>.*) \| `(?P<command>maneuver-automaton .*?)` \| `(?P<read>.*?)` "
    r"\| (?P<paper>.*?) \| (?P<ours>.*?) \|",
    flags=re.MULTILINE,
)
WHOLE, WIDE, SMALL = 1248, 1000, 720  # [pixels] at most: as drawn, in a page, in the gallery


def measured_pages() -> list[Path]:
    """The pages whose outputs are written here."""
    docs = ROOT / "docs"
    return [
        docs / "inside.md",
        docs / "paper.md",
        *sorted(docs.glob("howto/*.md")),
        *sorted(docs.glob("questions/*.md")),
    ]


def with_table(page: str) -> str:
    """The text of a page of the reference, with what is generated as it is now."""
    word, written = TABLES[page]
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    begin, end = f"<!-- {word} -->\n", "<!-- end -->"
    before, _, rest = text.partition(begin)
    return f"{before}{begin}\n{written()}\n\n{end}{rest.partition(end)[2]}"


def write_table(page: str) -> None:
    """Write what is generated into a page."""
    text = with_table(page)
    (ROOT / "docs" / page).write_text(text, encoding="utf-8")


def run_page(page: Path) -> None:
    """Write what the code and the commands of a page give, and its picture."""
    text = page.read_text(encoding="utf-8")
    text = CODE.sub(lambda match: with_output(match[0], match["code"], match["output"]), text)
    text = with_numbers(text)
    page.write_text(text, encoding="utf-8")
    shrink(Path(f"{page.stem}.png"), PICTURES / f"{page.stem}.png", most=WIDE)


def with_output(block: str, code: str, before: str | None) -> str:
    """A block of code, run, and what it prints where that is shown; as before if it is the same."""
    out = io.StringIO()
    try:
        with contextlib.redirect_stdout(out):
            exec(compile(code, "page", "exec"), {"__name__": "__main__"})
    except ModuleNotFoundError as error:  # of an extra
        print(f"(a block was not run: {error})", end=" ")
        return block
    now = out.getvalue()
    if before is None:
        return block
    if before.startswith(printed.MEASURED):
        now = f"{printed.MEASURED} {printed.machine()})\n{now}"
    elif not printed.differs(before, now):
        return block  # another processor may round otherwise
    return f"```python\n{code}```\n\n```text\n{now}```\n"


def with_numbers(text: str) -> str:
    """The text of a page, with what its commands give in the cell before the last."""
    kept: dict[str, dict[str, Any]] = {}

    def row(match: re.Match[str]) -> str:
        command = match["command"]
        if command not in kept:
            kept[command] = document_of(command)
        names = {"__builtins__": {"all": all, "len": len, "zip": zip}, **kept[command]}
        ours = in_words(eval(match["read"], names))
        return match[0].replace(
            f"| {match['paper']} | {match['ours']} |", f"| {match['paper']} | {ours} |"
        )

    return ROW.sub(row, text)


def in_words(value: Any) -> str:
    """A number, a word or a list of them, for a cell of a table."""
    if isinstance(value, list):
        between = "; " if any(isinstance(one, list) for one in value) else ", "
        return between.join(map(in_words, value)) or "none"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def document_of(command: str) -> dict[str, Any]:
    """What a command writes into plan.json or closed_loop.json."""
    words = shlex.split(command)[1:]
    with tempfile.TemporaryDirectory() as folder:
        run([*words, "--out", folder, "--no-plot", "--quiet"])
        file = "closed_loop.json" if words[0] == "mpc" else "plan.json"
        found: dict[str, Any] = json.loads((Path(folder) / file).read_text(encoding="utf-8"))
    return found


def run_notebook(file: Path) -> None:
    """Execute a notebook, and keep its outputs but players, its pictures in few colours."""
    import nbformat
    import tutorials

    notebook = tutorials.executed(file.read_text(encoding="utf-8"))
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if tutorials.PLAYER.match(str(data.get("text/html", ""))):
                data.pop("text/html")
                data["text/plain"] = tutorials.PLAYED
            if "image/png" in data:
                picture = few_colours(Image.open(io.BytesIO(base64.b64decode(data["image/png"]))))
                data["image/png"] = base64.b64encode(picture).decode()
    file.write_text(nbformat.writes(notebook).rstrip() + "\n", encoding="utf-8")


def draw_scenario(scenario: Path) -> None:
    """Plan a scenario, or drive it in closed loop, and keep its picture and its file."""
    loop = gallery.entry(scenario).command == "mpc"
    film = ["--animate"] if scenario.stem == FILMED else []
    run(["mpc" if loop else "plan", str(scenario), "--out", "out", "--quiet", *film])
    made = Path("out") / ("closed_loop" if loop else "plan")
    status = json.loads(made.with_suffix(".json").read_text(encoding="utf-8"))["status"]
    if status not in ("found", "reached", "steps_spent"):
        raise RuntimeError(f"its own command ends with {status}: the old picture is kept")
    shrink(made.with_suffix(".png"), PICTURES / "gallery" / f"{scenario.stem}.png", most=SMALL)
    if scenario.stem in LARGE:
        drawn, name = LARGE[scenario.stem]
        shrink(Path("out") / drawn, ROOT / "scenarios" / "pictures" / name, most=WHOLE)
    if film:
        shutil.copy("out/plan.gif", ROOT / "scenarios" / "pictures" / f"{scenario.stem}.gif")
    PLANS.mkdir(exist_ok=True)
    kept = PLANS / f"{scenario.stem}.json.gz"
    kept.write_bytes(gzip.compress(shortened(made.with_suffix(".json")), mtime=0))
    thumbnails.main([scenario.stem])
    shutil.rmtree("out", ignore_errors=True)


def shortened(file: Path) -> bytes:
    """A plan.json whose samples have no more digits than a player shows."""
    document = json.loads(file.read_text(encoding="utf-8"))
    for samples in trajectories(document):
        for key, digits in (("time_s", 12), ("pose", 9), ("reduced_state", 6), ("control", 6)):
            if samples.get(key):
                samples[key] = np.round(np.array(samples[key]), digits).tolist()
    return json.dumps(document).encode()


def trajectories(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The samples of a plan, or of the plans of several vehicles."""
    yield document.get("trajectory", {})
    for vehicle in (document.get("vehicles") or {}).values():
        yield vehicle.get("trajectory", {})


def shrink(picture: Path, to: Path, *, most: int) -> None:
    """Keep a picture in few colours, at most so many pixels wide."""
    if not picture.exists():
        return
    to.parent.mkdir(parents=True, exist_ok=True)
    image = Image.open(picture)
    image.thumbnail((most, 2 * most))
    to.write_bytes(few_colours(image))


def few_colours(image: Image.Image) -> bytes:
    """A picture as a PNG of 256 colours, chosen by coverage: thin lines keep theirs."""
    written = io.BytesIO()
    few = image.convert("RGB").quantize(256, method=Image.Quantize.MAXCOVERAGE)
    few.save(written, "PNG", optimize=True)
    return written.getvalue()


def draw_figure(name: str) -> None:
    """Draw a picture of a study."""
    import inside
    import studies
    import symmetry

    (inside.PICTURES | symmetry.PICTURES | studies.PICTURES)[f"{name}.png"]().savefig(
        f"{name}.png", dpi=130
    )
    shrink(Path(f"{name}.png"), ROOT / "scenarios" / "pictures" / f"{name}.png", most=WHOLE)


def work() -> dict[str, dict[str, Callable[[], None]]]:
    """What there is to do, by word and name."""
    notebooks = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))
    return {
        "tables": {TABLES[page][0]: lambda page=page: write_table(page) for page in TABLES},
        "pages": {page.stem: lambda page=page: run_page(page) for page in measured_pages()},
        "notebooks": {file.stem: lambda file=file: run_notebook(file) for file in notebooks},
        "figures": {name: lambda name=name: draw_figure(name) for name in FIGURES},
        "gallery": {one.stem: lambda one=one: draw_scenario(one) for one in gallery.scenarios()},
    }


def main(words: Collection[str]) -> None:
    """Do what is named, or everything; a name alone is that of a page."""
    all_work = work()
    kinds = [word for word in words if word in all_work]
    names = [word for word in words if word not in all_work]
    kinds = kinds or (["pages"] if names else list(all_work))
    known = {name for kind in kinds for name in all_work[kind]}
    if unknown := [name for name in names if name not in known]:
        sys.exit(
            f"{', '.join(unknown)}: not among {', '.join(all_work)}, {', '.join(sorted(known))}"
        )
    failed: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for name in ("scenarios", "maneuver_automaton/libraries"):
            shutil.copytree(ROOT / name, Path(folder) / name)
        os.chdir(folder)
        for kind in kinds:
            for name in [one for one in all_work[kind] if not names or one in names]:
                began, worked = time.perf_counter(), time.process_time()
                print(f"{kind} {name}", end=" ", flush=True)
                try:
                    all_work[kind][name]()
                    took, work_s = time.perf_counter() - began, time.process_time() - worked
                    print(f"{took:.1f} s, {work_s:.1f} s of a processor", flush=True)
                except Exception as error:  # noqa: BLE001, it is named, and the others are done
                    print(f"failed: {type(error).__name__}: {error}", flush=True)
                    failed.append(f"{kind} {name}")
        os.chdir(ROOT)
    if failed:
        sys.exit(f"not measured: {', '.join(failed)}")


if __name__ == "__main__":
    main(sys.argv[1:])
