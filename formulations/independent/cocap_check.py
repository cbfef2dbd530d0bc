#!/usr/bin/env python3
"""cocap-check: what a plan, a certificate or a proof says of J, by whole numbers alone.

    python cocap_check.py INSTANCE [PLAN or CERTIFICATE or PROOF]...

An instance says who can fly where, what is seen from there, and what that is worth. J of a plan is

    sum over groups of  weight * sqrt(sum of all that is seen of the group)  + rewards for moves,

or weight * min(number of drones, k) for groups that count drones. The answers are "J of this plan
is at least a" and "no plan has more than b". Numbers of files are taken as the doubles that they
are, and then all is integers and fractions: quantities are multiples of 2^-64, rounded up where an
upper bound is wanted and down where a lower one is; roots are integer roots. Nothing is searched,
and what is not known is refused.

Why no plan has more than b. For any alpha, beta >= 0 and what drones i see, c_i >= 0,

    sqrt(sum c_i) <= alpha sum sqrt(c_i) + beta sum c_i + (rest - alpha)^2 / (4 beta),   rest = 1,

since rest r <= alpha r + beta r^2 + (rest - alpha)^2 / (4 beta) for every r >= 0; min(sum c_i, k)
<= gamma sum c_i + k max(0, rest - gamma), where each c_i is 0 or 1. Part of a root may be bounded
by cuts instead, rest is what they leave. At most one drone may use what a row names, by the rules:
its multiplier is added once, and taken from each path that uses it. So J is at most the constants
plus each drone's best path, which one sweep from the last step to the first finds. A proof is a
tree: at each branch at most n drones use something, or at least n + 1; every plan goes one way.
"""

import functools
import hashlib
import itertools
import json
import math
import sys
from collections.abc import Callable
from fractions import Fraction
from typing import Any

BITS = 64
ONE = 1 << BITS

# Of certificates and proofs; those that nothing depends on are let pass.
FIELDS = {
    "format", "version", "scene", "digest", "method", "classes", "coverage_version", "objective",
    "bound", "coverage", "certificate", "nodes",
}  # fmt: skip
PLAN_FIELDS = {
    "format", "version", "scene", "digest", "digest_without_objective", "planner", "limit",
    "reason", "seconds", "time_limit", "work_limit", "cut_short", "coverage_version", "reward",
    "plan",
}  # fmt: skip
VERSIONS = {
    "cocap-opt certificate": (4, 5, 6), "cocap-opt proof": (3, 4, 5), "cocap-opt plan": (2, 3, 4),
}  # fmt: skip
ROUNDED = 1 - Fraction(1, 10**9)  # of a plan's reward, which is a sum of doubles
# What reading damaged files may raise.
DAMAGED = (
    OSError, RecursionError, MemoryError, ArithmeticError, ValueError, TypeError, LookupError,
    AttributeError,
)  # fmt: skip
MOST_CORNERS = 1_000_000  # of a cut that are looked at

Number = int | Fraction
Ints = tuple[int, ...]
Spec = dict[str, Any]  # an object of a file of JSON
Flown = tuple[Ints, Ints, list[Fraction], list[Fraction]]  # cells and positions (m), tail and head
Decisions = tuple[tuple[Spec, int, int], ...]  # resource, 1 for at most and -1 for at least, n
# What drones of a class pay for places, moves and states at a step; None: they are closed.
Charged = tuple[dict[Ints, int | None], dict[Ints, int | None], dict[Ints, int | None]]


class Refused(Exception):  # noqa: N818
    """A file says something that is not so, or that this checker does not know."""


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
    """Refuses what is not so."""
    if not condition:
        raise Refused(message)


# -- instances ------------------------------------------------------------------------------------


# Words before the colon of each kind of line, and what stands after it, if it has one.
WORDS = {
    "digest": ((1,), ""), "coverage": ((1,), ""), "horizon": ((1,), ""), "groups": ((3,), ""),
    "rewards": ((4,), ""), "rules": ((4,), ""), "weight": ((2, 3), ""), "kind": ((0,), ""),
    "orientation": ((2,), "turns"), "place": ((7,), "moves"), "closed": ((2, 3), ""),
    "sees": ((3,), "views"), "class": ((1,), "goal"), "drone": ((1,), "starts"),
}  # fmt: skip


