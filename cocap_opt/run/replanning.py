"""Replans the rest of a mission while it is flown, and computes a bound for all plans of the rest.

The search starts from the old rest, so its result is no worse; if a planner takes no start, or its
plan breaks a rule, the old rest is kept. Then a bound is computed by branch-and-price, which stops
once the plan is proved to be near enough.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.method import Method
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result
from cocap_opt.run.engine import BOUND_METHOD
from cocap_opt.run.judged import Judged
from cocap_opt.run.kept_share import run_keeping
from cocap_opt.run.options import Allowance
from cocap_opt.run.rest import Rest
from cocap_opt.run.view_share import keeps_share
from cocap_opt.stop import Clock, Stop, never

NEAR = 0.01  # gap (bound - J) / bound at which the search for a bound ends
BOUND_SECONDS = 30.0  # default time for the bound, in s

_KEPT = "the old rest is kept: nothing better was found"


@dataclass(frozen=True, repr=False)
class Replanned:
    """The rest of a mission, replanned.

    Attributes
    ----------
    problem : the scene of the whole mission
    plan : plan of the whole mission, with its first steps as they were flown; None if a drone is
        lost, because a plan needs states of all drones at all steps, or if the rest has no plan
    value : J of the whole mission: what was flown, and the rest; -inf without a plan of the rest
    rest : the plan of the rest, its J, its bound and the certificate, all for the scene of the rest
        (`rest.problem`), whose drones are `drones`
    from_step : k, the step at which the scene of the rest begins
    drones : numbers of the drones that still fly, in the order of the paths of the rest
    flown : J of the flown part, up to step k
    old : J of the old rest in the scene of the rest; None if it breaks a rule there
    fault : the rule that the old rest breaks, in words; empty if it breaks none
    bound_seconds : wall-clock time of the search for the bound, s; the time for the plan is in
        `rest`
    """

    problem: Problem
    plan: Plan | None
    value: float
    rest: CertifiedResult
    from_step: int
    drones: tuple[int, ...]
    flown: float
    old: float | None
    fault: str
    bound_seconds: float = 0.0

    def summary(self) -> str:
        """Describes the rest and its mission in a few lines."""
        old = f"no longer possible: {self.fault}" if self.old is None else f"{self.old:,.2f}"
        return "\n".join([
            f"from step {self.from_step}, drones {', '.join(map(str, self.drones))}",
            f"{'flown':8}{self.flown:,.2f}",
            f"{'old rest':8} {old}",
            self.rest.summary(),
        ])  # fmt: skip

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.rest!r}, from step {self.from_step})"


class Replanning:
    """Replans a rest: first the plan, then the bound.

    Parameters
    ----------
    rest : the rest to plan
    plan : the old plan of the whole mission

    Attributes
    ----------
    old : J of the old rest; None where it breaks a rule
    fault : the rule that the old rest breaks, in words; empty if it breaks none
    bound_seconds : wall-clock time of the search for the bound, s, once it has ended
    """

    def __init__(self, rest: Rest, plan: Plan) -> None:
        self.rest, self.bound_seconds = rest, 0.0
        self._old = rest.of_plan(plan)
        verdict = check(rest.scene, self._old)
        broken = (*verdict.violations, *verdict.conflicts)
        self.fault = _in_steps_of_mission(rest, plan, str(broken[0])) if broken else ""
        self.old = None if broken else verdict.reward

    def planned(
        self, method: str | Method[Any], stop: Stop, name: str, **options: Any
    ) -> Judged[Any]:
        """Returns a planner's plan of the rest, or the old rest if that is better.

        Parameters
        ----------
        stop : ends coverage and search
        options : options of `engine.run`
        """
        start = None if self.old is None else self._old
        judged = run_keeping(self.rest.scene, method, stop, name=name, start=start, **options)
        if self._is_worse(judged):
            judged = self._kept(name, judged)
        return _saying(judged, self.rest.message)

    def _is_worse(self, judged: Judged[Any]) -> bool:
        """Returns True if the old rest can be flown, and is better than a planner's plan."""
        if self.old is None:
            return False
        return not judged.valid or self._rank(judged.result.plan) < self._rank(self._old)

    def _rank(self, plan: Plan) -> tuple[bool, float]:
        """Returns a key that orders plans that obey the rules: those that reach the share come
        first.
        """
        return keeps_share(self.rest.scene, plan), check(self.rest.scene, plan).reward

    def _kept(self, name: str, judged: Judged[Any]) -> Judged[Any]:
        """Returns the old rest as the result of a planner's search that found nothing better."""
        found, reason = judged.result, judged.result.reason
        if reason in (Reason.INFEASIBLE, Reason.FAILED, Reason.UNSUPPORTED, Reason.OPTIMAL):
            reason = Reason.FINISHED if found.limit is None else Reason.STOPPED
        result = replace(found, plan=self._old, value=self.old, reason=reason, message=_KEPT)
        again = Judged.of(name, self.rest.scene, result)
        return again._replace(coverage_seconds=judged.coverage_seconds, views=judged.views)

    def bounded(
        self, judged: Judged[Any], seconds: float, stop: Stop = never, **options: Any
    ) -> Judged[CertifiedResult]:
        """Returns a plan of the rest with its bound, or a better plan found by the search for the
        bound.

        Parameters
        ----------
        judged : the plan; if there is none, a bound is computed nevertheless
        seconds : time for the bound; 0: compute none
        stop : a further stopping criterion
        options : options of `engine.run`
        """
        result, known = judged.result, _certified(judged.result)
        if not seconds or known.gap <= NEAR:  # exact methods give their own bound
            return judged._replace(result=known)
        start = result.plan if judged.valid else None
        clock = Clock()
        found = run_keeping(
            self.rest.scene, BOUND_METHOD, Allowance(seconds).begin(stop), start=start, gap=NEAR,
            **options,
        )  # fmt: skip
        self.bound_seconds = clock.seconds
        if found.valid and (start is None or self._rank(found.result.plan) > self._rank(start)):
            return _saying(
                found._replace(
                    result=replace(
                        found.result,
                        seconds=result.seconds,
                        coverage_seconds=result.coverage_seconds,
                    ),
                    coverage_seconds=judged.coverage_seconds,
                ),
                "; ".join(filter(None, (_better(judged), self.rest.message))),
            )
        proved = found.result
        # the result says that no plan reaches the share
        if start is not None and proved.plan is None:
            told = "; ".join(filter(None, (result.message, proved.message)))
            return judged._replace(result=replace(known, message=told))
        both = known
        if proved.bound < known.bound:
            both = replace(known, bound=proved.bound, certificate=proved.certificate)
        if proved.reason is Reason.INFEASIBLE:
            both = replace(both, reason=proved.reason, limit=None, message=proved.message)
        again = Judged.of(BOUND_METHOD, self.rest.scene, both)
        return again._replace(coverage_seconds=judged.coverage_seconds, views=judged.views)

    def answer(self, judged: Judged[CertifiedResult], name: str) -> Replanned:
        """Returns everything that is known about the rest and the mission.

        Parameters
        ----------
        name : name of the planner
        """
        rest, result = self.rest, judged.answer(self.rest.scene, name)
        return Replanned(
            problem=rest.mission,
            plan=None if result.plan is None else rest.joined(result.plan),
            value=rest.reward_flown + result.value,
            rest=result,
            from_step=rest.step,
            drones=rest.drones,
            flown=rest.reward_flown,
            old=self.old,
            fault=self.fault,
            bound_seconds=self.bound_seconds,
        )


