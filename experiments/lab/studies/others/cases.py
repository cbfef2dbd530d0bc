"""Cases of the study of other projects: their scenes with starts, and their planners on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

from cocap_opt.data import ProblemError
from cocap_opt.experiments.lab.studies.others.published import Published, Scene, Tell
from cocap_opt.experiments.sweeps.instances import Instance, Key, Settings
from cocap_opt.experiments.sweeps.scenes import Scenes
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.formats.greedy_perspectives import start_sets

_OWN_STARTS = {"start-set": "yaml"}


@dataclass(frozen=True)
class Case:
    """A scene with starts.

    Attributes
    ----------
    seed : the start set; 0 if there are none
    is_start_set : True if starts are those of a start set, for which they published no results
    published : their planners with published results, by name
    """

    scene: Scene
    problem: Problem
    seed: int
    is_start_set: bool
    published: Mapping[str, Published]

    @classmethod
    def all_of(cls, scenes: Sequence[Scene], sets: Sequence[int] | None, tell: Tell) -> list[Self]:
        """Reads scenes and the plans beside them; files that cannot be read are reported.

        Parameters
        ----------
        sets : start sets; None for all that a scene has

        Raises
        ------
        FileError
            If no scene can be read.
        """
        found: list[Self] = []
        for scene in scenes:
            try:
                found += cls._of(scene, sets, tell)
            except (FileError, ProblemError) as error:
                tell(f"{scene.word}: left out: {error}")
        if not found:
            raise FileError("no scene can be read")
        return cls._told_apart(found)

    @classmethod
    def _of(cls, scene: Scene, sets: Sequence[int] | None, tell: Tell) -> list[Self]:
        if scene.is_hughes:
            problem = load_scene(str(scene.path))
            return [cls._with_published(scene, problem, tell)]
        count = start_sets(scene.path)
        wanted = range(count) if sets is None or not count else sets
        scenes = Scenes([str(scene.path)], wanted, tell=tell)
        cases = [cls(scene, problem, k, True, {}) for (_, k), problem in scenes.problems.items()]
        own_starts = cls._own_starts(scene, tell)
        if own_starts is not None and (own_starts.published or not cases):
            cases.append(own_starts)
        return cases

    @classmethod
    def _own_starts(cls, scene: Scene, tell: Tell) -> Self | None:
        """Returns the case with the starts of the scene's own file; None if these are unusable."""
        try:
            problem = load_scene(str(scene.path), 0, _OWN_STARTS)
        except FileError as error:
            tell(f"{scene.word}: its own starts left out: {error}")
            return None
        named = problem.replace(name=f"{problem.name}-own-starts")
        return cls._with_published(scene, named, tell)

    @classmethod
    def _with_published(cls, scene: Scene, problem: Problem, tell: Tell) -> Self:
        published = {planner.name: planner for planner in Published.beside(scene, problem, tell)}
        return cls(scene, problem, 0, False, published)

    @classmethod
    def _told_apart(cls, cases: Sequence[Self]) -> list[Self]:
        """Returns the cases, renamed so that no two scenes have the same name."""
        keys = [(case._words, case.seed) for case in cases]
        problems = Scenes.told_apart(
            {key: case.problem for key, case in zip(keys, cases, strict=True)}
        )
        return [replace(case, problem=problems[key]) for key, case in zip(keys, cases, strict=True)]

    @property
    def _words(self) -> str:
        starts = "" if self.is_start_set or self.scene.is_hughes else ", own starts"
        return f"{self.scene.word}{starts}"

    @property
    def counted_steps(self) -> int:
        """The steps whose views are part of J."""
        return self.problem.horizon + 1 - self.problem.first_step

    def instance(self, planners: Sequence[str], settings: Settings) -> Instance:
        """Returns its instance of a sweep, in which their plans have rows, too."""
        plans = {
            name: planner.plan
            for name, planner in self.published.items()
            if planner.plan is not None
        }  # fmt: skip
        own_starts = not (self.is_start_set or self.scene.is_hughes)
        return Instance(self.problem, self.seed, planners, settings, plans, own_starts=own_starts)

    @classmethod
    def is_same(cls, cases: Sequence[Self], key: Key, digest: str) -> bool:
        """Returns False if the file of an earlier row's scene now makes another scene."""
        name, seed = key
        scene = next((c.scene for c in cases if c.is_start_set and c.problem.name == name), None)
        if scene is None or seed is None:
            return True
        try:
            return problem_digest(load_scene(str(scene.path), seed)) == digest
        except FileError:
            return False