class Kind:
    """Drones that fly and see alike: orientations, places, moves, and what is seen from there."""

    def __init__(self) -> None:
        self.headings: list[Ints] = []  # (heading, pitch) of each orientation
        self.turns: list[list[int]] = []  # of each, the orientations a step later
        self.cells: list[Ints] = []  # (x, y, layer among all) of each place
        self.layers: list[int] = []  # of each place, among those of its drones
        self.at: list[list[Fraction]] = []  # m
        self.moves: list[list[tuple[int, bool]]] = []  # place a step later; dx + dy = 0
        self.closed: set[Ints] = set()  # (t, place) and (t, tail, head)
        self.sees: dict[Ints, list[tuple[int, Fraction]]] = {}  # (t, place, orientation)

    @functools.cached_property
    def place_of(self) -> dict[Ints, int]:
        """The place of each cell, once all is read."""
        return {cell: p for p, cell in enumerate(self.cells)}

    @functools.cached_property
    def states(self) -> dict[Ints, Ints]:
        """Place and orientation of each state (x, y, layer, heading, pitch), once all is read."""
        places = enumerate(zip(self.cells, self.layers, strict=True))
        return {
            (*cell[:2], layer, *turn): (p, o)
            for p, (cell, layer) in places
            for o, turn in enumerate(self.headings)
        }


