"""An explained gap as plain data: its terms, the objects they concern, and their sums.

`explained_tables` makes tables of it, `explained_words` sentences.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import msgspec

from cocap_opt.coordination.best_response import Replan, replans
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.certificates.resources import Cells, Move, Moves, Resource, Swap, Visit
from cocap_opt.formulations.explanation import Explanation, Kind, explain
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.model import Model, compiled
from cocap_opt.output.printing import Record
from cocap_opt.problem import Cell, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.verified import ProvedBound, Verified

_MOST_STATES = 400_000  # states; computing their coverage takes some seconds
# relative to the bound; smaller terms are shown as a dot in tables and get no sentence
SHOWN = 5e-6
_MANY = 4.0  # in multiples of the gap
_PARTS: dict[str, tuple[Kind, ...]] = {
    "drones leave the best paths of the bound": ("path",),
    "face rewards overestimated": ("face",),
    "views of people overestimated": ("views",),
    "priced rules unused or broken": ("row",),
    "priced decisions of the plan's leaf": ("decision",),
    "excess of another leaf's bound": ("leaves",),
    "tightened by stages and path search": ("stages",),
    "stated bound above the proved one": ("claim",),
    "allowance for rounding": ("rounding",),
}


@dataclass(frozen=True)
class Explained:
    """The gap of a plan, its terms, and the changes of single paths that would reduce it.

    Attributes
    ----------
    leaves : bounds of a proof's leaves, in order, if known
    """

    model: Model
    plan: Plan
    explanation: Explanation
    leaves: tuple[float, ...] = ()

    @classmethod
    def of(cls, verified: Verified) -> "Explained | None":
        """Returns the explanation of a verification's outcome.

        Returns None if there is no plan that can be flown, or no bound to compare it with.
        """
        plan, proved = verified.plan, verified.proved
        if plan is None or proved is None or proved.file.bound is None or not verified.reward >= 0:
            return None
        model, file, pricing, _ = proved
        if verified.understated:  # the gap is to the proved bound, not to the claimed one
            file = msgspec.structs.replace(file, bound=pricing.bound)
        found = explain(model, plan, verified.reward_there, file, pricing.bound)
        return cls(model, plan, found, pricing.leaves)

    @property
    def problem(self) -> Problem:
        """The problem of the plan."""
        return self.model.problem

    @cached_property
    def replans(self) -> list[Replan]:
        """The best change of each robot's path alone, robot by robot."""
        return replans(self.model, self.plan)

    @property
    def is_closed(self) -> bool:
        """True if the plan obeys the rules and its J equals the bound, except for rounding."""
        found = self.explanation
        return found.share(found.gap) <= OPTIMALITY and not any(self.plan.conflicts(self.problem))

    @property
    def taken_off(self) -> float:
        """The part of the other terms that stages and tried paths subtract, in units of J."""
        return max(-self.explanation.total("stages"), 0.0)

    @property
    def is_blurred(self) -> bool:
        """True if far more was subtracted than remains, so no term is the cause of the gap."""
        return self.taken_off > _MANY * max(self.explanation.gap, 0.0)

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
                "resource": None if term.resource is None else self.named(term.resource),
                "sense": term.sense,
                "robots": term.robots,
                "used": None if term.users is None else len(term.users),
                "price": term.price,
            }
            for term in found.terms
        ]

    @property
    def record(self) -> Record:
        """The whole explanation as plain data, without the sentences."""
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
                {"robot": replan.robot, "gain": replan.gain, "share": found.share(replan.gain)}
                for replan in self.replans
            ],
        }

    def parts(self) -> dict[str, float]:
        """Returns the sums of the terms by kind, which add up to the gap."""
        found = self.explanation
        return {
            words: found.total(*kinds)
            for words, kinds in _PARTS.items()
            if found.of_kind(*kinds) and (kinds != ("claim",) or found.total("claim"))
        }

    def named(self, resource: Resource | None) -> str:
        """Returns a resource in words; empty if there is none."""
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
        """Returns up to two cells, with layers if there are several, and the number of further
        cells.
        """
        layers = len(self.problem.layers) > 1
        shown = [f"({c.x}, {c.y}, {c.layer})" if layers else f"({c.x}, {c.y})" for c in cells[:2]]
        return " ".join(shown) + (f" +{len(cells) - 2}" if len(cells) > 2 else "")


def is_too_large(problem: Problem) -> bool:
    """Returns True if an explanation would need the coverage of very many states."""
    model = compiled(problem)
    return sum(int(model.reachable(c).sum()) for c in model.classes) > _MOST_STATES


def gaps_of(
    problem: Problem, plans: Sequence[Plan], file: CertificateFile | ProofFile
) -> list[Explanation]:
    """Explains the gaps of plans that can be flown, after verifying the file.

    Raises
    ------
    CertificateError
        If the file belongs to another problem, is not valid, or claims too low a bound.
    ValueError
        If it proves that no plan exists.
    """
    model, _, pricing, _ = ProvedBound.of(Model(problem, plain=True), file)
    rewards = [check(model.problem, plan).reward for plan in plans]
    return [
        explain(model, plan, reward, file, pricing.bound)
        for plan, reward in zip(plans, rewards, strict=True)
    ]
