#!/usr/bin/env python3
"""Lowers a certificate or a proof to whole numbers for cocap-check-verified.

    python lower.py INSTANCE CERTIFICATE [-o LOWERED] [--multipliers]

The output need not be trusted: prices are rounded, constants of groups and cuts are computed, and
the verified checker accepts the numbers only if its theorem covers them. So a mistake here can
cause a true claim to be rejected, but never a false one to be accepted.
"""

import argparse
import itertools
import math
import sys
from collections.abc import Iterable, Iterator
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "independent"))

# Imported by its path, as anyone does who has only this folder; mypy does not look there.
import cocap_check as check  # type: ignore[import-not-found]

SCALE = 1 << 64  # denominator of alpha, beta, roots and shares
MOST_BITS = 52  # bits of a payment's fraction
COARSE = 1 << 20  # denominator of fractions in the search's bounds
NATIVE_BITS = 60  # so that J in 1/precision is a small whole number of Zarith

Spec = dict[str, Any]
Words = list[object]
Lowered = tuple[int, int, Words]  # share and constant of a cut, and the words of its functions

# The fields of each resource, except its type and step.
RESOURCES = {
    "visit": {"state", "robot_class"}, "cells": {"cells", "robot_class"}, "swap": {"cells"},
    "move": {"cells", "robot_class"}, "moves": {"moves"},
}  # fmt: skip


