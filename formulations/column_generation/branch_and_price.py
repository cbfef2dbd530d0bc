"""Branch and price: proved optima.

A tree of decisions (`branching`) over relaxations (`relaxation`), the node of the
largest bound first. A node is a leaf where its bound is at most the incumbent's J. The tree
with the multipliers of its leaves is the proof (`proof`), whatever stopped the search: the
leaves of an unfinished tree merely prove less.

Compare branch-and-cut-and-price for path finding (Lam, Le Bodic, Harabor, Stuckey, BCP-MAPF).
"""

import heapq
import time
from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import numpy as np

from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates.certificate import Decision
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.proof import Branch, Leaf, ProofFile, price_proof
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.branching import WHOLE, amounts_of, fractional
from cocap_opt.formulations.column_generation.diving import decided, dive
from cocap_opt.formulations.column_generation.master import Column, Master
from cocap_opt.formulations.column_generation.pricing import Priced
from cocap_opt.formulations.column_generation.relaxation import Relaxation
from cocap_opt.formulations.column_generation.root import solved_root
from cocap_opt.formulations.column_generation.search import Search, cutoff_of, result_of, use_start
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, only_start, silent
from cocap_opt.model import compiled
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.stop import Limit, Stop, never

METHOD = "branch-and-price"
NEARLY_WHOLE = 1e-7  # amounts that count as whole where nothing else is left to branch on
ROUGH = 0.1  # of what is open to the cutoff: less is not worth converging to before branching
ROUGH_ROOT = 0.02  # likewise, at the root, whose bound holds for all


@dataclass
class Node:
    """A node of the tree, solved or not yet.

    Attributes
    ----------
    best : its best bound so far; at first the parent's, which holds for it as well
    inherited : columns, conflict rows and cuts to begin with
    solved : whether its relaxation has been looked at
    branch : what it was branched on; None for a leaf
    """

    decisions: tuple[Decision, ...]
    best: Priced
    inherited: "Inherited | None"
    solved: bool = False
    branch: Branch | None = None


class Inherited(NamedTuple):
    """What a node takes over from its parent's relaxation."""

    columns: list[Column]
    rows: tuple[Resource, ...]
    cuts: tuple[Cut, ...]
    penalty: float


