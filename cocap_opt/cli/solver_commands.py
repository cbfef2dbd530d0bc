"""The commands that compute on one scene: plan, bound and solve."""

import math
import sys
from contextlib import redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from cyclopts import Parameter

from cocap_opt.cli.answers import check_outputs, in_order, record_of, save, say, say_unwritten
from cocap_opt.cli.options import (
    USUAL,
    Budget,
    Free,
    Json,
    PlanOutput,
    Scene,
    Seed,
    Verbose,
    load,
    load_planned,
    say_strains,
    say_why_no_plan,
)
from cocap_opt.cli.rest_command import WHOLE, RestOptions, replan
from cocap_opt.console.progress import Watch
from cocap_opt.experiments.tables.rows import OWN_STARTS, PlanRow
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import (
    PlanReader,
    save_bytes,
)
from cocap_opt.output.nearness import nearness
from cocap_opt.output.printing import Record
from cocap_opt.output.trace import Trace
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.forecast import warn_of_limit
from cocap_opt.run.judged import Judged, RefereeError
from cocap_opt.run.kept_share import run_keeping
from cocap_opt.run.named_planners import FORMS, planner_named
from cocap_opt.run.options import Allowance, Option, UsageError
from cocap_opt.run.own_planners import OwnPlannerError
from cocap_opt.run.takes import take_rows
from cocap_opt.stop import Interrupt, Stop
from cocap_opt.text import counted, pair

AT_THE_ROOT = "column-generation"  # a bound that also gives a plan
_WITH_STEP_ENVELOPES = ("branch-and-price", AT_THE_ROOT)
_NOT_COMPILED = (
    "numba is not installed; with it (`pip install -e '.[fast]'`) step envelopes may lower the "
    "bound further"
)
_SOLVE_METHODS = (*EXACT, AT_THE_ROOT)

_Start = Annotated[Path | None, Parameter(help="file of a plan to start from")]
_TraceFile = Annotated[
    Path | None, Parameter(name="--trace", help="CSV file for value and bound over time")
]


