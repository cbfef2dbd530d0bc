"""Variants of a sweep's scenes in which drones start elsewhere."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

from cocap_opt.experiments.sweeps.scenes import Problems
from cocap_opt.problem import Problem
from cocap_opt.run.options import Option
from cocap_opt.run.start_sets import (
    FREE,
    KINDS,
    RANDOM,
    with_free_starts,
    with_greedy_starts,
    with_random_starts,
)

STATED = "stated"
CHOICES = (STATED, *KINDS)
DRAWS = 10  # sets of random starts for each scene

StartSets = dict[str, list[tuple[str, int]]]  # names and seeds of problems, by choice of starts


class StartChoices(NamedTuple):
    """The problems of a sweep, and which of them differ only in the drones' starts.

    Attributes
    ----------
    problems : by name and seed
    groups : by scene and seed: the problems of each choice of starts; empty if starts are not
        compared
    """

    problems: Problems
    groups: dict[tuple[str, int], StartSets]

    @classmethod
    def of(cls, problems: Problems, choices: Sequence[str]) -> Self:
        """Returns the problems with the chosen starts; unchanged if there is no choice.

        Raises
        ------
        UsageError
            If a choice is unknown.
        ProblemError
            If a scene has no starts of a chosen kind.
        """
        if not choices:
            return cls(problems, {})
        for choice in choices:
            Option("--starts").require_one_of(choice, CHOICES)
        found: Problems = {}
        groups: dict[tuple[str, int], StartSets] = {}
        for (scene, seed), problem in problems.items():
            group = groups.setdefault((problem.name, seed), {})
            for choice in dict.fromkeys(choices):
                for key, variant in _variants(scene, seed, problem, choice):
                    found[key] = variant
                    group.setdefault(choice, []).append((variant.name, key[1]))
        return cls(found, groups)


def _variants(
    scene: str, seed: int, problem: Problem, choice: str
) -> Iterator[tuple[tuple[str, int], Problem]]:
    """Yields the scenes of a choice, by name and seed; sets of random starts have other seeds."""
    if choice == STATED:
        yield (scene, seed), problem
    elif choice == RANDOM:
        named = problem.replace(name=f"{problem.name} {seed}")
        for number in range(DRAWS):
            variant = with_random_starts(named, number)
            yield (variant.name, number), variant
    else:
        variant = with_free_starts(problem) if choice == FREE else with_greedy_starts(problem)
        yield (variant.name, seed), variant
