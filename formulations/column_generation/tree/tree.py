"""The tree of branch-and-price: its nodes, the queue of open nodes, and the proof."""

import heapq
from collections.abc import Mapping
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import Branch, Decision, Leaf, Pricing, ProofFile
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.certificates.state_cuts import AnyCut
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.master.pricing import Priced
from cocap_opt.formulations.column_generation.master.resource_use import INTEGRAL, ResourceUse
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.diving import dive
from cocap_opt.formulations.column_generation.tree.relaxation import Relaxation
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.mixtures.columns import Column
from cocap_opt.problem import COVERAGE_VERSION

# Penalty, columns, rows and cuts that a node inherits from its parent's relaxation.
_Inheritance = tuple[float, list[Column], tuple[Resource, ...], tuple[AnyCut, ...]]


@dataclass
class _Node:
    """A node of the tree, solved or unsolved.

    Attributes
    ----------
    best : its best bound so far; initially the parent's, which is valid for the node, too
    inherited : initial content of its relaxation; None once the relaxation exists
    is_solved : True if its relaxation has been solved
    branch : the resource on which the node was branched, and its children; None for a leaf
    """

    decisions: tuple[Decision, ...]
    best: Priced
    inherited: _Inheritance | None = None
    is_solved: bool = False
    branch: Branch | None = None


