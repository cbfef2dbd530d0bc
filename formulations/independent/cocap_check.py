#!/usr/bin/env python3
"""cocap-check: computes what a plan, a certificate or a proof proves about J, by integer
arithmetic.

    python cocap_check.py INSTANCE [PLAN or CERTIFICATE or PROOF]...

An instance says who can fly where, what is seen from there, and how much that is worth. J of a plan
is

    sum over groups of weight * sqrt(sum of all views of the group) + rewards for moves,

or weight * min(number of drones, k) for groups that count drones. The answers are "J of this plan
is at least a" and "no plan has more than b". If b < 0, the answer is "no plan exists", since
instances with a negative weight or reward are rejected, so J is never negative. Numbers in files
are read as exact doubles, and all computations use integers and fractions: quantities are multiples
of 2^-64, rounded up for upper bounds and down for lower bounds; roots are integer roots. Unknown
content is rejected.

Why no plan has more than b. For any alpha, beta >= 0 and views c_i >= 0 of drones i,

    sqrt(sum c_i) <= alpha sum sqrt(c_i) + beta sum c_i + (rest - alpha)^2 / (4 beta),   rest = 1,

since rest r <= alpha r + beta r^2 + (rest - alpha)^2 / (4 beta) for every r >= 0; and min(sum c_i,
k) <= gamma sum c_i + k max(0, rest - gamma) if each c_i is 0 or 1. Part of a root may be bounded by
cuts instead; rest is the remaining share. By the rules, at most one drone may use the resource of a
row: the row's multiplier is added once, and subtracted from each path that uses the resource. So J
is at most the constants plus the value of each drone's best path, which one sweep from the last
step to the first finds. A proof is a tree: at each branch, either at most n drones use a resource,
or at least n + 1; every plan belongs to one of the two. Staged certificates close states that no
better plan visits, and bound each step as a whole: `Staged` and `Search` explain why.
"""

import contextlib
import functools
import hashlib
import io
import itertools
import json
import math
import operator
import os
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

BITS = 64
ONE = 1 << BITS

# Fields of certificates and proofs; fields on which nothing depends are ignored.
FIELDS = {
    "format", "version", "scene", "digest", "method", "classes", "coverage_version", "instance",
    "objective", "bound", "coverage", "certificate", "nodes",
}  # fmt: skip
MULTIPLIERS = {"type", "alpha", "beta", "rows", "cuts", "state_cuts", "decisions", "views"}
STAGED = {"type", "multipliers", "target", "stages", "paths_above", "paths_from", "tails"}
LEAF, BRANCH = {"type", "certificate"}, {"type", "resource", "robots", "at_most", "at_least"}
PLAN_FIELDS = {
    "format", "version", "scene", "digest", "digest_without_objective", "planner", "limit",
    "reason", "seconds", "time_limit", "work_limit", "cut_short", "coverage_version", "reward",
    "plan",
}  # fmt: skip
VERSIONS = {
    "cocap-opt certificate": (4, 5, 6, 7, 8), "cocap-opt proof": (3, 4, 5, 6),
    "cocap-opt plan": (2, 3, 4),
}  # fmt: skip
ROUNDED = 1 - Fraction(1, 10**9)  # tolerance for a plan's reward, which is a sum of doubles
# Errors that damaged files may raise.
DAMAGED = (
    OSError, RecursionError, MemoryError, ArithmeticError, ValueError, TypeError, LookupError,
    AttributeError,
)  # fmt: skip
MOST_CORNERS = 1_000_000  # limit on corners of a cut that are examined, and on gains at them
TOO_MANY = "computing its constant takes too long"
LARGEST_ROOT = Fraction(1e50)  # limit on roots in cuts, and on what is paid for them
MOST_STATES = 1000  # limit on states of a class in a state cut
# limit on branches of the searches of a file; tries of prices at a branch
MOST_BRANCHES, TRIES = 1_000_000, 40
MOST_FOUND = 3_000_000  # limit on the ways that a search keeps, of some hundred bytes each

Number = int | Fraction
Ints = tuple[int, ...]
Spec = dict[str, Any]  # an object of a JSON file
# cells and positions (m), of tail and head
Flown = tuple[Ints, Ints, list[Fraction], list[Fraction]]
Decisions = tuple[tuple[Spec, int, int], ...]  # resource, 1 for "at most" or -1 for "at least", n
Gains = dict[int, list[tuple[int, int, int, float, float]]]  # the views of each state
Condition = tuple[int, bool, list[int]]  # constant, whether worth is added, payments of states
# A state of a search: number of the drone or class that takes it, number of the class, state.
Placed = tuple[int, int, Ints]
# An upper bound on what other steps add: a constant, and an amount for each state of a class.
Rest = tuple[int, Callable[[int, Ints], int]]
# States of a step, a search over them, conditions that a profit is above a number, and profits.
Profits = tuple[list[Placed], "Search", Callable[[int], list[Condition]], Callable[[Ints], int]]
# Joint states with their values; and, for each joint state that leads to some, the F of these.
Reached = tuple[dict[Any, int], dict[Any, dict[Any, int]]]
# Charges of a class's drones for places, moves and states at a step; None: closed.
Charged = tuple[dict[Ints, int | None], dict[Ints, int | None], dict[Ints, int | None]]


class Refused(Exception):  # noqa: N818
    """A file is wrong or has content that this checker does not know."""


