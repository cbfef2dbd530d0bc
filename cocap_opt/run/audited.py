"""Audits of instances: compares them with facts that independent code finds in the scene's JSON."""

import json
import math
from collections.abc import Sequence

from cocap_opt.files.documents import SceneFile, encode, problem_digest
from cocap_opt.formulations.independent.audit import Audit, Auditor, Path, Progress
from cocap_opt.formulations.independent.instance_facts import read_instance
from cocap_opt.formulations.independent.scene_facts import UnknownError, facts_of_scene
from cocap_opt.problem import Problem
from cocap_opt.stop import Stop, never

WHOLE = 10_000  # reached states up to which all are enclosed by default
SOME = 1_000  # states with the most pixels, and as many drawn ones, that are enclosed otherwise


def audited(
    problem: Problem,
    text: str,
    plans: Sequence[Sequence[Path]],
    views: float | None,
    seed: int,
    progress: Progress = lambda done, total: None,
    stop: Stop = never,
) -> Audit:
    """Returns the audit of an instance of a scene.

    Parameters
    ----------
    text : the instance
    plans : plans, as paths of all drones, whose states' coverage is enclosed
    views : number of states with the most pixels, and number of states drawn at random from all
        reached ones, that are enclosed, too; inf: all; 0: none, not even those of plans; None: all
        if there are at most `WHOLE`, otherwise `SOME`
    seed : seed of the random draws
    progress : called with the number of enclosed states, and the total
    stop : ends the enclosing of states; J of each plan is enclosed all the same

    Raises
    ------
    UnknownError
        If the scene has a feature that audits do not support.
    FormatError
        If the text is not an instance.
    ImportError
        If enclosures are requested, but python-flint is not installed.
    """
    document = json.loads(encode(SceneFile.of(problem)))["problem"]
    instance = read_instance(text)
    auditor = Auditor(document, facts_of_scene(document), instance)
    audit = auditor.facts()
    if instance.digest != problem_digest(problem):
        words = f"digest: scene {problem_digest(problem)}, instance {instance.digest}"
        audit.differences.insert(0, words)
    if views is None:
        views = math.inf if audit.reached <= WHOLE else SOME
    if views:
        try:
            audit.coverage = auditor.coverage(
                plans, views, seed, progress, lambda: stop.reached() is not None
            )
            audit.rewards = [auditor.reward(paths) for paths in plans]
        except UnknownError as error:
            raise UnknownError(f"{error}; use --views 0 to leave coverage out") from error
    return audit
