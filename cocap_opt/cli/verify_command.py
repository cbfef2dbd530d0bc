"""The command `verify`, which checks the claims of plans and certificates about a scene."""

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
import numpy as np
from cyclopts import Parameter

from cocap_opt.cli.options import (
    FLAG,
    Free,
    Json,
    Scene,
    Seed,
    Verbose,
    load_planned,
    plan_with_scene,
    say_narrow_way,
)
from cocap_opt.console.exit_codes import FAILED
from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.experiments.tables.rows import OWN_STARTS
from cocap_opt.files.documents import FileError, PlanFile, other_coverage, problem_digest
from cocap_opt.footage.quality import Quality
from cocap_opt.formulations.certificates import CertificateError, CertificateFile, ProofFile
from cocap_opt.model import Model
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import PlanReader, read_claim
from cocap_opt.output.nearness import nearness
from cocap_opt.output.printing import Record, line_width, print_texts
from cocap_opt.problem import Objective, Plan, Problem, Views
from cocap_opt.run.explained import Explained
from cocap_opt.run.explained_tables import explained_tables
from cocap_opt.run.explained_words import explained_sentences, in_three_sentences
from cocap_opt.run.forecast import warn_of_checking
from cocap_opt.run.judged import Judged, finite
from cocap_opt.run.opinions import Opinions, require_small
from cocap_opt.run.options import Option, UsageError
from cocap_opt.run.takes import take_rows
from cocap_opt.run.verified import ProvedBound, Verified
from cocap_opt.scenarios import FORMATS, has_seed, scene_of_plan
from cocap_opt.stop import TimeLimit, never
from cocap_opt.text import printable

_USUAL_LIMIT = 600.0  # s
_NO_PLAN = "proved: no plan exists"
_OPTIMISTIC = (
    "a limit stopped the search for this bound; at some steps it assumes that nothing hides anybody"
)