def up(value: Number) -> int:
    """Returns a rational number in units of 2^-64, rounded up."""
    value = Fraction(value)
    return -((-value.numerator << BITS) // value.denominator)


def down(value: Number) -> int:
    """Returns a rational number in units of 2^-64, rounded down."""
    return -up(-Fraction(value))


def root_down(value: int) -> int:
    """Returns the root of a number in units of 2^-64, rounded down."""
    return math.isqrt(value << BITS)


def root_up(value: int) -> int:
    """Returns the root of a number in units of 2^-64, rounded up."""
    root = math.isqrt(value << BITS)
    return root + (root * root < value << BITS)


def require(condition: object, message: str) -> None:
    """Raises Refused if the condition does not hold."""
    if not condition:
        raise Refused(message)


@contextlib.contextmanager
def within(place: str) -> Iterator[None]:
    """Prefixes the reason of a rejection with the place of the item."""
    try:
        yield
    except (Refused, *DAMAGED) as error:
        raise Refused(f"{place}: {reason_of(error)}") from error


# -- instances ------------------------------------------------------------------------------------


# The words of each kind of line, before its colon and after it (any number of them): w is a whole
# number, b 0 or 1, x a hexadecimal number, t text; WANTED describes the others.
LINES = {
    "digest": ("t", ""), "coverage": ("w", ""), "horizon": ("w", ""), "groups": ("www", ""),
    "rewards": ("xxxx", ""), "rules": ("bbxx", ""), "weight": ("wxw", ""), "kind": ("", ""),
    "orientation": ("ww", "w"), "place": ("wwwwxxx", "m"), "closed": ("www", ""),
    "sees": ("www", "v"), "class": ("w", "w"), "drone": ("w", "s"),
}  # fmt: skip
# lines that occur exactly once
HEAD = ("digest", "coverage", "horizon", "groups", "rewards", "rules")
MAY_END_EARLY = {"weight", "closed"}  # may be given without their last word
PARENTS = {
    "orientation": "kind", "place": "kind", "closed": "kind", "sees": "kind", "drone": "class",
}  # fmt: skip
WANTED = {
    "w": "a whole number >= 0", "b": "0 or 1", "x": "hexadecimal, such as 0x1.0p+0",
    "t": "text", "m": "a place, such as 3 or 3=", "v": "group:amount, such as 3:0x1.0p+0",
    "s": "place,orientation, such as 3,0",
}  # fmt: skip


def parse(kind: str, word: str) -> Any:
    """Returns the value of a word of an instance; raises ValueError or OverflowError if it has
    none.
    """
    if kind == "x":
        return exact(word)
    if kind == "v":
        group, _, amount = word.partition(":")
        return digits(group), exact(amount)
    if kind == "m":
        return digits(word.removesuffix("=")), word.endswith("=")
    if kind == "s":
        place, _, orientation = word.partition(",")
        return digits(place), digits(orientation)
    if kind == "b" and word not in ("0", "1"):
        raise ValueError(word)
    return word if kind == "t" else digits(word)


def parsed(name: str, kinds: str, words: list[str], noun: str) -> list[Any]:
    """Returns the values of the words of a line; an error names the wrong word."""
    values: list[Any] = []
    for kind, word in zip(kinds, words, strict=False):
        try:
            values.append(parse(kind, word))
        except (ValueError, OverflowError) as error:
            n = len(values) + 1
            th = "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
            message = f"{name}, {n}{th} {noun}: must be {WANTED[kind]}, not {word!r:.40}"
            raise Refused(message) from error
    return values


class Kind:
    """Drones that fly and see alike: their orientations, places, moves and views."""

    def __init__(self) -> None:
        self.headings: list[Ints] = []  # (heading, pitch) of each orientation
        self.turns: list[list[int]] = []  # for each orientation, the orientations one step later
        self.cells: list[Ints] = []  # (x, y, layer among all heights) of each place
        self.layers: list[int] = []  # layer of each place among the heights of its drones
        self.at: list[list[Fraction]] = []  # m
        # places one step later, and True if dx + dy = 0
        self.moves: list[list[tuple[int, bool]]] = []
        self.closed: dict[Ints, None] = {}  # (t, place) and (t, tail, head)
        self.sees: dict[Ints, list[tuple[int, Fraction]]] = {}  # (t, place, orientation)

    @functools.cached_property
    def place_of(self) -> dict[Ints, int]:
        """The place of each cell; available once the file has been read."""
        return {cell: p for p, cell in enumerate(self.cells)}

    @functools.cached_property
    def states(self) -> dict[Ints, Ints]:
        """Place and orientation of each state (x, y, layer, heading, pitch); available once the
        file has been read.
        """
        places = enumerate(zip(self.cells, self.layers, strict=True))
        return {
            (*cell[:2], layer, *turn): (p, o)
            for p, (cell, layer) in places
            for o, turn in enumerate(self.headings)
        }


class Misplaced(Exception):  # noqa: N818
    """A line of an instance contradicts others: the nth line of a word, in a kind if it belongs to
    one.
    """

    def __init__(self, message: str, word: str, nth: int, kind: int | None) -> None:
        super().__init__(message, word, nth, kind)
        self.message, self.word, self.nth, self.kind = message, word, nth, kind

    def told(self, lines: list[list[str]]) -> str:
        """Returns the message, with the number of the line."""
        numbered = [(n, words[0]) for n, words in enumerate(lines, 1) if words]
        first = 0
        if self.kind is not None:
            first = [n for n, word in numbered if word == "kind"][self.kind]
        found = [n for n, word in numbered if word == self.word and n >= first]
        return f"line {found[self.nth]}: {self.word}: {self.message}"


def fits(condition: object, word: str, message: str, nth: int = 0, kind: int | None = None) -> None:
    """Raises Misplaced for the nth line of a word, in a kind if given, if the condition does not
    hold.
    """
    if not condition:
        raise Misplaced(message, word, nth, kind)


class Instance:
    """An instance, read and checked as a whole."""

    def __init__(self, text: str) -> None:
        self.sha256 = hashlib.sha256(text.encode()).hexdigest()
        lines = [line.split() for line in text.splitlines()]
        require(lines and lines[0] == ["cocap-instance", "1"], "line 1: must be cocap-instance 1")
        self.head: dict[str, list[Any]] = {}
        self.weights: dict[int, Fraction] = {}  # weights of groups; all other groups weigh nothing
        self.caps: dict[int, int] = {}  # k of groups that count drones
        self.kinds: list[Kind] = []
        self.classes: list[int] = []  # the kind of each class
        # for each class, the allowed places at the last step
        self.goals: list[set[int] | None] = []
        self.members: list[list[int]] = []  # for each class, its drones
        self.starts: dict[int, list[Ints]] = {}  # for each drone, its possible (place, orientation)
        require(lines[-1] == ["end"], f"line {len(lines)}: the last line must be `end`")
        for number, words in enumerate(lines[1:-1], 2):
            try:
                require(words, "must not be empty")
                self._read(*words)
            except Refused as error:
                raise Refused(f"line {number}: {error}") from error
        for name in HEAD:
            require(name in self.head, f"must contain a line {name}")
        (self.digest,), (self.coverage,), (self.horizon,) = (self.head[name] for name in HEAD[:3])
        self.rows, self.faces, self.people = self.head["groups"]
        self.rewards: list[Fraction] = self.head["rewards"]
        self.vertex, self.swap, *far = self.head["rules"]
        self.far: list[Fraction] = far
        self.n_roots = self.rows * self.faces
        self.where: dict[Ints, list[Fraction]] = {}  # position of each cell, m
        try:
            self._check()
        except Misplaced as error:
            raise Refused(error.told(lines)) from error

    def _read(self, word: str, *rest: str) -> None:
        """Reads a line, given its first word."""
        if word == "scene":  # nothing depends on the scene's name
            return
        known = ", ".join(LINES)
        words = f"must begin with a known word, not {word!r:.40}; known are scene, {known}"
        require(word in LINES, words)
        kinds, kind_after = LINES[word]
        middle = rest.index(":") if ":" in rest else len(rest)
        has_colon = middle < len(rest)
        require(kind_after or not has_colon, f"{word}: must not have a colon")
        sizes = {len(kinds), len(kinds) - (word in MAY_END_EARLY)}
        wanted = " or ".join(map(str, sorted(sizes))) if kinds else "nothing after it"
        noun = "word" if kinds == "t" else "number"
        words = f"{wanted} {noun}{'s' * (wanted != '1')}" if kinds else wanted
        before = " before the colon" * bool(kind_after)
        require(middle in sizes, f"{word}: must have {words}{before}, not {middle}")
        parent = PARENTS.get(word, "")
        has_parent = not parent or (self.kinds if parent == "kind" else self.classes)
        require(has_parent, f"{word}: must follow a line {parent}")
        values = parsed(word, kinds, [*rest[:middle]], noun)
        after_colon = rest[middle + 1 :]
        after = parsed(word, kind_after * len(after_colon), [*after_colon], "word after the colon")
        if word in HEAD:
            require(word not in self.head, f"{word}: must be given once, not twice")
            self.head[word] = values
        elif word == "weight":
            group, weight, *most = values
            require(group not in self.weights, f"weight: must be given once for group {group}")
            self.weights[group] = weight
            if most:
                self.caps[group] = most[0]
        elif word == "kind":
            self.kinds.append(Kind())
        elif word == "orientation":
            self.kinds[-1].headings.append(tuple(values))
            self.kinds[-1].turns.append(after)
        elif word == "place":
            x, y, number, layer = values[:4]
            kind = self.kinds[-1]
            kind.cells.append((x, y, layer))
            kind.layers.append(number)
            kind.at.append(values[4:])
            kind.moves.append(after)
        elif word == "closed":
            closed, key = self.kinds[-1].closed, tuple(values)
            require(key not in closed, "closed: must be given once")
            closed[key] = None
        elif word == "sees":
            key = tuple(values)
            require(key not in self.kinds[-1].sees, "sees: must be given once for a state")
            self.kinds[-1].sees[key] = after
        elif word == "class":
            self.classes.append(values[0])
            self.goals.append({*after} if has_colon else None)
            self.members.append([])
        elif word == "drone":
            (drone,) = values
            require(drone not in self.starts, f"drone: must be given once for drone {drone}")
            self.members[-1].append(drone)
            self.starts[drone] = after

    def _check(self) -> None:
        """Rejects lines that contradict each other."""
        steps, n_groups = range(self.horizon + 1), self.n_roots + (self.horizon + 1) * self.people
        fits(self.horizon >= 1, "horizon", f"must be at least 1, not {self.horizon}")
        fits(
            self.rows in (1, len(steps)),
            "groups",
            f"must have 1 row or {len(steps)}, not {self.rows}",
        )
        fits(min(self.rewards) >= 0, "rewards", "must be numbers >= 0")
        fits(min(self.far) >= 0, "rules", "must be distances >= 0")
        needed = "must begin with 1, as the other rules need it"
        fits(self.vertex or not (self.swap or self.far[0]), "rules", needed)
        for n, (group, weight) in enumerate(self.weights.items()):
            below = f"must be of a group below {n_groups}, not {group}"
            fits(group < n_groups, "weight", below, n)
            fits(weight >= 0, "weight", "must be >= 0", n)
            counts = group >= self.n_roots
            end = "must" if counts else "must not"
            fits(counts == (group in self.caps), "weight", f"{end} end with a number of drones", n)
            fits(self.caps.get(group, 1) >= 1, "weight", "must be of 1 drone or more", n)
        for number, kind in enumerate(self.kinds):
            self._check_kind(number, kind)
        drones = [drone for members in self.members for drone in members]
        for n, drone in enumerate(drones):
            below = f"must be below {len(drones)}, the number of drones, not {drone}"
            fits(drone < len(drones), "drone", below, n)
        nth = 0
        for n, (k, members) in enumerate(zip(self.classes, self.members, strict=True)):
            below = f"must be of a kind below {len(self.kinds)}, not {k}"
            fits(k < len(self.kinds), "class", below, n)
            fits(members, "class", "must have a line drone after it", n)
            places, turns = len(self.kinds[k].moves), len(self.kinds[k].turns)
            is_known = all(place < places for place in self.goals[n] or ())
            fits(is_known, "class", f"must end at places below {places}", n)
            for drone in members:
                fits(self.starts[drone], "drone", "must have a start", nth)
                is_known = all(p < places and o < turns for p, o in self.starts[drone])
                ranges = f"must start at places below {places}, in orientations below {turns}"
                fits(is_known, "drone", ranges, nth)
                nth += 1

    def _check_kind(self, number: int, kind: Kind) -> None:
        """Rejects lines of a kind that contradict each other."""
        n_places, n_turns, horizon = len(kind.moves), len(kind.turns), self.horizon
        known = f"must name places below {n_places}"
        turns = f"must name orientations below {n_turns}"
        cells: set[Ints] = set()
        states: set[Ints] = set()
        for n, (cell, layer) in enumerate(zip(kind.cells, kind.layers, strict=True)):
            heads = [head for head, _ in kind.moves[n]]
            fits(all(head < n_places for head in heads), "place", known, n, number)
            fits(len({*heads}) == len(heads), "place", "must name each move only once", n, number)
            key = *cell[:2], layer
            is_new = cell not in cells and key not in states
            fits(is_new, "place", "must have a cell that no other place has", n, number)
            cells.add(cell)
            states.add(key)
            is_there = self.where.setdefault(cell, kind.at[n]) == kind.at[n]
            fits(
                is_there,
                "place",
                ("must have the position that other kinds give for this cell"),
                n,
                number,
            )
        for n, (heading, after) in enumerate(zip(kind.headings, kind.turns, strict=True)):
            is_new = heading not in kind.headings[:n]
            fits(is_new, "orientation", "must be given once in a kind", n, number)
            fits(all(turn < n_turns for turn in after), "orientation", turns, n, number)
        for n, (t, *places) in enumerate(kind.closed):
            fits(t <= horizon, "closed", f"must be at a step up to {horizon}", n, number)
            fits(all(place < n_places for place in places), "closed", known, n, number)
        late, zero = f"must be at a step up to {horizon}", "must name amounts > 0"
        others, counted = "must name groups of its step", "must count 1 drone of such a group"
        for n, ((t, place, turn), views) in enumerate(kind.sees.items()):
            fits(t <= horizon, "sees", late, n, number)
            fits(place < n_places, "sees", known, n, number)
            fits(turn < n_turns, "sees", turns, n, number)
            fits(
                len(dict(views)) == len(views),
                "sees",
                ("must name each group only once"),
                n,
                number,
            )
            for group, amount in views:
                counts = group >= self.n_roots
                first, width = (self.n_roots, self.people) if counts else (0, self.faces)
                first += width * (t if self.rows > 1 or counts else 0)
                fits(first <= group < first + width, "sees", others, n, number)
                fits(amount > 0, "sees", zero, n, number)
                fits(amount == 1 or not counts, "sees", counted, n, number)

    def near(self, before: list[Fraction], after: list[Fraction]) -> bool:
        """True if two drones violate the separation at some moment of a straight move.

        One is at `before` relative to the other (m) when the move begins, and at `after` when it
        ends.
        """
        aside, above = self.far[0] - Fraction(1, 10**6), self.far[1] - Fraction(1, 10**6)
        way = [b - a for a, b in zip(before, after, strict=True)]
        low, high = Fraction(0), Fraction(1)
        if self.far[1]:
            z, dz = before[2], way[2]
            if dz == 0:
                if abs(z) >= above:
                    return False
            else:
                ends = sorted(((-above - z) / dz, (above - z) / dz))
                low, high = max(low, ends[0]), min(high, ends[1])
                if not (ends[0] < high and low < ends[1] and low <= high):
                    return False
        axes = 2 if self.far[1] else 3
        square = sum(way[k] ** 2 for k in range(axes))
        if square:
            best = -sum(before[k] * way[k] for k in range(axes)) / square
            low = min(max(best, low), high)
        return sum((before[k] + low * way[k]) ** 2 for k in range(axes)) < aside**2

    def conflict(self, a: Flown, b: Flown) -> bool:
        """True if two drones may not make two moves, or occupy two places, at the same step.

        Each argument is (tail cell, head cell, tail position, head position); both ends of a place
        are the same.
        """
        if self.vertex and (a[0] == b[0] or a[1] == b[1]):
            return True
        if self.swap and a[0] == b[1] and a[1] == b[0]:
            return True
        if not self.far[0]:
            return False
        before = [q - p for p, q in zip(a[2], b[2], strict=True)]
        after = [q - p for p, q in zip(a[3], b[3], strict=True)]
        return self.near(before, after)

    def value(self, group: int, amount: int, root: Callable[[int], int]) -> int:
        """Returns the worth of an amount of a group before its weight, using a root that rounds up
        or down.
        """
        return min(amount, self.caps[group] * ONE) if group in self.caps else root(amount)


def exact(word: str) -> Fraction:
    """Returns the exact value of a hexadecimal number; raises ValueError or OverflowError if it is
    not one.
    """
    if not word.lstrip("-").startswith("0x"):
        raise ValueError(word)
    return Fraction(float.fromhex(word))


def digits(word: str) -> int:
    """Returns the whole number that digits spell; raises ValueError if they do not spell one."""
    if not (word.isascii() and word.isdecimal()):
        raise ValueError(word)
    return int(word)


def number_of(value: object, field: str = "") -> Fraction:
    """Returns the exact value of a number in a JSON file, which is read as a double."""
    if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
        return Fraction(value)
    raise Refused(f"{field}must be a finite number, not {value!r:.40}")


# -- plans ----------------------------------------------------------------------------------------


def value_of_plan(instance: Instance, plan: Spec) -> int:
    """Returns J of a plan, rounded down; rejects plans that break a rule."""
    only(plan, PLAN_FIELDS)
    only(plan["plan"], {"paths"})
    paths = plan["plan"]["paths"]
    require(len(paths) == len(instance.starts), "plan: must contain one path per drone")
    seen: dict[int, Fraction] = {}
    total, flown = Fraction(0), []
    for number, k in enumerate(instance.classes):
        kind = instance.kinds[k]
        states, goal = kind.states, instance.goals[number]
        for drone in instance.members[number]:
            named, name = [state_of(state) for state in paths[drone]], f"drone {drone}"
            require(len(named) == instance.horizon + 1, f"{name}: wrong number of steps")
            require(states.keys() >= {*named}, f"{name}: is in a state that does not exist")
            path = [states[state] for state in named]
            require(
                path[0] in instance.starts[drone], (f"{name}: does not begin at an allowed start")
            )
            require(goal is None or path[-1][0] in goal, f"{name}: does not end at its goal")
            for t, (p, o) in enumerate(path):
                require((t, p) not in kind.closed, f"{name}: is in a closed place")
                for group, amount in kind.sees.get((t, p, o), ()):
                    seen[group] = seen.get(group, Fraction(0)) + amount
            for t, ((p, o), (q, n)) in enumerate(itertools.pairwise(path)):
                moves, is_closed = dict(kind.moves[p]), (t, p, q) in kind.closed
                ok = q in moves and n in kind.turns[o] and not is_closed
                require(ok, f"{name}: cannot make its move from step {t}")
                still, cell, heading, even = instance.rewards
                total += still * ((p, o) == (q, n)) + cell * (p == q) + even * moves[q]
                total += heading * (kind.headings[o][0] == kind.headings[n][0])
            flown.append([(kind.cells[p], kind.at[p]) for p, _ in path])
    for pair in itertools.combinations(flown, 2):
        for t in range(instance.horizon):
            a, b = ((p[t][0], p[t + 1][0], p[t][1], p[t + 1][1]) for p in pair)
            require(not instance.conflict(a, b), f"two drones break a rule from step {t} on")
    worth = down(total)
    for group, amount in seen.items():
        value = instance.value(group, down(amount), root_down)
        worth += down(instance.weights.get(group, Fraction(0)) * Fraction(value, ONE))
    return worth


# -- certificates ---------------------------------------------------------------------------------


def highest_corner(drones: list[list[tuple[int, int]]], root: Callable[[int], int]) -> int:
    """Returns the largest excess of a root, rounded up, over payments, which occurs at breakpoints.

    Drones are placed one by one. A partial placement is dropped if another one has as many pixels
    for no more payment. A root gains less the more is seen already, so a partial placement is
    dropped, too, if the gains that later drones would have now cannot bring it above the best one.
    The first best one is a placement that no single drone can improve.

    Parameters
    ----------
    drones : for each drone, its breakpoints as (pixels, payment); (0, 0) may be left out
    root : the root, or another increasing concave function, rounded up
    """
    before, best, chosen, seen, owed = -1, root(0), [(0, 0)] * len(drones), 0, 0
    while best > before:
        before = best
        for number, points in enumerate(drones):
            seen, owed = seen - chosen[number][0], owed - chosen[number][1]
            heights = [(root(seen + p) - v, p, v) for p, v in ((0, 0), *points)]
            chosen[number] = max(heights)[1:]
            seen, owed = seen + chosen[number][0], owed + chosen[number][1]
        best = max(best, root(seen) - owed)
    ways, looked_at = [(0, 0)], 0  # pixels and payment of each partial placement
    for number, points in enumerate(drones, 1):
        ways += [(pixels + p, paid + v) for pixels, paid in ways for p, v in points]
        looked_at += len(ways)
        require(looked_at <= MOST_CORNERS, TOO_MANY)
        lowest, kept = math.inf, []
        later = [(points, len([*same])) for points, same in itertools.groupby(drones[number:])]
        n_later = sum(len(points) for points, _ in later)
        for pixels, paid in sorted(ways, key=lambda way: (-way[0], way[1])):
            if paid < lowest:
                kept.append((pixels, paid))
                lowest, best = paid, max(best, root(pixels) - paid)
        ways, most = [], math.inf  # what later drones can gain at as many pixels, or fewer
        for pixels, paid in reversed(kept):
            here = root(pixels)
            if here - paid + most > best:
                looked_at += n_later
                require(looked_at <= MOST_CORNERS, TOO_MANY)
                most = 0
                for points, n in later:
                    gain = max(root(pixels + p) - v for p, v in points) - here + 2
                    most += n * max(gain, 0)
            if here - paid + most > best:
                ways.append((pixels, paid))
    return best


class Cut:
    """Functions phi of the root that a drone has of a group: root of the sum <= constant + sum of
    phi.
    """

    def __init__(self, instance: Instance, spec: Spec, members: list[list[int]]) -> None:
        only(spec, {"t", "face", "curves", "share"})
        self.group, self.share = bounded_by(instance, spec)
        self.worth = 0  # of its share, once that is known
        self.curves: dict[int, list[tuple[Fraction, Fraction]]] = {}
        for position, curve in enumerate(array(spec["curves"], "curves")):
            with within(f"curves[{position}]"):
                self._take_curve(curve, len(members))
        self.lines: dict[int, tuple[int, int, list[tuple[int, int]]]] = {}  # in whole numbers
        for k, points in self.curves.items():
            unit = math.lcm(*(value.denominator for point in points for value in point))
            slopes = [abs((b[1] - a[1]) / (b[0] - a[0])) for a, b in itertools.pairwise(points)]
            scaled = [(int(r * unit) << BITS, int(v * unit) << BITS) for r, v in points]
            self.lines[k] = math.ceil(max([Fraction(1), *slopes])), unit, scaled
        self.constant = highest_corner([
            [(up(r * r), down(v)) for r, v in curve[1:]]
            for k, curve in self.curves.items()
            for _ in members[k]
        ], root_up)  # fmt: skip

    def _take_curve(self, curve: Spec, classes: int) -> None:
        """Reads the breakpoints of a class."""
        only(curve, {"robot_class", "roots", "values"})
        roots = [number_of(v, "roots: ") for v in array(curve["roots"], "roots")]
        number = whole(curve["robot_class"], "robot_class: ")
        require(0 <= number < classes, f"robot_class: must be 0..{classes - 1}")
        require(number not in self.curves, f"robot_class: {number} is given twice")
        rising = all(a < b for a, b in itertools.pairwise([Fraction(0), *roots]))
        is_allowed = rising and roots and roots[-1] <= LARGEST_ROOT
        require(is_allowed, "roots: must be > 0, <= 1e+50 and increasing")
        values = values_in(curve, len(roots), "root")
        self.curves[number] = [(Fraction(0), Fraction(0)), *zip(roots, values, strict=True)]

    def phi(self, number: int, state: Ints, amount: int, root: int) -> int:
        """Returns phi of class `number`, rounded up, given its root, rounded up by at most one."""
        low = max(root - 1, 0)
        if number not in self.lines:
            return low + 1
        steepest, unit, points = self.lines[number]
        x = low * unit  # in units of 1 / (unit 2^64), like the breakpoints
        for (r, v), (s, u) in itertools.pairwise(points):
            if x <= s:
                return -(-(v * (s - r) + (x - r) * (u - v)) // ((s - r) * unit)) + steepest
        r, v = points[-1]
        return -(-(v + x - r) // unit) + steepest


class StateCut:
    """Numbers phi of listed states, of which no two in one cell are taken at once: root of the sum
    <= constant + sum of phi.

    Elsewhere phi is the root or slope times the pixels, whichever is less. That is at least what
    the root gains, beyond the line of that slope that touches it, taken up to where they touch.
    """

    def __init__(self, instance: Instance, spec: Spec, kinds: list[int]) -> None:
        only(spec, {"t", "face", "payments", "slope", "share"})
        self.group, self.share = bounded_by(instance, spec)
        self.worth = 0  # of its share, once that is known
        require(instance.vertex, "must not be given if drones may share a cell")
        self.slope = number_of(spec["slope"], "slope: ")
        is_allowed = 1 <= self.slope * LARGEST_ROOT <= LARGEST_ROOT**2
        require(is_allowed, "slope: must be 1e-50..1e+50")
        self.t, self.listed = whole(spec["t"]), dict[Ints, Fraction]()  # by class, place, turn
        self.cells: dict[Ints, list[tuple[int, int]]] = {}  # (pixels, value) of their states
        before = -1
        for position, part in enumerate(array(spec["payments"], "payments")):
            with within(f"payments[{position}]"):
                only(part, {"robot_class", "states", "values"})
                number = whole(part["robot_class"], "robot_class: ")
                require(before < number < len(kinds), "robot_class: must exist and increase")
                self._take_class(number, instance.kinds[kinds[number]], part)
                before = number
        by_cell = sorted(self.cells.values(), key=max, reverse=True)  # which is faster
        self.constant = highest_corner(by_cell, self._root)

    def _root(self, pixels: int) -> int:
        """Returns the root or, left of where they touch, the line, rounded up."""
        p, q = self.slope.as_integer_ratio()
        if 4 * p * p * pixels >= q * q * ONE:
            return root_up(pixels)
        return -(-(q * q * ONE + 4 * p * p * pixels) // (4 * p * q))

    def _take_class(self, number: int, kind: Kind, part: Spec) -> None:
        """Reads the states of a class, without those that no drone can reach."""
        with within("states"):
            states = [state_of(state) for state in array(part["states"], "states")]
        require(0 < len(states) <= MOST_STATES, f"states: must be 1..{MOST_STATES} states")
        require(len(set(states)) == len(states), "states: must be distinct")
        values = values_in(part, len(states), "state")
        for state, value in zip(states, values, strict=True):
            if state not in kind.states:
                continue
            p, o = kind.states[state]
            pixels = sum(up(c) for g, c in kind.sees.get((self.t, p, o), ()) if g == self.group)
            self.listed[number, p, o] = value
            self.cells.setdefault(kind.cells[p], []).append((pixels, down(value)))

    def phi(self, number: int, state: Ints, amount: int, root: int) -> int:
        """Returns phi of a view, rounded up, given its amount and its root, rounded up."""
        value = self.listed.get((number, *state))
        if value is not None:
            return up(value)
        return min(root, up(self.slope * Fraction(amount, ONE)))


def bounded_by(instance: Instance, spec: Spec) -> tuple[int, Fraction]:
    """Returns the group that a cut bounds, and its share of the group's root."""
    share = number_of(spec["share"], "share: ")
    require(0 <= share <= 1, "share: must be 0..1")
    t, face = whole(spec["t"], "t: "), whole(spec["face"], "face: ")
    require(instance.rows > 1, "must not be given if pixels add up over time")
    require(0 <= t < instance.rows, f"t: must be 0..{instance.rows - 1}")
    require(0 <= face < instance.faces, f"face: must be 0..{instance.faces - 1}")
    return t * instance.faces + face, share


def whole(value: object, field: str = "") -> int:
    """Returns a whole number; rejects everything else, including booleans."""
    if type(value) is not int:
        raise Refused(f"{field}must be a whole number, not {value!r:.40}")
    return value


def values_in(spec: Spec, count: int, noun: str) -> list[Fraction]:
    """Returns the values of a cut at its roots or states."""
    values = [number_of(v, "values: ") for v in array(spec["values"], "values")]
    require(len(values) == count, f"values: must contain {count} numbers, one per {noun}")
    require(0 <= min(values) <= max(values) <= LARGEST_ROOT, "values: must be 0..1e+50")
    return values


def state_of(value: Any) -> Ints:
    """Returns a state (x, y, layer, heading, pitch), of which the last three may be left out."""
    ok = isinstance(value, list) and 2 <= len(value) <= 5
    require(ok, f"must be a state (x, y, layer, heading, pitch), not {value!r:.40}")
    return (*map(whole, value), *[0] * (5 - len(value)))


def array(value: object, field: str) -> list[Any]:
    """Returns an array; rejects everything else."""
    if not isinstance(value, list):
        raise Refused(f"{field}: must be an array, not {value!r:.40}")
    return value


def only(spec: object, names: set[str]) -> None:
    """Rejects unknown fields."""
    if not isinstance(spec, dict):
        raise Refused(f"must be an object, not {spec!r:.40}")
    unknown = [name for name in spec if name not in names]
    require(not unknown, f"must have no field {unknown[:1]}; allowed: {', '.join(sorted(names))}")


class Bound:
    """The bound that multipliers prove for the plans that obey some decisions."""

    def __init__(self, instance: Instance, single: bool) -> None:
        self.instance, self.members = instance, instance.members
        self.classes = [*enumerate(instance.classes)]
        if single:  # every drone forms its own class
            of = {d: n for n, drones in enumerate(instance.members) for d in drones}
            self.classes = [(of[d], instance.classes[of[d]]) for d in range(len(of))]
            self.members = [[d] for d in range(len(of))]
        self.views = [
            {
                key: [(g, up(c), root_up(up(c))) for g, c in views]
                for key, views in kind.sees.items()
            }
            for kind in instance.kinds
        ]  # groups, each with its views and their roots, both rounded up
        # prices by alpha and beta, and cuts
        self.prices: dict[int, tuple[int, int, list[Cut | StateCut]]] = {}
        self.gained: dict[int, tuple[Fraction, int, int]] = {}  # gains at reference pixels
        self.visible = {g for kind in instance.kinds for v in kind.sees.values() for g, _ in v}
        # Of the current multipliers: constants of groups and of rows (with their steps), charges.
        self.constants: dict[int, int] = {}
        self.row_constants: list[tuple[int, int]] = []
        self.charged: Charged = ({}, {}, {})

    def of(self, numbers: Spec, decisions: Decisions = ()) -> int | None:
        """Returns an upper bound on J of plans that obey the decisions, rounded up; None: no
        plan.
        """
        if numbers.get("type") == "reference":
            return self._of_reference(numbers)
        self.take(numbers)
        total = sum(self.constants.values()) + sum(value for _, value in self.row_constants)
        nus = [number_of(nu) for nu in array(numbers.get("decisions", []), "decisions")]
        require(len(nus) == len(decisions) and all(nu >= 0 for nu in nus), "decisions: wrong")
        for (resource, sign, count), nu in zip(decisions, nus, strict=True):
            if sign > 0 and count <= 0:
                self._charge(resource, None)  # closed
            else:
                total += up(sign * count * nu)
                self._charge(resource, down(sign * nu))
        return self._with_paths(total)

    def take(self, numbers: Spec) -> None:
        """Reads multipliers: credits for views, constants, and charges of rows."""
        instance = self.instance
        only(numbers, MULTIPLIERS)
        require(numbers.get("type", "multipliers") == "multipliers", "certificate: unknown type")
        alpha = self._table(numbers, "alpha")
        beta = self._table(numbers, "beta")
        cuts: list[Cut | StateCut] = []
        for number, spec in enumerate(array(numbers.get("cuts", []), "cuts")):
            with within(f"cuts[{number}]"):
                cuts.append(Cut(instance, spec, self.members))
        kinds = [kind for _, kind in self.classes]
        for number, spec in enumerate(array(numbers.get("state_cuts", []), "state_cuts")):
            with within(f"state_cuts[{number}]"):
                cuts.append(StateCut(instance, spec, kinds))
        rest: dict[int, Fraction] = {}
        by_group: dict[int, list[Cut | StateCut]] = {}
        for cut in cuts:
            rest[cut.group] = rest.get(cut.group, Fraction(1)) - cut.share
            by_group.setdefault(cut.group, []).append(cut)
        self.prices, self.gained, self.constants = {}, {}, {}
        for group, weight in instance.weights.items():
            if group not in self.visible:
                continue
            a, b, left = alpha[group], beta[group], rest.get(group, Fraction(1))
            open_, constant = max(left - a, Fraction(0)), 0
            if group >= instance.n_roots:
                constant += up(weight * instance.caps[group] * open_)
            elif open_:
                require(b > 0, "certificate: beta must be > 0 if alpha is too small")
                constant += up(weight * open_ * open_ / (4 * b))
            for cut in by_group.get(group, ()):
                cut.worth = up(weight * cut.share)
                constant += up(weight * cut.share * Fraction(cut.constant, ONE))
            self.constants[group] = constant
            self.prices[group] = up(weight * a), up(weight * b), by_group.get(group, [])
        self.charged, self.row_constants = ({}, {}, {}), []
        for number, row in enumerate(array(numbers.get("rows", []), "rows")):
            with within(f"rows[{number}]"):
                self._take_row(row)

    def _take_row(self, row: Spec) -> None:
        """Reads the multiplier of a row, whose resource at most one drone can use."""
        only(row, {"resource", "multiplier"})
        multiplier = number_of(row["multiplier"], "multiplier: ")
        require(multiplier >= 0, "multiplier: must be >= 0")
        self._require_row(row["resource"])
        self.row_constants.append((whole(row["resource"]["t"], "t: "), up(multiplier)))
        self._charge(row["resource"], down(multiplier))

    def _with_paths(self, total: int) -> int | None:
        """Returns a constant plus the values of each drone's best path; None if a drone has no
        path.
        """
        instance = self.instance
        for number in range(len(self.classes)):
            value = self.sweep(number)[0]
            for drone in self.members[number]:
                best = [value[s] for s in instance.starts[drone] if s in value]
                if not best:
                    return None
                total += max(best)
        return total

    def _of_reference(self, numbers: Spec) -> int | None:
        """Returns the bound by gains beyond reference pixels; gains shrink as more is seen."""
        i = self.instance
        only(numbers, {"type", "pixels", "views"})
        seen = self._table(numbers, "pixels")
        self.prices, self.charged = {}, ({}, {}, {})
        self.gained = {g: (w, up(seen[g]), down(seen[g])) for g, w in i.weights.items()}
        total = sum(
            up(w * Fraction(i.value(g, up(seen[g]), root_up), ONE)) for g, w in i.weights.items()
        )
        return self._with_paths(total)

    def _table(self, numbers: Spec, name: str) -> list[Fraction]:
        """Returns the numbers of all groups: those of faces, then those of people, who have none in
        beta.
        """
        i = self.instance
        values = self._numbers(numbers[name], f"{name}: ", i.rows, i.faces)
        people = array(numbers.get("views", []), "views")
        if name == "beta":
            return values + [Fraction(0)] * ((i.horizon + 1) * i.people)
        if i.people or people:
            values += self._numbers(people, "views: ", i.horizon + 1, i.people)
        return values

    def _numbers(self, table: Any, field: str, rows: int, columns: int) -> list[Fraction]:
        """Returns the numbers of a table, row by row."""
        lists = [table, *(table if isinstance(table, list) else ())]
        is_whole = all(isinstance(row, list) for row in lists) and (
            [*map(len, lists)] == [rows, *[columns] * rows]
        )
        require(is_whole, f"{field}must have {rows} rows of {columns} numbers")
        values = [number_of(value, field) for row in table for value in row]
        require(all(value >= 0 for value in values), f"{field}must be >= 0")
        return values

    def paid(self, number: int, state: Ints, views: list[tuple[int, int, int]]) -> int:
        """Returns the credit of a drone of a class for its views from a state, rounded up."""
        total, instance = 0, self.instance
        for group, amount, root in views:
            if group in self.gained:
                weight, high, low = self.gained[group]
                gain = instance.value(group, high + amount, root_up)
                total += up(weight * Fraction(gain - instance.value(group, low, root_down), ONE))
            if group not in self.prices:
                continue
            a, b, cuts = self.prices[group]
            if group >= instance.n_roots:
                total += a
                continue
            total += (a * root >> BITS) + (b * amount >> BITS) + 2
            for cut in cuts:
                total += (cut.worth * cut.phi(number, state, amount, root) >> BITS) + 1
        return total

    def sweep(self, number: int) -> list[dict[Ints, int]]:
        """Returns the value of the best path from each state on, at each step."""
        of_class, k = self.classes[number]
        kind = self.instance.kinds[k]
        still, cell, heading, even = map(up, self.instance.rewards)
        n, goal, horizon = len(kind.moves), self.instance.goals[of_class], self.instance.horizon
        worth = {key: self.paid(number, key[1:], views) for key, views in self.views[k].items()}
        places, moves, states = self.charged
        value: dict[Ints, int] = {}
        values: list[dict[Ints, int]] = []
        for t in range(horizon, -1, -1):
            after, value = value, {}
            turned: list[dict[int, int]] = [{} for _ in kind.turns]  # values by place
            for (q, o), worth_there in after.items():
                turned[o][q] = worth_there
            for o, turns in enumerate(kind.turns) if after else ():
                best: dict[int, int] = {}
                for turn in turns:
                    more = heading if kind.headings[turn][0] == kind.headings[o][0] else 0
                    for q, worth_there in turned[turn].items():
                        best[q] = max(best.get(q, worth_there + more), worth_there + more)
                for p in range(n):
                    found = None
                    for q, balanced in kind.moves[p]:
                        charge = moves.get((number, t, p, q), 0)
                        if q not in best or charge is None or (t, p, q) in kind.closed:
                            continue
                        reached = best[q] - charge + even * balanced + cell * (p == q)
                        if p == q and still and o in turns:
                            same = after.get((q, o))
                            if same is not None:
                                reached = max(
                                    reached,
                                    same + heading + still + even * balanced + cell - charge,
                                )
                        found = reached if found is None else max(found, reached)
                    if found is not None:
                        value[p, o] = found
            if t == horizon:
                ends = range(n) if goal is None else goal
                value = {(p, o): 0 for p in ends for o in range(len(kind.turns))}
            for p, o in [*value]:
                here, such = places.get((number, t, p), 0), states.get((number, t, p, o), 0)
                if here is None or such is None or (t, p) in kind.closed:
                    del value[p, o]
                else:
                    value[p, o] += worth.get((t, p, o), 0) - here - such
            values.insert(0, value)
        return values

    # -- resources --------------------------------------------------------------------------

    def _users(self, resource: Spec) -> tuple[int, list[Any]]:
        """Returns the step of a resource, and the cells, moves (tail, head) or state in it."""
        kind, t = str(resource.get("type")), whole(resource.get("t"), "t: ")
        lasts = kind in ("swap", "moves", "move")
        require(0 <= t <= self.instance.horizon - lasts, "resource: t is not a step of the scene")
        known = {
            "cells": {"cells", "robot_class"},
            "swap": {"cells"},
            "moves": {"moves"},
            "move": {"cells", "robot_class"},
            "visit": {"state", "robot_class"},
        }
        require(kind in known, f"resource: unknown type {kind!r}")
        only(resource, known[kind] | {"type", "t"})
        if kind == "visit":
            return t, [state_of(resource["state"])]
        if kind == "moves":
            return t, [(cell_of(a), cell_of(b)) for a, b in resource["moves"]]
        cells = [cell_of(cell) for cell in resource["cells"]]
        if kind == "cells":
            return t, cells
        require(len(cells) == 2, "resource: must contain two cells")
        return t, [(cells[0], cells[1])] + ([(cells[1], cells[0])] if kind == "swap" else [])

    def _charge(self, resource: Spec, charge: int | None) -> None:
        """Charges the users of a resource in each class; None closes the resource."""
        charged = self.charged
        t, users = self._users(resource)
        only_class = resource.get("robot_class")
        for number, (_, k) in enumerate(self.classes):
            kind = self.instance.kinds[k]
            if only_class not in (None, number):
                continue
            at = kind.place_of
            for user in dict.fromkeys(users):
                keys: list[Ints] = []
                if resource["type"] == "visit":
                    part, states = charged[2], kind.states
                    keys += [states[user]] if user in states else []
                elif resource["type"] == "cells":
                    part = charged[0]
                    keys += [(at[user],)] if user in at else []
                else:
                    part = charged[1]
                    keys += [(at[user[0]], at[user[1]])] if {*user} <= at.keys() else []
                for key in keys:
                    full = (number, t, *key)
                    before = part.get(full, 0)
                    part[full] = None if charge is None or before is None else before + charge

    def _require_row(self, resource: Spec) -> None:
        """Rejects a row unless all its users conflict, apart from users that no drone can reach."""
        require(
            resource.get("robot_class") is None and resource.get("type") != "visit",
            "row: must apply to all drones",
        )
        kind, (_, users) = resource["type"], self._users(resource)
        require(kind in ("cells", "swap", "moves"), "resource: must be cells, a swap or moves")
        if kind == "swap":
            require(self.instance.swap, "resource: the scene has no swap rule")
            return
        ends = [(u, u) if kind == "cells" else u for u in dict.fromkeys(users)]
        where = self.instance.where
        moves = [(a, b, where[a], where[b]) for a, b in ends if a in where and b in where]
        for a, b in itertools.combinations_with_replacement(moves, 2):
            require(self.instance.conflict(a, b), "resource: two drones may use it at once")


# -- staged certificates --------------------------------------------------------------------------


class TooLong(Exception):  # noqa: N818
    """A search exceeds its limit of branches or of results; the claim may still hold."""


class _Mixture:
    """A mixture of states, with its groups and conditions, in doubles."""

    def __init__(
        self,
        constants: list[float],
        shares: dict[int, float],
        rows: dict[int, tuple[list[tuple[int, float, float]], tuple[float, ...]]],
        nothing: dict[int, float],
    ) -> None:
        self.constants, self.rows = constants, rows
        self.shares: dict[int, float] = {}
        self.amounts, self.gains, self.values = dict(nothing), dict(nothing), [*constants]
        for x, share in shares.items():
            self._add(x, share)

    def _add(self, x: int, share: float) -> None:
        views, pays = self.rows[x]
        self.shares[x] = self.shares.get(x, 0.0) + share
        for g, gain, amount in views:
            self.gains[g] += share * gain
            self.amounts[g] += share * amount
        self.values = [value - share * pay for value, pay in zip(self.values, pays, strict=True)]

    def move(self, picks: list[int], step: float) -> None:
        """Moves the mixture towards other states."""
        rest = 1 - step
        self.shares = {x: rest * share for x, share in self.shares.items()}
        self.amounts = {g: rest * amount for g, amount in self.amounts.items()}
        self.gains = {g: rest * gain for g, gain in self.gains.items()}
        both = zip(self.values, self.constants, strict=True)
        self.values = [rest * value + step * constant for value, constant in both]
        for x in picks:
            self._add(x, step)


class Search:
    """A search of all placements of the drones of a step, one by one, that keep each condition
    above 0.

    A condition is a constant, less a payment for each drone's state; some conditions add the worth
    of all groups. At a branch with z seen so far, further views c_i gain

        phi(z + sum c_i) - phi(z) <= alpha sum gain(c_i) + beta sum c_i + kappa

    of each group, by the inequality at the top of this file: the left-hand side is concave in the
    sum, and 0 at 0. If all conditions are above 0, so is their sum with shares >= 0. Therefore a
    branch ends if the best states for the sum, one for each remaining drone and at most one per
    cell, do not bring it above 0; and a state is dropped if it does not bring the sum above 0
    together with the best others. The alpha, beta and shares to try are found heuristically, in
    doubles. The bounds that follow from them are computed in whole numbers.
    """

    def __init__(
        self,
        instance: Instance,
        states: list[tuple[int, Ints, list[tuple[int, int]]]],
        counts: list[int],
        near: Callable[[int, int], bool],
    ) -> None:
        self.instance, self.near, self.counts = instance, near, counts
        self.numbers = [number for number, _, _ in states]  # class of each state
        self.cells = [cell for _, cell, _ in states]
        self.views = [[v for v in views if v[0] in instance.weights] for _, _, views in states]
        self.most: dict[int, int] = {}
        for views in self.views:
            for g, c in views:
                self.most[g] = max(c, self.most.get(g, 0))
        self.weight = {g: up(instance.weights[g]) for g in self.most}
        self.base = {
            x: [self._gain(g, c, 0, 0) for g, c in views] for x, views in enumerate(self.views)
        }
        self.gaining: list[bool] = []
        self.pays: list[list[int]] = []
        self.rows: list[tuple[float, ...]] = []
        self.found: list[tuple[int, ...]] = []
        self.tries = 0  # tries of prices at a branch; 0 if all placements are to be found

    def run(
        self, conditions: list[Condition], left: int, tries: int = 0,
        among: list[int] | None = None,
    ) -> int:  # fmt: skip
        """Finds all placements that meet the conditions; returns how many of the allowed branches
        remain.
        """
        self.gaining = [gaining for _, gaining, _ in conditions]
        self.pays = [pays for _, _, pays in conditions]
        floats = [[pay / ONE for pay in pays] for pays in self.pays if tries]
        self.rows = [*zip(*floats, strict=True)]  # payments of each state, in doubles
        self.found, self.left, self.tries = [], left, tries
        cands = [*range(len(self.numbers))] if among is None else among
        constants = [constant for constant, _, _ in conditions]
        self._branch((), {}, constants, self.counts, cands, self.base, {})
        return self.left

    def worth(self, chosen: Ints) -> int:
        """Returns the worth of all groups together, rounded up."""
        seen: dict[int, int] = {}
        for g, c in itertools.chain.from_iterable(self.views[x] for x in chosen):
            seen[g] = seen.get(g, 0) + c
        phi, weight = self.instance.value, self.weight
        return sum((weight[g] * phi(g, c, root_up) >> BITS) + 1 for g, c in seen.items())

    def _gain(self, g: int, c: int, seen: int, before: int) -> tuple[int, int, int, float, float]:
        """Returns a view's group, gain and amount, and the latter two also as doubles.

        The views of the group so far are worth at least `before`, before the weight.
        """
        if g in self.instance.caps:
            gain = self.instance.value(g, seen + c, root_up) - before
        else:
            gain = math.isqrt(seen + c << BITS) + 1 - before
        gain = (self.weight[g] * gain >> BITS) + 1
        return g, gain, c, gain / ONE, c / ONE

    def _picks(
        self, worth: dict[int, Any], counts: list[int]
    ) -> tuple[Any, dict[int, Any], list[int]] | None:
        """Returns the most that the remaining drones can add, the last pick of each class, and the
        states.
        """
        total, last, picks = 0, {}, []
        order = sorted(worth, key=worth.__getitem__, reverse=True)
        for k, count in enumerate(counts):
            taken: set[Ints] = set()
            found = 0
            for x in order if count else ():
                if self.numbers[x] != k or self.cells[x] in taken:
                    continue
                times = 1 if self.instance.vertex else count
                taken.add(self.cells[x])
                total += times * worth[x]
                picks += [x] * times
                last[k], found = worth[x], found + times
                if found == count:
                    break
            if found < count:
                return None
        return total, last, picks

    def _branch(
        self, chosen: Ints, seen: dict[int, int], constants: list[int], counts: list[int],
        cands: list[int], gains: Gains, shares: dict[int, float],
    ) -> None:  # fmt: skip
        self.left -= 1
        if self.left < 0:
            raise TooLong
        total = {x: sum(gain[1] for gain in gains[x]) for x in cands}
        robots = sum(counts)
        parts = [*zip(constants, self.gaining, self.pays, strict=True)]
        for constant, gaining, pays in parts:
            worth = {x: (total[x] if gaining else 0) - pays[x] for x in cands}
            if not (cands := self._kept(constant, worth, counts, cands)):
                return
        if robots == 1:
            self.found += [(*chosen, x) for x in cands]
            if len(self.found) > MOST_FOUND:
                raise TooLong
            return
        if self.tries and robots > 2:
            cands, shares = self._relaxed(seen, constants, counts, cands, gains, shares)
        number = next(k for k, count in enumerate(counts) if count)
        after = [count - (k == number) for k, count in enumerate(counts)]
        high = {x: total[x] - self.pays[0][x] for x in cands}
        order = sorted((x for x in cands if self.numbers[x] == number), key=high.__getitem__)
        others = [x for x in cands if self.numbers[x] > number]
        rest = self._picks(
            {x: high[x] for x in others}, [count * (k > number) for k, count in enumerate(counts)]
        )
        while order and rest is not None:
            x = order.pop()  # best first; states before it are not taken again
            if constants[0] + counts[number] * high[x] + rest[0] <= 0:
                break
            left = [*(order if after[number] else ()), *others]
            if after[number] and not self.instance.vertex:
                left.append(x)
            left = [y for y in left if not self.near(x, y)]
            now = dict(seen)
            for g, c in self.views[x]:
                now[g] = now.get(g, 0) + c
            worth = {g: self.instance.value(g, now[g], root_down) for g, _ in self.views[x]}
            fewer = {
                y: [
                    self._gain(e[0], e[2], now[e[0]], worth[e[0]]) if e[0] in worth else e
                    for e in gains[y]
                ]
                for y in left
            }
            rest_of = [
                constant + (total[x] if gaining else 0) - pays[x]
                for constant, gaining, pays in parts
            ]
            self._branch((*chosen, x), now, rest_of, after, left, fewer, shares)

    def _kept(
        self, constant: int, worth: dict[int, int], counts: list[int], cands: list[int]
    ) -> list[int]:
        """Returns the states whose sum with the best others is above 0."""
        best = self._picks(worth, counts)
        if best is None or constant + best[0] <= 0:
            return []
        most, last = constant + best[0], best[1]
        return [
            x
            for x in cands
            if self.numbers[x] in last and most - last[self.numbers[x]] + worth[x] > 0
        ]

    def _relaxed(
        self, seen: dict[int, int], constants: list[int], counts: list[int], cands: list[int],
        gains: Gains, above: dict[int, float],
    ) -> tuple[list[int], dict[int, float]]:  # fmt: skip
        """Drops states by trial prices; returns the remaining states and the mixture.

        Each try moves the mixture towards its best states (conditional gradients).
        """
        high = {x: sum(e[3] for e in gains[x]) - self.rows[x][0] for x in cands}
        begun = self._picks(high, counts)
        if begun is None:
            return [], {}
        mass = [0.0] * len(counts)
        for x in cands:
            mass[self.numbers[x]] += above.get(x, 0.0)
        if all(m > 0.3 * count for m, count in zip(mass, counts, strict=True) if count):
            shares = {
                x: above[x] * counts[self.numbers[x]] / mass[self.numbers[x]]
                for x in cands
                if x in above
            }
        else:
            shares = dict.fromkeys(begun[2], 1.0)
        seen_f = {g: c / ONE for g, c in seen.items()}
        constants_f = [constant / ONE for constant in constants]
        rows = {x: ([(e[0], e[3], e[4]) for e in gains[x]], self.rows[x]) for x in cands}
        mixture = _Mixture(constants_f, shares, rows, dict.fromkeys(self.most, 0.0))
        heat, best, prices = 0.0, math.inf, None
        for n in range(self.tries):
            (slopes, kappa), values = self._slopes(seen_f, mixture)
            if (lowest := min(values)) > 0:
                break
            heat = heat or max(-0.01 * lowest, 1e-9)
            parts = [math.exp(max((lowest - value) / heat, -40.0)) for value in values]
            parts = [part if part > 1e-4 else 0.0 for part in parts]
            total = sum(parts)
            parts = [part / total for part in parts]
            used = [(k, part) for k, part in enumerate(parts) if part]
            gaining = sum(itertools.compress(parts, self.gaining))
            constant = gaining * kappa + sum(map(operator.mul, parts, constants_f))
            scaled = {g: (gaining * a, gaining * b) for g, (a, b) in slopes.items()}
            worth = {}
            for x, (views, pays) in rows.items():
                value = 0.0
                for k, part in used:
                    value -= part * pays[k]
                for g, gain, amount in views:
                    a, b = scaled[g]
                    value += a * gain + b * amount
                worth[x] = value
            picks = self._picks(worth, counts)
            if picks is None:
                return [], {}
            if constant + picks[0] < best:
                best, prices = constant + picks[0], (slopes, parts)
            if best < 0:
                break
            mixture.move(picks[2], 2 / (30 + n))
        if prices is not None:
            cands = self._proved(seen, constants, counts, cands, gains, prices)
        return cands, mixture.shares

    def _slopes(
        self, seen: dict[int, float], mixture: "_Mixture"
    ) -> tuple[tuple[dict[int, tuple[float, float]], float], list[float]]:
        """Returns alpha and weighted beta of groups, their kappas, and the values of the
        mixture.
        """
        slopes, kappas, worth = {}, 0.0, 0.0
        for g, gain in mixture.gains.items():
            before, weight, cap = seen.get(g, 0.0), self.weight[g] / ONE, self.instance.caps.get(g)
            slopes[g] = 1.0, 0.0
            if cap is None:
                root, amount = math.sqrt(before), mixture.amounts[g]
                together = weight * (math.sqrt(before + amount) - root)
            else:
                together = weight * (cap - min(before, cap))
            if gain <= 0 or together <= 0:
                continue
            worth += min(gain, together)
            alpha = min(max(0.5 - 8 * (gain - together) / together, 0.0), 1.0)
            if cap is None:
                square, rest = before + max(amount, self.most[g] / ONE / 16), weight * (1 - alpha)
                touched = math.sqrt(square)
                beta = rest / (2 * touched)
                kappas += rest * (touched - root) - beta * (square - before)
                slopes[g] = alpha, beta
            else:
                kappas += (1 - alpha) * together
                slopes[g] = alpha, 0.0
        values = [v + worth * g for v, g in zip(mixture.values, self.gaining, strict=True)]
        return (slopes, kappas), values

    def _proved(
        self, seen: dict[int, int], constants: list[int], counts: list[int], cands: list[int],
        gains: Gains, prices: tuple[dict[int, tuple[float, float]], list[float]],
    ) -> list[int]:  # fmt: skip
        """Returns the states that remain at given prices, computed in multiples of 2^-30."""
        parts = [int(part * 2**30) for part in prices[1]]
        used = [(part, pays) for part, pays in zip(parts, self.pays, strict=True) if part]
        gaining = sum(part for part, g in zip(parts, self.gaining, strict=True) if g)
        slopes, kappas = {}, 0
        for g, (alpha, beta) in prices[0].items():
            a, b, kappa = int(alpha * 2**30), int(beta * ONE), 0
            before, weight, rest = seen.get(g, 0), self.weight[g], 2**30 - a
            if g in self.instance.caps:
                more = max(self.instance.caps[g] * ONE - before, 0)
                b, kappa = 0, weight * more * rest >> BITS + 30
            elif rest and b:
                # rest^2 w / (4 b) - rest root(z) + b z / w, all times w
                kappa = -(-rest * rest * weight * weight // (4 * b << 60))
                kappa += (b * before >> BITS) - (rest * weight * root_down(before) >> BITS + 30) + 1
            else:
                a, b = 2**30, 0
            slopes[g] = a, b
            kappas += kappa + 1
        constant = (gaining * kappas >> 30) + 1
        constant += (sum(map(operator.mul, parts, constants)) >> 30) + 1
        worth = {}
        for x in cands:
            gain = sum(
                (slopes[e[0]][0] * e[1] >> 30) + (slopes[e[0]][1] * e[2] >> BITS) + 2
                for e in gains[x]
            )
            paid = sum(part * pays[x] for part, pays in used)
            worth[x] = (gaining * gain - paid >> 30) + 1
        return self._kept(constant, worth, counts, cands)


class Staged:
    """The bound of a staged certificate: J of any plan is at most the target, or this bound.

    Take a plan with J > target. At each step t, its states x and their prices obey

        F_t(x) <= K_t + sum of prices,

    where F_t is the worth of the groups at the step. So J <= B, the sum of all K_t, of the rows'
    multipliers, and of each drone's best path at these prices, less charges. The slack of a state
    is the difference between a drone's best path and its best path through the state. The plan
    loses the slack of its states, and K_t + prices - F_t at each step. So a state with slack >= B -
    target is closed, and at each step

        sum of slacks + K_t + sum of prices - F_t(x) < B - target.                             (*)

    A stage sets new prices and constants: a search shows that no joint state of remaining states
    that is free of conflicts and obeys (*) has more than K_t. At the end, all remaining joint
    states may be explored, step by step, above a higher target: from the start, or from a step in
    the middle on to the end and then back to the start. Or tails of plans are explored: if all lose
    at least L from some step on, J is at most B - L.

    A stage may also show that no move of the team from a step t to the next has more than M_t at
    both together. Then B is less by d_t = max(0, K_t + K_{t+1} - M_t). No two such moves share a
    step, so B is less by the sum of all d. In (*), the d of the step's own move is added to B -
    target: the losses at all other steps, less the d of the moves between them, are not negative.
    """

    def __init__(self, bound: Bound, numbers: Spec, budget: int) -> None:
        self.bound, self.instance, self.left = bound, bound.instance, budget
        i, horizon = self.instance, self.instance.horizon
        only(numbers, STAGED)
        require(i.rows > 1, "staged: not allowed if pixels add up over time")
        bound.take(numbers["multipliers"])
        self.target = up(number_of(numbers["target"], "target: "))
        self.constants = [0] * (horizon + 1)
        for g, constant in bound.constants.items():
            step = g // i.faces if g < i.n_roots else (g - i.n_roots) // i.people
            self.constants[step] += constant
        self.rows = sum(value for _, value in bound.row_constants)
        classes = range(len(bound.classes))
        self.known: dict[tuple[Ints, Ints], bool] = {}  # whether pairs of moves are in conflict
        self.of = [number for number in classes for _ in bound.members[number]]  # drones' classes
        self.pairs: dict[int, int] = {}  # M_t, the constants of moves of the team from t to t + 1
        # For each class and step: the prices of remaining states; their moves, with rewards less
        # charges; the value of the best path from there on; and slacks, as of the last closing.
        self.prices: list[list[dict[Ints, int]]] = []
        self.moves: list[list[dict[Ints, dict[Ints, int]]]] = [[] for _ in classes]
        self.to_go = [bound.sweep(number) for number in classes]
        self.slack: list[list[dict[Ints, int]]] = [[] for _ in classes]
        self.earlier: list[list[tuple[int, list[dict[Ints, int]]]]] = [[] for _ in self.constants]
        for number in classes:
            views = bound.views[bound.classes[number][1]]
            self.prices.append([
                {(p, o): bound.paid(number, (p, o), views.get((t, p, o), [])) for p, o in value}
                for t, value in enumerate(self.to_go[number])
            ])  # fmt: skip
        self._close()
        for number, stage in enumerate(array(numbers["stages"], "stages")):
            with within(f"stages[{number}]"):
                self._stage(stage)
        self.value = max(self.target, self.total)
        above, middle = numbers.get("paths_above"), numbers.get("paths_from")
        require(above is not None or middle is None, "paths_from: not allowed without paths_above")
        if above is not None:
            self._explore(up(number_of(above, "paths_above: ")), middle)
        tails = array(numbers.get("tails", []), "tails")
        require(above is None or not tails, "tails: not allowed together with paths_above")
        if tails:
            self._lose(tails)

    # -- closing ----------------------------------------------------------------------------

    def _successors(self, number: int, t: int, state: Ints) -> dict[Ints, int]:
        """Returns the successors of a state, with rewards less charges of the moves."""
        kind = self.instance.kinds[self.bound.classes[number][1]]
        still, cell, heading, even = map(up, self.instance.rewards)
        charges, after, (p, o) = self.bound.charged[1], self.to_go[number][t + 1], state
        found: dict[Ints, int] = {}
        for q, balanced in kind.moves[p]:
            if (t, p, q) in kind.closed:
                continue
            gain = even * balanced + cell * (p == q) - (charges.get((number, t, p, q)) or 0)
            for turn in kind.turns[o]:
                if (q, turn) in after:
                    same = kind.headings[turn][0] == kind.headings[o][0]
                    found[q, turn] = gain + heading * same + still * ((q, turn) == state)
        return found

    def _charge(self, number: int, t: int, state: Ints) -> int:
        """Returns the charge that rows put on a state."""
        places, _, states = self.bound.charged
        return (places.get((number, t, state[0])) or 0) + (states.get((number, t, *state)) or 0)

    def _sweep(self) -> None:
        """Computes the value of the best path from each remaining state, at the current prices."""
        for number, prices in enumerate(self.prices):
            after: dict[Ints, int] = {}
            for t in range(self.instance.horizon, -1, -1):
                moves, here = self.moves[number][t], {}
                for s in self.slack[number][t]:
                    ways = (
                        [gain + after[q] for q, gain in moves[s].items() if q in after]
                        if moves
                        else [0]
                    )
                    if ways:
                        here[s] = prices[t][s] - self._charge(number, t, s) + max(ways)
                self.to_go[number][t] = after = here

    def _close(self) -> None:
        """Closes states whose slack is too large, and computes B, `total`."""
        horizon, begun = self.instance.horizon, self._begin()
        room = self.total - self.target
        for number, so_far in enumerate(begun):
            to_go, slack, moves = self.to_go[number], [], []
            for t in range(horizon + 1):
                kept = {
                    s: -(v + to_go[t][s]) for s, v in so_far.items() if -(v + to_go[t][s]) < room
                }
                after: dict[Ints, int] = {}
                ways: dict[Ints, dict[Ints, int]] = {}
                for s in kept if t < horizon else ():
                    ways[s] = self._successors(number, t, s)
                    here = so_far[s] + self.prices[number][t][s] - self._charge(number, t, s)
                    for q, gain in ways[s].items():
                        after[q] = max(after.get(q, here + gain), here + gain)
                slack.append(kept)
                moves.append(ways)
                so_far = after
            self.slack[number], self.moves[number] = slack, moves
        self._sweep()  # from some of the remaining states, no path continues
        self._begin()
        for number, steps in enumerate(self.to_go):
            for t, reach in enumerate(steps):
                self.slack[number][t] = {s: self.slack[number][t][s] for s in reach}
                self.prices[number][t] = {s: self.prices[number][t][s] for s in reach}
        room, saved = self.total - self.target, [0, *self._saved()]
        self.closed = [
            (constant, room + sum(saved[t : t + 2]), [dict(prices[t]) for prices in self.prices])
            for t, constant in enumerate(self.constants)
        ]

    def _saved(self) -> list[int]:
        """Returns d_t of each step, by which the move that begins there lowers the bound."""
        saved, constants = [0] * len(self.constants), self.constants
        for t, most in self.pairs.items():
            saved[t] = max(0, constants[t] + constants[t + 1] - most)
        return saved

    def _begin(self) -> list[dict[Ints, int]]:
        """Computes B, `total`; returns, for each class and start, the negated value of its best
        path.
        """
        begun, is_open = [], True
        self.total = sum(self.constants) - sum(self._saved()) + self.rows
        for number, to_go in enumerate(self.to_go):
            first: dict[Ints, int] = {}
            for drone in self.bound.members[number]:
                able = [s for s in self.instance.starts[drone] if s in to_go[0]]
                best = max((to_go[0][s] for s in able), default=0)
                is_open &= bool(able)
                self.total += best
                for s in able:
                    first[s] = max(first.get(s, -best), -best)
            begun.append(first)
        if not is_open:
            self.total = self.target
        return begun

    # -- stages -----------------------------------------------------------------------------

    def _stage(self, stage: Spec) -> None:
        """Takes new prices and constants after checking them, and closes states."""
        only(stage, {"payments", "constants", "moves"})
        priced: set[int] = set()
        for step in array(stage.get("payments", []), "payments"):
            only(step, {"t", "robot_class", "states", "payments", "others"})
            t, number = whole(step["t"], "t: "), whole(step.get("robot_class", 0), "robot_class: ")
            ok = 0 <= t <= self.instance.horizon and 0 <= number < len(self.prices)
            require(ok and len(step["states"]) == len(step["payments"]), "wrong payments")
            if t not in priced:
                priced.add(t)
                self.earlier[t].append(
                    (self.constants[t], [dict(prices[t]) for prices in self.prices])
                )
                self._end_moves(t - 1, t)
            prices, others = (
                self.prices[number][t],
                up(number_of(step.get("others", 0), "others: ")),
            )
            for s in prices:
                prices[s] += others
            names = self.instance.kinds[self.bound.classes[number][1]].states
            for name, payment in zip(step["states"], step["payments"], strict=True):
                state = names.get(state_of(name))
                if state in prices:
                    prices[state] = up(number_of(payment, "payments: "))
        for step in array(stage.get("constants", []), "constants"):
            t, claim = _claim(step, self.instance.horizon)
            if t in priced:
                self.constants[t] = self._highest(t, claim)
            elif claim < self.constants[t]:  # at the same prices it can only fall
                self.constants[t] = min(self.constants[t], self._highest(t, claim))
            priced.discard(t)
        require(not priced, "a step with payments has no constant")
        for move in array(stage.get("moves", []), "moves"):
            t, claim = _claim(move, self.instance.horizon - 1)
            highest = self._highest_move(t, claim)
            self.pairs[t] = min(highest, self.pairs.get(t, highest))
            self._end_moves(t - 1, t + 1)
        self._sweep()
        self._close()

    def _end_moves(self, *steps: int) -> None:
        """Drops the constants of the moves that begin at these steps."""
        for t in steps:
            self.pairs.pop(t, None)

    def _highest(self, t: int, claim: int) -> int:
        """Returns a constant that no joint state exceeds: the claim, or a larger one if the claim
        is too low. Earlier constants limit the profits of joint states, too.
        """
        _, search, above, profit = self._profits(t)
        self.left = search.run(above(claim), self.left, TRIES)
        return max([claim, *map(profit, search.found)])

    def _highest_move(self, t: int, claim: int) -> int:
        """Returns a constant that no move of the team from a step to the next exceeds: the claim,
        or a larger one if the claim is too low. No step adds more than its own constant.
        """
        most, (here, there) = claim, self.constants[t : t + 2]
        if here + there <= claim:
            return claim
        states, search, above, profit = self._profits(t)
        self.left = search.run(above(claim - there), self.left, TRIES)
        begun = {
            tuple(s for _, _, s in sorted(states[x] for x in found)): min(here, profit(found))
            for found in search.found
        }
        states, search, above, profit = self._profits(t + 1, self.of)
        at = {(robot, s): x for x, (robot, _, s) in enumerate(states)}
        for tails, (value, moves) in self._ways(begun, [moves[t] for moves in self.moves]).items():
            for found in self._led_to(at, search, moves, above(claim - value)):
                if not self._is_forbidden(tails, tuple(states[x][2] for x in found)):
                    most = max(most, value + min(there, profit(found)))
        return most

    def _profits(self, t: int, of: list[int] | None = None) -> Profits:
        """Returns the states of a step and a search over them, as `_search` does; the conditions
        that a joint state counts and that its profit is above a number; and its profit, which
        earlier constants limit.
        """
        states, search, obeyed = self._counting(t, of)
        now = [self.prices[k][t][s] for _, k, s in states]
        ceilings = self._ceilings(t, states, 0, now)

        def above(least: int) -> list[Condition]:
            limits = [(high - least, False, pays) for high, _, pays in ceilings]
            return [(-least, True, now), *obeyed, *limits]

        def profit(found: Ints) -> int:
            most = [high - sum(pays[x] for x in found) for high, _, pays in ceilings]
            return min([search.worth(found) - sum(now[x] for x in found), *most])

        return states, search, above, profit

    def _counting(
        self, t: int, of: list[int] | None = None
    ) -> tuple[list[Placed], Search, list[Condition]]:
        """Returns the states of a step and a search over them, as `_search` does, and two
        conditions: that joint states obey (*), and that slacks alone do not rule them out.
        """
        states, search = self._search(t, of)
        constant, room, prices = self.closed[t]
        slack = [self.slack[k][t][s] for _, k, s in states]
        paid = [prices[k][s] + lost for (_, k, s), lost in zip(states, slack, strict=True)]
        return states, search, [(room - constant, True, paid), (room, False, slack)]

    def _ceilings(
        self, t: int, states: list[Placed], constant: int, pays: list[int]
    ) -> list[Condition]:
        """Returns the conditions that earlier constants of a step set for other payments."""
        return [
            (
                high + constant,
                False,
                [pay - prices[k][s] for (_, k, s), pay in zip(states, pays, strict=True)],
            )
            for high, prices in self.earlier[t]
        ]

    def _search(self, t: int, of: list[int] | None = None) -> tuple[list[Placed], Search]:
        """Returns the remaining states of a step, and a search over them: class by class or, given
        the class of each drone, drone by drone.
        """
        counts = [1] * len(of) if of else [len(drones) for drones in self.bound.members]
        numbers = enumerate(of or range(len(counts)))
        states = [(number, k, s) for number, k in numbers for s in self.slack[k][t]]
        listed = []
        for number, k, (p, o) in states:
            kind = self.bound.classes[k][1]
            views = self.bound.views[kind].get((t, p, o), [])
            cell = self.instance.kinds[kind].cells[p]
            listed.append((number, cell, [(g, c) for g, c, _ in views]))

        def near(x: int, y: int) -> bool:
            a, b = listed[x][1], listed[y][1]
            return self._conflict((a, a), (b, b))

        return states, Search(self.instance, listed, counts, near)

    def _conflict(self, a: tuple[Any, Any], b: tuple[Any, Any]) -> bool:
        """True if two moves (tail, head) of cells are in conflict."""
        if (a, b) not in self.known:
            where = self.instance.where
            self.known[a, b] = self.instance.conflict(
                (*a, where[a[0]], where[a[1]]), (*b, where[b[0]], where[b[1]])
            )
        return self.known[a, b]

    # -- paths ------------------------------------------------------------------------------

    def _explore(self, above: int, middle: Any) -> None:
        """Explores all remaining plans above a target, from joint state to joint state.

        A plan that has collected F up to step t is worth at most the sum of F, the later constants
        and rows, and the value that each drone's state can still bring at the current prices.

        Parameters
        ----------
        middle : `paths_from` of the file: the step at which this begins; None: the start
        """
        i = self.instance
        require(above >= self.target, "paths_above: must not be below the target")
        require(not any(i.rewards), "paths_above: not allowed if moves are rewarded")
        before, self.target = self.total, above
        self._close()
        starts = self._starts()
        if middle is None:
            best = self._explore_onward(above, starts)
        else:
            ok = 1 <= whole(middle, "paths_from: ") <= i.horizon
            require(ok, f"paths_from: must be 1..{i.horizon}, not {middle}")
            require(self._is_fixed(), "paths_from: not allowed if starts are free")
            best = self._explore_from(middle, above, starts) if all(starts) else above
        self.value = min(self.value, max(above, min(before, best)))

    def _starts(self) -> list[dict[Ints, int]]:
        """Returns the remaining starts of each drone, class by class."""
        drones = [drone for members in self.bound.members for drone in members]
        return [
            {s: 0 for s in self.instance.starts[drone] if s in self.to_go[number][0]}
            for number, drone in zip(self.of, drones, strict=True)
        ]

    def _is_fixed(self) -> bool:
        """True if no drone chooses its start."""
        return all(len(starts) == 1 for starts in self.instance.starts.values())

    def _lose(self, claims: list[Any]) -> None:
        """Proves how much J all plans above the target lose from some steps on; each loss is the
        claim, or less if the claim is too high.

        The joint states of a step at which less is lost are followed to the end. Shorter tails of
        plans lose at least what has been proved of them.
        """
        i, horizon = self.instance, self.instance.horizon
        require(not any(i.rewards), "tails: not allowed if moves are rewarded")
        bound = self.total + sum(self._saved())
        lost = [0] * (horizon + 2)
        for number, claim in enumerate(claims):
            with within(f"tails[{number}]"):
                only(claim, {"t", "loss"})
                t, loss = whole(claim["t"], "t: "), -up(-number_of(claim["loss"], "loss: "))
                first = 0 if self._is_fixed() else 1
                require(first <= t <= horizon, f"t: must be {first}..{horizon}, not {t}")
                loss = self._least_loss(t, loss, bound, lost)
                lost[: t + 1] = [max(loss, known) for known in lost[: t + 1]]
        self.value = min(self.value, max(self.target, bound - max(lost)))

    def _least_loss(self, t: int, loss: int, bound: int, lost: list[int]) -> int:
        """Returns the J that plans above the target lose from a step on, at most a given loss.

        Parameters
        ----------
        bound : the bound without constants of moves, from which losses count
        lost : what has been proved of the tails from each step on
        """
        above, horizon = bound - loss, self.instance.horizon
        if t:
            states, search, conditions, _ = self._profits(t)
            alone = loss - lost[t + 1]  # what the step itself may lose
            self.left = search.run(conditions(self.constants[t] - alone), self.left, TRIES)
            before = bound - sum(self.constants[t:]) - self._rows_from(t)
            reached: dict[Any, int] = {}
            for found in search.found:
                team = tuple(s for _, _, s in sorted(states[x] for x in found))
                best = sum(self.to_go[k][t][s] for k, s in zip(self.of, team, strict=True))
                reached[team] = before + search.worth(found) - best
        else:
            ways = {(): (0, self._starts())}
            reached, _ = self._step(0, above, ways, self._later(0, lost), lambda *_: True)
        for step in range(t + 1, horizon + 1):
            reached, _ = self._onward(step, above, reached, lost)
        return min(loss, bound - max(reached.values())) if reached else loss

    def _explore_onward(self, above: int, starts: list[dict[Ints, int]]) -> int:
        """Returns the largest value of a plan above the target, or the target.

        If starts are free and nothing is seen from them, the joint states of step 1 come first, and
        then any starts that lead to them.
        """
        seen = any(not t and views for sees in self.bound.views for (t, *_), views in sees.items())
        first = int(not seen and any(len(states) > 1 for states in starts))
        choices = starts
        if first:
            choices = [
                {head: 0 for s in states for head in self.moves[number][0].get(s, {})}
                for number, states in zip(self.of, starts, strict=True)
            ]
        reached, _ = self._step(
            first, above, {(): (0, choices)}, self._later(first),
            lambda _, team: not first or self._has_start(starts, team),
        )  # fmt: skip
        for t in range(first + 1, self.instance.horizon + 1):
            reached, _ = self._onward(t, above, reached)
        return max(reached.values(), default=above)

    def _explore_from(self, middle: int, above: int, starts: list[dict[Ints, int]]) -> int:
        """Returns the largest value of a plan above the target, or the target.

        First come the joint states of the middle step that obey (*). The way to each of them is
        worth at most the earlier constants and rows, and the best paths to its states. From there,
        joint states are explored to the end. Then it is known how much each collects later. Those
        whose total is above the target are explored back to the start.
        """
        rest, brought = self._sooner(middle)
        worth = self._obeying(middle)
        reached = most = {
            team: gain + rest + sum(map(brought, self.of, team)) for team, gain in worth.items()
        }
        moves = []
        for t in range(middle + 1, self.instance.horizon + 1):
            reached, links = self._onward(t, above, reached)
            moves.append(links)
        gains = dict.fromkeys(reached, 0)  # F that the best path from a joint state collects later
        for links in reversed(moves):
            onward = {
                team: [gain + gains[head] for head, gain in heads.items() if head in gains]
                for team, heads in links.items()
            }
            gains = {team: max(values) for team, values in onward.items() if values}
        reached = {
            team: worth[team] + gain for team, gain in gains.items() if most[team] + gain > above
        }
        for t in range(middle - 1, -1, -1):
            reached = self._back(t, above, reached)
        # Drones of one class may be exchanged.
        order = sorted(zip(self.of, (s for states in starts for s in states), strict=True))
        return reached.get(tuple(s for _, s in order), above)

    def _obeying(self, t: int) -> dict[Any, int]:
        """Returns the joint states of a step that obey (*), and their worth."""
        states, search, conditions = self._counting(t)
        space, _, paid = conditions[0]
        conditions += self._ceilings(t, states, space, paid)
        self.left = search.run(conditions, self.left, TRIES)
        return {
            tuple(s for _, _, s in sorted(states[x] for x in found)): search.worth(found)
            for found in search.found
        }

    def _onward(
        self, t: int, above: int, before: dict[Any, int], lost: list[int] | None = None
    ) -> Reached:
        """Returns the joint states of a step that are reached from those of the step before."""
        ways = self._ways(before, [moves[t - 1] for moves in self.moves])
        return self._step(
            t, above, ways, self._later(t, lost),
            lambda tails, heads: not self._is_forbidden(tails, heads),
        )  # fmt: skip

    def _back(self, t: int, above: int, later: dict[Any, int]) -> dict[Any, int]:
        """Returns the joint states of a step that lead to those of the next step."""
        tails: list[dict[Ints, dict[Ints, int]]] = []
        for moves in self.moves:
            tails.append({})
            for tail, heads in moves[t].items():
                for head in heads:
                    tails[-1].setdefault(head, {})[tail] = 0
        return self._step(
            t, above, self._ways(later, tails), self._sooner(t),
            lambda heads, tails: not self._is_forbidden(tails, heads),
        )[0]  # fmt: skip

    def _later(self, t: int, lost: list[int] | None = None) -> Rest:
        """Returns the sum of later constants and rows, less what later moves save or what the tail
        after the step loses, and the most that a state brings later.
        """

        def brings(number: int, s: Ints) -> int:
            return self.to_go[number][t][s] - self.prices[number][t][s]

        less = lost[t + 1] if lost else sum(self._saved()[t + 1 :])
        return sum(self.constants[t + 1 :]) - less + self._rows_from(t), brings

    def _sooner(self, t: int) -> Rest:
        """Returns the sum of earlier constants and rows and of all drones' best paths, less what
        earlier moves save, and the most that a drone's way to a state brings, less its best path.
        """

        def brought(number: int, s: Ints) -> int:
            return -self.slack[number][t][s] - self.to_go[number][t][s]

        constants = sum(self.constants[t:]) - sum(self._saved()[max(t - 1, 0) :])
        return self.total - constants - self._rows_from(t), brought

    def _rows_from(self, t: int) -> int:
        """Returns the sum of the multipliers of the rows of a step and of later ones."""
        return sum(value for step, value in self.bound.row_constants if step >= t)

    def _step(
        self, t: int, above: int, ways: dict[Any, Any], other: Rest,
        may_move: Callable[[Any, Any], bool],
    ) -> Reached:  # fmt: skip
        """Returns the joint states of a step that are reached, each with the largest value of a way
        to it; and, for each joint state that leads to them, the F of each of them.

        Parameters
        ----------
        ways : for each joint state, its value, and the states to which each drone can move
        other : the most that the steps add that are not explored yet
        may_move : called with a joint state and one to which it leads; False: ignore the move
        """
        reached: dict[Any, int] = {}
        links: dict[Any, dict[Any, int]] = {}
        rest, adds = other
        states, search = self._search(t, self.of)
        away = [-adds(number, s) for _, number, s in states]
        at = {(robot, s): x for x, (robot, _, s) in enumerate(states)}
        limit = [pay - self.prices[k][t][s] for pay, (_, k, s) in zip(away, states, strict=True)]
        for team, (value, moves) in ways.items():
            open_ = value + rest - above
            conditions = [(open_, True, away), (open_ + self.constants[t], False, limit)]
            for found in self._led_to(at, search, moves, conditions):
                heads = tuple(states[x][2] for x in found)
                if not may_move(team, heads):
                    continue
                gain = search.worth(found)
                # Drones of one class may be exchanged.
                order = sorted(zip(self.of, heads, strict=True))
                key = tuple(s for _, s in order)
                reached[key] = max(value + gain, reached.get(key, value + gain))
                links.setdefault(team, {})[key] = gain
        return reached, links

    def _led_to(
        self, at: dict[Any, int], search: Search, moves: list[Any], conditions: list[Condition]
    ) -> list[Ints]:
        """Returns the joint states, drone by drone, to which moves lead and that meet conditions.

        Parameters
        ----------
        at : the number of each drone's state in the search
        moves : the states to which each drone can move
        """
        among = [
            at[way] for robot, heads in enumerate(moves) for s in heads if (way := (robot, s)) in at
        ]
        self.left = search.run(conditions, self.left, 0, among)
        return search.found

    def _ways(self, reached: dict[Any, int], moves: list[dict[Ints, Any]]) -> dict[Any, Any]:
        """Returns the value of each joint state, and the states to which each drone can move.

        Parameters
        ----------
        moves : for each class and state, the states to which a drone can move
        """
        return {
            team: (value, [moves[k].get(s, {}) for k, s in zip(self.of, team, strict=True)])
            for team, value in reached.items()
        }

    def _has_start(self, starts: list[dict[Ints, int]], heads: Any, before: Any = ()) -> bool:
        """True if the drones can reach these states from some starts without a conflict."""
        if len(before) == len(heads):
            return True
        robot = len(before)
        number, head = self.of[robot], heads[robot]
        cells = self.instance.kinds[self.bound.classes[number][1]].cells
        for s in starts[robot]:
            if head in self.moves[number][0].get(s, {}):
                tail = cells[s[0]]
                move = tail, cells[head[0]]
                if not any(
                    self._conflict(move, other) or self._conflict((tail, tail), (other[0],) * 2)
                    for other in before
                ) and self._has_start(starts, heads, (*before, move)):
                    return True
        return False

    def _is_forbidden(self, tails: Any, heads: Any) -> bool:
        """True if two drones break a rule on the way between two steps."""
        cells = [self.instance.kinds[self.bound.classes[number][1]].cells for number in self.of]
        moves = [(cell[a[0]], cell[b[0]]) for cell, a, b in zip(cells, tails, heads, strict=True)]
        return any(self._conflict(a, b) for a, b in itertools.combinations(moves, 2))


def _claim(spec: Spec, last: int) -> tuple[int, int]:
    """Returns the step and the constant that a stage claims, with an allowance for rounding."""
    only(spec, {"t", "constant"})
    t, claim = whole(spec["t"], "t: "), up(number_of(spec["constant"], "constant: "))
    require(0 <= t <= last, "t is not a step of the scene")
    return t, claim + (abs(claim) >> 44)  # allows for rounding by the producer of the file


# -- files ----------------------------------------------------------------------------------------


def cell_of(cell: Any) -> Ints:
    """Returns a cell (x, y, layer)."""
    require(
        isinstance(cell, list) and len(cell) in (2, 3),
        ("resource: must contain cells (x, y, layer)"),
    )
    return tuple(cell) if len(cell) == 3 else (*cell, 0)


def bound_of_file(
    instance: Instance, file: Spec, branches: int | None = None
) -> tuple[int | None, bool]:
    """Returns the bound of a certificate or a proof, rounded up, and True if a search was left out.

    The bound is None if there is no plan. All searches together may use the given number of
    branches.
    """
    only(file, FIELDS)
    require(file.get("classes", "alike") in ("alike", "single"), "classes: must be alike or single")
    bound = Bound(instance, file.get("classes") == "single")
    is_proof = file["format"] == "cocap-opt proof"
    require(("nodes" in file) == is_proof and ("certificate" in file) != is_proof, "wrong fields")
    if not is_proof:
        numbers = file["certificate"]
        if numbers.get("type") == "staged":
            try:
                return Staged(bound, numbers, branches or MOST_BRANCHES).value, False
            except TooLong:
                return bound.of(numbers["multipliers"]), True
        return bound.of(numbers), False
    nodes, worst = file["nodes"], None
    todo: list[tuple[Any, Decisions]] = [(0, ())]
    met: set[int] = set()
    while todo:
        number, decisions = todo.pop()
        require(0 <= whole(number) < len(nodes), "nodes: names a node that does not exist")
        require(number not in met, "nodes: a node has two parents")
        met.add(number)
        node = nodes[number]
        with within(f"nodes[{number}]"):
            if node.get("type") == "leaf":
                only(node, LEAF)
                found = bound.of(node["certificate"], decisions)
                worst = found if worst is None else worst if found is None else max(worst, found)
                continue
            require(node.get("type") == "branch", "type: must be branch or leaf")
            only(node, BRANCH)
            resource, count = node["resource"], whole(node["robots"], "robots: ")
            require(count >= 0, "robots: must be >= 0")
            todo += [
                (node["at_most"], (*decisions, (resource, 1, count))),
                (node["at_least"], (*decisions, (resource, -1, count + 1))),
            ]
    return worst, False


def told(value: int, rounding: int) -> str:
    """Returns a number in units of 2^-64 in decimals, rounded up or down."""
    scaled = -(-value * 10**6 >> BITS) if rounding > 0 else value * 10**6 >> BITS
    sign, scaled = "-" * (scaled < 0), abs(scaled)
    return f"{sign}{scaled // 10**6}.{scaled % 10**6:06d}"


def kind_of(instance: Instance, document: Any) -> str:
    """Returns the kind of a file; rejects an unknown kind, or a file that does not belong to this
    instance.
    """
    require(isinstance(document, dict), "must be a JSON object")
    kind = str(document.get("format"))
    require(kind in VERSIONS, f"format: must be one of {', '.join(VERSIONS)}, not {kind!r:.40}")
    versions, version = VERSIONS[kind], whole(document.get("version"), "version: ")
    among = ", ".join(map(str, versions))
    require(version in versions, f"version: must be one of {among}, not {version}")
    require(document.get("digest") == instance.digest, "digest: the file belongs to another scene")
    made_of = document.get("instance", instance.sha256)
    is_it = made_of == instance.sha256
    require(is_it, f"instance: the file belongs to the instance with sha256 {made_of!r:.80}")
    version = document.get("coverage_version")
    is_it = version in (None, instance.coverage)
    require(is_it, f"coverage_version: must be the instance's {instance.coverage}, not {version}")
    return kind


def answer(instance: Instance, document: Spec, branches: int | None = None) -> tuple[str, bool]:
    """Returns the statement that a file proves, and True if part of its claim is not checked."""
    if kind_of(instance, document) == "cocap-opt plan":
        value = value_of_plan(instance, document)
        reward = number_of(document["reward"], "reward: ")
        require(value >= down(reward * ROUNDED), "reward: claims more than the plan's J")
        return f"J of this plan is at least {told(value, -1)}", False
    bound, is_part = bound_of_file(instance, document, branches)
    says = what_holds(bound)
    if is_part:
        return (
            f"{says}, by its multipliers; its claim rests on a search that takes too long here",
            True,
        )
    claim = document["bound"]
    limit = None if claim is None else down(number_of(claim, "bound: "))
    is_plan_less = bound is None or bound < 0
    holds = is_plan_less if limit is None else bound is None or bound <= limit
    require(holds, "bound: claims less than its numbers prove")
    return says, False


def what_holds(bound: int | None) -> str:
    """Returns the statement that a bound makes about all plans; None: a drone has no path.

    J is never negative, since weights and rewards of an instance are not.
    """
    if bound is None:
        return "no plan exists: a drone has no path left"
    if bound < 0:
        return f"no plan exists: J would be at most {told(bound, 1)}, but no J is below 0"
    return f"no plan has more than {told(bound, 1)}"


# -- the command ----------------------------------------------------------------------------------


class WrongCall(Exception):  # noqa: N818
    """The command line lacks a file, or names files of the wrong kind or in the wrong order."""


HELP = """\
usage: {name} [--branches N] INSTANCE [FILE]...

Checks what plans, certificates and proofs claim of J, by whole numbers alone.

  INSTANCE  the scene in exact numbers; write it with
            cocap-opt export SCENE -o scene.instance
  FILE      a plan, a certificate or a proof of that scene (JSON), as many as
            you like

  --branches N  give up the searches of a file after N branches (default:
                {branches:,}, which takes minutes); more take longer

Prints a line for each FILE:

  J of this plan is at least ...   the plan obeys the rules, and its J is right
  no plan has more than ...        the bound holds for every plan
  no plan exists: ...              no plan obeys the rules
  refused: ...                     the reason why the file proves nothing

Exit codes:

  0  every claim of the files holds
  1  a file is refused: its claim does not hold, it breaks a rule, or it has
     unknown content
  2  a wrong call, such as a missing file: nothing is checked; or the answer
     cannot be written
  3  a claim rests on a search that takes too long here: only its multipliers
     are checked; --branches allows a longer one

Example: {name} bottleneck.instance plan.json proof.json
"""


def number_of_branches(word: str = "") -> int:
    """Returns the number that follows --branches."""
    if not (word.isdecimal() and word.isascii() and len(word) < 19 and int(word)):
        raise WrongCall(f"--branches: must be a whole number > 0, not {word or 'nothing'}")
    return int(word)


def content_of(name: str) -> bytes:
    """Returns the bytes of a file."""
    try:
        with open(name, "rb") as file:
            return file.read()
    except FileNotFoundError as error:
        raise WrongCall(f"{name}: no such file") from error
    except (OSError, ValueError) as error:  # ValueError: the name contains a NUL
        words = getattr(error, "strerror", None) or error
        raise WrongCall(f"{name}: cannot be read: {words}") from error


def require_kinds(names: list[str], contents: list[bytes]) -> None:
    """Raises WrongCall unless the first file is an instance and all others are JSON."""
    for number, (name, content) in enumerate(zip(names, contents, strict=True)):
        is_instance = content.startswith(b"cocap-instance")
        if number and is_instance:
            raise WrongCall(f"{name}: is an instance; name only one, as the first file")
        if not number and not is_instance:
            found = noun_of(content)
            words = f"is {found}; name the .instance first" if found else (
                "is not an instance; write one with cocap-opt export SCENE -o scene.instance"
            )  # fmt: skip
            raise WrongCall(f"{name}: {words}")
        if number and not content.strip():
            raise WrongCall(f"{name}: is empty")
        if number and content.lstrip()[:1] not in b"{[":
            words = "is not JSON; name plans, certificates and proofs of cocap-opt"
            raise WrongCall(f"{name}: {words}")


def noun_of(content: bytes) -> str:
    """Returns a noun for a JSON file; empty if it is not a kind that is checked."""
    try:
        kind = json.loads(content)["format"]
    except DAMAGED:
        return ""
    return f"a {kind.removeprefix('cocap-opt ')}" if kind in [*VERSIONS] else ""


def read_json(content: bytes) -> Any:
    """Returns the value of a JSON file; rejects objects that contain a field twice."""
    try:
        return json.loads(
            content.decode(), parse_constant=no_constant, object_pairs_hook=without_twins
        )
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise Refused(f"{where}: must be JSON; the file is damaged or truncated") from error
    except RecursionError as error:
        raise Refused("is nested too deeply") from error


def main(arguments: list[str]) -> int:
    """Reads the files and prints the statements that they prove.

    Returns
    -------
    0 if all claims hold, 1 if a file is rejected, 2 for a wrong command line, 3 if a claim rests on
    a search that takes too long here
    """
    say = functools.partial(print, flush=True)
    command = "python cocap_check.py" if sys.argv[0].endswith(".py") else "cocap-check"
    if {"-h", "--help"} & {*arguments}:
        say(HELP.format(name=command, branches=MOST_BRANCHES), end="")
        return 0
    branches = None
    try:
        if "--branches" in arguments:
            at = arguments.index("--branches")
            branches = number_of_branches(*arguments[at + 1 : at + 2])
            arguments = arguments[:at] + arguments[at + 2 :]
        options = [name for name in arguments if name.startswith("-")]
        if options:
            words = f"no such option; to name a file like that, write ./{options[0]}"
            raise WrongCall(f"{options[0]}: {words}")
        if not arguments:
            raise WrongCall(f"INSTANCE: name a file; see {command} --help")
        contents = [*map(content_of, arguments)]
        require_kinds(arguments, contents)
    except WrongCall as error:
        say(error)
        return 2
    name, worst = arguments[0], 0
    try:
        instance = Instance(contents[0].decode())
    except (Refused, *DAMAGED) as error:
        say(f"{name}: refused: {reason_of(error)}")
        return 1
    say(f"instance of sha256 {instance.sha256}")
    for name, content in zip(arguments[1:], contents[1:], strict=True):
        try:
            words, is_part = answer(instance, read_json(content), branches)
            say(f"{name}: {words}")
            worst = worst or 3 * is_part
        except (Refused, *DAMAGED) as error:
            say(f"{name}: refused: {reason_of(error)}")
            worst = 1
    return worst


def reason_of(error: BaseException) -> str:
    """Returns the reason why a file is rejected, in words."""
    if isinstance(error, KeyError) and isinstance(error.args[0], str):
        return f"must have the field {error}"
    if isinstance(error, UnicodeDecodeError):
        return f"must be UTF-8 text, but byte {error.start + 1} is not"
    if isinstance(error, (OverflowError, RecursionError)):
        return "a number is too large, or lists are nested too deeply"
    if isinstance(error, (AttributeError, IndexError, TypeError)):
        return f"a field has a value of the wrong kind or length ({error})"
    return str(error) or type(error).__name__


def without_twins(pairs: list[tuple[str, Any]]) -> Spec:
    """Returns an object of a file; rejects an object that contains a field twice."""
    require(len(dict(pairs)) == len(pairs), "a field is given twice")
    return dict(pairs)


def no_constant(name: str) -> None:
    """Rejects NaN and infinity, which are not JSON numbers."""
    raise Refused(f"must hold finite numbers only, not {name}")


def run() -> None:
    """Runs the command; the exit code is only 0 or 1 if the whole answer was written."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files need not be valid text
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = main(sys.argv[1:])
    except KeyboardInterrupt:
        code = 130
    except OSError as error:
        code = 2
        with contextlib.suppress(OSError):
            sys.stderr.write(f"standard output: cannot be written: {error.strerror}\n")
        # What is left in the buffer would fail once more at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    sys.exit(code)


if __name__ == "__main__":
    run()
