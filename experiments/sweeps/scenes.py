"""The scenes of a sweep: makes problems of names and seeds; no two scenes have the same name."""

from collections.abc import Callable, Mapping, Sequence

from cocap_opt.console.streams import say
from cocap_opt.data import ProblemError
from cocap_opt.experiments.sweeps.instances import Key
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene

Problems = dict[tuple[str, int], Problem]  # problems by the scene's name as typed, and seed


class Scenes:
    """The problems of some scenes, by name or file, and seeds; each problem occurs once.

    Seeds that make the same scene are one sample, not several. The sample has seed 0 if that makes
    the same scene, otherwise the first of these seeds.

    Parameters
    ----------
    tell : called with a message if several seeds make the same scene

    Attributes
    ----------
    problems : by the scene's name as typed, and seed; no two scenes have the same name
    """

    def __init__(
        self,
        names: Sequence[str],
        seeds: Sequence[int],
        load: Callable[[str, int], Problem] = load_scene,
        tell: Callable[[str], None] = say,
    ) -> None:
        self.problems = self.told_apart({
            (name, seed): problem
            for name in dict.fromkeys(names)
            for seed, problem in _seeded(name, seeds, load, tell).items()
        })  # fmt: skip
        self._load = load
        self._words = {problem.name: name for (name, _), problem in self.problems.items()}

    @staticmethod
    def told_apart(problems: Mapping[tuple[str, int], Problem]) -> Problems:
        """Returns problems with new names where two scenes would have the same name.

        A scene's new name is its name as typed; it is needed if its name is also another scene's
        name, or another scene's name as typed. A problem's digest does not depend on its name, so
        certificates and plans still fit.
        """
        claimed: dict[str, set[str]] = {}
        for (scene, _), problem in problems.items():
            claimed.setdefault(problem.name, set()).add(scene)
            claimed.setdefault(scene, set()).add(scene)
        return {
            (scene, seed): problem.replace(name=scene)
            if len(claimed[problem.name]) > 1
            else problem
            for (scene, seed), problem in problems.items()
        }

    def is_same(self, key: Key, digest: str) -> bool:
        """Returns False if an earlier row's name and seed now make another scene."""
        name, seed = key
        return (
            seed is None
            or name not in self._words
            or _digest(self._load, self._words[name], seed) == digest
        )


def _seeded(
    scene: str,
    seeds: Sequence[int],
    load: Callable[[str, int], Problem],
    tell: Callable[[str], None],
) -> dict[int, Problem]:
    first = {_digest(load, scene, 0): 0} if any(seeds) else {}
    found: dict[int, Problem] = {}
    again = []
    for seed in seeds:
        problem = load(scene, seed)
        known = first.setdefault(problem_digest(problem), seed)
        found.setdefault(known, problem)
        if known != seed:
            again.append(f"{seed} makes the scene of seed {known}")
    if again:
        more = f" (and {len(again) - 1} more such seeds)" if again[1:] else ""
        tell(f"{scene}: seed {again[0]}{more}; each scene is used once")
    return found


def _digest(load: Callable[[str, int], Problem], scene: str, seed: int) -> str:
    """Returns the digest of the scene with a seed; empty if the scene cannot be made."""
    try:
        return problem_digest(load(scene, seed))
    except (FileError, ProblemError):
        return ""
