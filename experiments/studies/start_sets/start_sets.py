"""Planners over start sets, as in Greedy Perspectives, with a bound beside each number.

A sweep whose instances are start sets, with tables of its own. Where a scene's folder holds what
their program planned, that plan is one more, from the starts in the scene's own file.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

from cocap_opt.data import ProblemError
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.results.files import PlanReader
from cocap_opt.experiments.results.judging import BOUND_METHOD
from cocap_opt.experiments.studies.start_sets.tables import THEIRS, Reported, SetTables
from cocap_opt.experiments.sweeps.instances import Instance, Key, Settings
from cocap_opt.experiments.sweeps.scenes import Scenes
from cocap_opt.experiments.sweeps.sweep import sweep
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.problem import Plan, Problem
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.scenarios.formats.greedy_perspectives import PeerResults

PLANNERS = ("formation", "one-step", "greedy", "sequential", "cocap", "cocap-vs", BOUND_METHOD)
_PEER_PLAN, _PEER_REWARD = "peer_paths.csv", "peer_reward.csv"


class _Peer(NamedTuple):
    """A plan by their program."""

    problem: Problem  # with the starts of the scene's own file
    plan: Plan
    reported: Reported

    @classmethod
    def all_beside(cls, scenes: Sequence[str], options: Mapping[str, str]) -> Iterator[Self]:
        """Reads the plans by their program, of the scenes that have one beside them."""
        own = {**options, "start-set": "yaml"}
        found = [scene for scene in dict.fromkeys(scenes) if _has_peer(scene)]
        problems = Scenes.told_apart({(scene, 0): load_scene(scene, 0, own) for scene in found})
        for (scene, _), problem in problems.items():
            named = problem.replace(name=f"{problem.name}-own-starts")
            try:
                yield cls._beside(scene, named)
            except (
                FileError,
                ProblemError,
            ) as error:  # such as moves that other conventions forbid
                say(f"{scene}: their plan is left out: {error}")

    @classmethod
    def _beside(cls, scene: str, problem: Problem) -> Self:
        """Reads the plan that lies beside a scene, and the rewards that they reported."""
        _, plan = PlanReader(scene, problem).plan(_folder(scene) / _PEER_PLAN)
        steps = slice(problem.first_step, None)
        rewards = PeerResults(problem).view_rewards(_folder(scene) / _PEER_REWARD)
        reported = (math.fsum(rewards.as_reported[steps]), math.fsum(rewards.own_tilt[steps]))
        return cls(problem, plan, reported)


def start_sets(
    scenes: Sequence[str],
    sets: Sequence[int],
    limit: float,
    options: Mapping[str, str],
    out: Path | None = None,
) -> bool:
    """Measures what is not in `out` yet by a sweep, and prints and writes the tables.

    Parameters
    ----------
    scenes : names or files
    sets : start sets, the seeds of the scenes
    limit : s, of each plan and each bound
    options : of the scenes' format

    Returns
    -------
    bool
        True if all is measured, False after Ctrl-C.
    """
    settings = Settings(time_limit=limit, bound_time_limit=limit)
    peers = list(_Peer.all_beside(scenes, options))
    problems = _start_set_problems(scenes, sets, options)
    instances = [
        *(Instance(problem, k, PLANNERS, settings) for (_, k), problem in problems.items()),
        *(
            Instance(p.problem, 0, PLANNERS, settings, {THEIRS: p.plan}, own_starts=True)
            for p in peers
        ),
    ]
    words = {problem.name: scene for (scene, _), problem in problems.items()}

    def is_same(key: Key, digest: str) -> bool:
        name, number = key
        known = name in words and number is not None
        return not known or _digest(words[name], number or 0, options) == digest

    rows = sweep(instances, out, is_same=is_same)
    whole = {instance.key for instance in instances if instance.is_whole and not instance.is_cut}
    tables = SetTables(
        [row for row in rows if row.key in whole],
        {one.problem.name: _counted_steps(one.problem) for one in instances},
        {peer.problem.name: peer.reported for peer in peers},
    )
    tables.publish(limit, out)
    return len(whole) == len(instances)


def _start_set_problems(
    scenes: Sequence[str], sets: Sequence[int], options: Mapping[str, str]
) -> dict[tuple[str, int], Problem]:
    """Returns the scenes by their words and start sets; each set must be another one."""
    problems = Scenes.told_apart({(s, k): load_scene(s, k, options) for s in scenes for k in sets})
    first: dict[tuple[str, str], int] = {}
    for (scene, k), problem in problems.items():
        other = first.setdefault((scene, problem_digest(problem)), k)
        if other != k:
            raise FileError(f"{scene}: --sets: {other} and {k} are the same start set; name one")
    return problems


def _digest(scene: str, number: int, options: Mapping[str, str]) -> str:
    """Returns the digest of a scene with a start set; empty if there is no such set any more."""
    try:
        return problem_digest(load_scene(scene, number, options))
    except (FileError, ProblemError):
        return ""


def _counted_steps(problem: Problem) -> int:
    return problem.horizon + 1 - problem.first_step


# -- their plans --------------------------------------------------------------------------


def _folder(scene: str) -> Path:
    path = Path(scene)
    return path if path.is_dir() else path.parent


def _has_peer(scene: str) -> bool:
    """Returns True for a scene of theirs with their plan and its reward beside it."""
    is_theirs = Path(scene).is_dir() or Path(scene).suffix.lower() in (".yaml", ".yml")
    files = (_folder(scene) / name for name in (_PEER_PLAN, _PEER_REWARD))
    return scene not in SCENES and is_theirs and all(file.is_file() for file in files)
