"""Random certificates: multipliers, rows, cuts, decisions and proofs of all kinds, none good."""

from itertools import product

import numpy as np
from msgspec.structs import replace

from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import (
    Branch,
    ClassCurve,
    ClassPayments,
    Decision,
    EnvelopeCut,
    Leaf,
    Multipliers,
    ProofFile,
    ReferencePixels,
    Row,
    Staged,
    StateCut,
)
from cocap_opt.formulations.certificates.format import (
    MoveConstant,
    Stage,
    StepConstant,
    StepPrices,
    Tail,
)
from cocap_opt.formulations.certificates.resources import Cells, Move, Moves, Resource, Swap, Visit
from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    first_tail,
    may_be_used,
    may_begin_later,
)
from cocap_opt.formulations.certificates.state_cuts import pixels_of
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Cell, Problem

Rows = tuple[tuple[float, ...], ...]


def as_rows(array: np.ndarray) -> Rows:
    """Nested tuples of a 2-D array."""
    return tuple(map(tuple, array.tolist()))


def all_cells(problem: Problem) -> list[Cell]:
    """All cells of a problem's map and layers."""
    width, depth = problem.height_map.shape
    layers = range(len(problem.layers))
    return [Cell(*at) for at in product(range(width), range(depth), layers)]


def random_rows(problem: Problem, rng: np.random.Generator) -> list[Row]:
    """Valid conflict rows with random multipliers."""
    if problem.rules.none:
        return []
    cells, rows = all_cells(problem), []
    places = problem.positions(cells)
    for k, cell in enumerate(cells):
        clique, near = [cell], problem.rules.too_near(places - places[k])
        for n in np.flatnonzero(near).tolist():
            if near[n] and n != k:  # near to all that are in the clique by now
                clique.append(cells[n])
                near &= problem.rules.too_near(places - places[n])
        t = int(rng.integers(problem.horizon + 1))
        rows.append(Row(Cells(t, tuple(clique)), float(rng.choice([0.0, 1.0, 50.0]))))
        if problem.rules.swap and len(cells) > 1:
            other = cells[(cells.index(cell) + 1) % len(cells)]
            t = int(rng.integers(problem.horizon))
            rows.append(Row(Swap(t, (cell, other)), float(rng.choice([0.5, 20.0]))))
    if problem.rules.separation:
        rows += [Row(moves, float(rng.choice([0.5, 20.0]))) for moves in random_moves(problem, rng)]
    return rows


def random_moves(problem: Problem, rng: np.random.Generator) -> list[Moves]:
    """Moves of which any two come too close to each other."""
    pairs = [(a, b) for a, b in product(all_cells(problem), repeat=2) if abs(a.x - b.x) < 2]
    found = []
    for _ in range(3):
        clique: list[tuple[Cell, Cell]] = []
        t = int(rng.integers(problem.horizon))
        for k in rng.permutation(len(pairs))[:8].tolist():
            moves = Moves(t, (*clique, pairs[k]))
            clique += [] if moves.why_shared(problem) else [pairs[k]]
        found.append(Moves(t, tuple(clique)))
    return found


def some_model(problem: Problem, rng: np.random.Generator) -> Model:
    """A problem with its robots in classes, or each a class of its own."""
    return compiled(problem).disaggregated() if rng.integers(2) else compiled(problem)


def random_curve(number: int, top: float, rng: np.random.Generator) -> ClassCurve:
    """A curve with random breakpoints up to somewhere near a root."""
    roots = np.sort(rng.uniform(0.05, 1.2, rng.integers(1, 5))) * top
    return ClassCurve(
        number, tuple(roots.tolist()), tuple(rng.uniform(0, top, len(roots)).tolist())
    )


def random_cuts(model: Model, rng: np.random.Generator) -> list[EnvelopeCut]:
    """Envelope cuts of some view sums, with random values and shares."""
    if model.problem.objective.over_time:
        return []
    largest = model.largest_roots().max(axis=0)[: model.problem.returns.n_roots]
    largest = largest.reshape(model.problem.horizon + 1, -1)
    cuts = []
    for t, face in np.argwhere(largest > 0).tolist():
        for _ in range(int(rng.integers(3))):
            numbers = np.flatnonzero(rng.random(len(model.classes)) < 0.8).tolist()
            curves = tuple(random_curve(k, float(largest[t, face]), rng) for k in numbers)
            cuts.append(EnvelopeCut(t, face, curves, float(rng.choice([0.0, 0.2, 0.5]))))
    return cuts


