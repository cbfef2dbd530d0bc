"""Scenes of other projects in a folder, and the plans and rewards that are published with them.

The layouts are those of their repositories. Greedy Perspectives: a folder for each scene with
`seq.yaml`, `map.npy` and `starts.csv`, and optionally `peer_paths.csv` and `peer_reward.csv` with
the plan of their program. Hughes et al.: a folder for each scene with `scene.json` or
`NAME_data.json`, solutions (`PLANNER/solution.json` or `solution_PLANNER.json`), and
`ppa_evaluation.csv`.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple, Self

from cocap_opt.data import ProblemError
from cocap_opt.experiments.lab.studies.others.stored_values import (
    reported_rewards,
    solutions_beside,
    stored_rewards,
)
from cocap_opt.files.documents import FileError
from cocap_opt.output.files import PlanReader
from cocap_opt.problem import Plan, Problem
from cocap_opt.scenarios.formats import hughes

Tell = Callable[[str], None]
Rewards = tuple[float, ...]  # view reward of each step that counts

# The scenes of their repositories that have plans or start sets.
GREEDY_PERSPECTIVES = ("corridor", "forest", "large", "merge", "split")
HUGHES = (
    "cluster", "cross_mix", "four_split", "heavy_mixing", "priority_runners", "priority_speaker",
    "split_and_join",
)  # fmt: skip
_PEER_PLAN, _PEER_REWARD, _STORED = "peer_paths.csv", "peer_reward.csv", "ppa_evaluation.csv"


class Scene(NamedTuple):
    """The file of a scene in a folder.

    Attributes
    ----------
    word : the file, relative to the folder
    is_hughes : True if it is a scene of Hughes et al., False for Greedy Perspectives
    """

    word: str
    path: Path
    is_hughes: bool

    @classmethod
    def all_in(cls, folder: Path) -> list[Self]:
        """Finds the scenes in a folder, at any depth.

        Raises
        ------
        FileError
            If it is not a folder, or contains no scene.
        """
        if not folder.is_dir():
            raise FileError(f"{folder}: must be a folder of scenes of other projects")
        found = [
            cls(path.relative_to(folder).as_posix(), path, path.suffix == ".json")
            for path in sorted(folder.rglob("*"))
            if path.name == "seq.yaml" or _is_hughes(path)
        ]
        if not found:
            words = "seq.yaml of Greedy Perspectives, or scene.json or NAME_data.json of Hughes et"
            raise FileError(f"{folder}: must contain folders with a {words} al.")
        return found

    @property
    def name(self) -> str:
        """The name that its folder gives it."""
        return self.path.resolve().parent.name


class Published(NamedTuple):
    """One of their planners on a scene, and its published results.

    Attributes
    ----------
    name : differs from the names of our planners
    plan : None if none is stored, or if no drone can fly it
    evaluated : rewards by our evaluator, for states between the cells, which are not a plan
    reported : rewards as stored with the scene
    own_tilts : rewards by the pixels of their renderer, with each drone's own tilt
    """

    name: str
    plan: Plan | None = None
    evaluated: Rewards | None = None
    reported: Rewards | None = None
    own_tilts: Rewards | None = None

    @classmethod
    def beside(cls, scene: Scene, problem: Problem, tell: Tell) -> list[Self]:
        """Reads all results that are published with a scene; unusable ones are reported.

        Parameters
        ----------
        problem : the scene, with the starts in its own file
        """
        reader = cls._of_hughes if scene.is_hughes else cls._of_greedy_perspectives
        return list(reader(scene, problem, tell))

    @classmethod
    def _of_greedy_perspectives(cls, scene: Scene, problem: Problem, tell: Tell) -> Iterator[Self]:
        folder = scene.path.parent
        if not (folder / _PEER_PLAN).is_file():
            tell(f"{scene.word}: there is no {_PEER_PLAN} beside it; only start sets are compared")
            return
        try:
            plan = PlanReader(str(scene.path), problem).plan(folder / _PEER_PLAN).plan
        except FileError as error:  # such as moves that other conventions forbid
            tell(f"{scene.word}: their plan left out: {error}")
            return
        steps, found = slice(problem.first_step, None), cls("theirs", plan)
        try:
            reported, with_own_tilts = reported_rewards(problem, folder / _PEER_REWARD)
            own_tilts = None if with_own_tilts is None else with_own_tilts[steps]
            yield found._replace(reported=reported[steps], own_tilts=own_tilts)
        except ProblemError as error:
            tell(f"{scene.word}: their rewards are left out: {error}")
            yield found

    @classmethod
    def _of_hughes(cls, scene: Scene, problem: Problem, tell: Tell) -> Iterator[Self]:
        reported = _stored(scene, problem, tell)
        solutions = solutions_beside(scene.path)
        for planner in dict.fromkeys((*reported, *solutions)):
            found = cls(f"their-{planner}", reported=reported.get(planner))
            if planner in solutions:
                yield found._with_solution(scene, problem, solutions[planner], tell)
            else:
                yield found

    def _with_solution(self, scene: Scene, problem: Problem, file: Path, tell: Tell) -> Self:
        try:
            evaluated = hughes.rewards_between_cells(file, problem)
            if evaluated is not None:
                return self._replace(evaluated=evaluated)
            return self._replace(plan=PlanReader(str(scene.path), problem).plan(file).plan)
        except (FileError, ProblemError) as error:
            tell(f"{scene.word}: one of their plans left out: {error}")
            return self


def not_there(folder: Path, scenes: list[Scene]) -> list[str]:
    """Returns sentences that name the published scenes that are missing from a folder.

    If the folder is that of a single scene, no scene counts as missing.
    """
    sentences = []
    for is_hughes, names in ((False, GREEDY_PERSPECTIVES), (True, HUGHES)):
        here = [scene for scene in scenes if scene.is_hughes == is_hughes]
        missing = [name for name in names if name not in {scene.name for scene in here}]
        if here and missing and not any(scene.path.parent == folder for scene in here):
            whose = "Hughes et al." if is_hughes else "Greedy Perspectives"
            sentences.append(f"{folder}: lacks scenes of {whose}: {', '.join(missing)}")
    return sentences


def _is_hughes(path: Path) -> bool:
    """Returns True for a file that is named and written like a scene of Hughes et al."""
    if path.name != "scene.json" and not path.name.endswith("_data.json"):
        return False
    try:
        return path.is_file() and hughes.SCENE in path.read_bytes()
    except OSError:
        return False


def _stored(scene: Scene, problem: Problem, tell: Tell) -> Mapping[str, Rewards]:
    """Reads the rewards that are stored with a scene, by planner; none if they are unusable."""
    try:
        return stored_rewards(scene.path.parent / _STORED, problem)
    except ProblemError as error:
        tell(f"{scene.word}: their rewards are left out: {error}")
        return {}
