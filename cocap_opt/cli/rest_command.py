"""The part of `plan` that replans the rest of a mission."""

import logging
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from cocap_opt.cli.answers import Wanted, check_outputs, in_order, record_of, save, say_unwritten
from cocap_opt.cli.options import Whole, load, say_why_no_plan
from cocap_opt.console.progress import Watch
from cocap_opt.console.streams import say
from cocap_opt.data import FieldError, ProblemError
from cocap_opt.experiments.tables.rows import PlanRow
from cocap_opt.files.documents import FileError, PlanFile, SceneFile, problem_digest
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.method import Method
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import PlanReader
from cocap_opt.output.nearness import nearness
from cocap_opt.output.printing import Record
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import UnsupportedError
from cocap_opt.run.engine import BOUND_METHOD, SOLVERS
from cocap_opt.run.forecast import warn_of_limit
from cocap_opt.run.judged import Judged, RefereeError, finite
from cocap_opt.run.options import Allowance, Option, UsageError
from cocap_opt.run.own_planners import OwnPlannerError
from cocap_opt.run.replanning import BOUND_SECONDS, NEAR, Replanning
from cocap_opt.run.rest import Rest
from cocap_opt.scenarios import scene_of_plan
from cocap_opt.stop import Interrupt, Stop
from cocap_opt.text import other_scene

_log = logging.getLogger(__name__)


@Parameter(name="*")
@dataclass(frozen=True)
class RestOptions:
    """The options of `plan` for the rest of a mission."""

    from_step: Annotated[
        Whole | None,
        Parameter(help="step up to which --plan has been flown, 1 to T - 1; replans the rest"),
    ] = None
    plan: Annotated[Path | None, Parameter(help="plan being flown, to replan from --from-step")] = (
        None
    )
    without: Annotated[
        list[Whole] | None,
        Parameter(negative="", consume_multiple=True, help="drones lost at that step, e.g. 0 2"),
    ] = None
    bound_limit: Annotated[
        float,
        Parameter(
            help=f"seconds for a bound on the rest, stopped earlier at a gap of {100 * NEAR:g} %; "
            "0: no bound"
        ),
    ] = BOUND_SECONDS
    rest_scene: Annotated[
        Path | None, Parameter(help="file to write the scene from that step on to")
    ] = None
    rest_plan: Annotated[Path | None, Parameter(help="file to write the plan of the rest to")] = (
        None
    )
    certificate: Annotated[
        Path | None, Parameter(help="file to write the certificate of the rest's bound to")
    ] = None

    @property
    def asked(self) -> bool:
        """True if the rest of a mission is to be planned; rejects options that have no meaning
        otherwise.
        """
        if self.from_step is not None:
            return True
        given = {
            "--plan": self.plan, "--without": self.without, "--rest-scene": self.rest_scene,
            "--rest-plan": self.rest_plan, "--certificate": self.certificate,
            "--bound-limit": None if self.bound_limit == BOUND_SECONDS else self.bound_limit,
        }  # fmt: skip
        for option, value in given.items():
            if value is not None:
                raise UsageError(
                    f"{option}: must be left out without --from-step, the step at which the rest "
                    "of a mission begins"
                )
        return False

    def require(self, output: Path | None, scene: str) -> Path:
        """Returns the file of the flown plan; rejects options of files that are not written."""
        if self.plan is None:
            raise UsageError("--plan: must name the plan that was flown up to that step")
        Option("--bound-limit").require_limit(self.bound_limit)
        if self.certificate is not None and not self.bound_limit:
            raise UsageError("--certificate: must be left out if --bound-limit is 0")
        if self.without and output is not None:
            raise UsageError(
                "-o: must be left out with --without, as a whole plan has all drones; "
                "--rest-scene and --rest-plan write the rest for the others"
            )
        written = {
            "-o": output, "--rest-scene": self.rest_scene, "--rest-plan": self.rest_plan,
            "--certificate": self.certificate,
        }  # fmt: skip
        check_outputs(written, scene, self.plan)
        return self.plan


WHOLE = RestOptions()


def replan(
    options: RestOptions,
    scene: str,
    seed: int,
    free: bool,
    planner: tuple[str, Method[Any]],
    allowance: Allowance,
    output: Path | None,
    json: bool,
    verbose: bool,
) -> int:
    """Plans the rest of a mission, writes it, computes a bound, and prints both.

    Parameters
    ----------
    planner : name and record of the planner
    allowance : limits for the plan; the bound has its own limit
    """
    path = options.require(output, scene)
    problem = load(scene, seed)
    replanning = _replanning(options, scene, problem, free, path)
    rest = replanning.rest
    with Interrupt.caught() as interrupt, Watch.on_terminal(rest.scene.name) as watch:
        judged = _planned(replanning, scene, seed, planner, allowance, interrupt, watch)
        made = _plans(rest, judged, planner[0], allowance, options, output)
        # written at once, as the crew is waiting for it
        save(record_of(_row(rest, seed, planner[0], judged)), "plan", made)
        if judged.result.plan is None:
            say_why_no_plan(scene, seed, rest.scene)
        first = output or options.rest_plan
        if first is not None and judged.valid and options.bound_limit:
            say(f"{first}: the plan is written; computing its bound")
        bounded = replanning.bounded(
            judged, options.bound_limit, interrupt, watch=watch, report=watch.report()
        )
        answer = record_of(_row(rest, seed, planner[0], bounded))
        made = _plans(rest, bounded, planner[0], allowance, options, output)
        proof = options.certificate, bounded.result.certificate
        save(answer, "plan", {**made, "certificate": proof})
    answer |= _of_the_mission(replanning, bounded)
    if bounded.result.plan is not None:
        answer |= nearness(rest.scene, bounded.result.plan)
    if not json:
        answer["drones"] = " ".join(map(str, rest.drones))
        if bounded.result.plan is not None and output is None and options.rest_plan is None:
            say_unwritten(answer, "--rest-plan rest.json" if options.without else "-o plan.json")
    print_result(in_order(answer, bounded.result.plan is not None), json, verbose)
    return 0


