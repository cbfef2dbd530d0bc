"""The terms of a gap for people: tables that add up, sentences, and plain data."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import msgspec
import numpy as np

from cocap_opt.coordination.replans import Replan, replans
from cocap_opt.data import FloatArray
from cocap_opt.experiments.results.conflicts import told_conflict
from cocap_opt.experiments.results.printing import Record, counted
from cocap_opt.experiments.results.verification import Verified
from cocap_opt.formulations.certificates import Cells, Move, Moves, Resource, Swap, Visit
from cocap_opt.formulations.explanation import Explanation, Kind, Term, explain
from cocap_opt.graph.choke_points import choke_point
from cocap_opt.model import Model
from cocap_opt.problem import Cell, Plan, Problem

SHOWN = 5e-6  # of the bound; less is a dot in tables and not worth a sentence
_TOLD = 6  # sentences on single terms
_LINES = 20  # of a table
_CHARACTERS = 80  # of a line at most
_WIDTH = 5  # of a number
_PARTS: dict[str, tuple[Kind, ...]] = {
    "drones leave the best paths that it knows": ("path",),
    "it pays more for faces than they give": ("face",),
    "rules with a price are not used, or broken": ("row",),
    "decisions of the plan's leaf have prices": ("decision",),
    "another leaf of the proof has a larger bound": ("leaves",),
    "it claims more than its numbers prove": ("claim",),
    "it covers rounding": ("rounding",),
}


@dataclass(frozen=True)
class Explained:
    """The gap of a plan, its terms, and the single re-plans that would lessen it.

    Attributes
    ----------
    leaves : bounds of a proof's leaves, in order, if they are known
    """

    model: Model
    plan: Plan
    explanation: Explanation
    leaves: tuple[float, ...] = ()

    @classmethod
    def of(cls, verified: Verified) -> "Explained | None":
        """Returns the explanation of what was verified.

        It is None where there is no plan that can be flown, or no bound to compare it with.
        """
        plan, file = verified.plan, verified.file
        if plan is None or file is None or file.bound is None or not verified.reward >= 0:
            return None
        pricing = verified.pricing
        proved = None if pricing is None else pricing.bound
        found = explain(verified.model, plan, verified.reward, file, proved)
        return cls(verified.model, plan, found, () if pricing is None else pricing.leaves)

    @property
    def problem(self) -> Problem:
        """The problem of the plan."""
        return self.model.problem

    @cached_property
    def replans(self) -> list[Replan]:
        """The plan with one robot planned again, robot by robot."""
        return replans(self.model, self.plan)

    # -- data -----------------------------------------------------------------------------

    @property
    def records(self) -> list[Record]:
        """A row of plain data per term; all rows have the same keys."""
        found = self.explanation
        return [
            {
                "kind": term.kind,
                "step": term.step,
                "robot": term.robot,
                "actor": term.actor,
                "face": term.face,
                "amount": term.amount,
                "share": found.share(term.amount),
                "resource": None if term.resource is None else self._named(term.resource),
                "sense": term.sense,
                "robots": term.robots,
                "used": None if term.users is None else len(term.users),
                "price": term.price,
            }
            for term in found.terms
        ]

    @property
    def record(self) -> Record:
        """All of it as plain data."""
        found, leaf = self.explanation, self.explanation.leaf
        terms = [
            {key: value for key, value in row.items() if value is not None}
            | ({} if term.resource is None else {"uses": msgspec.to_builtins(term.resource)})
            for row, term in zip(self.records, found.terms, strict=True)
        ]
        return {
            "bound": found.bound,
            "reward": found.reward,
            "difference": found.gap,
            "sum": found.total(),
            "terms": terms,
            "leaf": leaf and {"node": leaf.node, "bound": leaf.bound, "leaves": list(self.leaves)},
            "replans": [
                {"robot": one.robot, "gain": one.gain, "share": found.share(one.gain)}
                for one in self.replans
            ],
            "sentences": self.sentences,
        }

    # -- tables ---------------------------------------------------------------------------

    @property
    def tables(self) -> list[str]:
        """The tables as text: parts that add up, drones and people by step, rows with prices."""
        return [self._parts(), *self._drones(), *self._people(), *self._rows()]

    def _parts(self) -> str:
        found = self.explanation
        rows = list(self.parts().items())
        rows += [("sum", found.total()), ("bound - J", found.gap)]
        return _table(
            "The gap, by what the bound has more than the plan",
            ["", "amount", "% of bound"],
            [[words, _money(amount), self._percent(amount)] for words, amount in rows],
        )

    def _percent(self, amount: float) -> str:
        return f"{round(100 * self.explanation.share(amount), 4) + 0.0:.4f}"

    def _drones(self) -> list[str]:
        losses = self.explanation.losses()
        title = "What drones lose by leaving a step as they do, % of the bound"
        names = [str(robot) for robot in range(len(losses))]
        return self._grid(title, "drone", names, losses, list(range(losses.shape[1])))

    def _people(self) -> list[str]:
        """Returns what is paid for people beyond what all drones get, by side and step."""
        problem = self.problem
        steps = [None] if problem.objective.over_time else list(range(problem.horizon + 1))
        sides = [(j, name) for j, a in enumerate(problem.actors) for name in a.shape.face_names]
        first = np.searchsorted(problem.face_owner, np.arange(len(problem.actors)))
        paid = np.zeros((len(sides), len(steps)))
        for term in self.explanation.of_kind("face"):
            assert term.actor is not None
            assert term.face is not None
            paid[first[term.actor] + term.face, term.step or 0] += term.amount
        title = "What people's sides are paid beyond what the drones get, % of the bound"
        return self._grid(title, "person", [f"{j} {name}" for j, name in sides], paid, steps)

    def _grid(
        self,
        title: str,
        noun: str,
        names: Sequence[str],
        amounts: FloatArray,
        steps: Sequence[int | None],
    ) -> list[str]:
        """Returns amounts [n, steps] as tables of some steps each, without lines of nothing."""
        shares = self.explanation.share(1.0) * amounts
        sums = shares.sum(axis=1)
        heavy = np.flatnonzero(np.abs(shares).max(axis=1, initial=0.0) >= SHOWN)
        lines = sorted(heavy[np.argsort(-sums[heavy], kind="stable")][:_LINES].tolist())
        if not lines:
            return []
        note = ""
        if others := len(shares) - len(lines):
            rest = round(100 * (sums.sum() - sums[lines].sum()), 3) + 0.0
            note = f"{counted(others, 'other line')}: {rest:.3f}"
        head = [*(["sum"] if len(steps) > 1 else []), *map(_step, steps)]
        cells = [
            (names[line], [_cell(x) for x in (sums[line], *shares[line])][-len(head) :])
            for line in lines
        ]
        most = (_CHARACTERS - max(len(noun), *(len(names[line]) for line in lines))) // (_WIDTH + 2)
        parts = [slice(n, n + most) for n in range(0, len(head), most)]
        return [
            _table(
                title if part is parts[0] else "",
                [noun, *head[part]],
                [[name, *own[part]] for name, own in cells],
                note if part is parts[-1] else "",
            )
            for part in parts
        ]

    def _rows(self) -> list[str]:
        """Returns the rules and decisions with a price, the dearest first."""
        terms = self.explanation.of_kind("row", "decision")
        if not terms:
            return []
        order = sorted(terms, key=lambda term: (-abs(term.amount), -(term.price or 0.0)))
        shown = [
            term
            for term in order[:_LINES]
            if self.explanation.share(max(abs(term.amount), term.price or 0.0)) >= SHOWN
        ]
        rows = [
            [
                self._row(term),
                str(term.step),
                ",".join(map(str, term.users or ())) or "nobody",
                _money(term.price or 0.0),
                _money(term.amount),
                self._percent(term.amount),
            ]
            for term in shown
        ]
        more = order[len(shown) :]
        rest = sum(term.amount for term in more)
        note = f"{counted(len(more), 'more row')}: {self._percent(rest)}" if more else ""
        title = "Rules (at most one drone) and decisions with a price, % of the bound"
        return [_table(title, ["", "step", "used by", "price", "amount", "%"], rows, note)]

    def _row(self, term: Term) -> str:
        """Returns a rule, or a decision with the number of drones, in a few characters."""
        if term.kind == "row":
            return self._named(term.resource)
        sign = "<=" if term.sense == "at most" else ">="
        return f"{sign} {term.robots} {self._named(term.resource)}"

    # -- words ----------------------------------------------------------------------------

    @property
    def sentences(self) -> list[str]:
        """Plain sentences: what is broken, what costs most, the leaf, and the way back."""
        found = self.explanation
        broken = sorted((term for term in found.terms if term.is_broken), key=lambda x: x.amount)
        costly = self._costly
        nothing = f"no single term is above {100 * SHOWN:g} % of the bound"
        told = [self._told(term) for term in broken[:_TOLD]]
        if more := broken[_TOLD:]:
            amount = self._amount(sum(term.amount for term in more))
            told.append(f"{counted(len(more), 'more broken rule')} with a price: {amount}")
        told += [*self._told_unpriced(broken), *(self._told(term) for term in costly[:_TOLD])]
        told = [*(told or [nothing]), *self._told_leaves(), *self._told_queue()]
        told += self._told_replans()
        return [f"{words[0].upper()}{words[1:]}." for words in told]

    @property
    def _costly(self) -> list[Term]:
        """Terms that are worth a sentence, the largest first."""
        terms = self.explanation.of_kind("path", "face", "row", "decision")
        some = [term for term in terms if self.explanation.share(term.amount) >= SHOWN]
        return sorted(some, key=lambda term: -term.amount)

    @property
    def costliest(self) -> str:
        """A few words on the largest term; empty where none is worth a sentence."""
        return self._told(self._costly[0]) if self._costly else ""

    def parts(self) -> dict[str, float]:
        """Returns the sums of the terms by what they are, which add up to the gap."""
        found = self.explanation
        return {
            words: found.total(*kinds)
            for words, kinds in _PARTS.items()
            if found.of_kind(*kinds) and (kinds != ("claim",) or found.total("claim"))
        }

    def _amount(self, amount: float) -> str:
        share = round(100 * self.explanation.share(amount), 3) + 0.0
        return f"{share:.3f} % of the bound ({_money(amount)})"

    def _told(self, term: Term) -> str:
        amount = self._amount(term.amount)
        if term.kind == "path":
            return f"drone {term.robot}, leaving step {term.step}, costs {amount}"
        if term.actor is not None and term.face is not None:
            name = self.problem.actors[term.actor].shape.face_names[term.face]
            when = "over all steps" if term.step is None else f"at step {term.step}"
            return (
                f"person {term.actor}'s {name} {when} is paid {amount} more than the drones "
                "get for it"
            )
        at = "at" if isinstance(term.resource, Cells | Visit) else "from"
        where = f"{self._named(term.resource)} {at} step {term.step}"
        who = _listed(term.users or ())
        if term.is_broken:
            return f"{who} use {where}, which breaks a rule: {amount}"
        return (
            f"{who} use{'' if len(term.users or ()) > 1 else 's'} {where}, where {term.sense} "
            f"{term.robots} may at the price {_money(term.price or 0.0)}: it costs {amount}"
        )

    def _told_unpriced(self, broken: Sequence[Term]) -> Iterable[str]:
        """Yields conflicts of the plan that no broken rule with a price accounts for."""
        priced = [(term.step, set(term.users or ())) for term in broken]
        free = [
            conflict
            for conflict in self.plan.conflicts(self.problem)
            if not any(conflict.t == t and users >= set(conflict.robots) for t, users in priced)
        ]
        for conflict in free[:_TOLD]:
            words = told_conflict(self.problem, conflict)
            yield f"{words} at step {conflict.t}, which breaks a rule that has no price there"
        if len(free) > _TOLD:
            yield f"{counted(len(free) - _TOLD, 'more broken rule')} without a price"

    def _told_leaves(self) -> Iterable[str]:
        leaf, leaves = self.explanation.leaf, self.leaves
        if leaf is None or len(leaves) < 2:
            return
        most = max(bound for n, bound in enumerate(leaves) if n != leaf.position)
        others = f"bounds of up to {most:,.2f}" if math.isfinite(most) else "no plans"
        yield (
            f"the plan belongs to leaf {leaf.position + 1} of {len(leaves)}, of bound "
            f"{leaf.bound:,.2f}; the others have {others}"
        )

    def _told_queue(self) -> Iterable[str]:
        """Yields where drones must queue, and what the rules there are priced at."""
        problem = self.problem
        wanted = self.model.cells_with_a_view(problem.horizon)
        choke = None if problem.rules.none else choke_point(problem, wanted)
        if choke is not None:
            rows = self.explanation.of_kind("row")
            price = sum(t.price or 0.0 for t in rows if _touches(t.resource, choke.cells))
            paid = f"; rules there carry prices of {self._amount(price)}" if price else ""
            yield f"{choke.told(len(problem.robots), 'somebody is seen')}{paid}"

    def _told_replans(self) -> Iterable[str]:
        found = self.explanation
        gaining = [one for one in self.replans if found.share(one.gain) >= SHOWN]
        gaining.sort(key=lambda one: -one.gain)
        for one in gaining[:_TOLD]:
            yield (
                f"planned again past the others, drone {one.robot} would gain "
                f"{self._amount(one.gain)}"
            )
        if len(gaining) > _TOLD:
            yield f"{counted(len(gaining) - _TOLD, 'more drone')} would gain less, each alone"
        if not gaining:
            # Where pixels add up over time, the path that is found is not always the best.
            can = "was found to" if self.problem.objective.over_time else "can"
            yield f"no drone alone {can} gain by another path that obeys the rules"

    def _named(self, resource: Resource | None) -> str:
        """Returns a resource in words."""
        if isinstance(resource, Cells):
            return f"cell{'s' if len(resource.cells) > 1 else ''} {self._cells(resource.cells)}"
        if isinstance(resource, Swap):
            return f"swap {self._cells(resource.cells)}"
        if isinstance(resource, Move):
            return f"move {self._cells(resource.cells)}"
        if isinstance(resource, Moves):
            more = len(resource.moves) - 1
            return f"move {self._cells(resource.moves[0])}" + (f" +{more}" if more else "")
        if isinstance(resource, Visit):
            x, y, layer, heading, pitch = resource.state
            aim = f"heading {heading}" + (f", pitch {pitch}" if pitch else "")
            return f"{aim} in cell {self._cells([Cell(x, y, layer)])}"
        return ""

    def _cells(self, cells: Sequence[Cell]) -> str:
        """Returns up to two cells, with their layers if there are several, and how many more."""
        layers = len(self.problem.layers) > 1
        shown = [f"({c.x}, {c.y}, {c.layer})" if layers else f"({c.x}, {c.y})" for c in cells[:2]]
        return " ".join(shown) + (f" +{len(cells) - 2}" if len(cells) > 2 else "")


def _touches(resource: Resource | None, cells: Sequence[Cell]) -> bool:
    """Returns True if drones are in one of the cells when they use a resource, begin or end."""
    if isinstance(resource, Moves):
        return any(cell in cells for move in resource.moves for cell in move)
    if isinstance(resource, Cells | Swap | Move):
        return any(cell in cells for cell in resource.cells)
    return False


def _table(title: str, head: list[str], rows: list[list[str]], note: str = "") -> str:
    """Returns a table as text: the first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    widths[1:] = [max(width, _WIDTH) for width in widths[1:]]
    lines = [
        "  ".join(
            [line[0].ljust(widths[0])]
            + [cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True)]
        )
        for line in (head, *rows)
    ]
    return "\n".join(line for line in (title, *lines, note) if line)


def _listed(robots: Sequence[int]) -> str:
    if not robots:
        return "nobody"
    *first, last = map(str, robots)
    return f"drones {', '.join(first)} and {last}" if first else f"drone {last}"


def _money(amount: float) -> str:
    return f"{round(amount, 2) + 0.0:,.2f}"


def _step(step: int | None) -> str:
    return "all steps" if step is None else str(step)


def _cell(share: Any) -> str:
    return "." if abs(share) < SHOWN else f"{100 * float(share):.3f}"
