"""The takes of a recipe: ways in which people may walk, listed individually or drawn at random."""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import ProblemError, require, within
from cocap_opt.problem import Actor, Take
from cocap_opt.problem.takes import PeopleInTakes, require_takes
from cocap_opt.scenarios.spread import MOST_TAKES, Spread, drawn_takes
from cocap_opt.scenarios.tables import Table
from cocap_opt.scenarios.text import naming
from cocap_opt.world.workspace import Workspace


class TakeTable(Table):
    """One of the tables `take` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    name: str
    probability: float


class SpreadTable(Table):
    """The table `spread` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    takes: int = 3
    delay: float = 0.0
    aside: float = 0.0
    speed: float = 0.0
    seed: int = 0


def people_in_takes(
    tables: Sequence[TakeTable], spread: SpreadTable | None, actors: Sequence[Actor],
    workspace: Workspace, steps: int, step: float,
) -> PeopleInTakes:  # fmt: skip
    """Returns the people of the takes that a recipe lists or draws.

    Parameters
    ----------
    tables, spread : tables of the recipe, which has at most one of the two
    actors : the people, who name their takes
    workspace : obstacles that drawn walks do not enter
    steps, step : T, and the length of a step in s

    Raises
    ------
    ProblemError
        If takes contradict each other, or a value is out of range; the message names the table.
    """
    if spread is None:
        takes = []
        for k, table in enumerate(tables):
            with naming(f"take[{k}]"):
                takes.append(Take(name=table.name, probability=table.probability))
        require_takes(takes, (), "take")
        return PeopleInTakes(tuple(takes), tuple(actors), tuple(range(len(actors))))
    with naming("spread"):
        within(spread.takes, 2, MOST_TAKES, "takes")
        require(spread.seed >= 0, "seed", f"must be 0 or more, not {spread.seed}")
        if tables:
            raise ProblemError("must be left out beside [[take]], which defines how people walk")
        if not actors:
            raise ProblemError("must be left out if there are no people")
        wide = Spread(spread.delay, spread.aside, spread.speed)
        rng = np.random.default_rng(spread.seed)
        return drawn_takes(actors, workspace, steps, step, wide, spread.takes, rng)


def in_takes(
    actor: Actor, named: str | list[str] | None, takes: Sequence[TakeTable]
) -> list[Actor]:
    """Returns a person once for each of their takes, or once if they are in all.

    Raises
    ------
    ProblemError
        If a name is not that of a take, or occurs twice.
    """
    if named is None:
        return [actor]
    names, known = [named] if isinstance(named, str) else named, [take.name for take in takes]
    for name in names:
        if name not in known:
            allowed = f"must be one of {', '.join(map(repr, known))}" if known else "needs [[take]]"
            raise ProblemError(f"take: {allowed}, not {name!r}")
    if len(set(names)) < len(names):
        raise ProblemError("take: names must be different")
    return [actor.replace(take=name) for name in names]
