"""A worker for every vehicle, on a Dask cluster: they exchange words, durations and starts only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from maneuver_automaton.budget import Budget
from maneuver_automaton.fleet.asking import Answer, Past, Question, answered
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.vehicle import Found
from maneuver_automaton.fleet.vehicles import prepare_vehicles, vehicles_of
from maneuver_automaton.fleet.wire import decoded, encoded

REFERENCE = 12  # bytes that name a plan that is known already: number of the vehicle, and of it
SETTINGS = 64  # bytes of the other numbers of a question


class Asked(NamedTuple):
    """A question as it is sent: plans by number, and those that are new as bytes."""

    base: int
    others: tuple[tuple[int, int, float], ...]  # number of a vehicle, of its plan, distance to keep
    new: dict[int, tuple[int, bytes]]  # by its number: whose it is, and the plan
    settings: tuple[float, float, float, float, int, float, float]
    limit_s: float


class VehicleWorker:
    """What stands on the other side: one vehicle, and the plans of others that it was told."""

    def __init__(self, fleet: FleetProblem, number: int) -> None:
        self.number = number
        self.vehicles = vehicles_of(fleet)
        self.known: dict[int, Found] = {}
        prepare_vehicles([self.vehicles[number]])

    def ask(self, asked: Asked) -> tuple[bytes | None, bytes | None]:
        """The answer to a question; plans that are not named in it are forgotten."""
        for name, (owner, said) in asked.new.items():
            self.known[name] = decoded(self.vehicles[owner], said)
        used = {asked.base, *(name for _, name, _ in asked.others)}
        self.known = {name: found for name, found in self.known.items() if name in used}
        time, after, between, known, most, tube_m, keep = asked.settings
        question = Question(
            number=self.number,
            base=self.known[asked.base],
            time=time,
            after=after,
            others=tuple(Past(j, self.known[name], own) for j, name, own in asked.others),
            between=between,
            known=known,
            most=most,
            tube_m=tube_m,
            keep=keep,
        )
        vehicle, budget = self.vehicles[self.number], Budget.from_now(asked.limit_s)
        found, alone = answered(vehicle, question, budget, lambda one: one.course.after(time))
        return (
            None if found is None else encoded(vehicle, found),
            None if alone is None else encoded(vehicle, alone),
        )


class DaskWorkers:
    """A worker of its own for every vehicle of a fleet, on the processes of a Dask cluster.

    Each keeps the fleet's problem, looks for the plans of its vehicle, and is told the plans that
    this one expects of the others. Under counted work the loop is that of one process, to the last
    bit. Whose worker is gone drives the plan that it holds, and looks for no other one.

    Parameters
    ----------
    fleet : FleetProblem
    client : distributed.Client
        Of a cluster with processes; see the extra ``distributed``.
    patience_s : float
        A worker that does not answer so long after its time limit is taken for gone [s].
    """

    def __init__(self, fleet: FleetProblem, client: Any, *, patience_s: float = 30.0) -> None:
        self.vehicles = vehicles_of(fleet)
        self.patience_s = patience_s
        problem = client.scatter(fleet, broadcast=True)
        places = sorted(client.scheduler_info(n_workers=-1)["workers"])
        if not places:
            raise ValueError("workers: the cluster has none, need at least one")
        begun = [
            client.submit(
                VehicleWorker,
                problem,
                one.number,
                actor=True,
                workers=[places[one.number % len(places)]],
                allow_other_workers=False,
                pure=False,
            )
            for one in self.vehicles
        ]
        self.actors: list[Any] = [one.result() for one in begun]
        self.gone: dict[int, str] = {}  # by the number of the vehicle, and why
        self._names: dict[Found, int] = {}  # plans that somebody knows
        self._next = 0
        self._told: list[set[int]] = [set() for _ in self.vehicles]
        self._counts = {"worker_messages": 0, "worker_plans": 0, "worker_bytes": 0}

    @property
    def counts(self) -> dict[str, int]:
        """Messages, plans in them, and bytes, both ways."""
        return dict(self._counts)

    def ask(self, questions: Sequence[Question], budget: Budget) -> list[Answer | None]:
        """The answers in order; all look at the same time. None from who is gone."""
        limit_s = max(budget.left, 0.0)
        under_way = [self._sent(one, limit_s) for one in questions]
        return [
            self._answer(question.number, one, limit_s)
            for question, one in zip(questions, under_way, strict=True)
        ]

    def _sent(self, question: Question, limit_s: float) -> Any:
        k = question.number
        if k in self.gone:
            return None
        new: dict[int, tuple[int, bytes]] = {}
        rows = [(k, question.base), *((j, one) for j, one, _ in question.others)]
        names = []
        for owner, found in rows:
            name = self._names.get(found)
            if name is None:
                name = self._names[found] = self._next
                self._next += 1
            names.append(name)
            if name not in self._told[k] and name not in new:
                new[name] = (owner, encoded(self.vehicles[owner], found))
        asked = Asked(
            base=names[0],
            others=tuple(
                (j, name, own) for (j, _, own), name in zip(question.others, names[1:], strict=True)
            ),
            new=new,
            settings=(
                question.time,
                question.after,
                question.between,
                question.known,
                question.most,
                question.tube_m,
                question.keep,
            ),
            limit_s=limit_s,
        )
        self._told[k] = set(names)
        used = set().union(*self._told)
        self._names = {found: name for found, name in self._names.items() if name in used}
        self._count([said for _, said in new.values()], REFERENCE * len(names) + SETTINGS)
        try:
            return self.actors[k].ask(asked)
        except Exception as error:  # noqa: BLE001, whatever it is, the worker is gone
            self.gone[k] = str(error)
            return None

    def _answer(self, k: int, under_way: Any, limit_s: float) -> Answer | None:
        if under_way is None:
            return None
        try:
            said = under_way.result(timeout=limit_s + self.patience_s)
        except Exception as error:  # noqa: BLE001, the same
            self.gone[k] = str(error) or f"no answer in {limit_s + self.patience_s:g} s"
            return None
        self._count([one for one in said if one is not None], 0)
        found, alone = (None if one is None else decoded(self.vehicles[k], one) for one in said)
        return Answer(found, alone)

    def _count(self, plans: Sequence[bytes], more: int) -> None:
        self._counts["worker_messages"] += 1
        self._counts["worker_plans"] += len(plans)
        self._counts["worker_bytes"] += sum(map(len, plans)) + more
