"""Readers of the rewards and coverage that other projects' programs stored beside their scenes.

For Greedy Perspectives, problems must be made by `greedy_perspectives.read`.
"""

from pathlib import Path

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.problem import Problem, State
from cocap_opt.scenarios.formats.greedy_perspectives import our_heading
from cocap_opt.scenarios.formats.hughes import BELOW, BESIDE
from cocap_opt.scenarios.text import integer, naming, number, read_table

# The number that each face of a `TriangulatedCuboid` has in Greedy Perspectives, in the order front
# (x = .5), left (y = .5), back, right and top. Their 0 and 1 are the bottom.
_THEIR_FACES = (7, 6, 8, 9, 2, 3, 4, 5, 11, 10)


def reported_rewards(
    problem: Problem, path: Path
) -> tuple[tuple[float, ...], tuple[float, ...] | None]:
    """Reads the view reward that Greedy Perspectives' program reports for each step of its plan.

    The file has columns t, reported_view_reward and optionally own_tilt_view_reward, one row per
    step. The row with 0 that their program writes after the last step is omitted.

    Returns
    -------
    the rewards [T+1] with the tilts that their cache mixes up, and the rewards with each robot's
    own tilt, or None if the file has none

    Raises
    ------
    ProblemError
        If a value is not a number, or the rows are not those of the steps in order; one line,
        naming the file.
    """
    reported, by_own_tilts = "reported_view_reward", "own_tilt_view_reward"
    last = problem.horizon
    with naming(path):
        rows = read_table(path, ("t", reported))
        steps = [integer(row["t"], f"line {line}, t") for line, row in rows]
        if steps == list(range(last + 2)) and _numbers(rows[-1:], reported) == (0.0,):
            rows = rows[:-1]
        elif steps != list(range(last + 1)):
            raise ProblemError(f"t: must be the steps 0..{last}, one row each, in order")
        with_own_tilts = _numbers(rows, by_own_tilts) if by_own_tilts in rows[0][1] else None
        return _numbers(rows, reported), with_own_tilts


def rendered_coverage(problem: Problem, path: Path) -> dict[tuple[int, State], FloatArray]:
    """Reads the coverage that Greedy Perspectives' program rendered.

    The file has columns x, y, h, t, actor, face, ppa, one row per face that a state sees.

    Returns
    -------
    dict
        Coverage [F] in px/m2 by step and state.

    Raises
    ------
    ProblemError
        If a value is not a number or not part of the problem; one line, naming the file.
    """
    columns = ("x", "y", "h", "t", "actor", "face")
    headings, per_actor = problem.robots[0].motion.headings, len(_THEIR_FACES)
    ours = {theirs: k for k, theirs in enumerate(_THEIR_FACES)}
    found: dict[tuple[int, State], FloatArray] = {}
    with naming(path):
        if len(problem.face_weights) != per_actor * len(problem.actors):
            raise ProblemError("the scene must have been read with triangles")
        for line, row in read_table(path, (*columns, "ppa")):
            x, y, heading, t, actor, face = (integer(row[c], f"line {line}, {c}") for c in columns)
            sizes = {"t": problem.horizon + 1, "actor": len(problem.actors), "face": per_actor + 2}
            for column, value in (("t", t), ("actor", actor), ("face", face)):
                if not 0 <= value < sizes[column]:
                    raise ProblemError(
                        f"line {line}, {column}: must be 0..{sizes[column] - 1}, not {value}"
                    )
            key = t, State(x, y, heading=our_heading(heading, headings))
            if face in ours:
                values = found.setdefault(key, np.zeros(len(problem.face_weights)))
                values[actor * per_actor + ours[face]] = number(row["ppa"], f"line {line}, ppa")
    return found


def _numbers(rows: list[tuple[int, dict[str, str]]], column: str) -> tuple[float, ...]:
    return tuple(number(row[column], f"line {line}, {column}") for line, row in rows)


def solutions_beside(path: Path) -> dict[str, Path]:
    """Returns the solutions beside a scene of Hughes et al., by the names of their planners."""
    named = {file.stem.removeprefix("solution_"): file for file in path.parent.glob(BESIDE)}
    below = {file.parent.name: file for file in path.parent.glob(BELOW)}
    return dict(sorted({**below, **named}.items()))


def stored_rewards(path: Path, problem: Problem) -> dict[str, tuple[float, ...]]:
    """Reads `ppa_evaluation.csv`, the view rewards that they stored with their solutions.

    Returns
    -------
    [T+1] rewards, frame by frame, by the names of the planners

    Raises
    ------
    ProblemError
        If a value is not a number, or the rows are not the frames in order; one line, naming the
        file.
    """
    frames = problem.horizon + 1
    with naming(path):
        rows = read_table(path, ("t",))
        if [integer(row["t"], f"line {line}, t") for line, row in rows] != [*range(1, frames + 1)]:
            raise ProblemError(f"t: must be the frames 1..{frames}, one row each, in order")
        return {
            planner: tuple(number(row[planner], f"line {line}, {planner}") for line, row in rows)
            for planner in rows[0][1]
            if planner != "t"
        }
