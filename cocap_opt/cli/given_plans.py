"""Plans from files that get rows in the gap table: which instance each is for, and its name."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

from cocap_opt.experiments.sweeps.cells import BOUND
from cocap_opt.experiments.sweeps.scenes import Problems
from cocap_opt.files.documents import FileError, PlanFile, problem_digest
from cocap_opt.output.files import PlanReader
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.options import UsageError
from cocap_opt.text import printable, shortened

_TAKEN = (*SOLVERS, BOUND)  # names that mean something else in the table


class _GivenPlan(NamedTuple):
    """The plan of a file, and the digest of the problem that it is for."""

    plan: Plan | PlanFile  # of a foreign file the plan alone
    digest: str

    @property
    def planner(self) -> str:
        """The planner as the file names it; empty if it does not."""
        return printable(self.plan.planner) if isinstance(self.plan, PlanFile) else ""


class GivenPlans(NamedTuple):
    """The plans of files, by the digest of their problem and by name.

    Attributes
    ----------
    problems : the problems of the command; a variant where the plans are for that
    own_starts : the drones start where the scene's own file says
    """

    plans: dict[str, dict[str, Plan | PlanFile]]
    problems: Problems
    own_starts: bool

    @classmethod
    def read(cls, paths: Sequence[Path], problems: Problems) -> Self:
        """Reads plans, each for one of the problems.

        A plan has the name of its planner, as its file has it. Where that is one of ours, or of two
        plans for one problem, its file is named besides; where it is not known, its file alone.

        Raises
        ------
        FileError, UsageError
            If a plan is for none of the problems, or a file is called as a planner is.
        """
        titles = PlanReader.titles(paths)
        for title in titles:
            if title in _TAKEN:
                raise UsageError(f"--plan: {title} is what a planner is called; rename the file")
        given, fitting = (_of_one if len(problems) == 1 else _of_several)(paths, problems)
        plans: dict[str, dict[str, Plan | PlanFile]] = {}
        for name, one in zip(_names(titles, given), given, strict=True):
            plans.setdefault(one.digest, {})[name] = one.plan
        is_variant = any(fitting[key] is not problem for key, problem in problems.items())
        return cls(plans, fitting, is_variant)

    def of(self, problem: Problem) -> dict[str, Plan | PlanFile]:
        """Returns the plans for a problem, by name."""
        return self.plans.get(problem_digest(problem), {}) if self.plans else {}


def _of_one(paths: Sequence[Path], problems: Problems) -> tuple[list[_GivenPlan], Problems]:
    """Reads plans for one problem, which may be foreign ones for a variant of it."""
    ((key, own),) = problems.items()
    plans = PlanReader(key[0], own).plans(paths)
    problem = plans[0].problem if plans else own
    digest = problem_digest(problem)
    return [_GivenPlan(one.file or one.plan, digest) for one in plans], {key: problem}


def _of_several(paths: Sequence[Path], problems: Problems) -> tuple[list[_GivenPlan], Problems]:
    """Reads plan files, each for that of several problems whose digest it has."""
    readers = {
        problem_digest(problem): PlanReader(scene, problem)
        for (scene, _), problem in problems.items()
    }
    return [_matched(path, readers) for path in paths], problems


def _matched(path: Path, readers: Mapping[str, PlanReader]) -> _GivenPlan:
    """Reads the plan file of one of the problems, whose readers are by digest."""
    content = next(iter(readers.values())).claim(path)
    if isinstance(content, Plan):
        raise FileError(f"{path}: does not say which seed it is for; name one scene and one seed")
    if not isinstance(content, PlanFile):
        raise FileError(f"{path}: must be a plan, not a certificate")
    if content.digest not in readers:
        raise FileError(
            f"{path}: digest: the plan was made for {shortened(printable(content.scene))} of "
            "another seed, content, rules or objective than those of this command"
        )
    readers[content.digest].flown(path, content)
    return _GivenPlan(content, content.digest)


def _names(titles: Sequence[str], given: Sequence[_GivenPlan]) -> list[str]:
    """Returns the names of plans: their planners' where these are free, with or without files'."""
    digests: dict[str, list[str]] = {}
    for one in given:
        digests.setdefault(one.planner, []).append(one.digest)
    free = {
        planner
        for planner, own in digests.items()
        if planner not in (*_TAKEN, *titles) and ":" not in planner and len(own) == len(set(own))
    }
    return [
        title
        if not one.planner or one.planner == title
        else one.planner
        if one.planner in free
        else f"{one.planner} ({title})"
        for one, title in zip(given, titles, strict=True)
    ]
