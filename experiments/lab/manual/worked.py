"""The worked examples of the concept pages: each is solved once, for its numbers and its pictures.

Small scenes have numbers that can be followed by hand; the bottleneck shows numbers of real size.
"""

from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.experiments.lab.manual.recorded_tree import RecordedNode, recorded_tree
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.certificates import (
    CertificateFile,
    Multipliers,
    ProofFile,
    Staged,
    verify,
)
from cocap_opt.formulations.certificates.format import Stage as FileStage
from cocap_opt.formulations.certificates.pricing import CertificatePrices
from cocap_opt.formulations.certificates.staged import (
    JointStates,
    Narrowing,
    best_plan,
    most_profitable,
)
from cocap_opt.formulations.certificates.staged.stages import MOST_NODES
from cocap_opt.formulations.certificates.sweep import plain_sweep
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.counting import (
    joint_states_left,
    states_left,
)
from cocap_opt.formulations.column_generation.step_envelopes.envelopes import step_envelopes
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.explanation import explain
from cocap_opt.formulations.result import OPTIMALITY, Snapshot
from cocap_opt.graph.networks import time_expanded_graph
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Objective, Plan, Problem
from cocap_opt.result import Result
from cocap_opt.run.engine import run
from cocap_opt.run.explained import Explained
from cocap_opt.run.front import Front
from cocap_opt.run.front_search import explored
from cocap_opt.scenarios import load_scene

if TYPE_CHECKING:
    import networkx as nx

SEED = 4  # seed of the bottleneck; CoCap loses more with it than with other seeds
SHORT = 2  # steps of the bottleneck with which cone programs are quick
BRIEF = 4  # steps with which a whole trade-off is quick


def planned(problem: Problem, planner: str) -> Result:
    """Returns the result of a planner, which must find a plan."""
    result: Result = run(problem, planner).result
    assert result.plan is not None
    return result


@cache
def trap() -> Problem:
    """Returns the scene in which the drone that is planned first takes the view of the second."""
    return load_scene("tiny-trap")


# -- the doorway: CoCap, the time-expanded graph, a certificate -----------------------------


@cache
def doorway() -> Problem:
    """Returns the scene in which two drones look through a doorway that has room for one."""
    return load_scene("tiny-doorway")


@cache
def doorway_tree() -> list[RecordedNode]:
    """Returns the nodes of CoCap's tree, in the order in which they are made."""
    return recorded_tree(doorway())


@cache
def doorway_graph() -> "nx.DiGraph[Any]":
    """Returns the time-expanded graph of drone 1."""
    return time_expanded_graph(doorway(), 1)


@cache
def doorway_bound() -> CertificateFile:
    """Returns the certificate of the root relaxation, which meets the optimum."""
    file = run(doorway(), "column-generation").result.certificate
    assert isinstance(file, CertificateFile)
    return file


class _BoundParts(NamedTuple):
    """The numbers whose sum is a bound."""

    faces: FloatArray  # [Z] constants of view sums
    rows: float  # prices of rules
    paths: tuple[float, ...]  # best path of each robot

    @classmethod
    def of(cls, problem: Problem, multipliers: Multipliers) -> "_BoundParts":
        """Returns the parts of the bound that multipliers prove."""
        model = compiled(problem)
        prices = CertificatePrices.of(model, multipliers)
        best = [0.0] * len(problem.robots)
        for number, robot_class in enumerate(model.classes):
            values = plain_sweep(
                problem, robot_class, prices.rewards(number), prices.charges(number)
            )
            for robot, starts in zip(robot_class.robots, robot_class.starts, strict=True):
                best[robot] = float(values[starts].max())
        return cls(prices.pixels.constants, prices.row_constant, tuple(best))

    @property
    def total(self) -> float:
        """The bound, apart from rounding."""
        return float(self.faces.sum()) + self.rows + sum(self.paths)


def doorway_multipliers() -> Multipliers:
    """Returns the numbers in the doorway's certificate."""
    numbers = doorway_bound().certificate
    assert isinstance(numbers, Multipliers)
    return numbers


@cache
def doorway_parts() -> _BoundParts:
    """Returns the terms whose sum is the doorway's bound."""
    return _BoundParts.of(doorway(), doorway_multipliers())


# -- the bottleneck: column generation, step envelopes, a gap explained ----------------------


class _Bottleneck(NamedTuple):
    """CoCap's plan of the bottleneck, and the bound on it."""

    problem: Problem
    plan: Result
    bound: float
    file: CertificateFile
    progress: tuple[Snapshot, ...]  # reports of the search for the bound

    @property
    def model(self) -> Model:
        """The compiled problem."""
        return compiled(self.problem)

    @property
    def staged(self) -> Staged:
        """The numbers in its certificate."""
        assert isinstance(self.file.certificate, Staged)
        return self.file.certificate


@cache
def bottleneck() -> _Bottleneck:
    """Returns the bottleneck, planned by CoCap and bounded by column generation."""
    problem = load_scene("bottleneck", SEED)
    told: list[Snapshot] = []
    found = run(problem, "column-generation", report=told.append).result
    assert isinstance(found.certificate, CertificateFile)
    plan = planned(problem, "cocap")
    return _Bottleneck(problem, plan, found.bound, found.certificate, tuple(told))


class Remaining(NamedTuple):
    """The states of the bottleneck that remain after a stage of a certificate."""

    words: str
    bound: float
    left: IntArray  # [T+1] states
    cells: frozenset[tuple[int, int]]  # at the middle step
    joint: int  # number of joint states of them, including conflicts
    reached: tuple[int, ...]  # [T+1] number of joint states, if all paths are tried after the stage