def branch_and_price(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
) -> CertifiedResult:
    """Best plan, and the proof that none is better by more than the relative gap.

    At a limit, the best plan and the bound so far, with their proof.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    limit = model.prepare_all(stop)
    if limit is not Limit.NONE:
        return only_start(problem, start, limit, time.perf_counter() - begin)
    search = Search(model, stop, report, begin)
    message = use_start(search, start)
    tree = _Tree(search, gap)
    limit = tree.grow()
    proof = tree.proof(problem)
    search = tree.search
    return result_of(search, proof, limit, gap, message, {
        "nodes": tree.solved, "leaves": sum(isinstance(n, Leaf) for n in proof.nodes),
        "columns": search.columns, "iterations": tree.iterations,
    })  # fmt: skip


class _Tree:
    """The search tree; nodes are numbered as they are made, the root is 0."""

    def __init__(self, search: Search, gap: float) -> None:
        self.search = search
        self.solved = 0
        self.iterations = 0
        self._gap = gap
        self._nodes: list[Node] = []
        self._queue: list[tuple[float, int]] = []  # (-bound, number) of open nodes

    def cutoff(self) -> float:
        """Bound at which a node is of no more interest; J >= 0 where there is no plan yet."""
        # Half of the gap is left to rounding.
        return cutoff_of(self.search, self._gap / 2)

    def grow(self) -> Limit:
        """Solve the open nodes, the largest bound first."""
        root = solved_root(self.search, self._gap / 2, ROUGH_ROOT)
        self.search = root.search
        self._nodes = [Node((), root.best, None, solved=True)]
        self.solved, self.iterations = 1, root.iterations
        self._open(0)
        stuck = Limit.NONE
        while self._queue:
            bound, number = heapq.heappop(self._queue)
            node = self._nodes[number]
            if -bound <= self.cutoff():
                break  # and so are all others
            others = -self._queue[0][0] if self._queue else -np.inf
            relaxation = root if number == 0 else self._relaxation(node)
            if number:
                relaxation.solve(self.cutoff, ROUGH, others, self.solved)
                self.solved, node.solved = self.solved + 1, True
                self.iterations += relaxation.iterations
            node.best, node.inherited = relaxation.best, None
            limit = relaxation.limit
            if limit not in (Limit.NONE, Limit.NUMERICS):
                return limit
            if node.best.bound > self.cutoff():
                self._look_for_plans(relaxation)
            if node.best.bound > self.cutoff() and not self._branch(number, relaxation, WHOLE):
                # Nothing is clearly fractional: what is open is a matter of accuracy.
                relaxation.solve(self.cutoff, 0.0, others, self.solved)
                node.best = relaxation.best
                if relaxation.limit not in (Limit.NONE, Limit.NUMERICS):
                    return relaxation.limit
                is_open = node.best.bound > self.cutoff()
                if is_open and not self._branch(number, relaxation, NEARLY_WHOLE):
                    stuck = Limit.NUMERICS  # the node stays a leaf with the bound it has
            self.search.report(self.search.snapshot(self.bound, self.solved))
        return stuck

    @property
    def bound(self) -> float:
        """Largest bound of the leaves."""
        return max(node.best.bound for node in self._nodes if node.branch is None)

    def _open(self, number: int) -> None:
        heapq.heappush(self._queue, (-self._nodes[number].best.bound, number))

    def _relaxation(self, node: Node) -> Relaxation:
        """The relaxation of a node, with what it inherits."""
        inherited = node.inherited
        assert inherited is not None
        master = Master(self.search.model, inherited.penalty, node.decisions)
        for column in inherited.columns:
            master.add(column)
        for resource in inherited.rows:
            master.add_row(resource)
        for cut in inherited.cuts:
            master.add_cut(cut)
        # Every robot needs a column: its best path under the decisions.
        priced = self.search.pricer(node.best.duals, node.decisions)
        for column in priced.columns:
            master.add(column)
        return Relaxation(self.search, master, priced, node.decisions)

    def _look_for_plans(self, relaxation: Relaxation) -> None:
        search, solution = self.search, relaxation.solution
        if solution is None:
            return
        search.offer(decided(search, solution))
        relaxation.look_for_plans()
        if self.solved & (self.solved - 1) == 0:  # nodes 1, 2, 4, 8, ..
            search.offer(dive(search, relaxation.master, solution))

    def _branch(self, number: int, relaxation: Relaxation, whole: float) -> bool:
        """Make the two children of a node; False where there is nothing to branch on."""
        solution, node = relaxation.solution, self._nodes[number]
        if solution is None:
            return False
        columns = solution.columns
        choices = fractional(amounts_of(self.search.model, columns, solution.mixture), whole)
        if not choices:
            return False
        # The most fractional; ties go to the earlier step.
        resource, amount = min(
            choices, key=lambda c: (round(abs(c[1] % 1 - 0.5), 3), c[0].t, repr(c[0]))
        )
        robots = int(np.floor(amount))
        used = [*solution.columns, *relaxation.master.used_columns(2)]
        inherited = Inherited(
            used, relaxation.master.rows, relaxation.master.cuts, relaxation.master.penalty
        )
        first = len(self._nodes)
        node.branch = Branch(resource, robots, first, first + 1)
        for decision in (
            Decision(resource, "at most", robots),
            Decision(resource, "at least", robots + 1),
        ):
            best = node.best._replace(duals=_with_decision(node.best.duals))
            self._nodes.append(Node((*node.decisions, decision), best, inherited))
            self._open(len(self._nodes) - 1)
        return True

    def proof(self, problem: Problem) -> ProofFile:
        """The tree as a file, with the bound that it proves."""
        model, nodes = self.search.model, list[Branch | Leaf]()
        self._write(0, nodes)
        unpriced = ProofFile(
            scene=problem.name,
            digest=problem_digest(problem),
            method=METHOD,
            classes="single" if model.is_apart else "alike",
            bound=None,
            nodes=tuple(nodes),
        )
        bound = price_proof(model, unpriced).bound
        return msgspec.structs.replace(unpriced, bound=None if bound == -np.inf else bound)

    def _write(self, number: int, nodes: list[Branch | Leaf]) -> None:
        """Append a node and those below it.

        A branch with nothing solved below it proves no more than it did as a leaf.
        """
        todo = [(number, -1, "")]  # node, its parent's number in the file, its side there
        while todo:
            number, parent, side = todo.pop()
            node, place = self._nodes[number], len(nodes)
            if parent >= 0:
                nodes[parent] = msgspec.structs.replace(nodes[parent], **{side: place})
            branch = node.branch
            if branch is None or not (
                self._nodes[branch.at_most].solved or self._nodes[branch.at_least].solved
            ):
                nodes.append(Leaf(node.best.duals.certificate(self.search.model)))
                continue
            nodes.append(branch)
            todo.append((branch.at_least, place, "at_least"))
            todo.append((branch.at_most, place, "at_most"))


def _with_decision(duals: Duals) -> Duals:
    """The same multipliers under one more decision, which costs nothing."""
    return Duals(duals.alpha, duals.beta, duals.rows, duals.cuts, np.append(duals.decisions, 0.0))