def _replanning(
    options: RestOptions, scene: str, problem: Problem, free: bool, path: Path
) -> Replanning:
    """Returns the rest to plan, and the old rest.

    Raises
    ------
    FileError, UsageError
        If the plan's first steps cannot be flown in the scene, or an option is out of range.
    """
    content = PlanReader(scene, problem).claim(path)
    if isinstance(content, CertificateFile | ProofFile):
        raise FileError(f"{path}: must be a plan, not a certificate")
    plan = content if isinstance(content, Plan) else content.plan
    fitting = scene_of_plan(scene, problem, plan)
    mission = fitting.without_rules() if free else fitting
    assert options.from_step is not None
    try:
        rest = Rest.of(mission, plan, options.from_step, options.without or ())
    except FieldError as error:
        raise Option.refused(error) from error
    except ProblemError as error:
        raise FileError(f"{path}: {error}") from error
    _say_made_for(content, fitting, path, options.from_step)
    return Replanning(rest, plan)


def _say_made_for(content: PlanFile | Plan, problem: Problem, path: Path, step: int) -> None:
    """Logs that a plan was made for another scene, but that its first steps obey the rules."""
    if isinstance(content, Plan) or content.digest == problem_digest(problem):
        return
    _log.warning(
        "%s: was made for %s; its steps 0..%d obey the rules here, too, and count as flown",
        path, other_scene(content.scene, problem.name), step,
    )  # fmt: skip


def _planned(
    replanning: Replanning,
    scene: str,
    seed: int,
    planner: tuple[str, Method[Any]],
    allowance: Allowance,
    stop: Stop,
    watch: Watch,
) -> Judged[Any]:
    """Returns the new plan of the rest; a third-party planner may fail to return one."""
    name, method = planner
    rest, seconds = replanning.rest.scene, allowance.seconds
    warn_of_limit(rest, method, seconds, seed, scene=scene, watch=watch)
    try:
        with redirect_stdout(sys.stderr):  # output of a planner is not part of the answer
            return replanning.planned(method, allowance.begin(stop), name, watch=watch, seed=seed)
    except UnsupportedError as error:
        raise UsageError(f"--planner: {error}") from error
    except (OwnPlannerError, RefereeError) as error:
        if name in SOLVERS:  # a bug of this project
            raise
        raise UsageError(f"--planner: {error}") from error


def _plans(
    rest: Rest,
    judged: Judged[Any],
    planner: str,
    allowance: Allowance,
    options: RestOptions,
    output: Path | None,
) -> dict[str, Wanted]:
    """Returns the files of a replanned mission: its whole plan, and the rest in the scene of the
    rest.
    """
    of_rest = judged.plan_file(rest.scene, planner, allowance)
    return {
        "file": (output, None if of_rest is None else _of_whole(rest, judged, of_rest)),
        "rest_scene": (options.rest_scene, SceneFile.of(rest.scene)),
        "rest_plan": (options.rest_plan, of_rest),
    }


def _of_whole(rest: Rest, judged: Judged[Any], of_rest: PlanFile) -> PlanFile | None:
    """Returns the file of the plan of the whole mission; None if a drone is lost."""
    plan = rest.joined(of_rest.plan)
    if plan is None:
        return None
    return PlanFile.of(
        rest.mission, plan, check(rest.mission, plan).reward, of_rest.planner,
        limit=of_rest.limit, cut_short=judged.result.ending.left_of(plan), reason=of_rest.reason,
        seconds=of_rest.seconds, time_limit=of_rest.time_limit, work_limit=of_rest.work_limit,
    )  # fmt: skip


def _row(rest: Rest, seed: int, planner: str, judged: Judged[Any]) -> PlanRow:
    """Returns the row of a plan of the rest, with its bound if there is one."""
    row = PlanRow.of(rest.scene, seed, planner, judged)
    bound = finite(judged.result.bound)
    method = None if bound is None else BOUND_METHOD
    return replace(row, method=method, bound=bound, gap=finite(judged.gap))


def _of_the_mission(replanning: Replanning, judged: Judged[CertifiedResult]) -> Record:
    """Returns the part of an answer about the mission, except its rest."""
    rest = replanning.rest
    answer: Record = {
        "from_step": rest.step,
        "drones": [*rest.drones],
        "flown_reward": rest.reward_flown,
        "whole_reward": rest.reward_flown + judged.reward if judged.verdict else None,
        "old_reward": replanning.old,
        "bound_seconds": replanning.bound_seconds or None,
        "digest": problem_digest(rest.scene),
    }
    if replanning.fault:
        answer["old_rest"] = f"can no longer be flown: {replanning.fault}"
    return answer