@cache
def in_stages() -> Staged:
    """Returns a certificate of the bottleneck whose paths are not tried, so that it has stages."""
    model = bottleneck().model
    root = Root.of(Search(model), OPTIMALITY)
    root.solve_aggregated()
    search = Search(model, incumbent=root.search.incumbent)
    step_envelopes(search, root.relaxation.best.duals, root.gap, tries_paths=False)
    assert search.spare is not None
    assert isinstance(search.spare.certificate, Staged)
    return search.spare.certificate


@cache
def stages() -> list[Remaining]:
    """Returns the states that remain after each stage of the bottleneck's certificate."""
    staged = in_stages()
    narrowing = Narrowing.of(bottleneck().model, staged.multipliers, staged.target)
    found = [_stage("in reach", narrowing)]
    narrowing = narrowing.closed()
    found.append(_stage("after the multipliers", narrowing))
    for n, stage in enumerate(staged.stages, 1):
        narrowing = narrowing.after(stage, partial(_most_profit, stage), partial(_constant, stage))
        found.append(_stage(f"after stage {n}", narrowing))
    return found


def _most_profit(stage: FileStage, k: int, joint: JointStates) -> float:
    """Returns the highest profit of joint states, or a stage's constant, whichever is higher."""
    return most_profitable(joint, stage.constants[k].constant, MOST_NODES).profit


def _constant(stage: FileStage, k: int, _: Narrowing) -> float:
    """Returns a stage's constant of moves, which its producer has proved."""
    return stage.moves[k].constant


def middle() -> int:
    """Returns the step of the bottleneck whose cells are shown."""
    return bottleneck().problem.horizon // 2


def _stage(words: str, narrowing: Narrowing) -> Remaining:
    model, cells = narrowing.model, set[tuple[int, int]]()
    for number, left in enumerate(narrowing.left):
        places = np.flatnonzero(left[middle()]) % model.classes[number].graph.n_places
        cells |= {model.places.cells[number][place][:2] for place in places.tolist()}
    return Remaining(
        words, narrowing.bound, states_left(narrowing), frozenset(cells),
        joint_states_left(narrowing), best_plan(narrowing, MOST_NODES).reached,
    )  # fmt: skip


@cache
def explained() -> Explained:
    """Returns the gap of CoCap's plan of the bottleneck, explained."""
    example = bottleneck()
    assert example.plan.plan is not None
    found = explain(example.model, example.plan.plan, example.plan.value, example.file)
    return Explained(example.model, example.plan.plan, found)


@cache
def seen_from(actor: int) -> FloatArray:
    """Returns the reward of one drone's best view of a person alone, from each cell [X, Y]."""
    example = bottleneck()
    robot_class, faces = example.model.classes[0], example.problem.face_owner == actor
    graph, weights = robot_class.graph, example.problem.face_weights
    states = np.arange(graph.n_states)
    pixels = example.model.views(robot_class).coverage(middle(), states)
    rewards = (np.sqrt(pixels[:, faces]) * weights[faces]).sum(axis=1)
    best = rewards.reshape(graph.n_orientations, graph.n_places).max(axis=0)
    found = np.zeros(example.problem.height_map.shape)
    for place, (x, y, _) in enumerate(example.model.places.cells[0]):
        if 0 <= x < found.shape[0] and 0 <= y < found.shape[1]:
            found[x, y] = max(found[x, y], best[place])
    return found


def overestimates() -> FloatArray:
    """Returns the excess of the bottleneck's bound over the reward of each person [A, T+1]."""
    problem = bottleneck().problem
    excess = np.zeros((len(problem.actors), problem.horizon + 1))
    for term in explained().explanation.of_kind("face"):
        excess[term.actor or 0, term.step or 0] += term.amount
    return excess


# -- bounds compared, and a proof -------------------------------------------------------------


@cache
def compared() -> list[tuple[str, list[float]]]:
    """Returns the bounds of all methods on two scenes, and last the optimum."""
    short = load_scene("bottleneck", 0).replace(horizon=SHORT)
    scenes = [trap(), short]
    starts = [planned(scene, "sequential").plan for scene in scenes]
    rows = [
        (name, [_bound(name, *both) for both in zip(scenes, starts, strict=True)])
        for name in BOUNDS
    ]
    optima = [run(scene, "branch-and-price").reward for scene in scenes]
    return [*rows, ("optimum", optima)]


@cache
def trade_off() -> Front:
    """Returns the proved trade-off between J and views on the first steps of the bottleneck."""
    front = Front.of(load_scene("bottleneck", 0).replace(horizon=BRIEF))
    found = explored(front, seconds=60.0, directions=20)
    assert found.settled
    return found


def _bound(name: str, problem: Problem, start: Plan | None) -> float:
    bound: float = run(problem, name, start=start).result.bound
    return bound


class _Proof(NamedTuple):
    """A problem solved by a tree of decisions."""

    problem: Problem
    value: float
    file: ProofFile
    bounds: tuple[float, ...]  # bounds of its leaves, in the order of their numbers


@cache
def proof() -> _Proof:
    """Returns a corridor whose pixels add up over time, solved by branch-and-price."""
    problem = load_scene("corridor", 2).replace(objective=Objective(over_time=True))
    found = run(problem, "branch-and-price").result
    assert isinstance(found.certificate, ProofFile)
    leaves = verify(problem, found.certificate, model=compiled(problem)).leaves
    return _Proof(problem, found.value, found.certificate, leaves)