class Instance:
    """An instance, read whole or refused."""

    def __init__(self, text: str) -> None:
        lines = [line.split() for line in text.splitlines()]
        require(lines and lines[0] == ["cocap-instance", "1"], "line 1: must be cocap-instance 1")
        require(lines[-1] == ["end"], "the last line must be: end")
        self.head: dict[str, tuple[str, ...]] = {}
        self.weights: dict[int, Fraction] = {}  # of groups; others weigh nothing
        self.caps: dict[int, int] = {}  # k of groups that count drones
        self.kinds: list[Kind] = []
        self.classes: list[int] = []  # the kind of each
        self.goals: list[set[int] | None] = []  # of each class, the places at the last step
        self.members: list[list[int]] = []  # of each class, its drones
        self.starts: dict[int, list[Ints]] = {}  # of each drone, (place, orientation)
        for number, words in enumerate(lines[1:-1], 2):
            try:
                self._read(*words)
            except (Refused, ValueError, TypeError, LookupError, OverflowError) as error:
                raise Refused(f"line {number}: {error}") from error
        for name in ("digest", "coverage", "horizon", "groups", "rewards", "rules"):
            require(name in self.head, f"there is no line: {name}")
        self.digest, self.horizon = self.head["digest"][0], int(self.head["horizon"][0])
        self.coverage = int(self.head["coverage"][0])
        self.rows, self.faces, self.people = map(int, self.head["groups"])
        self.rewards = [exact(word) for word in self.head["rewards"]]
        vertex, swap, *far = self.head["rules"]
        self.vertex, self.swap, self.far = vertex == "1", swap == "1", [*map(exact, far)]
        self.n_roots = self.rows * self.faces
        self.where: dict[Ints, list[Fraction]] = {}  # position of each cell, m
        self._check()

    def _read(self, word: str, *rest: str) -> None:
        if word == "scene":  # nothing depends on its name
            return
        parts = " ".join(rest).split(" : ") if ":" in rest[:-1] else [" ".join(rest).rstrip(" :")]
        before, after = parts[0].split(), parts[1].split() if len(parts) > 1 else []
        require(word in WORDS, f"unknown word: {word!r:.40}")
        sizes, after_colon = WORDS[word]
        require(len(before) in sizes, f"{word}: wrong number of words")
        require(len(parts) <= 2 and (after_colon or ":" not in rest), f"{word}: too many colons")
        if word in ("digest", "coverage", "horizon", "groups", "rewards", "rules"):
            require(word not in self.head, f"{word} is there twice")
            self.head[word] = rest
            require(word != "rules" or {*rest[:2]} <= {"0", "1"}, "rules: must be 0 or 1")
        elif word == "weight":
            group, weight, *most = before
            require(int(group) not in self.weights, "a weight is there twice")
            self.weights[int(group)] = exact(weight)
            if most:
                self.caps[int(group)] = int(most[0])
        elif word == "kind":
            self.kinds.append(Kind())
        elif word == "orientation":
            self.kinds[-1].headings.append(tuple(map(int, before)))
            self.kinds[-1].turns.append([*map(int, after)])
        elif word == "place":
            x, y, number, layer = map(int, before[:4])
            kind = self.kinds[-1]
            kind.cells.append((x, y, layer))
            kind.layers.append(number)
            kind.at.append([exact(value) for value in before[4:]])
            kind.moves.append([(int(head.rstrip("=")), head[-1] == "=") for head in after])
        elif word == "closed":
            self.kinds[-1].closed.add(tuple(map(int, before)))
        elif word == "sees":
            key, views = tuple(map(int, before)), [view.split(":") for view in after]
            require(key not in self.kinds[-1].sees, "a view is there twice")
            self.kinds[-1].sees[key] = [(int(g), exact(amount)) for g, amount in views]
        elif word == "class":
            self.classes.append(int(before[0]))
            self.goals.append({*map(int, after)} if ":" in rest else None)
            self.members.append([])
        elif word == "drone":
            drone = int(before[0])
            require(drone not in self.starts, "a drone is there twice")
            self.members[-1].append(drone)
            self.starts[drone] = [tuple(map(int, state.split(","))) for state in after]
            require(all(len(state) == 2 for state in self.starts[drone]), "drone: wrong state")

    def _check(self) -> None:
        require(self.horizon >= 1 and self.rows in (1, self.horizon + 1), "groups: wrong rows")
        require(min(self.rewards) >= 0 and len(self.rewards) == 4, "rewards: must be four, >= 0")
        require(len(self.far) == 2 and min(self.far) >= 0, "rules: must be four numbers >= 0")
        require(self.vertex or not (self.swap or self.far[0]), "rules: vertex must be 1")
        require([*sorted(self.starts)] == [*range(len(self.starts))], "drones: must be 0, 1, ..")
        n_groups = self.n_roots + (self.horizon + 1) * self.people
        for group, weight in self.weights.items():
            require(0 <= group < n_groups and weight >= 0, "weight: no such group, or < 0")
            require((group >= self.n_roots) == (group in self.caps), "weight: k only of counts")
            require(self.caps.get(group, 1) >= 1, "weight: k must be >= 1")
        for kind in self.kinds:
            n, n_turns, steps = len(kind.moves), len(kind.turns), range(self.horizon + 1)
            heads = {head for moves in kind.moves for head, _ in moves}
            require(heads <= {*range(n)}, "place: a move leads nowhere")
            require(all(len(dict(moves)) == len(moves) for moves in kind.moves), "a move is twice")
            require(len({*kind.cells}) == n, "place: a cell is there twice")
            require(len(kind.states) == n * n_turns, "orientation: one is there twice")
            for t, place, *head in kind.closed:
                require(t in steps and {place, *head} <= {*range(n)}, "closed: no such place")
            for cell, at in zip(kind.cells, kind.at, strict=True):
                require(self.where.setdefault(cell, at) == at, "place: a cell is at two positions")
            require({o for turns in kind.turns for o in turns} <= {*range(n_turns)}, "wrong turn")
            for (t, place, turn), views in kind.sees.items():
                require(
                    t in steps and 0 <= place < n and 0 <= turn < n_turns, "sees: no such state"
                )
                require(len(dict(views)) == len(views), "sees: a group is there twice")
                for group, amount in views:
                    row = t if self.rows > 1 or group >= self.n_roots else 0
                    first, width = (
                        (0, self.faces) if group < self.n_roots else (self.n_roots, self.people)
                    )
                    require(first + row * width <= group < first + (row + 1) * width, "wrong group")
                    require(amount == 1 if group >= self.n_roots else amount > 0, "wrong amount")
        for k, members in zip(self.classes, self.members, strict=True):
            require(0 <= k < len(self.kinds) and members, "class: no such kind, or no drones")
            kind = self.kinds[k]
            for drone in members:
                ok = all(
                    0 <= p < len(kind.moves) and 0 <= o < len(kind.turns)
                    for p, o in self.starts[drone]
                )
                require(ok and self.starts[drone], "drone: no such start")

    def near(self, before: list[Fraction], after: list[Fraction]) -> bool:
        """True if two drones break the separation while one sees the other from before to after."""
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
        """True if two drones may not make two moves, or be at two places, at the same step.

        Each is (tail cell, head cell, tail at, head at); of a place both ends are the same.
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
        """Returns the worth of an amount of a group, before its weight, by a root that rounds."""
        return min(amount, self.caps[group] * ONE) if group in self.caps else root(amount)


def exact(word: str) -> Fraction:
    """Returns the exact value of a hexadecimal number."""
    require(word.lstrip("-").startswith("0x"), f"no hexadecimal number: {word!r:.40}")
    return number_of(float.fromhex(word))


def number_of(value: object) -> Fraction:
    """Returns the exact value of a number in a file of JSON, which is that of a double."""
    if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
        return Fraction(value)
    raise Refused(f"no finite number: {value!r:.40}")


# -- plans ----------------------------------------------------------------------------------------


def value_of_plan(instance: Instance, plan: Spec) -> int:
    """Returns J of a plan, rounded down; refuses plans that break a rule."""
    only(plan, PLAN_FIELDS)
    only(plan["plan"], {"paths"})
    paths = plan["plan"]["paths"]
    require(len(paths) == len(instance.starts), "plan: must have one path for each drone")
    seen: dict[int, Fraction] = {}
    total, flown = Fraction(0), []
    for number, k in enumerate(instance.classes):
        kind = instance.kinds[k]
        states, goal = kind.states, instance.goals[number]
        for drone in instance.members[number]:
            named, name = [tuple(map(whole, state)) for state in paths[drone]], f"drone {drone}"
            require(len(named) == instance.horizon + 1, f"{name}: wrong number of steps")
            require(states.keys() >= {*named}, f"{name}: is somewhere where it cannot be")
            path = [states[state] for state in named]
            require(path[0] in instance.starts[drone], f"{name}: does not start where it may")
            require(goal is None or path[-1][0] in goal, f"{name}: does not reach its goal")
            for t, (p, o) in enumerate(path):
                require((t, p) not in kind.closed, f"{name}: is at a closed place")
                for group, amount in kind.sees.get((t, p, o), ()):
                    seen[group] = seen.get(group, Fraction(0)) + amount
            for t, ((p, o), (q, n)) in enumerate(itertools.pairwise(path)):
                moves, is_closed = dict(kind.moves[p]), (t, p, q) in kind.closed
                ok = q in moves and n in kind.turns[o] and not is_closed
                require(ok, f"{name}: cannot move as it does from step {t}")
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


class Cut:
    """Functions phi of the root that a drone has of a group: root of all <= constant + sum phi."""

    def __init__(self, instance: Instance, spec: Spec, members: list[list[int]]) -> None:
        only(spec, {"t", "face", "curves", "share"})
        self.share = number_of(spec["share"])
        require(0 <= self.share <= 1, "cut: share must be 0..1")
        t, face = whole(spec["t"]), whole(spec["face"])
        require(0 <= t < instance.rows and 0 <= face < instance.faces, "cut: no such group")
        require(instance.rows > 1, "cut: there are none where pixels add up over time")
        self.group, self.worth = t * instance.faces + face, 0  # of its share, once that is known
        self.curves: dict[int, list[tuple[Fraction, Fraction]]] = {}
        for curve in spec["curves"]:
            only(curve, {"robot_class", "roots", "values"})
            roots, values = ([number_of(v) for v in curve[name]] for name in ("roots", "values"))
            number = whole(curve["robot_class"])
            require(0 <= number < len(members), "cut: no such class")
            rising = all(a < b for a, b in itertools.pairwise([Fraction(0), *roots]))
            require(rising and roots, "cut: roots must rise from 0")
            require(len(roots) == len(values) and min(values) >= 0, "cut: wrong values")
            require(number not in self.curves, "cut: a class is there twice")
            self.curves[number] = [(Fraction(0), Fraction(0)), *zip(roots, values, strict=True)]
        self.lines: dict[int, tuple[int, int, list[tuple[int, int]]]] = {}  # in whole numbers
        for k, points in self.curves.items():
            unit = math.lcm(*(value.denominator for point in points for value in point))
            slopes = [abs((b[1] - a[1]) / (b[0] - a[0])) for a, b in itertools.pairwise(points)]
            scaled = [(int(r * unit) << BITS, int(v * unit) << BITS) for r, v in points]
            self.lines[k] = math.ceil(max([Fraction(1), *slopes])), unit, scaled
        self.constant = self._highest({k: len(members[k]) for k in self.curves})

    def _highest(self, sizes: dict[int, int]) -> int:
        """Returns the most that a root exceeds the phi, rounded up: it does so at breakpoints.

        Drones are placed one by one. A root gains the less, the more is seen: what one more can
        gain here bounds what any later one can gain.
        """
        choices = [(up(r * r), down(v), k) for k, c in self.curves.items() for r, v in c[1:]]
        best, left, looked_at = 0, dict(sizes), 0

        def place(first: int, pixels: int, paid: int) -> None:
            nonlocal best, looked_at
            looked_at += 1
            require(looked_at <= MOST_CORNERS, "cut: it takes too long to find its constant")
            here = root_up(pixels) - paid
            best = max(best, here)
            gains = {
                n: root_up(pixels + p) - paid - v - here + 2
                for n, (p, v, k) in enumerate(choices[first:], first)
                if left[k]
            }
            others = (sum(left.values()) - 1) * max(gains.values(), default=0)
            for n, gain in gains.items():
                if here + gain + others > best:
                    left[choices[n][2]] -= 1
                    place(n, pixels + choices[n][0], paid + choices[n][1])
                    left[choices[n][2]] += 1

        place(0, 0, 0)
        return best

    def phi(self, number: int, low: int) -> int:
        """Returns phi of class `number` at a root between low and low + 1 (2^-64), rounded up."""
        if number not in self.lines:
            return low + 1
        steepest, unit, points = self.lines[number]
        x = low * unit  # in units of 1 / (unit 2^64), as the breakpoints
        for (r, v), (s, u) in itertools.pairwise(points):
            if x <= s:
                return -(-(v * (s - r) + (x - r) * (u - v)) // ((s - r) * unit)) + steepest
        r, v = points[-1]
        return -(-(v + x - r) // unit) + steepest


def whole(value: object) -> int:
    """Returns a whole number; refuses all else, booleans included."""
    if type(value) is not int:
        raise Refused(f"no whole number: {value!r:.40}")
    return value


def only(spec: object, names: set[str]) -> None:
    """Refuses fields that are not known."""
    require(isinstance(spec, dict) and set(spec) <= names | {"type"}, f"what is {spec!r:.60}?")


class Bound:
    """The bound that multipliers prove of the plans that obey some decisions."""

    def __init__(self, instance: Instance, single: bool) -> None:
        self.instance, self.members = instance, instance.members
        self.classes = [*enumerate(instance.classes)]
        if single:  # every drone is a class of its own
            of = {d: n for n, drones in enumerate(instance.members) for d in drones}
            self.classes = [(of[d], instance.classes[of[d]]) for d in range(len(of))]
            self.members = [[d] for d in range(len(of))]
        self.views = [
            {
                key: [(g, up(c), root_up(up(c))) for g, c in views]
                for key, views in kind.sees.items()
            }
            for kind in instance.kinds
        ]  # groups with what is seen and its root, both rounded up
        self.prices: dict[int, tuple[int, int, list[Cut]]] = {}  # of alpha and beta, and cuts
        self.gained: dict[int, tuple[Fraction, int, int]] = {}  # at reference pixels
        self.visible = {g for kind in instance.kinds for v in kind.sees.values() for g, _ in v}

    def of(self, numbers: Spec, decisions: Decisions = ()) -> int | None:
        """Returns the most J of any plan that obeys the decisions, rounded up; None: no plan."""
        instance = self.instance
        if numbers.get("type") == "reference":
            return self._of_reference(numbers)
        only(numbers, {"alpha", "beta", "rows", "cuts", "decisions", "views"})
        alpha = self._table(numbers["alpha"], numbers.get("views", ()))
        beta = self._table(numbers["beta"], None)
        require(numbers.get("type", "multipliers") == "multipliers", "certificate: unknown type")
        cuts = [Cut(instance, spec, self.members) for spec in numbers.get("cuts", ())]
        rest: dict[int, Fraction] = {}
        by_group: dict[int, list[Cut]] = {}
        total = 0
        for cut in cuts:
            rest[cut.group] = rest.get(cut.group, Fraction(1)) - cut.share
            by_group.setdefault(cut.group, []).append(cut)
        self.prices, self.gained = {}, {}
        for group, weight in instance.weights.items():
            if group not in self.visible:
                continue
            a, b, left = alpha[group], beta[group], rest.get(group, Fraction(1))
            open_ = max(left - a, Fraction(0))
            if group >= instance.n_roots:
                total += up(weight * instance.caps[group] * open_)
            elif open_:
                require(b > 0, "certificate: beta must be > 0 where alpha is too small")
                total += up(weight * open_ * open_ / (4 * b))
            for cut in by_group.get(group, ()):
                cut.worth = up(weight * cut.share)
                total += up(weight * cut.share * Fraction(cut.constant, ONE))
            self.prices[group] = up(weight * a), up(weight * b), by_group.get(group, [])
        charged: Charged = ({}, {}, {})
        for row in numbers.get("rows", ()):
            only(row, {"resource", "multiplier"})
            multiplier = number_of(row["multiplier"])
            require(multiplier >= 0, "row: the multiplier must be >= 0")
            self._require_row(row["resource"])
            total += up(multiplier)
            self._charge(charged, row["resource"], down(multiplier))
        nus = [number_of(nu) for nu in numbers.get("decisions", ())]
        require(len(nus) == len(decisions) and all(nu >= 0 for nu in nus), "decisions: wrong")
        for (resource, sign, count), nu in zip(decisions, nus, strict=True):
            if sign > 0 and count <= 0:
                self._charge(charged, resource, None)  # closed
            else:
                total += up(sign * count * nu)
                self._charge(charged, resource, down(sign * nu))
        return self._with_paths(total, charged)

    def _with_paths(self, total: int, charged: Charged) -> int | None:
        """Returns a constant and each drone's best path together; None where one has none."""
        instance = self.instance
        for number, (of_class, k) in enumerate(self.classes):
            value = self._sweep(number, of_class, k, charged)
            for drone in self.members[number]:
                best = [value[s] for s in instance.starts[drone] if s in value]
                if not best:
                    return None
                total += max(best)
        return total

    def _of_reference(self, numbers: Spec) -> int | None:
        """Returns the bound by gains beyond what is seen somewhere, which only shrink."""
        i = self.instance
        only(numbers, {"pixels", "views"})
        seen = self._table(numbers["pixels"], numbers.get("views", ()))
        self.prices = {}
        self.gained = {g: (w, up(seen[g]), down(seen[g])) for g, w in i.weights.items()}
        total = sum(
            up(w * Fraction(i.value(g, up(seen[g]), root_up), ONE)) for g, w in i.weights.items()
        )
        return self._with_paths(total, ({}, {}, {}))

    def _table(self, faces: Any, people: Any) -> list[Fraction]:
        """Returns the numbers of all groups: of faces, then of people."""
        i = self.instance
        require(len(faces) == i.rows and all(len(row) == i.faces for row in faces), "wrong table")
        values = [number_of(value) for row in faces for value in row]
        if people is None:
            values += [Fraction(0)] * ((i.horizon + 1) * i.people)
        elif i.people or people:
            ok = len(people) == i.horizon + 1 and all(len(row) == i.people for row in people)
            require(ok, "views: wrong table")
            values += [number_of(value) for row in people for value in row]
        require(all(value >= 0 for value in values), "certificate: numbers must be >= 0")
        return values

    def _paid(self, number: int, views: list[tuple[int, int, int]]) -> int:
        """Returns the payment to a drone of a class for a view, rounded up."""
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
                total += (cut.worth * cut.phi(number, max(root - 1, 0)) >> BITS) + 1
        return total

    def _sweep(self, number: int, of_class: int, k: int, charged: Charged) -> dict[Ints, int]:
        """Returns the most that a path from each state on brings, at step 0."""
        kind = self.instance.kinds[k]
        still, cell, heading, even = map(up, self.instance.rewards)
        n, goal, horizon = len(kind.moves), self.instance.goals[of_class], self.instance.horizon
        worth = {key: self._paid(number, views) for key, views in self.views[k].items()}
        places, moves, states = charged
        value: dict[Ints, int] = {}
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
        return value

    # -- resources --------------------------------------------------------------------------

    def _users(self, resource: Spec) -> tuple[int, list[Any]]:
        """Returns moves (tail, head) of cells, or single cells, that use a resource, and more."""
        kind, t = str(resource.get("type")), whole(resource.get("t"))
        lasts = kind in ("swap", "moves", "move")
        require(0 <= t <= self.instance.horizon - lasts, "resource: there is no such step")
        known = {
            "cells": {"cells", "robot_class"},
            "swap": {"cells"},
            "moves": {"moves"},
            "move": {"cells", "robot_class"},
            "visit": {"state", "robot_class"},
        }
        require(kind in known, f"resource: what is {kind!r}?")
        only(resource, known[kind] | {"t"})
        if kind == "visit":
            return t, [tuple(resource["state"])]
        if kind == "moves":
            return t, [(cell_of(a), cell_of(b)) for a, b in resource["moves"]]
        cells = [cell_of(cell) for cell in resource["cells"]]
        if kind == "cells":
            return t, cells
        require(len(cells) == 2, "resource: must have two cells")
        return t, [(cells[0], cells[1])] + ([(cells[1], cells[0])] if kind == "swap" else [])

    def _charge(self, charged: Charged, resource: Spec, charge: int | None) -> None:
        """Charges a resource's users in each class; None closes it."""
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
        """Refuses a row whose users do not all conflict, but for those out of all drones' reach."""
        require(
            resource.get("robot_class") is None and resource.get("type") != "visit",
            "row: must be of all drones",
        )
        kind, (_, users) = resource["type"], self._users(resource)
        require(kind in ("cells", "swap", "moves"), "row: must be cells, a swap or moves")
        if kind == "swap":
            require(self.instance.swap, "row: there is no swap rule")
            return
        ends = [(u, u) if kind == "cells" else u for u in dict.fromkeys(users)]
        where = self.instance.where
        moves = [(a, b, where[a], where[b]) for a, b in ends if a in where and b in where]
        for a, b in itertools.combinations_with_replacement(moves, 2):
            require(self.instance.conflict(a, b), "row: two drones may use this at once")