def random_state_cuts(model: Model, rng: np.random.Generator) -> list[StateCut]:
    """State cuts of some view sums, with random states, values, slopes and shares."""
    if model.problem.objective.over_time or not model.problem.rules.vertex:
        return []
    cuts = []
    largest = model.largest_roots()[:, : model.problem.returns.n_roots]
    for view_sum in np.flatnonzero(largest.max(axis=0, initial=0.0) > 0).tolist():
        if rng.random() < 0.5:
            continue
        t, face = divmod(view_sum, model.n_faces)
        payments = []
        for number, robot_class in enumerate(model.classes):
            graph = robot_class.graph
            states = np.flatnonzero(np.tile(graph.free, graph.n_orientations))
            seeing = pixels_of(model, number, view_sum, states) > 0
            chance = np.where(seeing, 0.7, 0.1)
            if len(listed := states[rng.random(len(states)) < chance]):
                values = rng.uniform(0, 1.2, len(listed)) * float(largest[number, view_sum])
                named = tuple(map(graph.state, rng.permutation(listed).tolist()))
                payments.append(ClassPayments(number, named, tuple(values.tolist())))
        slope = float(rng.choice([0.1, 0.5, 2.0, 1e9])) / float(largest[:, view_sum].max())
        share = float(rng.choice([0.0, 0.2, 0.5]))
        cuts.append(StateCut(t, face, tuple(payments), slope, share))
    return cuts


def random_resource(model: Model, rng: np.random.Generator) -> Resource:
    """Something that robots can use."""
    problem = model.problem
    cells = all_cells(problem)
    one, other = (cells[int(k)] for k in rng.integers(len(cells), size=2))
    number = int(rng.integers(len(model.classes)))
    graph = model.classes[number].graph
    t = int(rng.integers(problem.horizon + 1))
    kind = rng.integers(4)
    if kind == 0 or (kind > 1 and (one == other or t == problem.horizon)):
        return Cells(t, (one,), None if rng.integers(2) else number)
    if kind == 1:
        free = np.flatnonzero(np.tile(graph.free, graph.n_orientations))
        return Visit(t, graph.state(int(rng.choice(free))), number)
    return Swap(t, (one, other)) if kind == 2 else Move(t, (one, other), number)


def random_multipliers(model: Model, rng: np.random.Generator, decisions: int = 0) -> Multipliers:
    """Multipliers of all kinds, none of them good."""
    problem = model.problem
    shape = (problem.view_sum_steps, len(problem.face_weights))
    return Multipliers(
        alpha=as_rows(rng.choice([0.0, 0.3, 1.0, 2.0], size=shape)),
        beta=as_rows(rng.choice([1e-4, 0.01, 1.0], size=shape)),
        rows=tuple(random_rows(problem, rng)),
        cuts=tuple(random_cuts(model, rng)),
        decisions=tuple(rng.choice([0.0, 0.5, 30.0], size=decisions).tolist()),
        views=random_views(problem, rng, [0.0, 0.3, 1.0, 2.0]),
        state_cuts=tuple(random_state_cuts(model, rng)),
    )


def random_views(problem: Problem, rng: np.random.Generator, among: list[float]) -> Rows:
    """A number for each step and person, if people count."""
    if not problem.count_weights.size:
        return ()
    return as_rows(rng.choice(among, size=problem.count_weights.shape))


def random_reference(problem: Problem, rng: np.random.Generator) -> ReferencePixels:
    """Pixels and numbers of drones at which gains are taken."""
    shape = (problem.view_sum_steps, len(problem.face_weights))
    pixels = as_rows(rng.choice([0.0, 10.0, 1e4], size=shape))
    return ReferencePixels(pixels, random_views(problem, rng, [0.0, 0.7, 1.0, 2.0, 5.0]))


def random_decisions(model: Model, rng: np.random.Generator) -> tuple[Decision, ...]:
    """One to three decisions."""
    return tuple(
        Decision(
            random_resource(model, rng),
            "at most" if rng.integers(2) else "at least",
            int(rng.integers(3)),
        )
        for _ in range(int(rng.integers(1, 4)))
    )


def random_proof(model: Model, rng: np.random.Generator) -> ProofFile:
    """A tree of random decisions with random multipliers; it claims nothing yet."""
    nodes: list[Branch | Leaf] = []

    def grow(depth: int) -> int:
        own = len(nodes)
        if len(nodes) > 12 or (depth > 1 and rng.integers(2)):
            nodes.append(Leaf(random_multipliers(model, rng, depth)))
            return own
        nodes.append(Leaf(random_multipliers(model, rng)))  # until its children are there
        resource, robots = random_resource(model, rng), int(rng.integers(3))
        sides = grow(depth + 1), grow(depth + 1)
        nodes[own] = Branch(resource, min(robots, len(model.problem.robots)), *sides)
        return own

    grow(0)
    return ProofFile(
        scene=model.problem.name,
        digest=problem_digest(model.problem),
        method="random",
        classes="single" if model.is_disaggregated else "alike",
        bound=0.0,
        nodes=tuple(nodes),
    )


