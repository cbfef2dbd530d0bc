"""Reads the facts of an instance from its text, in the form that `scene_facts` uses."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from cocap_opt.formulations.independent.scene_facts import Facts, Kind, Place, Position, Turned


class FormatError(ValueError):
    """The text is not an instance; the message names the line."""


class Sight(NamedTuple):
    """Everything that, by the instance, a state sees at a step."""

    kind: int
    step: int
    place: Place
    turned: Turned
    amounts: dict[int, float]  # amount of each group, in px/m2 or 1 drone


@dataclass
class _KindRead:
    """A kind while it is read; places and orientations are numbers."""

    orientations: list[tuple[Turned, list[int]]] = field(default_factory=list)
    places: list[tuple[Place, Position, list[str]]] = field(default_factory=list)
    closed: list[tuple[int, ...]] = field(default_factory=list)
    sees: list[tuple[int, int, int, str]] = field(default_factory=list)
    drones: list[int] = field(default_factory=list)


@dataclass
class Instance:
    """An instance: its facts, and its views.

    Attributes
    ----------
    digest : digest of the scene, as recorded in the instance
    facts : all facts except the views
    """

    digest: str
    facts: Facts
    _kinds: list[_KindRead]

    def sights(self) -> Iterator[Sight]:
        """Yields the views of states in the order of the file: kind by kind."""
        for number, kind in enumerate(self._kinds):
            for t, q, o, text in kind.sees:
                amounts = dict(_entry(part) for part in text.split())
                yield Sight(number, t, kind.places[q][0], kind.orientations[o][0], amounts)


def _entry(text: str) -> tuple[int, float]:
    group, _, amount = text.partition(":")
    return int(group), float.fromhex(amount)


def read_instance(text: str) -> Instance:
    """Reads an instance.

    Raises
    ------
    FormatError
        If a line does not follow the format.
    """
    reader = _Reader()
    for number, line in enumerate(text.splitlines(), 1):
        try:
            reader.read(line)
        except (ValueError, IndexError) as error:
            words = f"line {number} does not follow the format: {error}"
            raise FormatError(words) from error
    try:
        return reader.instance()
    except (ValueError, IndexError) as error:
        raise FormatError(f"does not follow the format: {error}") from error


class _Reader:
    """Processes lines one by one and assembles an instance."""

    def __init__(self) -> None:
        self._single: dict[str, object] = {}
        self._weights: dict[int, tuple[float, int]] = {}
        self._kinds: list[_KindRead] = []
        self._starts: dict[int, tuple[int, list[str]]] = {}
        self._goals: dict[int, list[int] | None] = {}
        self._kind, self._goal, self._digest = 0, list[int]() or None, ""
        self._ended = False

    def read(self, line: str) -> None:
        """Processes a line."""
        word, _, rest = line.partition(" ")
        head, colon, tail = rest.partition(":")
        at = head.split()
        if word == "digest":
            self._digest = at[0]
        elif word == "horizon":
            self._single["horizon"] = int(at[0])
        elif word == "groups":
            names = ("rows of groups", "faces", "people who count")
            self._single.update(zip(names, map(int, at), strict=True))
        elif word == "rewards":
            self._single["rewards for moves"] = tuple(map(float.fromhex, at))
        elif word == "rules":
            self._single["rules"] = tuple(map(float.fromhex, at))
        elif word == "weight":
            most = int(at[2]) if len(at) > 2 else 0
            self._new(self._weights, int(at[0]), (float.fromhex(at[1]), most), "group")
        elif word == "kind":
            self._kinds.append(_KindRead())
        elif word == "class":
            self._kind, self._goal = int(at[0]), [*map(int, tail.split())] if colon else None
        elif word == "drone":
            self._kinds[self._kind].drones.append(int(at[0]))
            self._new(self._starts, int(at[0]), (self._kind, tail.split()), "drone")
            self._goals[int(at[0])] = self._goal
        elif word == "end":
            self._ended = True
        elif word not in ("cocap-instance", "scene", "coverage"):
            self._read_of_kind(word, at, tail, head)

    def _new(self, known: dict[int, tuple[float, int]] | dict[int, tuple[int, list[str]]],
             key: int, value: object, noun: str) -> None:  # fmt: skip
        if key in known:
            raise ValueError(f"{noun} {key} is given twice")
        known[key] = value  # type: ignore[assignment]

    def _read_of_kind(self, word: str, at: list[str], tail: str, head: str) -> None:
        """Processes a line that belongs to the last kind."""
        kind = self._kinds[-1]
        if word == "orientation":
            kind.orientations.append(((int(at[0]), int(at[1])), [*map(int, tail.split())]))
        elif word == "place":
            x, y, layer, among_all = map(int, at[:4])
            position = Position(among_all, *map(float.fromhex, at[4:]))
            kind.places.append(((x, y, layer), position, tail.split()))
        elif word == "closed":
            kind.closed.append(tuple(map(int, head.split())))
        elif word == "sees":
            kind.sees.append((int(at[0]), int(at[1]), int(at[2]), tail))
        else:
            raise ValueError(f"unknown word {word!r}")

    def instance(self) -> Instance:
        """Returns the instance that all lines define."""
        if not self._ended:
            raise ValueError("the line `end` is missing")
        starts: dict[int, set[tuple[int, ...]]] = {
            i: {
                (*self._kinds[kind].places[q][0], *self._kinds[kind].orientations[o][0])
                for q, o in (map(int, state.split(",")) for state in states)
            }
            for i, (kind, states) in self._starts.items()
        }
        goals = {
            i: None if ends is None
            else {self._kinds[self._starts[i][0]].places[q][0] for q in ends}
            for i, ends in self._goals.items()
        }  # fmt: skip
        kinds = tuple(map(_kind, self._kinds))
        return Instance(
            self._digest, Facts(self._single, self._weights, kinds, starts, goals), self._kinds
        )


def _kind(read: _KindRead) -> Kind:
    """Returns a kind with places and orientations in place of numbers."""
    places = [place for place, _, _ in read.places]
    orientations = [at for at, _ in read.orientations]
    if len({*places}) < len(places) or len({*orientations}) < len(orientations):
        raise ValueError("a kind contains a place or an orientation twice")
    return Kind(
        tuple(sorted(read.drones)),
        {place: position for place, position, _ in read.places},
        {
            (place, places[int(end.rstrip("="))], end.endswith("="))
            for place, _, ends in read.places for end in ends
        },
        {(at, orientations[end]) for at, ends in read.orientations for end in ends},
        {(t, places[ends[0]]) for t, *ends in read.closed if len(ends) == 1},
        {(t, places[ends[0]], places[ends[1]]) for t, *ends in read.closed if len(ends) == 2},
    )  # fmt: skip