def cell_of(cell: Any) -> Ints:
    """Returns a cell (x, y, layer)."""
    require(isinstance(cell, list) and len(cell) in (2, 3), "resource: no cell")
    return tuple(cell) if len(cell) == 3 else (*cell, 0)


def bound_of_file(instance: Instance, file: Spec) -> tuple[int | None, bool]:
    """Returns the bound of a certificate or a proof, rounded up, and if a search is left out.

    The bound is None where there is no plan.
    """
    only(file, FIELDS)
    require(file.get("classes", "alike") in ("alike", "single"), "classes: must be alike or single")
    bound = Bound(instance, file.get("classes") == "single")
    is_proof = file["format"] == "cocap-opt proof"
    require(("nodes" in file) == is_proof and ("certificate" in file) != is_proof, "wrong fields")
    if not is_proof:
        numbers = file["certificate"]
        if numbers.get("type") == "staged":
            only(numbers, {"multipliers", "target", "stages", "paths_above"})
            return bound.of(numbers["multipliers"]), True
        return bound.of(numbers), False
    nodes, worst = file["nodes"], None
    todo: list[tuple[Any, Decisions]] = [(0, ())]
    met: set[int] = set()
    while todo:
        number, decisions = todo.pop()
        require(0 <= whole(number) < len(nodes), "nodes: no such node")
        require(number not in met, "nodes: a node has two parents")
        met.add(number)
        node = nodes[number]
        if node.get("type") == "leaf":
            only(node, {"certificate"})
            found = bound.of(node["certificate"], decisions)
            worst = found if worst is None else worst if found is None else max(worst, found)
            continue
        require(node.get("type") == "branch", "nodes: must be branches and leaves")
        only(node, {"resource", "robots", "at_most", "at_least"})
        resource, count = node["resource"], whole(node["robots"])
        require(count >= 0, "nodes: robots must be >= 0")
        todo += [
            (node["at_most"], (*decisions, (resource, 1, count))),
            (node["at_least"], (*decisions, (resource, -1, count + 1))),
        ]
    return worst, False


