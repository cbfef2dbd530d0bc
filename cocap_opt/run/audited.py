"""Audits of instances: a scene's own JSON, and what other code than the exporter finds in it."""

import json
import math
from collections.abc import Sequence

from cocap_opt.files.documents import SceneFile, encode, problem_digest
from cocap_opt.formulations.independent.audit import Audit, Auditor, Path, Progress
from cocap_opt.formulations.independent.instance_facts import read_instance
from cocap_opt.formulations.independent.scene_facts import UnknownError, facts_of_scene
from cocap_opt.problem import Problem
from cocap_opt.stop import Stop, never

WHOLE = 10_000  # states that drones reach, up to which all are enclosed if nothing else is asked
SOME = 1_000  # states with most pixels, and as many drawn ones, that are enclosed of more


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
    plans : paths of all drones, whose states have their coverage enclosed
    views : number of states with most pixels, and of states drawn from all that drones reach, which
        are enclosed, too; inf: all; 0: none, and those of plans neither; None: all where there are
        at most `WHOLE`, else `SOME`
    seed : of the draws
    progress : told how many states are enclosed, and of how many
    stop : of the enclosures; those of J of plans are made all the same

    Raises
    ------
    UnknownError
        If the scene has something that an audit does not know.
    FormatError
        If the text is not an instance.
    ImportError
        If enclosures are asked for, and python-flint is not installed.
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
            raise UnknownError(f"{error}; --views 0 leaves coverage out") from error
    return audit
