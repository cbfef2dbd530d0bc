"""Coverage by Greedy Perspectives' own program compared with ours, state by state.

Their program counts pixels in an image of 400 x 300 pixels, each of which stands for 100 pixels of
the camera, so the px/m2 of a face are multiples of a quantum. Only states that robot 0 can reach
are compared: their cache gives every robot the tilt of the robot that first requested a state, and
robot 0 is the first there.
"""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from cyclopts import Parameter

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.experiments.lab.studies.others.stored_values import rendered_coverage
from cocap_opt.model import Model
from cocap_opt.output.printing import Listing, Record
from cocap_opt.problem import Problem, State
from cocap_opt.scenarios.formats import greedy_perspectives
from cocap_opt.vision.render import Renderer

_THEIR_STEP = 10  # our pixels along an edge of one of their pixels
_PIXELS = 100.0  # our pixels per pixel of theirs
_QUANTILES = {"half": 0.5, "90 %": 0.9, "99 %": 0.99, "all": 1.0}


class _Difference(NamedTuple):
    """Our coverage of a face in a state minus theirs, in quanta."""

    planned: float
    rendered: float
    hidden: bool  # True if something hides a part of the face


def peers(
    scene: Annotated[Path, Parameter(help="their seq.yaml")],
    coverage: Annotated[Path, Parameter(help="their CSV file of pixels")],
    /,
    *,
    states: Annotated[int, Parameter(help="number of random states to compare")] = 500,
) -> None:
    """Prints how far planned and rendered coverage differ from theirs."""
    problem = greedy_perspectives.read(scene, options={"start-set": "yaml"})
    theirs = rendered_coverage(problem, coverage)
    found, totals = _differences(problem, theirs, states)
    rows: list[Record] = []
    for what in ("planned", "rendered"):
        for part, hidden in (("in full view", False), ("partly hidden", True)):
            values = [abs(getattr(d, what)) for d in found if d.hidden == hidden]
            quantiles = {
                word: float(np.quantile(values, q)) if values else None
                for word, q in _QUANTILES.items()
            }
            rows.append({"coverage": what, "faces": part, "count": len(values), **quantiles})
    Listing(f"{problem.name}: quantiles of the differences from theirs, in quanta", rows).print()
    Listing("sums over all these faces, relative to theirs", [
        {"coverage": what, "difference (%)": 100 * (ours / totals["theirs"] - 1)}
        for what, ours in totals.items() if what != "theirs"
    ]).print()  # fmt: skip


def _differences(
    problem: Problem, theirs: dict[tuple[int, State], FloatArray], most: int
) -> tuple[list[_Difference], dict[str, float]]:
    """Compares some random states; returns the differences, and sums of px/m2 by name."""
    model, renderer = Model(problem), Renderer(problem, _THEIR_STEP)
    robot, robot_class = problem.robots[0], model.class_of[0]
    graph = robot_class.graph
    reached = graph.reachable(model.starts(0), problem.horizon)
    near = (key for key in theirs if graph.window.covers(key[1].x, key[1].y))
    known = [key for key in near if reached[key[0], graph.index(key[1])]]
    if not known:
        raise ProblemError("drone 0 reaches none of the states in the coverage file")
    chosen = np.random.default_rng(0).permutation(len(known))[:most].tolist()
    found: list[_Difference] = []
    totals = dict.fromkeys(("theirs", "planned", "rendered"), 0.0)
    for t, state in (known[k] for k in chosen):
        areas = renderer.areas(t)
        planned = model.views(robot_class).coverage(t, np.array([graph.index(state)]))[0]
        pixels, unhidden = renderer.pixels(robot, t, state), renderer.unhidden(robot, t, state)
        peer, quantum = theirs[t, state], _PIXELS / areas
        for name, values in zip(totals, (peer, planned, pixels / areas), strict=True):
            totals[name] += float(values.sum())
        for f in np.flatnonzero((peer > 0) | (planned > 0) | (pixels > 0)).tolist():
            found.append(
                _Difference(
                    planned=float((planned[f] - peer[f]) / quantum[f]),
                    rendered=float((pixels[f] / areas[f] - peer[f]) / quantum[f]),
                    hidden=bool(pixels[f] < unhidden[f]),
                )
            )
    return found, totals
