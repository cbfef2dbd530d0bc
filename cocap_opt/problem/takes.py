"""Takes: people who may walk otherwise, each way with its probability.

People of one take are there together: they hide each other, and nobody of another take. A person
of no take is in all of them, as a copy in each, for in each somebody else may hide them. So people
of take k are people like all others, who count p_k times as much; J is its mean over the takes.
"""

import math
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import msgspec

from cocap_opt.data import Data, ProblemError, require, within
from cocap_opt.problem.actor import Actor
from cocap_opt.problem.objective import Objective
from cocap_opt.text import printable, shortened

_MOST_TAKES = 1_000
_SUM_ROUNDING = 1e-6  # of probabilities such as 0.333333


class Take(Data, frozen=True):
    """One of several ways in which people may walk.

    Attributes
    ----------
    name : by which people name the take that they are in
    probability : that people walk in this way, 0 to 1; those of all takes sum to 1. People of a
        take with probability 0 add nothing to J, but drones keep away from them, too

    Raises
    ------
    ProblemError
        If the name is empty or the probability out of range; it names the field.
    """

    name: str
    probability: float

    def __post_init__(self) -> None:
        super().__post_init__()
        msgspec.structs.force_setattr(self, "name", shortened(printable(self.name)))
        require(bool(self.name.strip()), "name", "must not be empty")
        within(self.probability, 0, 1, "probability")


def told_take(name: str) -> str:
    """Returns the words for a take: its name, after the word take where it does not fit alone."""
    return name if name.casefold().startswith(("take", "as ")) else f"take {name}"


def equal_chances(names: Sequence[str]) -> tuple[Take, ...]:
    """Returns takes of these names, all equally probable."""
    return tuple(Take(name=name, probability=1 / len(names)) for name in names)


class PeopleInTakes(NamedTuple):
    """The people of all takes, made of people who walk in one way.

    Attributes
    ----------
    takes : none where people walk as they do
    actors : each is in one take or in all
    numbers : of each, the number of the person of whom it is made
    """

    takes: tuple[Take, ...]
    actors: tuple[Actor, ...]
    numbers: tuple[int, ...]

    def objective(self, given: Objective) -> Objective:
        """Returns the objective for them, made of one for the people of whom they are made."""
        return of_people(given, max(self.numbers, default=-1) + 1, self.numbers)


def least_chance(takes: Sequence[Take]) -> float:
    """Returns the least probability of a take that may happen; 1 without takes."""
    return min((take.probability for take in takes if take.probability), default=1.0)


def require_takes(takes: Sequence[Take], actors: Sequence[Actor], field: str = "takes") -> None:
    """Checks takes, and that people name them; the message names the field.

    Raises
    ------
    ProblemError
        If two takes have one name, probabilities do not sum to 1, or a person names no take.
    """
    names = [take.name for take in takes]
    require(len(takes) <= _MOST_TAKES, field, f"must be at most {_MOST_TAKES}, not {len(takes)}")
    for name, same in groupby(sorted(names)):
        require(len(list(same)) == 1, field, f"must have names of their own; two are {name!r}")
    if takes:
        total = math.fsum(take.probability for take in takes)
        allowed = f"probabilities must sum to 1, not {total:.9g}"
        require(abs(total - 1) <= _SUM_ROUNDING, field, allowed)
    allowed = f"must be one of {', '.join(map(repr, names))}" if takes else "needs takes"
    for j, actor in enumerate(actors):
        if actor.take is not None and actor.take not in names:
            raise ProblemError(f"actors[{j}].take: {allowed}, not {actor.take!r}")


def in_all_takes(
    takes: Sequence[Take], actors: Sequence[Actor], objective: Objective
) -> tuple[tuple[Actor, ...], Objective]:
    """Returns the people of each take, one take after the other, and an objective for them.

    A person of no take is in all of them, as a copy in each. Where each person's views have a
    weight, each copy has the same. All stays as it is where everybody is in a take already.
    """
    if not takes or all(actor.take is not None for actor in actors):
        return tuple(actors), objective
    both = [
        (j, actor.replace(take=take.name))
        for take in takes
        for j, actor in enumerate(actors)
        if actor.take in (None, take.name)
    ]
    numbers = [j for j, _ in both]
    return tuple(actor for _, actor in both), of_people(objective, len(actors), numbers)


def of_people(objective: Objective, people: int, chosen: Sequence[int]) -> Objective:
    """Returns the objective for some people, in their order, of those whom it is for.

    Parameters
    ----------
    people : number of those whom it is for
    chosen : numbers of the people who are left; one may come several times
    """
    views = objective.views
    if views is None or not isinstance(views.weight, tuple) or len(views.weight) != people:
        return objective
    weight = tuple(views.weight[j] for j in chosen)
    return objective.replace(views=views.replace(weight=weight))
