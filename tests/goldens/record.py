"""Write the data that later versions are held against: `python -m tests.goldens.record [PART ...]`.

Parts are scenes, inertia, loops, documents, messages, exports, pages and files. Record where a
change is meant, and say why beside it; never to make a test pass.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from collections.abc import Callable, Mapping
from typing import Any

from tests.goldens import documents, exports, messages, written
from tests.goldens.inertia import all_with_inertia
from tests.goldens.loops import all_loops
from tests.goldens.measured import (
    FOLDER,
    RUNS,
    answer,
    cheapest_loop,
    cheapest_of,
    record_of,
    record_of_loop,
)
from tests.goldens.scenes import all_kinematic


def scenes() -> dict[str, Any]:
    """The answers to the kinematic scenes."""
    return {name: _said(name, record_of(answer(one))) for name, one in all_kinematic().items()}


def inertia() -> dict[str, Any]:
    """The cheapest of several runs of every scene with inertia."""
    return {name: _said(name, cheapest_of(scene)) for name, scene in all_with_inertia().items()}


def loops() -> dict[str, Any]:
    """The closed loops."""
    return {
        name: _said(
            name, cheapest_loop(loop, runs=RUNS) if loop.inertia else record_of_loop(loop.run())
        )
        for name, loop in all_loops().items()
    }


PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    "scenes": scenes,
    "loops": loops,
    "documents": documents.recorded,
    "messages": messages.recorded,
    "exports": exports.recorded,
    "pages": exports.recorded_pages,
    "files": written.write_files,
    "inertia": inertia,
}


def _said(name: str, kept: dict[str, Any]) -> dict[str, Any]:
    shown = {key: kept[key] for key in ("status", "cost", "costs") if key in kept}
    print(f"{name}: {shown}", flush=True)  # noqa: T201
    return kept


def _commit() -> str:
    command = ["git", "log", "-1", "--format=%H", "--", "maneuver_automaton"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def write(name: str, content: Mapping[str, Any]) -> None:
    """One line per entry, so that a difference shows which."""
    lines = [f'"commit": {json.dumps(_commit())}']
    lines += [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in content.items()]
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    (FOLDER / f"{name}.json").write_text(text, encoding="utf-8")


def main() -> None:
    """Record the parts that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], metavar="PART")
    for part in parser.parse_args().parts or PARTS:
        content = PARTS[part]()
        if content:
            write(part, content)


if __name__ == "__main__":
    main()
