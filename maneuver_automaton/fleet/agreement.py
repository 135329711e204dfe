"""Who drives what, as each vehicle knows it, where messages may be lost, and where none is.

A vehicle may drive another plan once all others have acknowledged it; until then the others keep
clear of both, the one it drives and the one it asked for. Whatever message is lost, what a vehicle
drives is among what each of the others expects of it. A message a step and pair says which plan is
held, and so ends all doubt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from maneuver_automaton.fleet.vehicle import OwnPlan

Kind = Literal["holds", "asks", "agrees", "drives", "withdraws"]


class Message(NamedTuple):
    """One message: what a vehicle says to another one in a step."""

    step: int
    sender: str
    receiver: str
    kind: Kind


Lost = Callable[[Message], bool]


@dataclass(slots=True, eq=False)
class _Lossless:
    """No message is lost: everybody knows what all hold. Messages are counted, but not stored."""

    near: Callable[[int, OwnPlan], int]
    held: Mapping[int, OwnPlan] = field(default_factory=dict)
    sent: int = 0

    def start(self, held: Mapping[int, OwnPlan]) -> None:
        self.held = held

    def begin(self, step: int, held: Mapping[int, OwnPlan]) -> None:
        self.held = held

    def enter(self, step: int, k: int, found: OwnPlan, held: Mapping[int, OwnPlan]) -> bool:
        self.sent += 2 * self.near(k, found)
        return True

    def everything(self) -> Iterator[tuple[int, OwnPlan]]:
        return iter(self.held.items())

    def agree(self, k: int, found: OwnPlan, holds: OwnPlan, refuses: Callable[[int], bool]) -> bool:
        """All others agree: each that is near is asked, agrees, and is told."""
        self.sent += 3 * self.near(k, found)
        return True

    def announce(self, k: int, found: OwnPlan) -> None:
        """Each that is near is told, and acknowledges it."""
        self.sent += 2 * self.near(k, found)

    def knows(self, j: int, k: int, found: OwnPlan) -> bool:
        return True

    def others_of(self, k: int) -> Mapping[int, Sequence[OwnPlan]]:
        return {j: (one,) for j, one in self.held.items() if j != k}

    def unknown(self, held: Mapping[int, OwnPlan]) -> list[tuple[int, int]]:
        return []


@dataclass(slots=True, eq=False)
class _Agreement:
    """What every vehicle expects of every other one: the plans that it may drive."""

    names: Sequence[str]
    lost: Lost | None = None
    tries: int = 3  # to send a message and to receive its answer, in a step
    expected: dict[int, dict[int, list[OwnPlan]]] = field(default_factory=dict)
    # Emergencies without an acknowledgement: the first drives what the second does not expect.
    unacknowledged: set[tuple[int, int]] = field(default_factory=set)
    step: int = 0
    sent: int = 0

    def start(self, held: Mapping[int, OwnPlan]) -> None:
        """All know the plans that are driven at first."""
        self.expected = {j: {k: [one] for k, one in held.items() if k != j} for j in held}

    def begin(self, step: int, held: Mapping[int, OwnPlan]) -> None:
        """A step begins: everybody says which plan it holds."""
        self.step = step
        for k in [*self.expected]:
            if k not in held:
                self.leave(k)
        for sender in held:
            self._tell(sender, held[sender], "holds")

    def enter(self, step: int, k: int, found: OwnPlan, held: Mapping[int, OwnPlan]) -> bool:
        """Let a vehicle in that holds a plan, if all others say that they know of it."""
        self.step = step  # it begins with those who enter
        others = [j for j in self.expected if j in held]  # who has left since is not asked
        known = [j for j in others if self._say(k, j, "asks")]
        for j in known:
            self.expected[j][k] = [found]
        if not all(self._say(j, k, "agrees") for j in known) or len(known) < len(others):
            return False
        self.expected[k] = {j: [held[j]] for j in others}
        return True

    def everything(self) -> Iterator[tuple[int, OwnPlan]]:
        """All plans that somebody expects of a vehicle, with its number."""
        for known in self.expected.values():
            yield from ((j, one) for j, some in known.items() for one in some)

    def leave(self, k: int) -> None:
        self.expected.pop(k, None)
        for others in self.expected.values():
            others.pop(k, None)
        self.unacknowledged = {pair for pair in self.unacknowledged if k not in pair}

    def agree(self, k: int, found: OwnPlan, holds: OwnPlan, refuses: Callable[[int], bool]) -> bool:
        """Whether all agree to another plan; who holds one that it is not proven past refuses."""
        others = [j for j in self.expected if j != k]
        agreed = all(self._agrees(j, k, found, holds, refuses) for j in others)
        if agreed:
            self._tell(k, found, "drives")
        else:
            self._tell(k, holds, "withdraws")
        return agreed

    def _agrees(
        self, j: int, k: int, found: OwnPlan, holds: OwnPlan, refuses: Callable[[int], bool]
    ) -> bool:
        """Whether a vehicle answers that it expects another plan of one that asks."""
        for _ in range(self.tries):
            if not self._say(k, j, "asks"):
                continue
            known = self.expected[j].setdefault(k, [holds])
            if not any(one is found for one in known):
                known.append(found)
            if refuses(j):
                return False
            if self._say(j, k, "agrees"):
                return True
        return False

    def announce(self, k: int, found: OwnPlan) -> None:
        """A vehicle drives another plan, agreed or not: repeated until all acknowledge it."""
        for j in self.expected:
            if j == k:
                continue
            self.unacknowledged.add((k, j))
            for _ in range(self.tries):
                if not self._say(k, j, "drives"):
                    continue
                self._expect(j, k, found)
                if self._say(j, k, "agrees"):
                    break

    def knows(self, j: int, k: int, found: OwnPlan) -> bool:
        """Whether a vehicle expects a plan of another one."""
        return any(one.course is found.course for one in self.expected[j].get(k, ()))

    def _expect(self, j: int, k: int, found: OwnPlan) -> None:
        """A vehicle knows for sure what another one drives."""
        self.expected[j][k] = [found]
        self.unacknowledged.discard((k, j))

    def others_of(self, k: int) -> Mapping[int, Sequence[OwnPlan]]:
        """The plans that a vehicle expects of each of the others."""
        return self.expected[k]

    def unknown(self, held: Mapping[int, OwnPlan]) -> list[tuple[int, int]]:
        """Pairs of which the first does not expect what the second drives, emergencies left out."""
        return [
            (j, k)
            for j in self.expected
            for k, found in held.items()
            if k != j and (k, j) not in self.unacknowledged and not self.knows(j, k, found)
        ]

    def _tell(self, sender: int, found: OwnPlan, kind: Kind) -> None:
        """A vehicle says to all others which plan it drives."""
        for receiver in self.expected:
            if receiver != sender and self._say(sender, receiver, kind):
                self._expect(receiver, sender, found)

    def _say(self, sender: int, receiver: int, kind: Kind) -> bool:
        """Whether a message arrives."""
        self.sent += 1
        if self.lost is None:
            return True
        return not self.lost(Message(self.step, self.names[sender], self.names[receiver], kind))


Knowledge = _Lossless | _Agreement
"""What every vehicle expects of every other one: the plans that it may drive."""


def knowledge_of(
    names: Sequence[str], lost: Lost | None, near: Callable[[int, OwnPlan], int]
) -> Knowledge:
    """What all know of each other: everything, unless messages may be lost."""
    return _Lossless(near) if lost is None else _Agreement(names, lost)