class Tree:
    """The search tree; nodes are numbered in the order of creation, and the root is 0.

    Attributes
    ----------
    search : the state that the nodes share
    has_stuck_leaf : True if a leaf remained open because of a solver's accuracy
    """

    def __init__(self, search: Search, gap: float) -> None:
        self.search = search
        self.has_stuck_leaf = False
        self._gap = gap - OPTIMALITY / 2  # the rest is reserved for rounding
        self._solved = 0
        self._iterations = 0
        self._root: Relaxation | None = None
        self._nodes: list[_Node] = []
        self._queue: list[tuple[float, int]] = []  # (-bound, number) of open nodes

    def is_pruned(self, node: _Node) -> bool:
        """Returns True if the node contains no plan that is better by more than the gap."""
        cutoff = self._cutoff()
        return node.best.bound <= cutoff or self.search.is_proved(cutoff)

    def _cutoff(self) -> float:
        return self.search.cutoff(self._gap)

    def solve_root(self) -> None:
        """Solves the root and adds it as an open node, even at a limit; raises LimitReached."""
        rough = self.search.parameters.tree.rough_root
        root = Root.of(self.search, self._gap, rough, at_once=True)
        try:
            root.solve()
        finally:
            self.search, self._root = root.search, root.relaxation
            self._solved, self._iterations = 1, root.relaxation.iterations
            self._open(_Node((), root.relaxation.best, is_solved=True))

    def _open(self, node: _Node) -> None:
        """Adds a node to the tree and to the queue."""
        heapq.heappush(self._queue, (-node.best.bound, len(self._nodes)))
        self._nodes.append(node)

    def select(self) -> _Node | None:
        """Removes and returns the open node with the largest bound; None if all are pruned."""
        if not self._queue:
            return None
        node = self._nodes[heapq.heappop(self._queue)[1]]
        return None if self.is_pruned(node) else node

    def solve(self, node: _Node) -> Relaxation:
        """Solves the relaxation of a node, unless it is the root, which is solved already; raises
        LimitReached.
        """
        if node.inherited is None:
            assert self._root is not None
            relaxation, self._root = self._root, None
            return relaxation
        relaxation, node.inherited = self._relaxation(node, *node.inherited), None
        try:
            self._converge(node, relaxation, self.search.parameters.tree.rough)
        finally:
            node.is_solved, self._solved = True, self._solved + 1
            self._iterations += relaxation.iterations
        return relaxation

    def _converge(self, node: _Node, relaxation: Relaxation, rough: float) -> None:
        """Solves a node's relaxation; the node takes over its best bound, even at a limit."""
        others = -self._queue[0][0] if self._queue else -np.inf
        try:
            relaxation.solve(self._cutoff, rough, others, self._solved)
        finally:
            node.best = relaxation.best

    def _relaxation(
        self, node: _Node, penalty: float, columns: list[Column],
        rows: tuple[Resource, ...], cuts: tuple[AnyCut, ...],
    ) -> Relaxation:  # fmt: skip
        """Returns the relaxation of a node, with its inherited content."""
        master = Master(self.search.model, penalty, node.decisions)
        master.add_all(columns, rows, cuts)
        # Every robot needs a column: its best path under the decisions.
        priced = self.search.pricer(node.best.duals, node.decisions)
        for column in priced.columns:
            master.add(column)
        return Relaxation(self.search, master, priced, node.decisions)

    def look_for_plans(self, relaxation: Relaxation) -> None:
        """Offers plans made from a node's mixture; dives at nodes 1, 2, 4, 8, .."""
        solution, search = relaxation.solution, self.search
        if solution is None:
            return
        search.offer(search.local_search.from_integral(solution.mixture))
        relaxation.round_to_plans()
        if self._solved & (self._solved - 1) == 0:
            search.offer(dive(search, relaxation.master, solution))

    def branch(self, node: _Node, relaxation: Relaxation) -> None:
        """Creates the two children of a node if a resource is used fractionally."""
        if not self._branch(node, relaxation, INTEGRAL):
            # Nothing is clearly fractional: the remaining gap is due to accuracy.
            self._converge(node, relaxation, 0.0)
            if not self.is_pruned(node) and not self._branch(
                node, relaxation, self.search.parameters.tree.nearly_integral
            ):
                self.has_stuck_leaf = True  # the node remains a leaf with its bound

    def _branch(self, node: _Node, relaxation: Relaxation, tolerance: float) -> bool:
        """Creates the two children of a node; returns False if there is nothing to branch on."""
        solution, master = relaxation.solution, relaxation.master
        if solution is None:
            return False
        use = ResourceUse.of(self.search.model, solution.mixture)
        choice = use.most_fractional(tolerance)
        if choice is None:
            return False
        resource, robots = choice[0], int(np.floor(choice[1]))
        columns = [*solution.mixture.columns, *master.used_columns(2)]
        inherited = master.penalty, columns, tuple(master.rows), tuple(master.cuts)
        # The parent's multipliers are valid for the children, whose new decision has price 0.
        duals = node.best.duals
        duals = replace(duals, decisions=np.append(duals.decisions, 0.0))
        best, first = node.best._replace(duals=duals), len(self._nodes)
        node.branch = Branch(resource, robots, first, first + 1)
        at_most = Decision(resource, "at most", robots)
        at_least = Decision(resource, "at least", robots + 1)
        for decision in (at_most, at_least):
            self._open(_Node((*node.decisions, decision), best, inherited))
        return True

    def report(self) -> None:
        """Reports the state of the search, with the largest bound of the leaves."""
        bound = max(node.best.bound for node in self._nodes if node.branch is None)
        self.search.report(self.search.snapshot(bound, self._solved))

    def statistics(self, proof: ProofFile) -> Mapping[str, float]:
        """Returns the number of solved nodes, of leaves, and the work that they took."""
        return {
            "nodes": self._solved,
            "leaves": sum(isinstance(node, Leaf) for node in proof.nodes),
            "columns": self.search.columns,
            "iterations": self._iterations,
        }

    def proof(self, method: str) -> ProofFile:
        """Returns the tree as a proof file, with the bound that it proves."""
        model = self.search.model
        unpriced = ProofFile(
            scene=model.problem.name,
            digest=problem_digest(model.problem),
            method=method,
            coverage_version=COVERAGE_VERSION,
            classes="single" if model.is_disaggregated else "alike",
            bound=None,
            nodes=tuple(self._written()),
        )
        bound = Pricing.of_proof(model, unpriced).bound
        return msgspec.structs.replace(unpriced, bound=None if bound == -np.inf else bound)

    def _written(self) -> list[Branch | Leaf]:
        """Returns the nodes as they are written in a proof, each parent before its children.

        A branch without solved descendants proves no more than it did as a leaf, so it is written
        as a leaf.
        """
        written: list[Branch | Leaf] = []
        todo = [(0, -1, "")]  # node, its parent's number in the file, its side of the branch
        while todo:
            number, parent, side = todo.pop()
            node, place = self._nodes[number], len(written)
            if parent >= 0:
                written[parent] = msgspec.structs.replace(written[parent], **{side: place})
            branch = node.branch
            if branch is None or not (
                self._nodes[branch.at_most].is_solved or self._nodes[branch.at_least].is_solved
            ):
                written.append(Leaf(node.best.duals.certificate(self.search.model)))
                continue
            written.append(branch)
            todo.append((branch.at_least, place, "at_least"))
            todo.append((branch.at_most, place, "at_most"))
        return written
