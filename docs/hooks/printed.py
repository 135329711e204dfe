"""What the code of the pages prints, held against what the pages say that it prints."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path

MEASURED = "(measured on"  # begins an output that depends on the clock or the machine
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def differs(said: str, now: str) -> bool:
    """Whether a page says another thing than its code prints now.

    Words and whole numbers have to be the same; decimal numbers may differ by one in their last
    digit. Nothing is asked of an output that says where it was measured.
    """
    if said.startswith(MEASURED):
        return False
    if NUMBER.sub("0", said).split() != NUMBER.sub("0", now).split():
        return True
    pairs = zip(NUMBER.findall(said), NUMBER.findall(now), strict=True)
    return any(abs(float(one) - float(other)) > _digit(one) for one, other in pairs)


def machine() -> str:
    """The processor, and on how many of its cores this may run."""
    name = platform.processor() or platform.machine()
    stated = Path("/proc/cpuinfo")
    if stated.exists():
        found = re.search(r"^model name\s*: (.*)$", stated.read_text(), flags=re.MULTILINE)
        name = found[1] if found else name
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores of {' '.join(name.split())}"


def _digit(number: str) -> float:
    """One in the last digit of a number as it is written, and a little; a whole one is exact."""
    digits, _, power = number.partition("e")
    if "." not in digits and not power:
        return 0.0
    return 1.01 * 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
