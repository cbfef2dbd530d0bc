"""Takes: alternative walks of the people, each with its probability.

The people of one take are present together: they hide each other, but nobody of another take. A
person who belongs to no take has a copy in each take, since different people may hide the person in
each. People of take k are thus treated like all others, but count p_k times as much; J is its mean
over the takes.
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
_SUM_ROUNDING = 1e-6  # tolerance for the sum of probabilities such as 0.333333


class Take(Data, frozen=True):
    """One of several ways in which people may walk.

    Attributes
    ----------
    name : name of the take, to which the `take` of its people refers
    probability : probability that people walk in this way, 0 to 1; the probabilities of all takes
        sum to 1. People of a take with probability 0 add nothing to J, but drones keep their
        distance from them, too

    Raises
    ------
    ProblemError
        If the name is empty or the probability out of range; the message names the field.
    """

    name: str
    probability: float

    def __post_init__(self) -> None:
        super().__post_init__()
        msgspec.structs.force_setattr(self, "name", shortened(printable(self.name)))
        require(bool(self.name.strip()), "name", "must not be empty")
        within(self.probability, 0, 1, "probability")


def told_take(name: str) -> str:
    """Returns words for a take: its name, preceded by "take" if necessary."""
    return name if name.casefold().startswith(("take", "as ")) else f"take {name}"


def equal_chances(names: Sequence[str]) -> tuple[Take, ...]:
    """Returns equally probable takes with these names."""
    return tuple(Take(name=name, probability=1 / len(names)) for name in names)


class PeopleInTakes(NamedTuple):
    """The people of all takes, derived from people who walk in one way.

    Attributes
    ----------
    takes : the takes; empty if people walk in one way only
    actors : people, each of whom is in one take or in all
    numbers : for each actor, the number of the person from whom it is derived
    """

    takes: tuple[Take, ...]
    actors: tuple[Actor, ...]
    numbers: tuple[int, ...]

    def objective(self, given: Objective) -> Objective:
        """Returns the objective for these actors, derived from that for the original people."""
        return of_people(given, max(self.numbers, default=-1) + 1, self.numbers)


def least_chance(takes: Sequence[Take]) -> float:
    """Returns the smallest probability above 0 of any take; 1 without takes."""
    return min((take.probability for take in takes if take.probability), default=1.0)


def require_takes(takes: Sequence[Take], actors: Sequence[Actor], field: str = "takes") -> None:
    """Checks takes, and the takes that people name; the message names the field.

    Raises
    ------
    ProblemError
        If two takes have the same name, probabilities do not sum to 1, or a person names a take
        that does not exist.
    """
    names = [take.name for take in takes]
    require(len(takes) <= _MOST_TAKES, field, f"must be at most {_MOST_TAKES}, not {len(takes)}")
    for name, same in groupby(sorted(names)):
        require(len(list(same)) == 1, field, f"must have distinct names; two are {name!r}")
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

    A person who belongs to no take gets a copy in each. If each person's views have their own
    weight, copies have the same weight. Nothing changes if everybody is already in a take.
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
    """Returns an objective for a selection of people, derived from that for all people.

    Parameters
    ----------
    people : number of people in the given objective
    chosen : numbers of the chosen people, in order; a number may occur several times
    """
    views = objective.views
    if views is None or not isinstance(views.weight, tuple) or len(views.weight) != people:
        return objective
    weight = tuple(views.weight[j] for j in chosen)
    return objective.replace(views=views.replace(weight=weight))
