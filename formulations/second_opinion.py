"""Gives a second opinion on certificates: computes the bound that a certificate proves with other
code.

For staged certificates the second opinion comes from `cocap_check`, which searches joint states
itself. For all others it is computed here with networkx.

`certificates.pricing` states the inequalities that bound J, and prices them by value iteration over
arrays. This module computes the same sums in plain loops over states and moves. It finds each
drone's best path with networkx, as a longest path through the part of the time-expanded graph that
the drone can reach from its starts. Both use the same code for the problem, the possible moves, the
views and the file format; they do not share the numbering of states, the charges, the envelopes or
the sweep. This module does not check again that every plan obeys the rows. It prices every leaf of
a proof.

In a directed acyclic graph, networkx's longest path may begin and end anywhere, so it leaves out
any part with a negative sum. Therefore all edge weights are raised by a constant that makes them
nonnegative. A longest path then starts from an auxiliary node with an edge to each start, and ends
at step T; it has T + 1 edges, for which the constant is subtracted again.
"""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from cocap_opt.files.documents import encode
from cocap_opt.formulations.certificates import (
    Branch,
    CertificateError,
    CertificateFile,
    ClassCurve,
    Decision,
    EnvelopeCut,
    Pricing,
    ProofFile,
    ReferencePixels,
    Staged,
    StateCut,
)
from cocap_opt.formulations.certificates.format import Certificate
from cocap_opt.formulations.certificates.resources import Cells, Move, Moves, Resource, Swap
from cocap_opt.formulations.independent import cocap_check, instance_of
from cocap_opt.graph.motion import Window
from cocap_opt.graph.networks import Node, edges_in_reach, keep_paths, reached_graph
from cocap_opt.model import Model
from cocap_opt.problem import Cell, Objective, Problem, Robot, State
from cocap_opt.referee import rewards_of_move
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import StateViews

if TYPE_CHECKING:
    from cocap_opt.graph.networks import Graph

# relative tolerance between two opinions, of the sum of the bound's absolute values
TOLERANCE = 1e-9
MOST_EDGES = 2_000_000  # edges of one drone's graph: takes a gigabyte
MOST_WORK = 40_000_000  # edges of all drones at all leaves: takes some minutes
MOST_CORNERS = 50_000  # corners of a cut that are enumerated in plain loops

_Worth = tuple[float, float]  # a sum, and the sum of its terms' absolute values
_Uses = dict[tuple[object, ...], float]  # cost of (t, Cell), (t, State) and (t, Cell, Cell)
_Pixels = dict[tuple[int, Node, int], float]  # by class, node and face
_Leaf = tuple[Certificate, Sequence[Decision]]  # a certificate, and the decisions of its leaf


class TooLargeError(ValueError):
    """The graphs are too large for networkx to price in minutes; the message says how large."""