def told(value: int, rounding: int) -> str:
    """Returns a number in units of 2^-64 as decimals, rounded up or down."""
    scaled = -(-value * 10**6 >> BITS) if rounding > 0 else value * 10**6 >> BITS
    sign, scaled = "-" * (scaled < 0), abs(scaled)
    return f"{sign}{scaled // 10**6}.{scaled % 10**6:06d}"


def answer(instance: Instance, document: Spec) -> tuple[str, bool]:
    """Returns the statement that a file proves, and if a part of its claim is not checked."""
    require(isinstance(document, dict), "must be an object")
    kind = str(document.get("format"))
    is_known = whole(document.get("version")) in VERSIONS.get(kind, ())
    require(is_known, "no known kind of file, or version")
    require(document.get("digest") == instance.digest, "digest: the file is of another instance")
    version = document.get("coverage_version")
    require(version in (None, instance.coverage), "coverage_version: the instance has another")
    if kind == "cocap-opt plan":
        value, reward = value_of_plan(instance, document), number_of(document["reward"])
        require(value >= down(reward * ROUNDED), "reward: claims more than the plan has")
        return f"J of this plan is at least {told(value, -1)}", False
    bound, is_part = bound_of_file(instance, document)
    claim = None if document["bound"] is None else number_of(document["bound"])
    says = "there is no plan" if bound is None else f"no plan has more than {told(bound, 1)}"
    if is_part:
        return f"{says}, by its multipliers; its claim rests on a search: not checked", True
    holds = bound is None or (claim is not None and bound <= down(claim))
    # J is never negative, so that a negative bound says that there is no plan.
    holds |= claim is None and bound is not None and bound < 0
    require(holds, "bound: claims less than its numbers prove")
    return says, False


