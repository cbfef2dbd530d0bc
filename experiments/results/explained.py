"""The terms of a gap for people: tables that add up, sentences, and plain data."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np

from cocap_opt.coordination.replans import Replan, replans
from cocap_opt.data import FloatArray
from cocap_opt.experiments.results.printing import Listing, Record, counted
from cocap_opt.experiments.results.verification import Verified
from cocap_opt.formulations.certificates import Cells, Move, Moves, Resource, Swap, Visit
from cocap_opt.formulations.explanation import Explanation, Kind, Term, explain
from cocap_opt.problem import Cell, Problem

SHOWN = 5e-6  # of the bound; less is a dot in tables and not worth a sentence
_TOLD = 6  # sentences on single terms
_LINES = 20  # of a table
_COLUMNS = 9  # steps of a table, so that a line has 80 characters
_PARTS: dict[str, tuple[Kind, ...]] = {
    "drones leave their best paths": ("path",),
    "faces are paid more than they give": ("face",),
    "rules have a price": ("row",),
    "decisions of the plan's leaf have a price": ("decision",),
    "another leaf of the proof has a larger bound": ("leaves",),
    "the file claims more than its numbers prove": ("claim",),
    "rounding is covered": ("rounding",),
}


class Explained(NamedTuple):
    """The gap of a verified plan, its terms, and the single re-plans that would lessen it.

    Attributes
    ----------
    leaves : bounds of a proof's leaves, in order
    """

    problem: Problem
    explanation: Explanation
    leaves: tuple[float, ...]
    replans: list[Replan]

    @classmethod
    def of(cls, verified: Verified) -> "Explained | None":
        """Returns the explanation of what was verified.

        It is None where there is no plan that can be flown, or no bound to compare it with.
        """
        plan, file = verified.plan, verified.file
        if plan is None or file is None or file.bound is None or not verified.reward >= 0:
            return None
        model, leaves = verified.model, verified.pricing.leaves if verified.pricing else ()
        found = explain(model, plan, verified.reward, file)
        return cls(verified.problem, found, leaves, replans(model, plan))

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
                "resource": None if term.resource is None else self._named(term.resource),
                "sense": term.sense,
                "robots": term.robots,
                "used": None if term.users is None else len(term.users),
                "price": term.price,
                "amount": term.amount,
                "share": found.share(term.amount),
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
    def listings(self) -> list[Listing]:
        """The tables: parts that add up, drones and people by step, and rows with prices."""
        found = [self._parts(), *self._drones(), *self._people(), *self._rows()]
        return [*found, Listing("In words", [], self.sentences)]

    def _parts(self) -> Listing:
        found = self.explanation
        rows = [
            self._part(words, found.total(*kinds))
            for words, kinds in _PARTS.items()
            if found.of_kind(*kinds) and (kinds != ("claim",) or found.total("claim"))
        ]
        ends = (("sum", found.total()), ("bound - J", found.gap))
        return Listing("The gap", [*rows, *(self._part(*end) for end in ends)])

    def _part(self, words: str, amount: float) -> Record:
        return {
            "what the bound has more": words,
            "amount": amount,
            "% of bound": self._percent(amount),
        }

    def _percent(self, amount: float) -> str:
        return f"{100 * self.explanation.share(amount):8.4f}"

    def _drones(self) -> list[Listing]:
        losses = self.explanation.losses()
        title = "What drones lose by leaving a step as they do (% of the bound)"
        return self._grid(title, "drone", losses, list(range(losses.shape[1])))

    def _people(self) -> list[Listing]:
        """Returns what is paid for people beyond what all drones get, by person and step."""
        terms, problem = self.explanation.of_kind("face"), self.problem
        steps = [None] if problem.objective.over_time else list(range(problem.horizon + 1))
        paid = np.zeros((len(problem.actors), len(steps)))
        for term in terms:
            assert term.actor is not None
            paid[term.actor, term.step or 0] += term.amount
        title = "What the bound pays for people beyond what drones get (% of the bound)"
        return self._grid(title, "person", paid, steps)

    def _grid(
        self, title: str, noun: str, amounts: FloatArray, steps: Sequence[int | None]
    ) -> list[Listing]:
        """Returns amounts [n, steps] as tables of so many steps, without lines of nothing."""
        shares = np.array([[self.explanation.share(x) for x in row] for row in amounts.tolist()])
        shares = shares.reshape(amounts.shape)
        heavy = np.flatnonzero(np.abs(shares).max(axis=1, initial=0.0) >= SHOWN)
        most = heavy[np.argsort(-shares[heavy].sum(axis=1), kind="stable")][:_LINES]
        notes = []
        if len(most) < len(shares):
            rest = shares.sum() - shares[most].sum()
            others = counted(len(shares) - len(most), "other " + noun).replace("persons", "people")
            notes = [f"{others}: {100 * rest:.4f} %"]
        if not len(most):
            return []
        parts = [range(n, min(n + _COLUMNS, len(steps))) for n in range(0, len(steps), _COLUMNS)]
        found = []
        for part in parts:
            rows = [
                {noun: str(one)}
                | {_step(steps[t]): _cell(shares[one, t]) for t in part}
                | ({"sum": _cell(shares[one].sum())} if part is parts[-1] else {})
                for one in sorted(most.tolist())
            ]
            found.append(Listing(title, rows, notes if part is parts[-1] else ()))
            title = ""
        return found

    def _rows(self) -> list[Listing]:
        """Returns the rules and decisions with a price, those that cost most first."""
        terms = self.explanation.of_kind("row", "decision")
        if not terms:
            return []
        order = sorted(terms, key=lambda term: (-abs(term.amount), -(term.price or 0.0)))
        rows = [
            {
                "step": "-" if term.step is None else str(term.step),
                "rule": f"{term.sense} {term.robots}: {self._named(term.resource)}",
                "used by": ", ".join(map(str, term.users or ())) or "nobody",
                "price": term.price,
                "amount": term.amount,
                "% of bound": self._percent(term.amount),
            }
            for term in order[:_LINES]
        ]
        more = order[_LINES:]
        notes = [
            f"{counted(len(more), 'more row')}, {sum(bool(term.amount) for term in more)} of them "
            f"with an amount: {self._percent(sum(term.amount for term in more)).strip()} %"
        ]
        return [Listing("Rules and decisions with a price", rows, notes if more else ())]

    # -- words ----------------------------------------------------------------------------

    @property
    def sentences(self) -> list[str]:
        """Plain sentences: what is broken, what costs most, the leaf, and the way back."""
        found = self.explanation
        costly = sorted(found.of_kind("path", "face", "row", "decision"), key=lambda x: -x.amount)
        costly = [term for term in costly if found.share(term.amount) >= SHOWN]
        broken = [term for term in found.terms if term.is_broken]
        return [
            f"{words[0].upper()}{words[1:]}."
            for words in (
                *(self._told(term) for term in broken),
                *(self._told(term) for term in costly[:_TOLD]),
                *self._told_leaves(),
                *self._told_replans(),
            )
        ]

    def _told(self, term: Term) -> str:
        share = f"{100 * self.explanation.share(term.amount):.3f} % of the bound"
        amount = f"{share} ({term.amount:,.2f})"
        if term.kind == "path":
            return f"drone {term.robot}, leaving step {term.step}, costs {amount}"
        if term.actor is not None and term.face is not None:
            name = self.problem.actors[term.actor].shape.face_names[term.face]
            when = "over all steps" if term.step is None else f"at step {term.step}"
            return (
                f"person {term.actor}'s {name} {when} costs {amount}: the bound pays for more than "
                "the drones together get"
            )
        where = f"{self._named(term.resource)} from step {term.step} on"
        if isinstance(term.resource, Cells | Visit):
            where = f"{self._named(term.resource)} at step {term.step}"
        if term.is_broken:
            users = _listed(term.users or ())
            return f"{users} use {where}, which breaks a rule: {amount}"
        who = f"{counted(len(term.users or ()), 'drone')} of {term.sense} {term.robots} use"
        return f"{who} {where}, which has the price {term.price:,.2f}: {amount}"

    def _told_leaves(self) -> Iterable[str]:
        leaf, leaves = self.explanation.leaf, self.leaves
        if leaf is None or len(leaves) < 2:
            return
        others = [bound for n, bound in enumerate(leaves) if n != leaf.position]
        yield (
            f"the plan belongs to leaf {leaf.position + 1} of {len(leaves)}, of bound "
            f"{leaf.bound:,.2f}; the others have bounds of {min(others):,.2f} to "
            f"{max(others):,.2f}"
        )

    def _told_replans(self) -> Iterable[str]:
        found = self.explanation
        for one in sorted(self.replans, key=lambda one: -one.gain):
            if found.share(one.gain) >= SHOWN:
                share = f"{100 * found.share(one.gain):.3f} % of the bound"
                yield (
                    f"planned again past the others, drone {one.robot} alone would gain {share} "
                    f"({one.gain:,.2f})"
                )
        if not any(found.share(one.gain) >= SHOWN for one in self.replans):
            yield "no drone alone would gain anything by another path that obeys the rules"

    def _named(self, resource: Resource | None) -> str:
        """Returns a resource in words."""
        if isinstance(resource, Cells):
            cells = _cells(resource.cells)
            return f"cell {cells}" if len(resource.cells) == 1 else f"cells {cells}"
        if isinstance(resource, Swap):
            return f"swap of {_cells(resource.cells)}"
        if isinstance(resource, Move):
            return f"move {_cells(resource.cells)}"
        if isinstance(resource, Moves):
            first = _cells(resource.moves[0])
            more = len(resource.moves) - 1
            return f"move {first}" + (f" or {more} near it" if more else "")
        if isinstance(resource, Visit):
            x, y, *_, heading, pitch = resource.state
            return f"cell ({x}, {y}) with heading {heading}" + (f", pitch {pitch}" if pitch else "")
        return ""


def _cells(cells: Sequence[Cell]) -> str:
    layers = any(cell.layer for cell in cells)
    shown = [f"({c.x}, {c.y}, layer {c.layer})" if layers else f"({c.x}, {c.y})" for c in cells[:3]]
    return " ".join(shown) + (f" and {len(cells) - 3} more" if len(cells) > 3 else "")


def _listed(robots: Sequence[int]) -> str:
    if not robots:
        return "no drones"
    *first, last = map(str, robots)
    return f"drones {', '.join(first)} and {last}" if first else f"drone {last}"


def _step(step: int | None) -> str:
    return "all steps" if step is None else str(step)


def _cell(share: Any) -> str:
    return "." if abs(share) < SHOWN else f"{100 * float(share):.3f}"