class SecondOpinion(NamedTuple):
    """The bound that a certificate or a proof proves, computed by code other than that of
    `verify`.
    """

    bound: float
    magnitude: float  # sum of the absolute values of the bound's terms
    by: Literal["networkx", "cocap-check"] = "networkx"

    @classmethod
    def of(
        cls,
        model: Model,
        file: CertificateFile | ProofFile,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> SecondOpinion:
        """Returns the bound of a certificate, or the largest bound of a proof's leaves.

        Parameters
        ----------
        model : model of the problem
        file : a file that `require_small` accepts and `certificates.verify` has found valid
        progress : called with the number of best paths that networkx has found, or of files that
            cocap-check has checked, and the total

        Raises
        ------
        CertificateError
            If cocap-check rejects the file.
        TooLargeError
            If a search of cocap-check, or a cut with many corners, would take too long.
        """
        problem = model.problem
        leaves: list[_Leaf]
        if isinstance(file, ProofFile):
            leaves = [(leaf.certificate, decisions) for _, leaf, decisions in file.leaves()]
        elif isinstance(file.certificate, Staged):
            progress(0, 1)  # takes some seconds or minutes, without progress reports
            bound = _by_cocap_check(model, file)
            return cls(bound, abs(bound), "cocap-check")
        else:
            leaves = [(file.certificate, ())]
        return cls(*max(_Prices(problem, file.classes == "single").of(leaves, progress)))

    def agrees(self, pricing: Pricing) -> bool:
        """Returns True if `verify` computes the same bound.

        The bounds may differ by 1e-9 of the sum of the bound's absolute values, and by the
        allowance for rounding that the sweep has added. cocap-check may find a smaller bound: if a
        file claims less than can be proved, the search of cocap-check may prove more than that of
        `verify`.
        """
        if math.inf in (abs(self.bound), abs(pricing.bound)):
            return self.bound == pricing.bound
        # allows for rounding even if `pricing.rounding` is 0
        rounding = math.nextafter(pricing.rounding, math.inf) * (1 + TOLERANCE)
        above = self.bound - pricing.bound
        if self.by == "cocap-check":
            above = max(above, 0.0)
        return abs(above) <= TOLERANCE * self.magnitude + rounding


def require_small(problem: Problem, file: CertificateFile | ProofFile) -> None:
    """Raises an error if networkx would, by an estimate, take too long to price a file.

    Counting the edges of the drones' graphs takes seconds: call this once, before any long
    computation.

    Raises
    ------
    TooLargeError
        If pricing would take more than a few minutes, or more than a gigabyte for one drone.
    """
    if isinstance(file, CertificateFile) and isinstance(file.certificate, Staged):
        return
    known: dict[tuple[object, ...], int] = {}
    edges = 0
    for i, robot in enumerate(problem.robots):
        alike = robot.motion, len(robot.camera.tilts), robot.start
        if alike not in known:
            known[alike] = edges_in_reach(problem, i, MOST_EDGES)
        if known[alike] > MOST_EDGES:
            raise TooLargeError(
                f"the graph of robots[{i}] has more than {MOST_EDGES:,} edges, too many for "
                "networkx"
            )
        edges += known[alike]
    leaves = 1
    if isinstance(file, ProofFile):
        leaves = sum(not isinstance(node, Branch) for node in file.nodes)
    if edges * leaves > MOST_WORK:
        raise TooLargeError(
            f"networkx would price {edges:,} edges at {leaves:,} "
            f"{'leaf' if leaves == 1 else 'leaves'}; the limit is {MOST_WORK:,} edges in total"
        )


# -- staged certificates ---------------------------------------------------------------------------


def _by_cocap_check(model: Model, file: CertificateFile) -> float:
    """Returns the bound of a staged certificate as computed by `cocap_check`, rounded up.

    Raises
    ------
    CertificateError, TooLargeError
        If `cocap_check` rejects the file, or if its search would take too long.
    """
    try:
        instance = cocap_check.Instance(instance_of(model))
        document = json.loads(encode(file))
        cocap_check.kind_of(instance, document)
        bound, is_part = cocap_check.bound_of_file(instance, document)
    except cocap_check.Refused as refused:
        raise CertificateError(f"certificate: rejected by cocap-check: {refused}") from refused
    if is_part:
        raise TooLargeError(
            f"its searches have more than {cocap_check.MOST_BRANCHES:,} branches, or find more "
            f"than {cocap_check.MOST_FOUND:,} joint states, which is too many for cocap-check"
        )
    assert bound is not None, "a staged certificate has a target"
    return math.nextafter(bound / cocap_check.ONE, math.inf)


# -- sums ------------------------------------------------------------------------------------------


class _Prices:
    """Sums for pricing the certificates of a problem.

    Parameters
    ----------
    single : True: every robot forms its own class; False: robots that differ only in their start
        form a class
    """

    def __init__(self, problem: Problem, single: bool) -> None:
        self._problem = problem
        kinds: list[object] = [
            i if single else (robot.motion, robot.camera, robot.goal)
            for i, robot in enumerate(problem.robots)
        ]
        numbers = {kind: number for number, kind in enumerate(dict.fromkeys(kinds))}
        self._classes = [numbers[kind] for kind in kinds]  # [R] number of each robot's class
        faces = problem.view_sum_weights[: problem.view_sum_steps * len(problem.face_weights)]
        self._weights = faces.reshape(problem.view_sum_steps, -1).tolist()
        views = problem.objective.views
        self._cap = 0 if views is None else views.cameras
        # Credits for a drone that sees a person at a step that counts.
        self._worth = [
            row if t >= problem.first_step else [0.0] * len(row)
            for t, row in enumerate(problem.count_weights.tolist())
        ]

    def of(self, leaves: Sequence[_Leaf], progress: Callable[[int, int], None]) -> list[_Worth]:
        """Returns the bounds that the given leaves prove.

        Robots are processed one by one, since a networkx graph is large.

        Parameters
        ----------
        progress : called with the number of best paths found, and the total
        """
        paths: list[list[_Worth]] = [[] for _ in leaves]
        sights: dict[object, _Sight] = {}
        for robot, spec in enumerate(self._problem.robots):
            graph = reached_graph(self._problem, robot)
            alike = self._sight_of(robot)
            if alike not in sights:
                sights[alike] = _Sight(self._problem, spec)
            sight = sights[alike]
            sight.look(graph)
            for n, leaf in enumerate(leaves):
                paths[n].append(self._best_path(robot, graph, sight, leaf))
                progress(robot * len(leaves) + n + 1, len(leaves) * len(self._problem.robots))
        visible = {
            (self._row(t), face)
            for sight in sights.values() for (_, t), faces in sight.seen.items()
            for face, _ in faces
        }  # fmt: skip
        noticed = {
            (t, person)
            for sight in sights.values() for (_, t), people in sight.people.items()
            for person in people
        }  # fmt: skip
        pixels = {
            (number, node, face): amount
            for robot, number in enumerate(self._classes)
            for node, faces in sights[self._sight_of(robot)].seen.items()
            for face, amount in faces
        }
        terms = [list(self._constants(*leaf, visible, pixels)) for leaf in leaves]
        for constants, (certificate, _) in zip(terms, leaves, strict=True):
            constants += self._kappas(certificate, visible)
            constants += self._count_kappas(certificate, noticed)
        return [
            (
                math.fsum(constants) + math.fsum(value for value, _ in best),
                math.fsum(map(abs, constants)) + math.fsum(magnitude for _, magnitude in best),
            )
            for constants, best in zip(terms, paths, strict=True)
        ]

    def _sight_of(self, robot: int) -> object:
        """Returns the motion and the camera of a robot, on which its views depend."""
        spec = self._problem.robots[robot]
        return spec.motion, spec.camera

    def _best_path(self, robot: int, graph: Graph, sight: _Sight, leaf: _Leaf) -> _Worth:
        """Returns the worth of a robot's best path through all nodes that it can reach."""
        certificate, decisions = leaf
        number = self._classes[robot]
        pay = self._payment(certificate, number)
        paid = {
            node: math.fsum(
                self._weights[self._row(node[1])][face]
                * pay(node[0], self._row(node[1]), face, pixels)
                for face, pixels in sight.seen[node]
            )
            for node in graph
            if node in sight.seen
        }
        for node in graph:
            if people := sight.people.get(node):
                counted = (self._count_payment(certificate, node[1], j) for j in people)
                paid[node] = math.fsum([paid.get(node, 0.0), *counted])
        uses = _uses_of(certificate, decisions, number)
        return _longest_path(self._problem, robot, graph, paid, uses)

    def _row(self, t: int) -> int:
        """Returns the row of a table that holds the pixels of step t."""
        return 0 if self._problem.objective.over_time else t

    def _constants(
        self,
        certificate: Certificate,
        decisions: Sequence[Decision],
        visible: Set[tuple[int, int]],
        pixels: _Pixels,
    ) -> Iterator[float]:
        """Yields the amounts to add for cuts, rows and decisions, which do not depend on the
        plan.

        Parameters
        ----------
        visible : view sums (row, face) that some drone can see; cuts of all others add nothing
        pixels : pixels of a robot of a class at a node and face, where they are not 0
        """
        if isinstance(certificate, ReferencePixels):
            for weights, reference in zip(self._weights, certificate.pixels, strict=True):
                yield from (w * math.sqrt(z) for w, z in zip(weights, reference, strict=True))
            for weights, drones in zip(self._worth, certificate.views, strict=False):
                yield from (w * min(n, self._cap) for w, n in zip(weights, drones, strict=True))
            return
        sizes = tuple(map(self._classes.count, range(max(self._classes) + 1)))
        for cut in certificate.cuts:
            if (cut.t, cut.face) not in visible:
                continue
            yield self._weights[cut.t][cut.face] * cut.share * _highest_corner(cut.curves, sizes)
        for state_cut in certificate.state_cuts:
            if (state_cut.t, state_cut.face) not in visible:
                continue
            weight = self._weights[state_cut.t][state_cut.face]
            yield weight * state_cut.share * self._highest_set(state_cut, pixels)
        for row in certificate.rows:
            yield row.multiplier
        for decision, nu in zip(decisions, certificate.decisions, strict=True):
            if not decision.closes:
                yield decision.sign * nu * decision.robots

    def _highest_set(self, cut: StateCut, pixels: _Pixels) -> float:
        """Returns the smallest valid constant of a state cut."""
        by_cell: dict[tuple[int, int, float], list[tuple[float, float]]] = {}
        for part in cut.payments:
            heights = self._problem.robots[self._classes.index(part.class_number)].motion.layers
            for state, value in zip(part.states, part.values, strict=True):
                seen = pixels.get((part.class_number, (state, cut.t), cut.face), 0.0)
                cell = state.x, state.y, heights[state.layer]
                by_cell.setdefault(cell, []).append((seen, value))
        return _highest_of(by_cell.values(), cut.slope)

    def _kappas(
        self, certificate: Certificate, visible: Iterable[tuple[int, int]]
    ) -> Iterator[float]:
        """Yields the amount to add for each view sum (row, face) that some drone can see."""
        if isinstance(certificate, ReferencePixels):
            return
        shares: dict[tuple[int, int], list[float]] = {}
        cuts: tuple[EnvelopeCut | StateCut, ...] = (*certificate.cuts, *certificate.state_cuts)
        for cut in cuts:
            shares.setdefault((cut.t, cut.face), []).append(cut.share)
        for row, face in visible:
            alpha, beta = certificate.alpha[row][face], certificate.beta[row][face]
            rest = _rounded_up(Fraction(1) - sum(map(Fraction, shares.get((row, face), []))))
            if self._weights[row][face] > 0 and alpha < rest:
                yield self._weights[row][face] * (rest - alpha) ** 2 / (4 * beta)

    def _count_kappas(
        self, certificate: Certificate, noticed: Iterable[tuple[int, int]]
    ) -> Iterator[float]:
        """Yields the amount to add for each step and each person whom some drone can see."""
        if isinstance(certificate, ReferencePixels):
            return
        for t, person in noticed:
            left = max(1 - certificate.views[t][person], 0.0)
            yield self._worth[t][person] * self._cap * left

    def _count_payment(self, certificate: Certificate, t: int, person: int) -> float:
        """Returns the credit for seeing a person at a step."""
        weight = self._worth[t][person]
        if isinstance(certificate, ReferencePixels):
            drones = certificate.views[t][person]
            return weight * (min(drones + 1, self._cap) - min(drones, self._cap))
        return weight * certificate.views[t][person]

    def _payment(
        self, certificate: Certificate, number: int
    ) -> Callable[[State, int, int, float], float]:
        """Returns the function that credits a class for pixels of a face from a state, before
        weights.
        """
        if isinstance(certificate, ReferencePixels):
            reference = certificate.pixels
            return lambda state, row, face, pixels: (
                pixels
                / (math.sqrt(reference[row][face] + pixels) + math.sqrt(reference[row][face]))
            )
        cuts: dict[tuple[int, int], list[EnvelopeCut]] = {}
        for cut in certificate.cuts:
            cuts.setdefault((cut.t, cut.face), []).append(cut)
        by_states: dict[tuple[int, int], list[tuple[StateCut, dict[State, float]]]] = {}
        for state_cut in certificate.state_cuts:
            listed = _values(state_cut, number)
            by_states.setdefault((state_cut.t, state_cut.face), []).append((state_cut, listed))

        def pay(state: State, row: int, face: int, pixels: float) -> float:
            root = math.sqrt(pixels)
            paid = certificate.alpha[row][face] * root + certificate.beta[row][face] * pixels
            return math.fsum(
                [
                    paid,
                    *(
                        cut.share * _phi(cut.curves, number, root)
                        for cut in cuts.get((row, face), ())
                    ),
                    *(
                        cut.share * listed.get(state, min(root, cut.slope * pixels))
                        for cut, listed in by_states.get((row, face), ())
                    ),
                ]
            )

        return pay


def _highest_of(by_cell: Iterable[Sequence[tuple[float, float]]], slope: float) -> float:
    """Returns the smallest valid constant of a state cut: at most one state is taken in each cell.

    The line of the given slope that touches the root takes its place, left of where they touch.

    Parameters
    ----------
    by_cell : pixels and phi of the listed states in each cell
    """
    sets = [(0.0, 0.0)]
    for choices in by_cell:
        sets = _unbettered((p + q, v + w) for p, v in sets for q, w in [(0.0, 0.0), *choices])
        if len(sets) > MOST_CORNERS:
            raise TooLargeError(
                f"a cut has more than {MOST_CORNERS:,} corners, which is too many for plain loops"
            )
    least = 0.25 / slope
    return max(
        (least + slope * seen if seen < least / slope else math.sqrt(seen)) - value
        for seen, value in sets
    )


def _rounded_up(value: Fraction) -> float:
    """Returns the smallest float that is not less."""
    nearest = float(value)
    return math.nextafter(nearest, math.inf) if Fraction(nearest) < value else nearest


def _values(cut: StateCut, number: int) -> dict[State, float]:
    """Returns phi at the listed states of a class."""
    return {
        state: value
        for part in cut.payments if part.class_number == number
        for state, value in zip(part.states, part.values, strict=True)
    }  # fmt: skip


def _phi(curves: Sequence[ClassCurve], number: int, root: float) -> float:
    """Returns phi of a class at a root: linear between breakpoints, with slope 1 beyond the
    last.
    """
    for curve in curves:
        if curve.class_number == number:
            before, height = 0.0, 0.0
            for at, value in zip(curve.roots, curve.values, strict=True):
                if root <= at:
                    return height + (value - height) * (root - before) / (at - before)
                before, height = at, value
            return height + root - before
    return root


@lru_cache(maxsize=4096)  # the leaves of a proof share most of their cuts
def _highest_corner(curves: tuple[ClassCurve, ...], sizes: tuple[int, ...]) -> float:
    """Returns the smallest valid constant of a cut: its largest excess at a corner, or 0.

    At a corner, every robot of the curves' classes is at a breakpoint or at 0. Robots are added one
    by one, and only corners that no other corner dominates in both pixels and value are kept.

    Parameters
    ----------
    sizes : number of robots of each class
    """
    corners = [(0.0, 0.0)]
    for curve in curves:
        points = [(0.0, 0.0), *zip((r * r for r in curve.roots), curve.values, strict=True)]
        for _ in range(sizes[curve.class_number]):
            corners = _unbettered((p + q, v + w) for p, v in corners for q, w in points)
            if len(corners) > MOST_CORNERS:
                raise TooLargeError(
                    f"a cut has more than {MOST_CORNERS:,} corners, which is too many for plain "
                    "loops"
                )
    return max(0.0, max(math.sqrt(pixels) - value for pixels, value in corners))


def _unbettered(corners: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Returns the corners (pixels, value) that no other corner dominates with more pixels at less
    value.
    """
    kept: list[tuple[float, float]] = []
    for pixels, value in sorted(set(corners), key=lambda corner: (-corner[0], corner[1])):
        if not kept or value < kept[-1][1]:
            kept.append((pixels, value))
    return kept


# -- the faces that drones see from all reachable nodes ------------------------------------------


class _Sight:
    """The views of all robots that have the same motion and cameras.

    Parameters
    ----------
    spec : any of these robots

    Attributes
    ----------
    seen : the faces seen from each node, and their px/m2; nodes without faces are left out
    people : the counted people seen from each node; nodes without people are left out
    """

    def __init__(self, problem: Problem, spec: Robot) -> None:
        self.seen: dict[Node, list[tuple[int, float]]] = {}
        self.people: dict[Node, list[int]] = {}
        self._looked: set[Node] = set()
        self._steps = range(problem.first_step, problem.horizon + 1)
        alike = [
            states.columns
            for robot, states in zip(problem.robots, problem.starts, strict=True)
            if (robot.motion, robot.camera) == (spec.motion, spec.camera)
        ]
        reach = spec.motion.radius * problem.horizon
        window = Window.around(np.concatenate(alike), reach, problem.workspace)
        self._views = StateViews.within(window, FaceGeometry(problem), problem, spec)
        self._graph = self._views.graph

    def look(self, nodes: Iterable[Node]) -> None:
        """Evaluates the views of nodes, except of nodes that have been evaluated before."""
        by_step: dict[int, list[int]] = {t: [] for t in self._steps}
        for state, t in set(nodes) - self._looked:
            if t in by_step:
                by_step[t].append(self._graph.index(state))
            self._looked.add((state, t))
        for t, states in by_step.items():
            ordered = np.sort(np.array(states, dtype=np.int64))
            for part in np.array_split(ordered, len(ordered) // self._views.batch + 1):
                coverage = self._views.coverage(t, part)
                for row, column in np.argwhere(coverage > 0).tolist():
                    node = self._graph.state(int(part[row])), t
                    if column < self._views.n_faces:
                        amount = float(coverage[row, column])
                        self.seen.setdefault(node, []).append((column, amount))
                    else:
                        person = column - self._views.n_faces
                        self.people.setdefault(node, []).append(person)


# -- uses that are charged: being in cells and states, and moves -------------------------------


def _uses_of(certificate: Certificate, decisions: Sequence[Decision], number: int) -> _Uses:
    """Returns the price of each use of a resource for robots of a class; infinity closes a
    resource.
    """
    if isinstance(certificate, ReferencePixels):
        return {}
    priced = [(row.resource, row.multiplier) for row in certificate.rows]
    for decision, nu in zip(decisions, certificate.decisions, strict=True):
        priced.append((decision.resource, math.inf if decision.closes else decision.sign * nu))
    costs: _Uses = {}
    for resource, cost in priced:
        if getattr(resource, "class_number", None) in (None, number):
            for use in _ways_to_use(resource):
                costs[use] = costs.get(use, 0.0) + cost
    return costs


def _ways_to_use(resource: Resource) -> Iterator[tuple[object, ...]]:
    """Yields the uses of a resource: being in a cell or a state at step t, or making a move from
    step t.
    """
    t = resource.t
    if isinstance(resource, Cells):
        yield from ((t, cell) for cell in resource.cells)
    elif isinstance(resource, Swap):
        here, there = resource.cells
        yield from ((t, here, there), (t, there, here))
    elif isinstance(resource, Moves):
        yield from ((t, tail, head) for tail, head in resource.moves)
    elif isinstance(resource, Move):
        yield (t, *resource.cells)
    else:
        yield (t, resource.state)


# -- the best path of one drone: the longest path of its priced time-expanded graph -------------


_BEFORE = "before"  # an auxiliary node with an edge to each start


def _longest_path(
    problem: Problem, robot: int, graph: Graph, credits: dict[Node, float], uses: _Uses
) -> _Worth:
    """Returns the worth of a robot's best path; -inf if it has none.

    Parameters
    ----------
    graph : all nodes that the robot can reach from its starts
    credits : credit for visiting each node
    """
    import networkx as nx  # takes a fifth of a second, and few commands need it

    cells = {state: problem.cell(robot, state) for state in {state for state, _ in graph}}

    def worth(node: Node) -> float:
        state, t = node
        cost = uses.get((t, cells[state]), 0.0) + uses.get((t, state), 0.0)
        return credits.get(node, 0.0) - cost

    worths = {node: worth(node) for node in graph}
    weighted = _weighted(problem.objective, graph, worths, cells, uses)
    keep_paths(weighted, problem, robot)
    starts = [(state, 0) for state in problem.starts[robot]]
    weighted.add_weighted_edges_from(
        [(_BEFORE, start, worths[start]) for start in starts if start in weighted]
    )
    if _BEFORE not in weighted:
        return -math.inf, 0.0
    edges = [edge for _, _, edge in weighted.edges(data=True)]
    lift = max(0.0, -min(edge["weight"] for edge in edges))
    for edge in edges:
        edge["weight"] += lift
    length = float(nx.dag_longest_path_length(weighted))
    lifted = (problem.horizon + 1) * lift
    return length - lifted, length + lifted


def _weighted(
    objective: Objective,
    graph: Graph,
    worth: dict[Node, float],
    cells: dict[State, Cell],
    uses: _Uses,
) -> Graph:
    """Returns the graph of the open and reachable nodes and edges, with weighted edges.

    The weight of an edge is the worth of its move plus that of its head; the worth of starts is not
    in any edge.
    """
    import networkx as nx

    rewarded = any(
        (objective.stationarity, objective.keep_cell, objective.keep_heading, objective.balanced)
    )
    charged = {use[0] for use in uses if len(use) == 3}  # steps from which moves are charged
    weighted: Graph = nx.DiGraph()
    weighted.add_nodes_from(node for node in graph if node[1] == 0 and worth[node] > -math.inf)
    for tail in graph:
        if tail not in weighted:
            continue
        (state, t), edges = tail, []
        for head in graph[tail]:
            weight = worth[head]
            if rewarded:
                weight += sum(rewards_of_move(objective, state, head[0]))
            if t in charged:
                weight -= uses.get((t, cells[state], cells[head[0]]), 0.0)
            if weight > -math.inf:
                edges.append((tail, head, weight))
        weighted.add_weighted_edges_from(edges)
    return weighted