def _verify(
    scene: Scene,
    /,
    *file: Annotated[Path, Parameter(help="a plan, certificates and proofs, in any order")],
    seed: Seed = 0,
    free: Free = False,
    explain: Annotated[
        bool,
        FLAG(name="--explain", help="explain in three sentences where the gap comes from"),
    ] = False,
    all_terms: Annotated[
        bool,
        FLAG(name="--all", help="with --explain: all sentences, and tables that add up to the gap"),
    ] = False,
    second_opinion: Annotated[
        bool,
        FLAG(
            help="also recompute bounds with independent code, networkx or cocap-check, which "
            "takes much longer; both results must agree"
        ),
    ] = False,
    plain: Annotated[
        bool,
        FLAG(
            help="use no compiled code (numba); staged certificates then take twenty times as "
            "long, other files no longer"
        ),
    ] = False,
    time_limit: Annotated[
        float,
        Parameter(
            help="seconds for checking bounds, including coverage, excluding second opinions; inf: "
            "no limit"
        ),
    ] = _USUAL_LIMIT,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Independently verify plans, certificates and proofs: exit 0 only if all claims hold.

    The plan may also come from the project that the scene comes from, or be a
    solver's solution (.sol) of a program from `export`; a solution of Hughes
    et al. names its scene, so you need not pass one. If you pass several bounds,
    the lowest is shown and explained. Gaps are measured to the proved bound,
    even if the file claims another one. A bound whose check is stopped by the
    time limit counts as not proved, though it may hold.

    Example: cocap-opt verify corridor plan.json certificate.json --explain
    """
    files = file or plan_with_scene(scene)
    if not files:
        if not os.path.exists(scene):
            load_planned(scene, seed)  # the file may not exist
        _require_scene(scene)
        raise UsageError("FILE: name a plan, a certificate or a proof")
    time_limit = Option("--time-limit").require_limit(time_limit)
    claims = _Claims.read(scene, seed, free, files)
    if explain and (claims.plan is None or not claims.bounds):
        raise UsageError("--explain: name a plan, and a certificate or a proof")
    if all_terms and not explain:
        raise UsageError("--all: applies to explanations; add --explain")
    if second_opinion and not claims.bounds:
        raise UsageError("--second-opinion: name a certificate or a proof")
    if plain and not claims.bounds:
        raise UsageError("--plain: name a certificate or a proof")
    if second_opinion:
        require_small(claims.problem, claims.bounds.values())
    bounds, failed = claims.proved(time_limit, plain)
    opinions = Opinions.of(bounds) if second_opinion else Opinions(tuple(bounds.values()))
    verified = Verified.of(
        claims.problem, claims.plan, claims.plan_file, bounds=opinions.bounds,
        failed=[*failed, *opinions.failed], plain=plain,
    )  # fmt: skip
    if verified.verdict is not None and verified.verdict.conflicts:
        say_narrow_way(scene, seed, claims.problem)
    own_seed = seed if has_seed(scene) else None
    answer = {
        **({"cut_short": claims.cut_short} if claims.cut_short else {}),
        "scene": claims.problem.name,
        "seed": own_seed,
        "digest": problem_digest(claims.problem),
        **claims.answer(verified),
        **opinions.answer(verified),
    }
    explained = Explained.of(verified) if explain else None
    if explained is not None and verified.is_on_other_objective:
        words = "the terms explain the gap on the file's objective"
        answer["message"] = "; ".join(filter(None, (answer.get("message", ""), words)))
    if explain and json:
        answer["explanation"] = _data(explained) if explained else None
    if explained and not json:
        print_texts([], [*in_three_sentences(explained), ""])
    print_result(answer if json else answer | claims.by_person(verified), json, verbose)
    if explained and not json and not explained.is_closed:
        more = ["For all sentences, and tables that add up to the gap, add --all."]
        tables = explained_tables(explained, line_width()) if all_terms else []
        print_texts(tables, explained_sentences(explained) if all_terms else more)
    if verified.violations:
        return FAILED
    opinions.require_all()
    return 0


def _data(explained: Explained) -> Record:
    return explained.record | {"sentences": explained_sentences(explained)}


def _require_scene(scene: str) -> None:
    """Rejects the file of a plan or a bound in place of a scene."""
    path = Path(scene)
    if not os.path.isfile(path):  # unlike Path.is_file, also False for an impossible name
        return
    with suppress(FileError):  # it may be a scene
        found = read_claim(path)
        kind = "plan" if isinstance(found, PlanFile) else "bound"
        name = f"; it was made for {printable(found.scene)}"
        raise UsageError(f"SCENE: {printable(scene)} is a {kind}; name its scene before it{name}")


def _between_cells(path: Path, problem: Problem) -> tuple[float, ...] | None:
    """Returns the rewards by step of a foreign plan between the cells; None for any other file."""
    try:
        found = (kind.rewards_between_cells(path, problem) for kind in FORMATS.values())
        return next((rewards for rewards in found if rewards is not None), None)
    except ProblemError as error:
        raise FileError(str(error)) from error


def _proof(verified: Verified) -> Record:
    """Returns the kind of a bound's proof in words, and the number of nodes that its searches
    took.
    """
    if verified.proved is None:
        return {}
    nodes = verified.proved.pricing.nodes
    words = verified.proved.file.proof
    return {"proof": f"{words}: {nodes:,} nodes" if nodes else words}


def _of_bound(verified: Verified) -> Iterator[str]:
    """Yields which plans a bound holds for, and why it may be high."""
    views = verified.problem.objective.views
    if verified.bound_there < 0:
        yield _NO_PLAN
    elif verified.is_of_share:
        asked = f"{100 * ((views and views.share) or 0):g} % of views"
        if verified.no_plan:
            yield f"proved: no plan keeps {asked}"
        elif verified.plan is None or verified.keeps_share:
            yield f"the bound holds for plans that keep {asked}"
        else:
            yield f"the bound holds for plans that keep {asked}, which this one does not"
    elif verified.is_on_other_objective:
        assert verified.proved is not None
        told = _told(verified.proved.problem.objective, verified.problem.objective)
        yield f"the file's bound is on another objective: {told}"
    if verified.optimistic:
        yield _OPTIMISTIC


def _told(objective: Objective, given: Objective) -> str:
    """Returns the weights in which an objective differs from another, in words."""
    before = msgspec.structs.asdict(given)
    found = msgspec.structs.asdict(objective)
    return ", ".join(
        f"{name} {_weight(value)}" for name, value in found.items() if value != before[name]
    )


def _weight(value: object) -> str:
    """Returns a field of an objective in words."""
    if not isinstance(value, Views):
        return "none" if value is None else f"{value}"
    weights = value.weights(1)
    least, most = f"{min(weights, default=0.0):g}", f"{max(weights, default=0.0):g}"
    return (
        f"of weight {least if least == most else f'{least} to {most}'}, up to {value.cameras} per "
        f"person, each of at least {100 * value.at_least:g} % of them"
    )


class _Claims(NamedTuple):
    """The claims to check; with a plan, for the variant of the scene for which it was made."""

    problem: Problem
    plan: Plan | None
    plan_file: PlanFile | None  # contains claims about the plan
    bounds: dict[Path, CertificateFile | ProofFile]
    about: Record  # values for the answer

    @classmethod
    def read(cls, scene: str, seed: int, free: bool, files: Sequence[Path]) -> "_Claims":
        """Reads all files, in a fixed order, before any is checked."""
        problem = load_planned(scene, seed)
        about: Record = {"free": True} if free else {}
        reader = PlanReader(scene, problem)
        content: PlanFile | Plan | None = None
        bounds = {}
        for path in sorted(set(files)):
            if (rewards := _between_cells(path, problem)) is not None:
                about |= {
                    "reward": math.fsum(rewards), "reward_at_start": rewards[0],
                    "reward_per_step": rewards[1:],
                    "message": f"{printable(path.name)} lies between the cells: it is evaluated "
                    "there, and cannot be flown",
                }  # fmt: skip
                continue
            claim = reader.claim(path)
            if isinstance(claim, CertificateFile | ProofFile):
                bounds[path] = claim
            elif content is not None:
                raise FileError(f"{path}: must be a certificate or a proof, not a second plan")
            else:
                content = claim
        claimed = content if isinstance(content, PlanFile) else None
        plan = claimed.plan if claimed else content
        if isinstance(plan, Plan):
            fitting = scene_of_plan(scene, problem, plan)
            about |= {"seed": None, "starts": OWN_STARTS} if fitting is not problem else {}
            problem = fitting
        problem = problem.without_rules() if free else problem
        return cls(problem, plan if isinstance(plan, Plan) else None, claimed, bounds, about)

    def proved(self, seconds: float, plain: bool) -> tuple[dict[str, ProvedBound], list[str]]:
        """Returns the proved bounds by file, and the errors in others, in words.

        Parameters
        ----------
        seconds : time limit of all checks; infinite if there is none
        plain : True: use no compiled code
        """
        bounds, failed = dict[str, ProvedBound](), list[str]()
        if not self.bounds:
            return bounds, failed
        try:
            model = Model(next(iter(self.bounds.values())).problem_of(self.problem), plain=True)
        except CertificateError as error:
            raise FileError(f"{next(iter(self.bounds))}: {error}") from error
        warn_of_checking(model, [*self.bounds.values()], seconds)
        stop = TimeLimit(seconds) if math.isfinite(seconds) else never
        for path, file in self.bounds.items():
            name = printable(str(path))
            with Watch.on_terminal(name) as watch:
                part = "leaf" if isinstance(file, ProofFile) else "search of a step"
                progress = watch.counter(part)
                try:
                    bounds[name] = ProvedBound.of(
                        model, file, progress=progress, stop=stop, plain=plain
                    )
                except CertificateError as error:
                    failed.append(f"{name}: {error}")
        return bounds, failed

    @property
    def cut_short(self) -> str:
        """Remark on how complete the plan was at a limit; it may be valid and only hover."""
        return self.plan_file.ending.left_of(self.plan_file.plan) if self.plan_file else ""

    def by_person(self, verified: Verified) -> Record:
        """Returns the rewards of people, which replace those of faces in a terminal."""
        verdict = verified.verdict
        if verdict is None or not verdict.face_reward:
            return {}
        rewards = np.bincount(self.problem.face_owner, weights=verdict.face_reward)
        return {"reward_per_face": None, "reward_per_person": tuple(rewards.tolist())}

    def _filmed(self) -> Record:
        """Returns quality and distances of a plan that can be flown, as `plan` reports them."""
        assert self.plan is not None
        found = Quality.of(self.problem, self.plan).summary
        return {
            "seen_by_two": finite(found.by_two),
            "seen_by_three": finite(found.by_three),
            "median_error": finite(found.median),
            "cameras": found.line,
            **nearness(self.problem, self.plan),
        }

    def _made_otherwise(self, verified: Verified) -> Iterator[str]:
        """Yields which files were made with another version of coverage."""
        if self.plan_file and (words := other_coverage(self.plan_file.coverage_version)):
            yield f"the plan: {words}"
        if words := verified.other_coverage:
            yield f"the bound: {words}"
        if words := verified.other_instance:
            yield words

    def answer(self, verified: Verified) -> Record:
        """Returns the record of findings that `verify` prints."""
        found: Record = {
            "valid": not verified.violations, "violations": [*verified.violations], **self.about
        }  # fmt: skip
        if (verdict := verified.verdict) is not None:
            known = math.isfinite(verified.reward)
            found |= {
                "planner": self.plan_file.planner if self.plan_file else None,
                "conflicts": len(verdict.conflicts),
                "reward": verified.reward if known else None,
            }
            if known:
                found |= Judged.parts_of(verdict) | {"reward_per_face": verdict.face_reward}
                found |= self._filmed()
                if rows := take_rows(self.problem, self.plan):
                    found["takes"] = rows
        if self.bounds:
            proved = math.isfinite(verified.bound)
            found |= {"method": verified.method, "bound": verified.bound if proved else None}
            found |= _proof(verified)
            if verified.understated:
                found |= {
                    "bound_proved": verified.proved_bound, "bound_claimed": verified.claimed_bound
                }  # fmt: skip
            if verified.plain:
                found["plain"] = True
            if verified.is_on_other_objective and not verified.is_of_share:
                found |= {
                    "reward_there": finite(verified.reward_there),
                    "bound_there": finite(verified.bound_there),
                }
            if words := "; ".join(_of_bound(verified)):
                found["message"] = words
        if words := "; ".join(self._made_otherwise(verified)):
            found["message"] = "; ".join(filter(None, (found.get("message", ""), words)))
        found["optimal"] = None
        if verdict is not None and math.isfinite(verified.gap):
            found |= {"gap": verified.gap, "optimal": verified.is_optimal}
        return found


COMMANDS = {"verify": _verify}