def _plan(
    scene: Scene,
    /,
    *,
    planner: Annotated[str, Parameter(help=f"one of {', '.join(SOLVERS)}; {FORMS}")] = RECOMMENDED,
    seed: Seed = 0,
    free: Free = False,
    budget: Budget = USUAL,
    rest: RestOptions = WHOLE,
    output: PlanOutput = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Plan a scene, check the plan, and with -o write it to a file.

    --from-step replans the rest of a mission: the drones have flown --plan up to that step, and
    then drones are lost, or people walk elsewhere in the scene you pass. The new rest is at least
    as good as the old one, unless that now breaks a rule. -o writes the plan of the whole mission
    before a bound on the rest is computed. If drones are lost, the plan covers the others only and
    begins at that step: write it with --rest-plan.

    Example: cocap-opt plan corridor --seed 0 -o plan.json
    """
    method = planner_named(Option("--planner"), planner)
    allowance = budget.allowance
    if rest.asked:
        return replan(rest, scene, seed, free, (planner, method), allowance, output, json, verbose)
    check_outputs({"-o": output}, scene)
    task = _Task.read(scene, seed, free, None)
    problem = task.problem
    say_strains(scene, seed, problem)
    with Interrupt.caught() as interrupt, Watch.on_terminal(f"{problem.name} seed {seed}") as watch:
        warn_of_limit(problem, method, allowance.seconds, seed, scene=scene, watch=watch)
        stop = allowance.begin(interrupt)
        try:
            with redirect_stdout(sys.stderr):  # output of a planner is not part of the answer
                judged = run_keeping(problem, method, stop, name=planner, watch=watch, seed=seed)
        except UnsupportedError as error:
            raise UsageError(f"--planner: {error}") from error
        except (OwnPlannerError, RefereeError) as error:
            if planner in SOLVERS:  # a bug of this project
                raise
            raise UsageError(f"--planner: {error}") from error
        if not judged.valid:
            say_why_no_plan(scene, seed, problem)
        judged.warn(problem, seed, planner)
        answer = record_of(PlanRow.of(problem, seed, planner, judged)) | task.about
        save(answer, "plan", {"file": (output, judged.plan_file(problem, planner, allowance))})
    answer |= judged.result.statistics
    if judged.verdict:
        answer |= judged.reward_parts
        answer["violations"] = judged.verdict.conflicts
        answer |= _nearness(problem, judged)
    answer |= _chosen_starts(problem, judged.result.plan)
    answer |= _take_by_take(problem, judged)
    if output is None and judged.result.plan is not None and not json:
        say_unwritten(answer)
    print_result(in_order(answer, judged.result.plan is not None), json, verbose)
    return 0


def _bound(
    scene: Scene,
    /,
    *,
    method: Annotated[
        str, Parameter(choices=tuple(BOUNDS), help="method that computes the bound")
    ] = "column-generation",
    seed: Seed = 0,
    start: _Start = None,
    free: Free = False,
    budget: Budget = USUAL,
    output: Annotated[
        Path | None,
        Parameter(name=["-o", "--output"], help="file to write the certificate to"),
    ] = None,
    trace: _TraceFile = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Compute an upper bound on J and the certificate that proves it.

    Example: cocap-opt bound corridor --seed 0 -o certificate.json
    """
    allowance = budget.allowance
    check_outputs({"-o": output, "--trace": trace}, scene, start)
    task = _Task.read(scene, seed, free, start)
    with Interrupt.caught() as interrupt:
        judged = task.certified(method, allowance, interrupt, OPTIMALITY, trace)
        answer = task.answer(method, judged)
        say(answer, task.surpassed(judged))
        if judged.result.reason is Reason.INFEASIBLE:
            say_why_no_plan(scene, seed, task.problem)
        save(answer, "certificate", {"file": (output, judged.result.certificate)})
    print_result(in_order({**answer, **judged.result.statistics}), json, verbose)
    return 0


def _solve(
    scene: Scene,
    /,
    *,
    method: Annotated[
        str,
        Parameter(
            choices=_SOLVE_METHODS,
            help=f"exact method; {AT_THE_ROOT} stops at the root, with a bound and a plan",
        ),
    ] = "branch-and-price",
    seed: Seed = 0,
    gap: Annotated[
        float,
        Parameter(help=f"gap, (bound - J) / bound, at which to stop; 0 means {OPTIMALITY:g}"),
    ] = 0.0,
    start: _Start = None,
    free: Free = False,
    budget: Budget = USUAL,
    output: PlanOutput = None,
    certificate: Annotated[Path | None, Parameter(help="file to write the proof to")] = None,
    trace: _TraceFile = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Find the best plan and prove that no other is better by more than --gap.

    At a limit or Ctrl-C it returns the best plan and bound so far. The file of
    --certificate proves the bound, and `verify` checks it; brute-force tries
    all plans and writes no certificate.

    Example: cocap-opt solve corridor --seed 0 -o plan.json --certificate proof.json
    """
    gap = Option("--gap").require_share(gap)
    if gap and method not in EXACT:
        raise UsageError(f"--gap: {method} always stops at the root; omit the option")
    allowance = budget.allowance
    check_outputs({"-o": output, "--certificate": certificate, "--trace": trace}, scene, start)
    task = _Task.read(scene, seed, free, start)
    with Interrupt.caught() as interrupt:
        least = max(gap, OPTIMALITY)
        judged = task.certified(method, allowance, interrupt, least, trace)
        answer = task.answer(method, judged)
        proof = certificate, judged.result.certificate
        if judged.result.plan is None:
            say_why_no_plan(scene, seed, task.problem)
        made = output, judged.plan_file(task.problem, method, allowance)
        save(answer, "plan", {"file": made, "certificate": proof})
    answer |= _nearness(task.problem, judged)
    has_plan = judged.result.plan is not None
    if output is None and has_plan and not json:
        say_unwritten(answer)
    print_result(in_order({**answer, **judged.result.statistics}, has_plan), json, verbose)
    return 0


def _motion(problem: Problem) -> str:
    """Returns the distance that drones may move in a step; with a duration, also the speed."""
    edge = problem.height_map.resolution
    kinds = []
    moves = {(bot.motion.radius, bot.motion.longest_aside(edge)) for bot in problem.robots}
    for radius, longest in sorted(moves):
        words = f"{counted(radius, 'cell')} of {edge:g} m along each axis a step"
        if problem.step is not None:
            words += f" of {problem.step:g} s, at most {longest / problem.step:.3g} m/s"
        kinds.append(words)
    return "; ".join(kinds)


def _chosen_starts(problem: Problem, plan: Plan | None) -> Record:
    """Returns the starts of a plan's drones, in words, if they had a choice."""
    if plan is None or not problem.has_free_starts:
        return {}
    words = []
    for i, (robot, path) in enumerate(zip(problem.robots, plan.paths, strict=True)):
        ((x, y, z),) = problem.where(robot, path[:1]).tolist()
        turned = 360 * path[0].heading / robot.motion.headings
        words.append(f"drone {i} at {pair(x, y)} m, {z:.4g} m high, {turned:.4g} deg")
    return {"chosen_starts": "; ".join(words)}


class _Task(NamedTuple):
    """The scene of a command, or the variant of it that fits a given start."""

    scene: str
    seed: int
    problem: Problem
    start: Plan | None
    about: Record  # values for the answer

    @classmethod
    def read(cls, scene: str, seed: int, free: bool, path: Path | None) -> "_Task":
        problem, start = (load if path is None else load_planned)(scene, seed), None
        about: Record = {"free": True} if free else {"rules": str(problem.rules)}
        about |= {"motion": _motion(problem)}
        if path is not None:
            # A start is evaluated anew, so it may come from a scene with other rules or another
            # objective.
            fitting, start, _ = PlanReader(scene, problem).plan(path, any_scene=True)
            about |= {"seed": None, "starts": OWN_STARTS} if fitting is not problem else {}
            problem = fitting
        problem = problem.without_rules() if free else problem
        about |= {"digest": problem_digest(problem)}
        return cls(scene, seed, problem, start, about)

    def certified(
        self, method: str, allowance: Allowance, stop: Stop, gap: float, path: Path | None
    ) -> Judged[CertifiedResult]:
        """Runs a bound or an exact method, shows progress, and writes a trace if requested."""
        problem, trace = self.problem, Trace()
        with Watch.on_terminal(f"{problem.name} seed {self.seed}") as watch:
            warn_of_limit(
                problem, method, allowance.seconds, self.seed, scene=self.scene, watch=watch
            )
            report = trace.beside(watch.report())
            try:
                judged: Judged[CertifiedResult] = run_keeping(
                    problem, method, allowance.begin(stop), watch=watch,
                    start=self.start, report=report, gap=gap,
                )  # fmt: skip
            except UnsupportedError as error:
                raise UsageError(f"--method {method}: {error}") from error
        if path is not None:
            trace.end(judged.result)
            save_bytes(path, trace.text.encode())
        return judged

    def surpassed(self, judged: Judged[CertifiedResult]) -> str:
        """Returns a message if the search found a better plan than the start, which `bound` does
        not write.
        """
        if self.start is None or not judged.valid:
            return ""
        given = check(self.problem, self.start).reward
        if judged.reward <= given + OPTIMALITY * abs(given):
            return ""
        return (
            f"reward and gap are those of a better plan than the start, whose J is {given:,.2f}: "
            "use `solve --start` with -o to write it"
        )

    def answer(self, method: str, judged: Judged[CertifiedResult]) -> Record:
        """Returns the record that the command prints."""
        judged.warn(self.problem, self.seed, method)
        row = PlanRow.certified(self.problem, self.seed, method, judged)
        record = record_of(row) | self.about | _chosen_starts(self.problem, judged.result.plan)
        record |= _take_by_take(self.problem, judged)
        if (file := judged.result.certificate) is not None:
            record["proof"] = file.proof
        is_open = OPTIMALITY < judged.result.gap < math.inf
        may_have = method in _WITH_STEP_ENVELOPES and not self.problem.objective.over_time
        if is_open and may_have and find_spec("numba") is None:
            say(record, _NOT_COMPILED)
        return record


def _nearness(problem: Problem, judged: Judged[Any]) -> Record:
    """Returns small distances of the plan for which the scene has no rule."""
    return {} if judged.result.plan is None else nearness(problem, judged.result.plan)


def _take_by_take(problem: Problem, judged: Judged[Any]) -> Record:
    """Returns J and the quality of a plan in each take, if there are takes."""
    rows = take_rows(problem, judged.result.plan)
    return {"takes": rows} if rows else {}


COMMANDS = {"plan": _plan, "bound": _bound, "solve": _solve}
