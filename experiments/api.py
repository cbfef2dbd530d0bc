"""The functions of the face, `import cocap_opt as co`: scenes, plans, bounds, checks, files."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import msgspec
import numpy as np

from cocap_opt.experiments.results.judging import ROUNDING
from cocap_opt.experiments.results.verification import ProvedBound, Verified
from cocap_opt.files.documents import (
    PlanFile,
    SceneFile,
    decode_document,
    problem_digest,
    read_bytes,
)
from cocap_opt.files.messages import in_words
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates.format import CertificateFile, ProofFile
from cocap_opt.formulations.result import (
    OPTIMALITY,
    BoundMethod,
    CertifiedResult,
    ExactMethod,
    Report,
    silent,
)
from cocap_opt.model import Model, compiled
from cocap_opt.planners import PLANNERS, RECOMMENDED, Planner
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict
from cocap_opt.referee import check as judge_plan
from cocap_opt.result import Reason, Result
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Clock, FirstOf, Stop, TimeLimit, never

if TYPE_CHECKING:
    import pandas as pd

    from cocap_opt.experiments.report.benchmark import Benchmark
    from cocap_opt.experiments.report.player import Player
    from cocap_opt.experiments.results.flights import Flight

_STORED = Path(__file__).parent / "studies" / "stored" / "solvers.csv"

M = TypeVar("M")
R = TypeVar("R", bound=Result)
Bound = CertificateFile | ProofFile


def load(scene: str | Path, seed: int = 0, **options: str) -> Problem:
    """Load a built-in scene by its name, or a scene file in any format that is known.

    Parameters
    ----------
    scene : a name, such as "bottleneck" (`SCENES` has them all), or a file
    seed : chooses the drones' starts; files of some formats have none
    options : conventions of the file's format, such as ``triangles="no"``; a hyphen in the name of
        an option is an underscore here, as in ``start_set="yaml"``

    Returns
    -------
    Problem

    Raises
    ------
    FileError
        If there is no such scene or option, or the file cannot be used; one line says why.

    Examples
    --------
    >>> problem = co.load("bottleneck", seed=3)
    """
    words = {name.replace("_", "-"): word for name, word in options.items()}
    _require(scene, "scene", "a name or a file", str, Path)
    _require(seed, "seed", "a whole number", int, np.integer)
    return load_scene(str(scene), int(seed), words)


def plan(
    problem: Problem,
    planner: str | Planner = RECOMMENDED,
    *,
    time_limit: float | None = None,
    stop: Stop = never,
) -> Result:
    """Plan all drones of a problem.

    Parameters
    ----------
    problem : the drones, the people, and where they are
    planner : a name in `PLANNERS`, or any callable that takes a problem and a stop
    time_limit : seconds, the coverage included
    stop : a further stopping criterion, such as ``co.WorkLimit(100)``

    Returns
    -------
    Result
        With the plan, its J in `value` as the planner claims it (`verify` computes it anew), and
        why the planner stopped. Its `seconds` include the coverage, unless that has been computed
        before in this process; those of `cocap-opt plan` and of `gap` do not.

    Raises
    ------
    UnsupportedError
        If the planner takes no such problems.
    ValueError
        If there is no planner of this name, or the time limit is negative.

    Examples
    --------
    >>> result = co.plan(problem, time_limit=10)
    >>> result.plot()
    """
    call, clock = _named("planner", planner, PLANNERS), Clock()
    _require_problem(problem)
    return _whole(call(problem, _limits(time_limit, stop)), problem, planner, clock)


def bound(
    problem: Problem,
    method: str | BoundMethod = "column-generation",
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    start: Plan | Result | None = None,
    report: Report = silent,
) -> CertifiedResult:
    """Compute an upper bound on J, which no plan exceeds, with the certificate that proves it.

    Parameters
    ----------
    problem : the drones, the people, and where they are
    method : a name in `BOUNDS`, or any callable that takes what those take
    time_limit : seconds, the coverage included
    stop : a further stopping criterion
    start : a plan that the method may begin with
    report : called with a `Snapshot` of value and bound now and then

    Returns
    -------
    CertifiedResult
        With the bound and its `certificate`; `verify` checks it without any solver.

    Raises
    ------
    UnsupportedError
        If the method takes no such problems.
    ValueError
        If there is no method of this name, or the time limit is negative.

    Examples
    --------
    >>> co.bound(problem, time_limit=10).bound
    """
    call, clock = _named("method", method, BOUNDS), Clock()
    _require_problem(problem)
    result = call(problem, _limits(time_limit, stop), _plan_of(start), report)
    return _whole(result, problem, method, clock)


def solve(
    problem: Problem,
    method: str | ExactMethod = "branch-and-price",
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    gap: float = 0.0,
    start: Plan | Result | None = None,
    report: Report = silent,
) -> CertifiedResult:
    """Find the best plan, and prove that no other is better.

    Parameters
    ----------
    problem : the drones, the people, and where they are
    method : a name in `EXACT`, or any callable that takes what those take
    time_limit : seconds, the coverage included; when they are over, the best plan and bound so far
        are returned
    stop : a further stopping criterion
    gap : (bound - J) / bound at which to stop; 0 means 1e-6, which is called optimal
    start : a plan to begin with
    report : called with a `Snapshot` of value and bound now and then

    Returns
    -------
    CertifiedResult
        With plan, value, bound, gap and `certificate`, which is None for brute force.

    Raises
    ------
    UnsupportedError
        If the method takes no such problems, or a solver that it needs is not installed.
    ValueError
        If there is no method of this name, the time limit is negative, or `gap` is not in [0, 1).

    Examples
    --------
    >>> co.solve(co.load("corridor"), time_limit=60).summary()
    """
    _require_problem(problem)
    _require(gap, "gap", "a number", int, float, np.number)
    if not 0 <= gap < 1:
        raise ValueError(f"gap: must be at least 0 and less than 1, not {gap}")
    call, clock = _named("method", method, EXACT), Clock()
    stop = _limits(time_limit, stop)
    result = call(problem, stop, _plan_of(start), report, gap=max(gap, OPTIMALITY))
    return _whole(result, problem, method, clock)


def check(problem: Problem, plan: Plan | Result) -> Verdict:
    """Ask the referee if a plan can be flown, which rules it breaks, and what its J is.

    The referee trusts no planner; it recomputes everything by slow, obvious loops.

    Parameters
    ----------
    problem : that the plan is for
    plan : a plan, or a result that has one

    Returns
    -------
    Verdict
        With `valid`, `violations` and `conflicts` in words, and J in `reward`.

    Raises
    ------
    ValueError
        If the result has no plan, or the plan's file says that it is for another problem.
    """
    _require_problem(problem)
    own = _plan_of(plan)
    if own is None:
        raise ValueError("plan: the result has no plan that could be checked")
    _require_made_for("plan", plan, problem)
    return judge_plan(problem, own)


def verify(problem: Problem, *claims: Plan | Result | Bound, networkx: bool = False) -> Verified:
    """Check plans, certificates and proofs, trusting nobody and calling no solver.

    Parameters
    ----------
    problem : that the claims are about
    claims : a plan, certificates, proofs, or results, of which plan, value, bound and certificate
        are checked
    networkx : price bounds a second time, by networkx alone, which takes seconds

    Returns
    -------
    Verified

    Raises
    ------
    CertificateError
        If a certificate belongs to another problem, is not valid, or claims a lower bound than its
        numbers prove, or networkx finds another bound.
    TooLargeError
        If networkx would take longer than some minutes.
    ValueError
        If a plan is for another problem, breaks a rule or cannot be flown, its J is not the one
        claimed or above the bound, a result claims a lower bound than its certificate, there are
        two plans, nothing to check, or a result has a bound, such as that of brute force, and no
        certificate is among the claims. Its plan alone, `result.plan`, can be checked.

    Examples
    --------
    >>> co.verify(problem, result.plan, result.certificate).gap
    """
    _require_problem(problem)
    for claim in claims:
        words = "a plan, a result, a certificate or a proof; `read` reads files of them"
        _require(claim, "claims", words, Plan, Result, CertificateFile, ProofFile)
        _require_made_for("plan", claim, problem)
    plans = [p for p in map(_plan_in, claims) if p is not None]
    bounds = [b for b in map(_bound_in, claims) if b is not None]
    if len(plans) > 1:
        raise ValueError("claims: name at most one plan")
    if not bounds:
        _require_checkable(claims, plans)
    model = Model(problem, use_cache=False) if bounds else None
    proved = [ProvedBound.of(model, file, networkx) for file in bounds if model is not None]
    for claim in claims:
        if isinstance(claim, Result):
            _require_consistent(claim)
    values = [one.value for one in claims if isinstance(one, Result) and one.plan is not None]
    verified = Verified.of(problem, plans[0] if plans else None, values=values, bounds=proved)
    if verified.violations:
        raise ValueError(verified.violations[0])
    return verified


def explain(
    problem: Problem, plan: Plan | Result, certificate: Bound | CertifiedResult | None = None
) -> "pd.DataFrame":
    """Tell what the gap between a plan and a bound is made of, as terms that add up to it.

    Each drone loses something by leaving a step as it does, the bound pays for faces beyond what
    the drones get, and charges for rules that nobody uses. No amount is below 0, but for that of a
    rule which the plan breaks. `cocap-opt verify --explain` tells it in words.

    Parameters
    ----------
    problem : that the plan is for
    plan : a plan that can be flown, or a result that has one
    certificate : the certificate or proof of the bound, or a result that has one; if not given,
        that of `plan`

    Returns
    -------
    DataFrame
        A row per term: `kind` (path, face, row, decision, leaves, claim, rounding), `step`,
        `robot`, `actor`, `face` (of the actor), `amount` in units of J, `share` of the bound, and
        of rows and decisions `resource`, `sense` and `robots` (at most, or at least, so many may
        use it), `used` and `price`. `attrs` has `bound`, `reward`, and their `difference`.

    Raises
    ------
    CertificateError
        If the certificate belongs to another problem, is not valid, or claims too low a bound.
    ValueError
        If the plan cannot be flown, or the certificate proves that there is no plan.

    Examples
    --------
    >>> co.explain(problem, result, best).nlargest(5, "amount")
    """
    from pandas import DataFrame

    from cocap_opt.experiments.results.explained import Explained

    _require_problem(problem)
    own = _plan_of(plan)
    file = _required_bound(plan if certificate is None else certificate)
    if own is None:
        raise ValueError("plan: the result has no plan that could be explained")
    _require_flown("plan", check(problem, own))
    proved = ProvedBound.of(Model(problem, use_cache=False), file)
    explained = Explained.of(Verified.of(problem, own, bounds=[proved]))
    if explained is None:
        raise ValueError("certificate: it proves that there is no plan, so there is no gap")
    frame = DataFrame(explained.records)
    whole = ["step", "robot", "actor", "face", "robots", "used"]
    frame = frame.astype({**dict.fromkeys(whole, "Int64"), "price": "float64"})
    found = explained.explanation
    frame.attrs = {"bound": found.bound, "reward": found.reward, "difference": found.gap}
    return frame


def replans(problem: Problem, plan: Plan | Result) -> "pd.DataFrame":
    """Plan each drone again past all others, which keep their paths, and tell what that gains.

    Parameters
    ----------
    problem : that the plan is for
    plan : a plan that can be flown, or a result that has one

    Returns
    -------
    DataFrame
        A row per drone that has such a path, the largest gain first: `robot`, `gain` of J, `share`
        (of the plan's J), and the new `plan`. A gain is below 0 where the drone gives up a conflict
        for it. Where pixels add up over time, the path is not always the drone's best.

    Raises
    ------
    ValueError
        If the plan cannot be flown.

    Examples
    --------
    >>> better = co.replans(problem, result).plan[0]
    """
    from pandas import DataFrame

    from cocap_opt.coordination.replans import replans as replanned

    verdict = check(problem, plan)
    _require_flown("plan", verdict)
    own = _plan_of(plan)
    assert own is not None
    found = sorted(replanned(compiled(problem), own), key=lambda one: -one.gain)
    value = verdict.reward
    return DataFrame({
        "robot": [one.robot for one in found],
        "gain": [one.gain for one in found],
        "share": [one.gain / value if value > 0 else 0.0 for one in found],
        "plan": [one.plan for one in found],
    })  # fmt: skip


def _require_consistent(claim: Result) -> None:
    """Checks what a result says of its plan and bound, besides J."""
    bound = _bound_in(claim)
    for name in ("value", "bound"):
        _require(getattr(claim, name), name, "a number", int, float, np.number)
    if claim.reason is Reason.INFEASIBLE and bound is not None and not bound.proved < 0:
        raise ValueError("reason: the result claims that there is no plan; its file does not")
    if claim.plan is None and claim.value != -inf:
        raise ValueError(f"reward: the result claims {claim.value!r} and has no plan")
    if bound is not None and not claim.bound >= bound.proved - ROUNDING * abs(bound.proved):
        raise ValueError(f"bound: the result claims {claim.bound!r}, its file {bound.proved!r}")


def gap(
    scenes: str | Path | Problem | Sequence[str | Path | Problem],
    planners: Sequence[str] | None = None,
    seeds: Iterable[int] = (0,),
    *,
    time_limit: float = 60.0,
    work_limit: int | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
) -> "pd.DataFrame":
    """Measure planners against certified bounds: the gap table, as `cocap-opt gap` makes it.

    Planners are named, not called: a result is kept under its planner's name and the digest of this
    project's code, which says nothing of a function of one's own. `plan` and `bound` measure such
    a function on one problem.

    Parameters
    ----------
    scenes : names, files or problems; one, or several
    planners : names in `PLANNERS` or `EXACT`; if not given greedy, sequential, cocap, cocap-vs,
        cocap-lns, and with one or two drones joint
    seeds : of the scenes; a scene that is the same for several seeds is taken once, and so is a
        problem, whose seed is 0
    time_limit : seconds for each plan, and for each of the two bounds of a scene and seed
    work_limit : units of work for each of them: pricing rounds, or nodes of CoCap's tree. With it
        the table, but for its seconds, is the same on every machine that needs less than the time
        limit
    out : folder that keeps plans, certificates and results; what is there is not computed again
    workers : processes, each on a core of its own; this process if not given

    Returns
    -------
    DataFrame
        A row per scene, seed and planner, with the columns of `results.csv`, which
        `cocap-opt columns` explains. A value that does not exist is None or nan.

    Raises
    ------
    ValueError
        If there is no such scene or planner, a limit is negative, there are not so many cores,
        `out` cannot be used, or a script that takes `workers` has no line
        ``if __name__ == "__main__":``.
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet; else the rows so far are returned.

    Examples
    --------
    >>> co.gap(["corridor", "bottleneck"], ["sequential", "cocap"], seeds=range(3))
    """
    from pandas import DataFrame

    from cocap_opt.experiments.console.options import Option
    from cocap_opt.experiments.results.rows import Row
    from cocap_opt.experiments.sweeps.instances import Instance, Settings
    from cocap_opt.experiments.sweeps.scenes import Scenes
    from cocap_opt.experiments.sweeps.sweep import Hired, sweep

    # Before anything is computed; numbers of NumPy become plain ones.
    kept = out is not None or workers is not None
    settings = Settings(
        time_limit=time_limit, bound_time_limit=time_limit, work_limit=work_limit, kept=kept
    )
    _require_sweep(planners or ())
    hired = Hired(Option("workers").require_cores(workers), None, settings.cell_limit)
    if hired.workers is not None:
        _require_guard()
    if not isinstance(seeds, Iterable):
        raise ValueError(f"seeds: must be several, such as range(3), not {seeds!r}")
    whole = tuple(Option("seeds").require_whole(seed) for seed in seeds)
    given = [scenes] if isinstance(scenes, str | Path | Problem) else scenes
    if not isinstance(given, Iterable):
        raise ValueError(f"scenes: must be names, files or problems, not {scenes!r}")
    given = list(given)
    words = [str(scene) for scene in given if not isinstance(scene, Problem)]
    named = Scenes(words, whole, tell=_nobody)
    problems = [(problem, seed) for (_, seed), problem in named.problems.items()]
    problems += [(scene, 0) for scene in given if isinstance(scene, Problem)]
    names = [(problem.name, seed) for problem, seed in problems]
    if len(set(names)) < len(names):
        raise ValueError("scenes: two are called the same; give them other names")
    instances = [Instance(problem, seed, planners, settings) for problem, seed in problems]
    folder = None if out is None else Path(out)
    rows = sweep(instances, folder, hired, is_same=named.is_same, quiet=True)
    return DataFrame(Row.records(rows))


def trajectory(
    problem: Problem,
    plan: Plan | Result,
    *,
    smooth: bool = False,
    step: float | None = None,
    every: float | None = None,
) -> "pd.DataFrame":
    """Tell where each drone of a plan is at every moment, as `cocap-opt fly` writes it.

    Straight flights go from step to step at constant speeds. Smooth ones are at the same places at
    the steps and have continuous speed and acceleration; that they keep away from each other and
    from obstacles is proved for every moment. Rows are moments of the flight: straight lines
    between them are up to `attrs["off_between_rows"]` m beside it, and nothing is proved of those.

    Parameters
    ----------
    problem : that the plan is for
    plan : a plan that obeys the scene's rules, or a result that has one
    smooth : with continuous speed and acceleration
    step : seconds of a step, of problems that do not say it
    every : seconds between rows; else a row a step, and ten a step of smooth flights

    Returns
    -------
    DataFrame
        A row per drone and moment: `drone`, `t` (s since step 0), `x`, `y`, `z` (m, coordinates of
        the map), `yaw` (degrees, 0 along x, counter-clockwise, without jumps at a full turn),
        `pitch` (degrees, of the camera, 0 level, below is negative), `above_ground` where the map
        tells the ground, `above_takeoff` (over the map below the drone's start), and where the
        scene says it `latitude`, `longitude` (WGS 84), `above_sea` or `above_ellipsoid`. `attrs`
        has `step`, `reward`, `least_distance` (m, between two drones at any moment),
        `people_distance` (m, from a drone to the middle of a person, from above; None where there
        is nobody) and the like.

    Raises
    ------
    ValueError
        If the plan breaks a rule, nobody or two say how long a step lasts, or a drone cannot fly
        so, or the scene's place cannot be converted; one line.

    Examples
    --------
    >>> co.trajectory(problem, result, step=1.0, smooth=True)
    """
    from pandas import DataFrame

    flight = _flight(problem, plan, smooth, step)
    table = DataFrame(flight.columns(every))
    table.attrs = {**flight.record(), "off_between_rows": flight.off_between_rows(every)}
    return table


def robustness(
    problem: Problem,
    plan: Plan | Result,
    *,
    smooth: bool = False,
    step: float | None = None,
    late: Sequence[float] = (1.0, 2.0),
    aside: Sequence[float] = (1.0,),
    lag: Sequence[float] = (0.5, 1.0, 2.0),
) -> "pd.DataFrame":
    """Tell what is left of a plan when people are late, early or aside, or a drone lags.

    Nobody notices: all others fly as planned. Distances and rules are those of every moment, on
    the flights' polynomials; J is looked at between the steps, too.

    Parameters
    ----------
    problem : that the plan is for
    plan : a plan that obeys the scene's rules, or a result that has one
    smooth : with continuous speed and acceleration
    step : seconds of a step, of problems that do not say it
    late : s, by which all people are late, and early
    aside : m, by which all people walk to the left of where they would, and to the right
    lag : s, by which any one drone is late; the worst drone counts

    Returns
    -------
    DataFrame
        A row per change, the first is the plan: `change` (in words), `reward` (J), `share` (of
        the J of the flight as planned), `least_distance` (m, between two drones),
        `people_distance` (m, from above, where the scene asks for one), `rules` (kept, or to whom
        drones come too near; none where there is none between the steps). `attrs` has
        `delay_tolerance`, the seconds below which drones may be behind each other, and
        `delay_tolerance_to_people`, those below which they may be ahead of people or behind them;
        inf: any delay will do; None: the scene asks for no such distance, or there is nobody.

    Raises
    ------
    ValueError
        If the plan breaks a rule, nobody or two say how long a step lasts, a drone cannot fly so,
        or a change is none or longer than the flight; one line.

    Examples
    --------
    >>> co.robustness(problem, result, step=2.0, smooth=True, lag=[0.2, 1])
    """
    from pandas import DataFrame

    from cocap_opt.experiments.results.robustness import (
        Changes,
        tolerated_delay,
        tolerated_delay_of_people,
    )

    flight = _flight(problem, plan, smooth, step, is_local=True)
    table = DataFrame(Changes(late, aside, lag).rows(flight))
    table.attrs = {
        "delay_tolerance": tolerated_delay(flight),
        "delay_tolerance_to_people": tolerated_delay_of_people(flight),
    }
    return table


def benchmark(path: str | Path | None = None) -> "Benchmark":
    """Read how long exact methods take, and how good their bounds are, step by step.

    Parameters
    ----------
    path : file `solvers.csv` that `cocap-opt study steps --out DIR` has written; the one that is
        stored with this project if not given

    Returns
    -------
    Benchmark
        `table` has a row a run, `plot()` draws time and bound against the number of steps.

    Raises
    ------
    ValueError
        If the file cannot be read, or is no such table.

    Examples
    --------
    >>> co.benchmark().plot()
    """
    from cocap_opt.experiments.report.benchmark import Benchmark

    return Benchmark.read(_STORED if path is None else Path(path))


def show(
    problem: Problem, *plans: Plan | Result, certificate: Bound | CertifiedResult | None = None
) -> "Player":
    """Play plans side by side, inline in a notebook; `.save("plans.html")` writes the page.

    Parameters
    ----------
    problem : that the plans are for
    plans : plans, or results that have one, whose J is in their titles; without any the drones are
        shown at their starts
    certificate : a certificate, a proof or a result that has one, by which the player tells the
        bound, what is proved of each plan, and what is lost by leaving each step

    Returns
    -------
    Player

    Raises
    ------
    CertificateError
        If the certificate belongs to another problem, is not valid, or claims too low a bound.
    ValueError
        If a plan cannot be flown in this problem, or its file says that it is for another; one
        that breaks collision rules is shown.
    """
    from cocap_opt.experiments.report.explaining import gaps_of
    from cocap_opt.experiments.report.player import Player

    _require_problem(problem)
    known = [(given, own) for given in plans if (own := _plan_of(given)) is not None]
    for n, (given, own) in enumerate(known, 1):
        _require_made_for(f"plan {n}", given, problem)
        _require_flown(f"plan {n}", judge_plan(problem, own))
    gaps = []
    if certificate is not None and known:
        gaps = gaps_of(problem, [own for _, own in known], _required_bound(certificate))
    titled = [(_title(n, given), own) for n, (given, own) in enumerate(known, 1)]
    return Player(problem, titled, gaps)


def save(
    path: str | Path, content: Problem | Plan | Result | Bound, problem: Problem | None = None
) -> None:
    """Write a problem, a plan, a certificate or a proof to a file, whole or not at all.

    Parameters
    ----------
    path : the file; what is there is replaced
    content : what to write; of a result, its plan
    problem : the problem that a plan is for; a result knows it

    Raises
    ------
    FileError
        If the file cannot be written.
    ValueError
        If a plan comes without its problem, is for another or cannot be flown in it, or a result
        has no plan.
    """
    words = "a problem, a plan, a result, a certificate or a proof"
    _require(content, "content", words, Problem, Plan, Result, CertificateFile, ProofFile)
    if isinstance(content, Result):
        problem = content.problem if problem is None else problem
    document = (
        SceneFile(problem=content) if isinstance(content, Problem)
        else content if isinstance(content, CertificateFile | ProofFile)
        else _plan_file(content, problem)
    )  # fmt: skip
    document.save(Path(path))


def read(path: str | Path) -> Problem | Plan | Bound:
    """Read a file that this project has written: a scene, a plan, a certificate or a proof.

    Parameters
    ----------
    path : the file; `load` reads scenes of other kinds

    Returns
    -------
    Problem, Plan, CertificateFile or ProofFile
        Whatever the file holds. A plan knows which problem it was made for (`Plan.made_for`), and
        is refused as one for any other.

    Raises
    ------
    FileError
        If it is none of these, or is damaged; one line says what is wrong.
    """
    name = Path(path)
    found = decode_document(
        read_bytes(name), str(name), SceneFile, PlanFile, CertificateFile, ProofFile
    )
    if isinstance(found, SceneFile):
        return found.problem
    if isinstance(found, PlanFile):
        return found.plan.of_problem(found.digest)
    assert isinstance(found, CertificateFile | ProofFile)
    return found


# -- parts --------------------------------------------------------------------------------


def _require(value: object, name: str, allowed: str, *kinds: type) -> None:
    """Raises TypeError, in words, if a value is of none of these kinds."""
    if not isinstance(value, kinds) or isinstance(value, bool):
        raise TypeError(f"{name}: must be {allowed}, not {value!r}")


def _require_problem(problem: object) -> None:
    _require(problem, "problem", "a Problem; `load` makes one of a scene's name or file", Problem)


def _require_made_for(name: str, given: object, problem: Problem) -> None:
    """Raises ValueError if a plan was read from a file that says it is for another problem."""
    if isinstance(given, Plan) and given.made_for not in ("", problem_digest(problem)):
        raise ValueError(
            f"{name}: its file says that it was made for another problem (scene, seed, rules or "
            "objective); Plan(paths=plan.paths) is the same plan, made for none"
        )


def _require_flown(name: str, verdict: Verdict) -> None:
    """Raises ValueError if a plan cannot be flown."""
    if verdict.violations:
        raise ValueError(f"{name}: {verdict.violations[0]}")


def _named(kind: str, given: str | M, known: Mapping[str, M]) -> M:
    """The method itself, or the one of this name."""
    if callable(given) and not isinstance(given, str):
        return given
    if not isinstance(given, str) or given not in known:
        raise ValueError(f"{kind}: must be one of {', '.join(known)}, not {given!r}")
    return known[given]


def _whole(result: R, problem: Problem, method: object, clock: Clock) -> R:
    """The result with its problem, seconds and method, where it does not know them itself."""
    name = method if isinstance(method, str) else getattr(method, "__name__", "")
    _require(result, name or "method", "a callable that returns a Result", Result)
    return replace(
        result,
        problem=problem if result.problem is None else result.problem,
        seconds=result.seconds or clock.seconds,
        method=result.method or name,
    )


def _limits(seconds: float | None, stop: Stop) -> Stop:
    _require(stop, "stop", "a stopping criterion, such as WorkLimit(100)", Stop)
    if seconds is None:
        return stop
    _require(seconds, "time_limit", "a number of seconds >= 0", int, float, np.number)
    if not seconds >= 0:
        raise ValueError(f"time_limit: must be a number of seconds >= 0, not {seconds}")
    return FirstOf(stop, TimeLimit(seconds))


def _require_sweep(planners: Sequence[str]) -> None:
    from cocap_opt.experiments.console.options import Option

    if isinstance(planners, str):
        raise ValueError(f"planners: must be several names, such as [{planners!r}]")
    if not all(isinstance(name, str) for name in planners):
        raise ValueError("planners: must be names; measure a function by co.plan and co.bound")
    for name in planners:
        Option("planners").require_one_of(name, {**PLANNERS, **EXACT})


def _require_guard() -> None:
    """Refuses a script that each worker process would run from its first line on."""
    script = Path(str(getattr(sys.modules["__main__"], "__file__", "")))
    if script.suffix == ".py" and script.is_file() and "__main__" not in script.read_text():
        words = 'each worker imports your script; put its work under `if __name__ == "__main__":`'
        raise ValueError(f"workers: {words}")


def _nobody(message: str) -> None:
    """Discards the note on seeds that make the same scene; the table shows which were kept."""


def _flight(
    problem: Problem,
    plan: Plan | Result,
    smooth: bool,
    step: float | None,
    is_local: bool = False,
) -> "Flight":
    """Returns the flights of a plan; local ones know no place on the Earth."""
    from cocap_opt.experiments.results.flights import Flight

    _require_problem(problem)
    own = _plan_of(plan)
    if own is None:
        raise ValueError("plan: the result has no plan that could be flown")
    _require_made_for("plan", plan, problem)
    if problem.step is None and step is None:
        raise ValueError("step: must be given, for the problem does not say how long a step lasts")
    if problem.step is not None and step is not None:
        raise ValueError(f"step: must be left out, for the problem says it: {problem.step:g} s")
    timed = problem if step is None else problem.replace(step=step)
    return Flight.of(timed.replace(earth=None) if is_local else timed, own, smooth)


def _plan_of(given: Plan | Result | None) -> Plan | None:
    """Returns the plan, of a result its plan; its states may be plain tuples."""
    if given is None or isinstance(given, Result):
        return None if given is None else given.plan
    _require(given, "plan", "a Plan or a Result; `read` reads files of plans", Plan)
    try:
        return msgspec.convert(msgspec.to_builtins(given, enc_hook=_plain_number), Plan)
    except msgspec.ValidationError as error:
        raise ValueError(f"plan: {in_words(error, 'plan', Plan)}") from None


def _plain_number(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise msgspec.ValidationError(f"must hold states of whole numbers, not {value!r}")


def _title(number: int, given: Plan | Result) -> str:
    return f"{number}: J = {given.value:,.0f}" if isinstance(given, Result) else f"plan {number}"


def _plan_in(claim: Plan | Result | Bound) -> Plan | None:
    return _plan_of(claim) if isinstance(claim, Plan | Result) else None


def _bound_in(claim: Plan | Result | Bound) -> Bound | None:
    if isinstance(claim, CertifiedResult):
        return claim.certificate
    return None if isinstance(claim, Plan | Result) else claim


def _required_bound(claim: object) -> Bound:
    """Returns a certificate or a proof, of a result its own; refuses all else in words."""
    words = "a certificate, a proof, or a result that has one"
    _require(claim, "certificate", words, CertificateFile, ProofFile, CertifiedResult)
    assert isinstance(claim, CertificateFile | ProofFile | CertifiedResult)
    file = _bound_in(claim)
    if file is None:
        raise ValueError("certificate: the result has none")
    return file


def _require_checkable(claims: Sequence[Plan | Result | Bound], plans: Sequence[Plan]) -> None:
    """Refuses claims without a certificate, of which nothing or too little could be checked."""
    for claim in claims:
        if isinstance(claim, Result) and claim.bound != inf:
            whose = f"{claim.method}'s" if claim.method else "a result's"
            raise ValueError(f"claims: {whose} bound has no certificate; name its plan alone")
    if not plans:
        raise ValueError("claims: must hold a plan, a certificate or a proof")


def _plan_file(content: Plan | Result, problem: Problem | None) -> PlanFile:
    own = _plan_of(content)
    if own is None:
        raise ValueError("content: the result has no plan")
    if problem is None:
        raise ValueError("problem: a plan is written with the problem that it is for")
    _require_problem(problem)
    _require_made_for("plan", content, problem)
    verdict = judge_plan(problem, own)
    _require_flown("plan", verdict)
    planner = content.method if isinstance(content, Result) else ""
    return PlanFile(
        scene=problem.name, digest=problem_digest(problem), planner=planner,
        reward=verdict.reward, plan=own,
    )  # fmt: skip