def random_narrowing(model: Model, target: float, rng: np.random.Generator) -> Narrowing:
    """What random multipliers leave above a target."""
    return Narrowing.of(model, random_multipliers(model, rng), target).closed()


def random_prices(model: Model, rng: np.random.Generator) -> tuple[StepPrices, ...]:
    """Prices of some states of some steps, none of them good."""
    problem, found = model.problem, []
    for t in range(problem.first_step, problem.horizon + 1):
        for number, robot_class in enumerate(model.classes):
            graph = robot_class.graph
            free = np.flatnonzero(np.tile(graph.free, graph.n_orientations))
            some = rng.choice(free, size=min(len(free), int(rng.integers(1, 20))), replace=False)
            states = tuple(graph.state(int(state)) for state in some)
            amounts = rng.choice([-5.0, 0.0, 3.0, 40.0, 200.0], size=len(states))
            others = float(rng.choice([0.0, -3.0, 2.0, 30.0]))
            found.append(StepPrices(t, number, states, tuple(amounts.tolist()), others))
    return tuple(found)


def random_team_moves(model: Model, rng: np.random.Generator) -> tuple[MoveConstant, ...]:
    """Claims for moves of the team; most are too low, and some moves share a step."""
    steps = [*range(model.problem.first_step, model.problem.horizon)]
    some = rng.choice(steps, int(rng.integers(1, len(steps) + 2))).tolist() if steps else []
    claims = rng.choice([-1e3, -1e18, 5.0, 50.0, 500.0], len(some)).tolist()
    return tuple(MoveConstant(t, claim) for t, claim in zip(some, claims, strict=True))


def random_stage(
    model: Model, rng: np.random.Generator, priced: bool, moves: bool = False
) -> Stage:
    """A stage of random prices and constants; some classes and steps are there twice.

    With `moves`, it often has claims for moves of the team, and new prices of some steps only.
    """
    problem = model.problem
    prices = [*random_prices(model, rng)] if priced else []
    steps = [*range(problem.first_step, problem.horizon + 1)]
    if not priced:
        steps = [t for t in steps if rng.integers(2)]
    if prices and not rng.integers(3):
        again = prices[int(rng.integers(len(prices)))]
        half = len(again.states) // 2
        prices.append(
            replace(again, states=again.states[half:], prices=again.prices[: -half or None])
        )
    if steps and not rng.integers(3):
        steps.append(int(rng.choice(steps)))
    claims = rng.choice([-1e3, -1e3, 5.0, 50.0], len(steps)).tolist()
    constants = tuple(StepConstant(t, claim) for t, claim in zip(steps, claims, strict=True))
    if not moves:
        return Stage(tuple(prices), constants)
    kept = {t for t in steps if rng.integers(2)}
    few = tuple(part for part in prices if part.t in kept)
    claimed = random_team_moves(model, rng) if rng.integers(4) else ()
    return Stage(few, constants, claimed)


def random_staged(
    model: Model, target: float, rng: np.random.Generator, moves: bool = True
) -> Staged:
    """A staged certificate, none of whose numbers is good; most claim less than they may.

    With `moves`, stages claim constants of moves of the team, too.
    """
    stages = tuple(random_stage(model, rng, k > 0, moves) for k in range(int(rng.integers(1, 4))))
    higher = target + float(rng.choice([0.0, 0.0, 0.05, 0.5])) * abs(target)
    above = higher if may_be_used(model) and rng.integers(2) else None
    begun = None
    if above is not None and may_begin_later(model) and rng.integers(2):
        begun = int(rng.integers(1, model.problem.horizon + 1))
    tails = random_tails(model, rng) if above is None and may_be_used(model) else ()
    return Staged(random_multipliers(model, rng), target, stages, above, begun, tails)


def random_tails(model: Model, rng: np.random.Generator) -> tuple[Tail, ...]:
    """Losses of the tails from some steps on, most of which are too high."""
    steps = range(model.problem.horizon, first_tail(model) - 1, -1)
    return tuple(
        Tail(t, float(rng.choice([1e4, 1e4, 30.0, 1.0, 0.0, -1.0])))
        for t in steps if rng.integers(4)
    )  # fmt: skip
