"""The oracle: all plans of a small problem, one by one.

Paths are enumerated on the time-expanded networkx graph, J is added up from their views
(`StateViews`), and the referee says what is feasible. Nothing of `reward`, `model`, `constraints`
or the planners is used.
"""

import math
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from strategies import graph_of

from cocap_opt.data import FloatArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import Plan, Problem, State
from cocap_opt.referee import _Referee
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import StateViews

StatePath = tuple[State, ...]


class Optimum(NamedTuple):
    """Best plan and its J; None and -inf where there is no plan."""

    plan: Plan | None
    value: float


def all_paths(problem: Problem, robot: int) -> list[StatePath]:
    """All paths of one robot from one of its starts to the last step, ending at its goal."""
    graph = graph_of(problem, robot)
    paths: list[StatePath] = [(state,) for state, t in sorted(graph) if t == 0]
    for t in range(problem.horizon):
        heads = {node: sorted(head for head, _ in graph[node]) for node in graph if node[1] == t}
        paths = [(*path, head) for path in paths for head in heads[path[-1], t]]
    return paths


def pixels_of(problem: Problem, robot: int, paths: list[StatePath]) -> FloatArray:
    """Coverage [n, T+1, W] that a robot has along each of the paths [n]; 0 where none count.

    After the pixels of faces come, where these are counted, 1 or 0 for each person: seen or not.
    """
    spec = problem.robots[robot]
    graph = TimeGraph.of(problem.workspace, spec.motion, len(spec.camera.tilts))
    views = StateViews.of(FaceGeometry(problem), problem, graph, spec.camera)
    counted, faces = problem.objective.views, len(problem.face_weights)
    width = faces + (len(problem.actors) if counted else 0)
    pixels = np.zeros((len(paths), problem.horizon + 1, width))
    if not paths:
        return pixels
    for t in range(0 if problem.objective.count_start else 1, problem.horizon + 1):
        number = {state: n for n, state in enumerate(dict.fromkeys(path[t] for path in paths))}
        states = np.array([graph.index(state) for state in number])
        seen = np.zeros((len(number), width))
        seen[:, :faces] = views.coverage(t, states)[:, :faces]
        if counted:
            row = {state: k for k, state in enumerate(states.tolist())}
            nodes = np.sort(states)
            people = views.people(t * graph.n_states + nodes)
            for k, person, share in zip(
                people.rows.tolist(),
                people.people.tolist(),
                (people.visible / people.unhidden).tolist(),
                strict=True,
            ):
                is_seen = share >= counted.at_least - 1e-9
                seen[row[int(nodes[k])], faces + person] = 1.0 if is_seen else 0.0
        pixels[:, t] = seen[[number[path[t]] for path in paths]]
    return pixels


def bonus_of(problem: Problem, path: StatePath) -> float:
    """Reward of one path for its moves."""
    return sum(bonus_of_move(problem, a, b) for a, b in pairwise(path))


def bonus_of_move(problem: Problem, a: State, b: State) -> float:
    """Reward of one move, from the definition of the objective."""
    objective = problem.objective
    return (
        objective.stationarity * (a == b)
        + objective.keep_cell * ((a.x, a.y, a.layer) == (b.x, b.y, b.layer))
        + objective.keep_heading * (a.heading == b.heading)
        + objective.balanced * (b.x - a.x == a.y - b.y)
    )


def views_of(problem: Problem, pixels: FloatArray) -> FloatArray:
    """View rewards [n] of the coverage [n, T+1, W] of whole plans."""
    faces, counted = len(problem.face_weights), problem.objective.views
    pixels, counts = pixels[..., :faces], pixels[..., faces:]
    if problem.objective.over_time:
        pixels = pixels.sum(axis=1, keepdims=True)
    values: FloatArray = (np.sqrt(pixels) * weights_of(problem)).sum(axis=(1, 2))
    if counted is None:
        return values
    weights = [
        [
            (counted.weight[j] if isinstance(counted.weight, tuple) else counted.weight)
            * (1.0 if actor.importance is None else actor.importance[t])
            for j, actor in enumerate(problem.actors)
        ]
        for t in range(problem.horizon + 1)
    ]
    worth = np.minimum(counts, counted.cameras) * np.array(weights).reshape(counts.shape[1:])
    return values * problem.objective.pixels + worth.sum(axis=(1, 2))


def weights_of(problem: Problem) -> FloatArray:
    """Weight of every face [T+1, F] ([1, F] over time), taken from the actors themselves."""
    steps = 1 if problem.objective.over_time else problem.horizon + 1
    return np.array(
        [
            [
                (1.0 if actor.weights is None else actor.weights[face])
                * (1.0 if actor.importance is None else actor.importance[t])
                for actor in problem.actors
                for face in range(len(actor.shape.faces()))
            ]
            for t in range(steps)
        ]
    )


def objective_from_scratch(problem: Problem, plan: Plan) -> float:
    """J of a plan."""
    pixels = sum(pixels_of(problem, i, [path])[0] for i, path in enumerate(plan.paths))
    views = float(views_of(problem, np.asarray(pixels)[None])[0])
    return views + sum(bonus_of(problem, path) for path in plan.paths)


_remembered: dict[Problem, Optimum] = {}  # of stored problems (`pool`)


def remember(problem: Problem, best: Optimum) -> None:
    """Lets `optimum` answer for a problem whose plans were gone through before."""
    _remembered[problem] = best


def optimum(problem: Problem) -> Optimum:
    """Best of all plans that obey the rules; remembered, for many properties ask for it."""
    return _remembered.get(problem) or search(problem)


@lru_cache(maxsize=1024)
def search(problem: Problem) -> Optimum:
    """Goes through all plans for the best one that obeys the rules."""
    paths = [all_paths(problem, robot) for robot in range(len(problem.robots))]
    shape = tuple(map(len, paths))
    if 0 in shape:
        return Optimum(None, -math.inf)
    steps, width = problem.horizon + 1, len(problem.face_weights)
    width += len(problem.actors) if problem.objective.views else 0
    pixels, bonus = np.zeros((1, steps, width)), np.zeros(1)
    for robot, own in enumerate(paths):
        seen = pixels_of(problem, robot, own)
        pixels = (pixels[:, None] + seen[None]).reshape(len(bonus) * len(own), steps, width)
        extra = np.array([bonus_of(problem, path) for path in own])
        bonus = (bonus[:, None] + extra[None]).ravel()
    values = views_of(problem, pixels) + bonus
    for best in np.argsort(-values, kind="stable"):
        which = np.unravel_index(best, shape)
        plan = Plan(paths=tuple(own[int(i)] for own, i in zip(paths, which, strict=True)))
        if not _Referee(problem).conflicts(plan):
            if found := _Referee(problem).violations(plan):
                raise AssertionError(f"the referee does not follow the graph: {found}")
            return Optimum(plan, float(values[best]))
    return Optimum(None, -math.inf)