def main(arguments: list[str]) -> int:
    """Reads the files and prints what they prove.

    Returns
    -------
    0 if all that they claim holds, 1 if one is refused, 2 for a wrong call, 3 if a claim rests on a
    search, which is not checked here
    """
    say = functools.partial(print, flush=True)
    if not arguments or arguments[0].startswith("-"):
        say(str(__doc__).split("\n\n")[1].strip())
        return 0 if arguments in (["-h"], ["--help"]) else 2
    instance, worst = None, 0
    for name in arguments:
        try:
            with open(name, "rb") as file:
                content = file.read()
            if instance is None:
                instance = Instance(content.decode())
                say(f"instance of sha256 {hashlib.sha256(content).hexdigest()}")
                continue
            document = json.loads(
                content, parse_constant=no_constant, object_pairs_hook=without_twins
            )
            words, is_part = answer(instance, document)
            say(f"{name}: {words}")
            worst = worst or 3 * is_part
        except (Refused, *DAMAGED) as error:
            say(f"{name}: refused: {error or type(error).__name__}")
            if instance is None:
                return 1
            worst = 1
    return worst


def without_twins(pairs: list[tuple[str, Any]]) -> Spec:
    """Returns an object of a file; refuses a field that is there twice."""
    require(len(dict(pairs)) == len(pairs), "a field is there twice")
    return dict(pairs)


def no_constant(name: str) -> None:
    """Refuses NaN and infinity, which are no numbers of JSON."""
    raise Refused(f"no number: {name}")


def run() -> None:
    """Runs as a command."""
    sys.exit(main(sys.argv[1:]))


if __name__ == "__main__":
    run()
