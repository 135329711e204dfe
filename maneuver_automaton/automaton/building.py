"""Libraries built by optimal control: in parallel, and going on where a killed build stopped.

Every finished maneuver stands on a line of its own in a journal, so that none is lost.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton._files import journal, journal_lines
from maneuver_automaton._parallel import in_parallel
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.automaton.library import hash_of, save_library
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control.maneuvers import (
    ManeuverObjective,
    TransferProgram,
    TransferSettings,
    duration_guess,
    transfer_program,
)
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.connecting import (
    ADMITTED_DEFECT,
    Inputs,
    connect,
    maneuver_defect,
)
from maneuver_automaton.primitives.symmetry import mirror_of

VERSION = 1  # of what a line says and of how maneuvers are made
SAMPLES = 3  # states at which a model is asked for its rates, to know it again


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Entry:
    """One line: the inputs of a maneuver, from which it can be driven again, or why it failed."""

    key: str
    interval: float  # [s]
    control: Array  # (n, n_u), each for the interval; no row if it failed
    reason: str = ""
    defect: float = math.inf

    def __post_init__(self) -> None:
        freeze(self, "control")

    def line(self) -> str:
        """The entry as JSON; numbers read back to the last bit."""
        numbers = {"interval": self.interval, "defect": self.defect}
        finite = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
        content = {"key": self.key, "reason": self.reason, **finite}
        return json.dumps({**content, "control": self.control.tolist()}, allow_nan=False)


def journal_path(library: Path) -> Path:
    """Where the journal of a library file lies: beside it."""
    return library.with_name(library.name + ".journal")


def build_key(model: Model, objective: ManeuverObjective, settings: TransferSettings) -> str:
    """Hash of all that maneuvers are made from, trims apart.

    A model is known by its names, its limits and its rates at a few states, so that a change of
    a user's formulas is noticed as well.
    """
    rng = np.random.default_rng(0)
    state = rng.uniform(0.1, 0.9, size=(SAMPLES, len(model.reduced_names)))
    control = rng.uniform(0.1, 0.9, size=(SAMPLES, len(model.control_names)))
    state = _within(model.reduced_limits, state)
    control = _within(model.control_limits, control)
    return hash_of(
        {
            "version": VERSION,
            "group": model.group.__name__,
            "names": [model.name, *model.control_names, *model.reduced_names],
            "limits": [repr(model.control_limits.tolist()), repr(model.reduced_limits.tolist())],
            "velocity": model.body_velocity(state, control).tolist(),
            "dynamics": model.reduced_dynamics(state, control).tolist(),
            "objective": asdict(objective),
            "settings": asdict(settings),
        }
    )


def read_journal(path: Path) -> dict[str, Entry]:
    """Entries by key; a line that a killed build left unfinished does not count."""
    entries: dict[str, Entry] = {}
    for line in journal_lines(path):
        with contextlib.suppress(ValueError, TypeError, KeyError):
            content = json.loads(line)
            key, numbers = str(content["key"]), (content["interval"], content["defect"])
            interval, defect = (math.inf if one is None else float(one) for one in numbers)
            entries[key] = Entry(
                key=key,
                reason=str(content["reason"]),
                interval=interval,
                defect=defect,
                control=np.array(content["control"], dtype=np.float64),
            )
    return entries


def _within(limits: Array, shares: Array) -> Array:
    low = np.where(np.isfinite(limits[:, 0]), limits[:, 0], 0.0)
    high = np.where(np.isfinite(limits[:, 1]), limits[:, 1], low + 1.0)
    within: Array = low + shares * (high - low)
    return within


SIDEWAYS = 1  # place of the lateral speed in a twist
Pair = tuple[str, str]  # names of the trims a maneuver leaves and reaches


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """Two trims that no maneuver joins, and why."""

    source: str
    target: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LibraryBuild:
    """A library, and what became of every pair."""

    automaton: Automaton
    failures: tuple[Failure, ...]
    worst_defect: float  # of all maneuvers, against an ODE solver, in their units
    solved: int  # maneuvers that were solved in this build
    resumed: int  # that a build before had finished
    mirrored: int  # that are the mirror image of another
    build_s: float

    __repr__ = brief


def build_library(
    model: Model,
    trims: Sequence[Trim],
    *,
    pairs: Iterable[Pair] | None = None,
    objective: ManeuverObjective | None = None,
    settings: TransferSettings | None = None,
    keep_sign: Sequence[str] = (),
    mirror: bool = True,
    jobs: int = 1,
    scheduler: str | None = None,
    path: Path | str | None = None,
    name: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> LibraryBuild:
    """Join trims by maneuvers of least cost, each solved, closed and driven again as a proof.

    With a `path`, every finished maneuver is written to a journal beside the file at once; a
    build that was killed goes on from there, and comes to the same library to the last bit. The
    library file is written in one step at the end, and the journal removed.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. III.

    Parameters
    ----------
    model : Model
        The vehicle.
    trims : sequence of Trim
        The nodes.
    pairs : iterable of (str, str), optional
        Names of the trims to join; all pairs of different reduced state if left out.
    objective, settings : optional
        See `connect`.
    keep_sign : sequence of str
        Controls that do not change their sign between two trims that have it alike: the speed of
        a car with a trailer, say, which else might go to and fro.
    mirror : bool
        Whether a maneuver serves its mirror image too, where model and trims have one.
    jobs, scheduler
        Processes at a time; a Dask scheduler, or "local"; see `in_parallel`.
    path : Path, optional
        The library file.
    name : str
        Of the library.
    progress : callable, optional
        Called with the number of pairs done, mirror images too, and their total.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    ValueError
        If a pair joins trims of equal reduced state.
    UnknownTrim
        If a pair names an unknown trim.
    OSError
        If the file or its journal cannot be written.
    """
    began = time.perf_counter()
    nodes = Automaton(model, tuple(trims), name=name)
    objective, settings = objective or ManeuverObjective(), settings or TransferSettings()
    for control in keep_sign:
        if control not in model.control_names:
            raise ValueError(
                f"keep_sign: the {model.name} has no control {control!r}, need some of "
                f"{', '.join(model.control_names)}"
            )
    wanted = tuple(all_pairs(nodes, keep_sign=keep_sign) if pairs is None else dict.fromkeys(pairs))
    for source, target in wanted:
        a, b = nodes.index_of(source), nodes.index_of(target)
        if nodes.trim_classes[a] == nodes.trim_classes[b]:
            raise ValueError(
                f"pair ({source!r}, {target!r}): has one reduced state, so the vehicle switches at "
                "will; need trims of different reduced state"
            )
    images = _images(nodes, wanted) if mirror else {}
    to_solve = [pair for pair in wanted if pair not in images]
    recipe = _Recipe(
        key=build_key(model, objective, settings),
        nodes=nodes,
        objective=objective,
        settings=settings,
        keep_sign=tuple(keep_sign),
    )
    keys = {pair: recipe.key_of(pair) for pair in to_solve}
    served = Counter(keys[images.get(pair, pair)] for pair in wanted)
    log = None if path is None else journal_path(Path(path))
    entries = {} if log is None else read_journal(log)
    open_pairs = [pair for pair in to_solve if keys[pair] not in entries]
    resumed = len(to_solve) - len(open_pairs)
    ready = len(wanted) - sum(served[keys[pair]] for pair in open_pairs)
    work = functools.partial(_solved, recipe)
    with contextlib.nullcontext() if log is None else journal(log) as write:
        for entry in in_parallel(work, open_pairs, jobs=jobs, scheduler=scheduler, order="as done"):
            entries[entry.key] = entry
            if write is not None:
                write([entry.line()])
            ready += served[entry.key]
            if progress is not None:
                progress(ready, len(wanted))
    done = {pair: entries[key] for pair, key in keys.items()}
    maneuvers, failures, defects = _assembled(nodes, wanted, images, done)
    automaton = Automaton(model, nodes.trims, maneuvers, name=name)
    if path is not None:
        save_library(automaton, path)
    if log is not None:
        log.unlink(missing_ok=True)
    return LibraryBuild(
        automaton=automaton,
        failures=failures,
        worst_defect=max(defects, default=0.0),
        solved=len(open_pairs),
        resumed=resumed,
        mirrored=len(images),
        build_s=time.perf_counter() - began,
    )


def all_pairs(automaton: Automaton, *, keep_sign: Sequence[str] = ()) -> list[Pair]:
    """One pair for every two classes of trims, in both directions: their first trims.

    Where controls keep their sign, there is one pair for every sign that both classes have, zero
    apart: ahead to ahead, and reverse to reverse.
    """
    kept = [automaton.model.control_names.index(name) for name in keep_sign]
    signs = np.sign(automaton.controls[:, kept])
    firsts: dict[tuple[float, ...], dict[int, str]] = {}
    for name, kind, sign in zip(
        automaton.trim_names, automaton.trim_classes.tolist(), signs, strict=True
    ):
        if sign.all():
            firsts.setdefault(tuple(sign.tolist()), {}).setdefault(kind, name)
    return [pair for names in firsts.values() for pair in itertools.permutations(names.values(), 2)]


def nearest_pairs(automaton: Automaton, count: int, *, keep_sign: Sequence[str] = ()) -> list[Pair]:
    """Of all pairs those from a trim to the `count` that are the fewest seconds away, and back.

    Seconds are counted at the fastest rates that the limits admit, half way: a rough measure.
    """
    pairs = all_pairs(automaton, keep_sign=keep_sign)
    away: dict[str, list[tuple[float, int, str]]] = {}
    for k, (source, target) in enumerate(pairs):
        states = automaton[source].reduced_state, automaton[target].reduced_state
        away.setdefault(source, []).append((duration_guess(automaton.model, *states), k, target))
    near = {(source, target) for source in away for *_, target in sorted(away[source])[:count]}
    return [pair for pair in pairs if pair in near or pair[::-1] in near]


def neighbour_pairs(automaton: Automaton, *, keep_sign: Sequence[str] = ()) -> list[Pair]:
    """Of all pairs those whose twists differ by at most one level in every component.

    The levels are the values that the trims take: of speed, turn rate and climb. The lateral speed,
    which follows from these where a vehicle drifts, does not count.
    """
    twists = np.delete(automaton.body_velocities, SIDEWAYS, axis=1).round(9)
    levels = np.stack([np.unique(column, return_inverse=True)[1] for column in twists.T], axis=-1)
    level = dict(zip(automaton.trim_names, levels, strict=True))
    return [
        (source, target)
        for source, target in all_pairs(automaton, keep_sign=keep_sign)
        if np.abs(level[source] - level[target]).max() <= 1
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Recipe:
    """What all maneuvers of a build are made from; equal keys mean equal recipes."""

    key: str
    nodes: Automaton = field(compare=False)
    objective: ManeuverObjective = field(compare=False)
    settings: TransferSettings = field(compare=False)
    keep_sign: tuple[str, ...] = field(compare=False)

    def key_of(self, pair: Pair) -> str:
        """Hash of all that one maneuver is made from; the names of the trims do not count."""
        trims = (self.nodes[name] for name in pair)
        ends = [[trim.reduced_state.tolist(), trim.control.tolist()] for trim in trims]
        return hash_of([self.key, *ends, *sorted(self.keep_sign)])


@functools.lru_cache(maxsize=1)
def _program(recipe: _Recipe) -> TransferProgram:
    return transfer_program(
        recipe.nodes.model, objective=recipe.objective, settings=recipe.settings
    )


def _solved(recipe: _Recipe, pair: Pair) -> Entry:
    nodes, key = recipe.nodes, recipe.key_of(pair)
    source, target = nodes[pair[0]], nodes[pair[1]]
    limits = nodes.model.control_limits.copy()
    for name in recipe.keep_sign:  # on one side of zero, where both trims are
        k = nodes.model.control_names.index(name)
        if source.control[k] * target.control[k] > 0.0:
            limits[k, int(source.control[k] < 0.0)] = 0.0
    found = connect(nodes.model, source, target, program=_program(recipe), control_limits=limits)
    if found.maneuver is None or found.inputs is None:
        none = np.zeros((0, len(nodes.model.control_names)))
        return Entry(key=key, interval=np.inf, control=none, reason=found.reason)
    return Entry(
        key=key, interval=found.inputs.interval, control=found.inputs.control, defect=found.defect
    )


def _images(nodes: Automaton, pairs: Sequence[Pair]) -> dict[Pair, Pair]:
    """Pairs that are the mirror image of an earlier one, and which; none without symmetry."""
    mirror = mirror_of(nodes.model)
    if mirror is None:
        return {}
    both = itertools.product(nodes.trims, repeat=2)
    other = {trim.name: image.name for trim, image in both if mirror.takes(trim, image)}
    images: dict[Pair, Pair] = {}
    known: set[Pair] = set()
    for source, target in pairs:
        known.add((source, target))
        if source in other and target in other:
            there = (other[source], other[target])
            if there in known and there != (source, target) and there not in images:
                images[source, target] = there
    return images


def _assembled(
    nodes: Automaton,
    pairs: Sequence[Pair],
    images: Mapping[Pair, Pair],
    entries: Mapping[Pair, Entry],
) -> tuple[tuple[Maneuver, ...], tuple[Failure, ...], list[float]]:
    """Maneuvers in the order of the pairs, what failed, and the defects."""
    mirror = mirror_of(nodes.model) if images else None
    found: dict[Pair, Maneuver] = {}
    failures: list[Failure] = []
    defects: list[float] = []
    for pair in pairs:
        original = images.get(pair, pair)
        entry = entries[original]
        if entry.reason:
            said = entry.reason if pair == original else f"its mirror image failed: {entry.reason}"
            failures.append(Failure(source=pair[0], target=pair[1], reason=said))
            continue
        if pair == original:
            inputs = Inputs(control=entry.control, interval=entry.interval)
            course = inputs.drive(nodes.model, nodes[pair[0]].reduced_state)
            name = " to ".join(pair)
            found[pair] = Maneuver.along(course, name=name, source=pair[0], target=pair[1])
            defect = entry.defect
        else:
            assert mirror is not None
            found[pair] = mirror.maneuver(found[original], source=pair[0], target=pair[1])
            source, target = nodes[pair[0]], nodes[pair[1]]
            defect = maneuver_defect(nodes.model, found[pair], source=source, target=target)
            if not defect <= ADMITTED_DEFECT:
                said = f"the mirror image, driven again, ends {defect:.2g} off its target"
                failures.append(Failure(source=pair[0], target=pair[1], reason=said))
                del found[pair]
                continue
        defects.append(defect)
    return tuple(found.values()), tuple(failures), defects