def up(value: Fraction) -> int:
    """Returns a number, rounded up."""
    return -(-value.numerator // value.denominator)


def root_up(square: int) -> int:
    """Returns the root of a number >= 0, rounded up."""
    root = math.isqrt(square)
    return root + (root * root < square)


def rooted(knee: int, square: int) -> int:
    """Returns the root of a number >= 0, or the line that touches it at the root `knee` if that
    is further right, rounded up.
    """
    below = square < knee * knee
    return -(-(square + knee * knee) // (2 * knee)) if below else root_up(square)


def listed(items: Iterable[Words]) -> Words:
    """Returns the words of a list: the number of items, followed by their words."""
    found = [*items]
    return [len(found), *itertools.chain.from_iterable(found)]


class Lowering:
    """The words of a file's claim, of the tree of its decisions, and of the numbers at its leaves.

    Attributes
    ----------
    precision : payments are in units of 1/precision
    bound : the claimed bound; None: there is no plan
    """

    def __init__(self, instance: check.Instance, single: bool, bound: Fraction | None) -> None:
        self.instance, self.single, self.bound = instance, single, bound
        bits = 16 if bound is None else up(abs(bound)).bit_length()
        self.precision = 1 << max(min(NATIVE_BITS - bits, MOST_BITS), 32)
        self.kinds = [*instance.classes]  # kind of each class
        # number of each class in the checker, by its number in the file
        self.number: list[int] = [*range(len(self.kinds))]
        if single:
            drones = [d for members in instance.members for d in members]
            of = {d: n for n, members in enumerate(instance.members) for d in members}
            self.kinds = [instance.classes[of[d]] for d in drones]
            self.number = [drones.index(d) for d in range(len(drones))]
        sizes = [1] * len(self.kinds) if single else [*map(len, instance.members)]
        self.sizes = dict(enumerate(sizes))
        self.visible = sorted({
            g for kind in instance.kinds for views in kind.sees.values() for g, _ in views
        })  # fmt: skip
        self._constants: dict[str, int] = {}

    def claim(self) -> Words:
        """Returns the words that precede the tree."""
        bound = Fraction(-1) if self.bound is None else self.bound
        return ["cocap-lowered", 5, int(self.single), bound.numerator, bound.denominator]

    def leaf(self, numbers: Spec, decisions: check.Decisions = ()) -> Words:
        """Returns the words of a leaf; `decisions` are those on the way from the root."""
        nus = [check.number_of(nu) for nu in numbers.get("decisions", ())]
        check.require(
            len(nus) == len(decisions), ("decisions: must contain one multiplier per decision")
        )
        # A closed resource: its charge is so high that no path that uses it gains anything.
        others = [check.number_of(row["multiplier"]) for row in numbers.get("rows", ())]
        charged = sum([abs(self.bound or Fraction(0)), *others, *nus], Fraction(1))
        closed = self.precision * up(1000 * charged)
        prices = [
            closed if sign > 0 and count <= 0 else round(nu * self.precision)
            for nu, (_, sign, count) in zip(nus, decisions, strict=True)
        ]
        return ["leaf", *self.multipliers(numbers), *listed([nu] for nu in reversed(prices))]

    def multipliers(self, numbers: Spec) -> Words:
        """Returns the words of a set of multipliers."""
        kind = numbers.get("type", "multipliers")
        check.require(kind == "multipliers", f"certificate: {kind} is not supported")
        check.only(numbers, check.MULTIPLIERS)
        for row in numbers.get("rows", ()):
            check.only(row, {"resource", "multiplier"})
        over_time = int(self.instance.rows == 1)
        return [
            SCALE, self.precision, over_time,
            *listed(self.groups(numbers)),
            *listed(
                [*self.resource(row["resource"]),
                 round(check.number_of(row["multiplier"]) * self.precision)]
                for row in numbers.get("rows", ())
            ),
        ]  # fmt: skip

    # -- groups -----------------------------------------------------------------------------

    def groups(self, numbers: Spec) -> Iterator[Words]:
        """Yields the words of each visible group: its prices, constant and step, and its cuts,
        those by state last.
        """
        i = self.instance
        cuts: dict[int, list[Spec]] = {}
        for cut in numbers.get("cuts", ()):
            cuts.setdefault(cut["t"] * i.faces + cut["face"], []).append(cut)
        by_state: dict[int, list[Lowered]] = {}
        for cut in numbers.get("state_cuts", ()):
            g = self._view_sum(cut)
            by_state.setdefault(g, []).append(self._state_cut(g, cut))
        for g in self.visible:
            yield [g + 1, *self._group(g, numbers, cuts.get(g, []), by_state.get(g, []))]

    def _group(self, g: int, numbers: Spec, cuts: list[Spec], by_state: list[Lowered]) -> Words:
        i, weight = self.instance, self.instance.weights.get(g)
        row, column = divmod(g, i.faces) if g < i.n_roots else divmod(g - i.n_roots, i.people)
        if weight is None:
            return [SCALE, SCALE, 0, row, 0, 0]
        if g >= i.n_roots:
            gamma = up(check.number_of(numbers["views"][row][column]) * SCALE)
            left = weight * i.caps[g] * Fraction(max(SCALE - gamma, 0), SCALE)
            return [0, gamma, up(left * self.precision), row, 0, 0]
        alpha, beta = (
            up(check.number_of(numbers[name][row][column]) * SCALE) for name in ("alpha", "beta")
        )
        lowered = [self._cut(cut) for cut in cuts]
        both = [*lowered, *by_state]
        rest = SCALE - sum(share for share, _, _ in both)
        constant = Fraction(sum(share * most for share, most, _ in both), SCALE * SCALE)
        if rest > alpha:
            check.require(beta > 0, "certificate: beta must be > 0 if alpha is too small")
            constant += Fraction((rest - alpha) ** 2, 4 * beta * SCALE)
        kappa = up(weight * constant * self.precision)
        words = (
            listed([share, most, *functions] for share, most, functions in found)
            for found in (lowered, by_state)
        )
        return [alpha, beta, kappa, row, *itertools.chain.from_iterable(words)]

    def _cut(self, cut: Spec) -> Lowered:
        """Returns the share of a cut, its constant and the words of its curves."""
        check.only(cut, {"t", "face", "curves", "share"})
        for curve in cut["curves"]:
            check.only(curve, {"robot_class", "roots", "values"})
        share = int(check.number_of(cut["share"]) * SCALE)
        curves = {
            self._class(curve["robot_class"]): [
                (round(check.number_of(r) * SCALE), round(check.number_of(v) * SCALE))
                for r, v in zip(curve["roots"], curve["values"], strict=True)
            ]
            for curve in cut["curves"]
        }
        key = str(sorted(curves.items()))
        if key not in self._constants:
            drones = [
                [(r * r, v) for r, v in points]
                for k, points in curves.items()
                for _ in range(self.sizes[k])
            ]
            self._constants[key] = check.highest_corner(drones, root_up)
        words = listed([k, *listed([r, v] for r, v in points)] for k, points in curves.items())
        return share, self._constants[key], words

    def _view_sum(self, cut: Spec) -> int:
        """Returns the group of a state cut."""
        i, t, face = self.instance, check.whole(cut["t"]), check.whole(cut["face"])
        check.require(i.rows > 1, "state_cuts: must not be given if pixels add up over time")
        check.require(0 <= t < i.rows, f"state_cuts: t must be 0..{i.rows - 1}")
        check.require(0 <= face < i.faces, f"state_cuts: face must be 0..{i.faces - 1}")
        group: int = t * i.faces + face
        return group

    def _state_cut(self, g: int, cut: Spec) -> Lowered:
        """Returns the share of a state cut, its constant, and the words of its knee and of its
        states, cell by cell. The line of its slope touches the root at the knee, which is rounded:
        both the payments and the constant are those of the rounded knee.
        """
        check.only(cut, {"t", "face", "share", "slope", "payments"})
        check.require(self.instance.vertex, "state_cuts: the scene has no vertex rule")
        share = check.number_of(cut["share"])
        check.require(0 <= share <= 1, "state_cuts: share must be 0..1")
        slope = check.number_of(cut["slope"])
        check.require(slope > 0, "state_cuts: slope must be > 0")
        knee = max(round(SCALE / (2 * slope)), 1)
        classes = [check.whole(paid["robot_class"]) for paid in cut["payments"]]
        rising = all(a < b for a, b in itertools.pairwise(classes))
        check.require(rising, "state_cuts: robot_class must be increasing")
        cells: dict[tuple[int, ...], list[tuple[Words, tuple[int, int]]]] = {}
        for paid in cut["payments"]:
            for cell, words, point in self._payments(cut["t"], g, paid):
                cells.setdefault(cell, []).append((words, point))
        points = [[p for _, p in of_cell] for of_cell in cells.values()]
        points.sort(key=max, reverse=True)  # which is faster
        root = partial(rooted, knee)
        most = max(root(0), check.highest_corner(points, root))  # possibly no drone is listed
        words = [knee, *listed(listed(words for words, _ in of_cell) for of_cell in cells.values())]
        return int(share * SCALE), most, words

    def _payments(
        self, t: int, g: int, paid: Spec
    ) -> Iterator[tuple[tuple[int, ...], Words, tuple[int, int]]]:
        """Yields, of each listed state of a class, its cell, its words, and its pixels and value.
        No drone takes a state that the instance lacks.
        """
        check.only(paid, {"robot_class", "states", "values"})
        number = self._class(paid["robot_class"])
        kind = self.instance.kinds[self.kinds[number]]
        names = [*map(check.state_of, paid["states"])]
        check.require(len({*names}) == len(names), "state_cuts: states must be distinct")
        is_whole = len(names) == len(paid["values"])
        check.require(is_whole, "state_cuts: must hold a number for each state")
        for name, value in zip(names, map(check.number_of, paid["values"]), strict=True):
            check.require(value >= 0, "state_cuts: values must be >= 0")
            if name in kind.states:
                place, turn = kind.states[name]
                seen = dict(kind.sees.get((t, place, turn), ())).get(g, Fraction(0))
                low = math.floor(value * SCALE)
                words: Words = [number, place * len(kind.turns) + turn + 1, low]
                yield kind.cells[place], words, (up(seen * SCALE * SCALE), low)

    # -- resources --------------------------------------------------------------------------

    def resource(self, spec: Spec) -> Words:
        """Returns the words of a resource: places and moves of each class that can use it."""
        kind, t, of = spec["type"], check.whole(spec["t"]), spec.get("robot_class")
        check.require(kind in RESOURCES, f"resource: unknown type {kind!r}")
        check.only(spec, RESOURCES[kind] | {"type", "t"})
        check.require(0 <= t <= self.instance.horizon, "resource: t is not a step of the scene")
        users = [
            (n, self.instance.kinds[k])
            for n, k in enumerate(self.kinds)
            if of is None or self.number[of] == n
        ]
        if kind == "visit":
            name = check.state_of(spec["state"])
            found = ((n, k.states[name], len(k.turns)) for n, k in users if name in k.states)
            return ["visit", t, *listed([n, p * turns + o + 1] for n, (p, o), turns in found)]
        if kind == "cells":
            cells = dict.fromkeys(map(check.cell_of, spec["cells"]))
            places = ([n, k.place_of[c] + 1] for n, k in users for c in cells if c in k.place_of)
            return ["at", t, *listed(places)]
        pairs = spec["moves"] if kind == "moves" else [spec["cells"]]
        ways = [(check.cell_of(a), check.cell_of(b)) for a, b in pairs]
        if kind == "swap":
            ways += [(b, a) for a, b in ways]
        moves = (
            [n, k.place_of[a] + 1, k.place_of[b] + 1]
            for n, k in users
            for a, b in dict.fromkeys(ways)
            if {a, b} <= k.place_of.keys()
        )
        return ["moving", t, *listed(moves)]

    # -- stages -----------------------------------------------------------------------------

    def staged(self, numbers: Spec) -> Words:
        """Returns the words of a staged certificate."""
        check.only(numbers, check.STAGED)
        check.require(not numbers.get("tails"), "tails: only the other checkers can verify them")
        above = numbers.get("paths_above")
        is_higher = above is None or check.number_of(above) >= check.number_of(numbers["target"])
        check.require(is_higher, "paths_above: must not be below the target")
        begin = self._begin(numbers)
        return [
            self._target(numbers["target"]), COARSE,
            *self.multipliers(numbers["multipliers"]),
            *listed(map(self._stage, numbers["stages"])),
            "-" if above is None else self._target(above),
            "-" if begin is None else begin,
        ]  # fmt: skip

    def _begin(self, numbers: Spec) -> int | None:
        """Returns the step at which the exploration of paths begins; None: step 0."""
        if numbers.get("paths_from") is None:
            return None
        is_possible = numbers.get("paths_above") is not None
        check.require(is_possible, "paths_from: not allowed without paths_above")
        begin: int = check.whole(numbers["paths_from"], "paths_from: ")
        last = self.instance.horizon
        check.require(1 <= begin <= last, f"paths_from: must be 1..{last}, not {begin}")
        return begin

    def _target(self, value: object) -> int:
        target: int = math.floor(check.number_of(value) * self.precision)
        return target

    def _stage(self, stage: Spec) -> Words:
        """Returns the words of a stage: its constants in order, the first of each step with the
        prices of that step; and its constants of moves.
        """
        check.only(stage, {"payments", "constants", "moves"})
        # for each step and class, new prices of states, and by how much all others rise
        prices: dict[int, dict[int, tuple[dict[int, int], int]]] = {}
        for step in stage.get("payments", ()):
            check.only(step, {"t", "robot_class", "states", "payments", "others"})
            number, of_step = self._class(step.get("robot_class", 0)), self._step(step)
            kind = self.instance.kinds[self.kinds[number]]
            check.require(
                len(step["states"]) == len(step["payments"]),
                "payments: must hold a number for each state",
            )
            rise = self._rounded(step.get("others", 0.0))
            before, risen = prices.setdefault(of_step, {}).get(number, ({}, 0))
            listed_prices = {state: price + rise for state, price in before.items()}
            # No drone of a class takes a state that its kind lacks in the instance.
            for name, price in zip(map(tuple, step["states"]), step["payments"], strict=True):
                if name in kind.states:
                    place, turn = kind.states[name]
                    listed_prices[place * len(kind.turns) + turn + 1] = self._rounded(price)
            prices[of_step][number] = listed_prices, risen + rise
        constants: list[Words] = []
        for step in stage.get("constants", ()):
            check.only(step, {"t", "constant"})
            of_classes = prices.pop(self._step(step), {})
            payments = (
                [number, *listed([s, price] for s, price in of_states.items()), others]
                for number, (of_states, others) in of_classes.items()
            )
            constants.append([step["t"], *listed(payments), self._rounded(step["constant"])])
        check.require(not prices, "stage: a step with payments has no constant")
        return [*listed(constants), *listed(map(self._move, stage.get("moves", ())))]

    def _move(self, move: Spec) -> Words:
        """Returns the words of a constant of a move between two steps."""
        check.only(move, {"t", "constant"})
        t = self._step(move)
        check.require(t < self.instance.horizon, "moves: no move begins at the last step")
        return [t, self._rounded(move["constant"])]

    def _step(self, spec: Spec) -> int:
        t: int = check.whole(spec["t"])
        check.require(0 <= t <= self.instance.horizon, "stage: t is not a step of the scene")
        return t

    def _class(self, number: object) -> int:
        """Returns the number of a class for the checker."""
        known = range(len(self.number))
        named: int = check.whole(number)
        check.require(named in known, "robot_class: does not exist")
        return self.number[named]

    def _rounded(self, value: object) -> int:
        rounded: int = round(check.number_of(value) * self.precision)
        return rounded

    # -- trees ------------------------------------------------------------------------------

    def tree(self, nodes: list[Spec], number: int = 0, decisions: check.Decisions = ()) -> Words:
        """Returns the words of a tree of decisions."""
        check.require(len(decisions) < len(nodes), "nodes: form a cycle")
        check.require(
            0 <= check.whole(number) < len(nodes), ("nodes: names a node that does not exist")
        )
        node = nodes[number]
        if node["type"] == "leaf":
            check.only(node, check.LEAF)
            return self.leaf(node["certificate"], decisions)
        check.require(node["type"] == "branch", "nodes: must be branches and leaves")
        check.only(node, check.BRANCH)
        resource, n = node["resource"], check.whole(node["robots"])
        most, least = (*decisions, (resource, 1, n)), (*decisions, (resource, -1, n + 1))
        return [
            "branch", *self.resource(resource), n,
            *self.tree(nodes, node["at_most"], most), *self.tree(nodes, node["at_least"], least),
        ]  # fmt: skip


def require_known(instance: check.Instance, file: Spec) -> None:
    """Rejects files of another kind, version or instance, and files with unknown fields."""
    check.only(file, check.FIELDS)
    kind = str(file.get("format"))
    is_bound = kind in ("cocap-opt certificate", "cocap-opt proof")
    is_known = is_bound and check.whole(file.get("version")) in check.VERSIONS[kind]
    check.require(is_known, "not a certificate or proof of a known version")
    check.require(file.get("digest") == instance.digest, "digest: belongs to another instance")
    version = file.get("coverage_version")
    check.require(
        version in (None, instance.coverage), ("coverage_version: does not match the instance")
    )
    classes = file.get("classes", "alike")
    check.require(classes in ("alike", "single"), "classes: must be alike or single")
    is_proof = kind == "cocap-opt proof"
    one_of = ("nodes" in file) == is_proof and ("certificate" in file) != is_proof
    check.require(one_of, "must contain a certificate, or nodes if it is a proof")


def lowered(instance: check.Instance, file: Spec, multipliers: bool) -> Words:
    """Returns the words of a file.

    Parameters
    ----------
    multipliers : True: of a staged certificate, lower only the initial multipliers, and claim the
        bound that they prove
    """
    require_known(instance, file)
    single = file.get("classes") == "single"
    bound = None if file["bound"] is None else check.number_of(file["bound"])
    numbers = file.get("certificate")
    if multipliers and numbers and numbers["type"] == "staged":
        numbers = numbers["multipliers"]
        most = check.Bound(instance, single).of(numbers)
        bound = None if most is None else Fraction(most, check.ONE) * (1 + Fraction(1, 10**12))
    lowering = Lowering(instance, single, bound)
    words = lowering.claim()
    if numbers is None:
        return [*words, "tree", *lowering.tree(file["nodes"])]
    if numbers.get("type") == "staged":
        return [*words, "staged", *lowering.staged(numbers)]
    return [*words, "tree", *lowering.leaf(numbers)]


def main() -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n\n")[0])
    parser.add_argument("instance", type=Path)
    parser.add_argument("certificate", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="output file (default: standard output)")
    parser.add_argument(
        "--multipliers",
        action="store_true",
        help=("lower only the initial multipliers of a staged certificate"),
    )
    given = parser.parse_args()
    try:
        read = [check.content_of(str(path)) for path in (given.instance, given.certificate)]
    except check.WrongCall as error:
        sys.exit(str(error))
    try:
        instance = check.Instance(read[0].decode())
    except (check.Refused, *check.DAMAGED) as error:
        sys.exit(f"{given.instance}: not read: {check.reason_of(error)}")
    try:
        file = check.read_json(read[1])
        words = lowered(instance, file, given.multipliers)
    except (check.Refused, *check.DAMAGED) as error:
        sys.exit(f"{given.certificate}: not lowered: {check.reason_of(error)}")
    text = " ".join(map(str, words)) + "\n"
    if given.output:
        try:
            given.output.write_text(text)
        except OSError as error:
            sys.exit(f"{given.output}: cannot be written: {error.strerror}")
    else:
        sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