def _in_steps_of_mission(rest: Rest, plan: Plan, words: str) -> str:
    """Returns the rule that a plan breaks in the mission, or the words for the rest if there is
    none.
    """
    robots = tuple(rest.mission.robots[i] for i in rest.drones)
    left = Plan(paths=tuple(plan.paths[i] for i in rest.drones))
    verdict = check(rest.mission.replace(robots=robots), left)
    broken = (*verdict.violations, *verdict.conflicts)
    return str(broken[0]) if broken else words


def _certified(result: Result) -> CertifiedResult:
    """Returns a result that may have a certificate."""
    if isinstance(result, CertifiedResult):
        return result
    return CertifiedResult(**{field.name: getattr(result, field.name) for field in fields(Result)})


def _saying(judged: Judged[Any], words: str) -> Judged[Any]:
    """Returns a result with an additional message, or unchanged if the message is empty."""
    if not words:
        return judged
    told = "; ".join(filter(None, (judged.result.message, words)))
    return judged._replace(result=replace(judged.result, message=told))


def _better(before: Judged[Any]) -> str:
    """Returns a message that the search for the bound found a better plan, and the J of the
    first.
    """
    words = "the search for the bound found a better plan"
    return f"{words} than the first, whose J is {before.reward:,.2f}" if before.valid else words
