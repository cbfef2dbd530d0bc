"""Instances: scenes as text, in exact numbers and without geometry.

The format is described in docs/reference/instances.md. Numbers are hexadecimal floating-point
numbers, which give each bit of a double: a checker adds and multiplies them without rounding.
Places that no drone can reach are left out.
"""

import hashlib
import json
from collections.abc import Iterator

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.files.documents import problem_digest
from cocap_opt.model import Model, RobotClass
from cocap_opt.model.coverage_tables import Sight, tell_nobody
from cocap_opt.problem import COVERAGE_VERSION, may_end
from cocap_opt.vision.coverage import Progress

VERSION = 1


def instance_of(model: Model, progress: Progress = tell_nobody) -> str:
    """Returns the instance of a problem as text.

    Parameters
    ----------
    model : model of the problem; missing coverage is computed
    progress : called with the progress of that computation
    """
    model.prepare_all(progress=progress)
    return "\n".join(_lines(model)) + "\n"


def instance_digest(model: Model) -> str:
    """Returns the SHA-256 of a problem's instance, which certificates record."""
    return hashlib.sha256(instance_of(model).encode()).hexdigest()


def _lines(model: Model) -> Iterator[str]:
    problem = model.problem
    objective, rules = problem.objective, problem.rules
    yield f"cocap-instance {VERSION}"
    yield f"scene {json.dumps(problem.name)}"
    yield f"digest {problem_digest(problem)}"
    yield f"coverage {COVERAGE_VERSION}"
    yield f"horizon {problem.horizon}"
    people = problem.count_weights.shape[1]
    yield f"groups {problem.view_sum_steps} {model.n_faces} {people}"
    rewards = (
        objective.stationarity, objective.keep_cell, objective.keep_heading, objective.balanced,
    )  # fmt: skip
    yield " ".join(["rewards", *map(_exact, rewards)])
    separation = map(_exact, (rules.separation, rules.vertical))
    yield " ".join(["rules", str(int(rules.vertex)), str(int(rules.swap)), *separation])
    weights, n_roots = problem.view_sum_weights, problem.returns.n_roots
    for group in np.flatnonzero(weights).tolist():
        most = "" if group < n_roots else f" {int(problem.returns.caps[group - n_roots])}"
        yield f"weight {group} {_exact(weights[group])}{most}"
    kinds: dict[Sight, int] = {}
    # for each kind, the number of each place by its number in the graph
    numbers: list[dict[int, int]] = []
    for number, robot_class in enumerate(model.classes):
        if robot_class.sight not in kinds:
            kinds[robot_class.sight] = len(numbers)
            places = np.flatnonzero(
                model.reachable(robot_class).reshape(-1, robot_class.graph.n_places).any(axis=0)
            )
            numbers.append({place: k for k, place in enumerate(places.tolist())})
            yield from _kind(model, number, places, numbers[-1])
    for robot_class in model.classes:
        kind = kinds[robot_class.sight]
        yield from _class(robot_class, kind, numbers[kind])
    yield "end"


def _kind(model: Model, number: int, places: IntArray, number_of: dict[int, int]) -> Iterator[str]:
    """Yields the orientations, places, moves and views of all drones of the same kind."""
    robot_class = model.classes[number]
    graph = robot_class.graph
    yield "kind"
    pitches = graph.shape[1]
    for orientation, turns in enumerate(graph.turns):
        heading, pitch = divmod(orientation, pitches)
        yield f"orientation {heading} {pitch} : {' '.join(map(str, turns))}"
    cells, positions = model.places.cells[number], model.places.positions[number]
    heads = graph.neighbours(places).T
    layers, xs, ys = graph.coordinates(places)
    for place, layer, x, y, ends in zip(
        places.tolist(), layers.tolist(), xs.tolist(), ys.tolist(), heads.tolist(), strict=True
    ):
        moves = [
            f"{number_of[end]}{'' if sum(move[1:]) else '='}"
            for end, move in zip(ends, graph.moves, strict=True)
            if end in number_of
        ]
        at = " ".join(map(_exact, positions[place].tolist()))
        yield f"place {x} {y} {layer} {cells[place].layer} {at} : {' '.join(moves)}"
    for t, place in graph.closed.places:
        if place in number_of:
            yield f"closed {t} {number_of[place]}"
    for t, tail, head in graph.closed.moves:
        if tail in number_of and head in number_of:
            yield f"closed {t} {number_of[tail]} {number_of[head]}"
    table = model.coverage(robot_class)
    steps, states = np.divmod(table.nodes, graph.n_states)
    orientations, at_places = np.divmod(states, graph.n_places)
    views = [
        f"{group}:{_exact(pixels)}"
        for group, pixels in zip(table.view_sums.tolist(), table.pixels.tolist(), strict=True)
    ]
    rows = zip(
        steps.tolist(), at_places.tolist(), orientations.tolist(), table.indptr[:-1].tolist(),
        table.indptr[1:].tolist(), strict=True,
    )  # fmt: skip
    for t, place, orientation, first, end in rows:
        yield f"sees {t} {number_of[place]} {orientation} : {' '.join(views[first:end])}"


def _class(robot_class: RobotClass, kind: int, number_of: dict[int, int]) -> Iterator[str]:
    """Yields a class with its goal, and the possible starts of its drones."""
    graph, goal = robot_class.graph, ""
    if robot_class.goal is not None:
        known = np.array([*number_of], dtype=np.int64)
        _, x, y = graph.coordinates(known)
        ends = known[may_end(robot_class.goal, x, y)].tolist()
        goal = " ".join([" :", *(str(number_of[place]) for place in ends)])
    yield f"class {kind}{goal}"
    for robot, starts in zip(robot_class.robots, robot_class.starts, strict=True):
        at = (divmod(start, graph.n_places) for start in starts.tolist())
        states = " ".join(f"{number_of[place]},{orientation}" for orientation, place in at)
        yield f"drone {robot} : {states}"


def _exact(value: float) -> str:
    """Returns the exact value of a number, bit for bit."""
    return float(value).hex()
