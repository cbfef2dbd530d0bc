"""Compares plans across takes: J in each take, the loss of a plan for one take in another, the cost
of hedging.

A plan for a single take is the best known plan if people are certain to walk that way. Like every
plan, it keeps its distance from the people of all takes, so each plan can be flown in each take.
"""

import html
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from cocap_opt.footage.quality import Quality
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.output.told_bounds import is_attained, told_gap
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.engine import run
from cocap_opt.stop import FirstOf, Limit, Stop, TimeLimit, never

if TYPE_CHECKING:
    import pandas as pd

HEDGED = "all takes"
_METHOD = "branch-and-price"


def reward_in(problem: Problem, plan: Plan) -> tuple[float, ...]:
    """Returns J of a plan in each take [K], by the referee; their weighted mean is J."""
    return tuple(check(problem.of_take(k), plan).reward for k in range(len(problem.takes)))


def take_rows(problem: Problem, plan: Plan | None) -> list[dict[str, Any]]:
    """Returns a row for each take, with J and the quality of a plan; empty without takes."""
    if plan is None or not problem.takes:
        return []
    found = Quality.of(problem, plan)
    return [
        {
            "take": take.name,
            "probability": take.probability,
            "reward": reward,
            "seen_by_two": _finite(summary.by_two),
            "seen_by_three": _finite(summary.by_three),
            "median_error": _finite(summary.median),
            "cameras": summary.line,
        }
        for take, reward, summary in zip(
            problem.takes, reward_in(problem, plan), found.by_take, strict=True
        )
    ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


class PlanForTake(NamedTuple):
    """The best known plan for one take, or for all of them.

    Attributes
    ----------
    made_for : name of the take, or "all takes"
    plan : the plan; None if none is known
    rewards : J in each take [K]
    mean : mean J over the takes
    bound : a proved bound on J in that take, or on average, of plans that are safe in all takes
    certificate : certificate of the bound; None if it has none
    problem : the problem of the certificate
    seconds : time of the search
    limit : the limit that ended the search before its plan was proved; None if none did
    """

    made_for: str
    plan: Plan | None
    rewards: tuple[float, ...]
    mean: float
    bound: float
    certificate: CertificateFile | ProofFile | None
    problem: Problem
    seconds: float
    limit: Limit | None = None


class Hedging(NamedTuple):
    """Plans for each take alone and a plan for all takes, each evaluated in every take.

    Attributes
    ----------
    problem : a problem with takes
    plans : the plan for each take [K]
    hedged : the best known plan on average over all takes
    """

    problem: Problem
    plans: tuple[PlanForTake, ...]
    hedged: PlanForTake

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each plan, with J in each take and on average; the last row has the bounds."""
        names = [take.name for take in self.problem.takes]
        rows: list[dict[str, Any]] = [
            {"plan for": row.made_for, **dict(zip(names, row.rewards, strict=True)),
             "on average": row.mean}
            for row in (*self.plans, self.hedged)
            if row.plan is not None
        ]  # fmt: skip
        bounds = dict(zip(names, (row.bound for row in self.plans), strict=True))
        return [*rows, {"plan for": "no plan has more than", **bounds,
                        "on average": self.hedged.bound}]  # fmt: skip

    @property
    def table(self) -> "pd.DataFrame":
        """The rows as a table."""
        from pandas import DataFrame  # takes long to import

        return DataFrame(self.rows)

    @property
    def foreknowledge(self) -> float:
        """Bound on the mean J if the take were known before planning: the mean of the takes'
        bounds.
        """
        both = zip(self.problem.takes, self.plans, strict=True)
        return math.fsum(take.probability * row.bound for take, row in both if take.probability)

    def sentences(self) -> Iterator[str]:
        """Yields sentences on the losses of plans for one take, and on the cost of hedging."""
        hedged, takes = self.hedged, self.problem.takes
        if hedged.plan is None:
            yield (
                "proved: no plan is safe in all takes"
                if self.hedged.bound < 0  # J never is
                else "no plan is known that is safe in all takes"
            )
            return
        for k, row in enumerate(self.plans):
            others = [i for i in range(len(takes)) if i != k and takes[i].probability]
            if row.plan is None or not others or not takes[k].probability:
                continue
            worst = max(others, key=lambda i: _loss(row.rewards[i], self.plans[i].rewards[i]))
            lost = _loss(row.rewards[worst], self.plans[worst].rewards[worst])
            yield (
                f'the plan for "{takes[k].name}" loses {100 * lost:.1f} % of J in '
                f'"{takes[worst].name}" compared with the plan made for it, and '
                f"{100 * _loss(row.mean, hedged.mean):.1f} % on average compared with the plan for "
                f"{HEDGED}"
            )
        for k, row in enumerate(self.plans):
            if row.plan is None or not takes[k].probability:
                continue
            cost = 100 * _loss(hedged.rewards[k], row.rewards[k])
            proved = _at_most(hedged.rewards[k], row.bound, 1)
            yield f'hedging costs {cost:.1f} % of J in "{takes[k].name}" ({proved})'
        cut_short = [row.made_for for row in (*self.plans, hedged) if row.limit is not None]
        if cut_short:
            yield (
                f"unfinished searches: {', '.join(cut_short)}; better plans may exist there, up to "
                "what is proved"
            )
        best = "" if is_attained(hedged.bound, hedged.mean) else "below "
        known = "as good as" if is_attained(self.foreknowledge, hedged.mean) else "below"
        yield (
            f"on average the plan for {HEDGED} is {best}the best such plan "
            f"({_at_most(hedged.mean, hedged.bound, 2)}), and {known} plans made for the take if "
            f"it were known ({_at_most(hedged.mean, self.foreknowledge, 1)})"
        )

    def __str__(self) -> str:
        with_digits = self.table.to_string(index=False, float_format=lambda x: f"{x:,.2f}")
        return "\n".join([with_digits, *self.sentences()])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        """Describes the comparison in a notebook."""
        return f"<pre>{html.escape(str(self))}</pre>"


def _loss(reward: float, of: float) -> float:
    """Returns the relative loss of J; 0 if there is nothing to lose."""
    return (of - reward) / of if of > 0 else 0.0


def _at_most(reward: float, bound: float, digits: int) -> str:
    """Returns words for the largest share of J that may be missing, by a bound."""
    if not math.isfinite(bound):
        return "no bound proved"
    if is_attained(bound, reward):
        return "proved, no plan is better"
    return f"proved: {told_gap(_loss(reward, bound), digits)}"


def if_sure(problem: Problem, k: int) -> Problem:
    """Returns the problem in which people are certain to walk as in one take.

    If drones keep a distance from people, those of the other takes remain, but nobody films them.
    """
    if not problem.airspace.people_aside:
        return problem.of_take(k)
    takes = tuple(take.replace(probability=float(i == k)) for i, take in enumerate(problem.takes))
    return problem.replace(takes=takes, name=problem.of_take(k).name)


def hedging(
    problem: Problem,
    seconds: float,
    stop: Stop = never,
    method: str = _METHOD,
    show: Callable[[str], None] = lambda name: None,
) -> Hedging:
    """Returns plans for each take alone and for all takes, each evaluated in every take, with
    certified bounds.

    Parameters
    ----------
    problem : a problem with takes
    seconds : time for each plan, including coverage
    stop : a further stopping criterion
    method : name of an exact method
    show : called with what is planned next
    """
    scenes = [if_sure(problem, k) for k in range(len(problem.takes))] + [problem]
    names = [*(take.name for take in problem.takes), HEDGED]
    results = []
    for name, scene in zip(names, scenes, strict=True):
        show(name)
        result = run(scene, method, FirstOf(TimeLimit(seconds), stop)).result
        results.append(result)
    known = list(dict.fromkeys(
        result.plan for result in results
        if result.plan is not None and check(problem, result.plan).valid
    ))  # fmt: skip
    worth = {plan: (*reward_in(problem, plan), check(problem, plan).reward) for plan in known}
    rows = []
    for k, (name, scene, result) in enumerate(zip(names, scenes, results, strict=True)):
        # If a search was cut short, another search may have found a better plan for its take.
        plan = max(known, key=lambda plan: worth[plan][k], default=None)
        rows.append(
            PlanForTake(
                made_for=name,
                plan=plan,
                rewards=() if plan is None else worth[plan][:-1],
                mean=-math.inf if plan is None else worth[plan][-1],
                bound=result.bound,
                certificate=result.certificate,
                problem=scene,
                seconds=result.seconds,
                limit=result.limit,
            )
        )
    return Hedging(problem, tuple(rows[:-1]), rows[-1])
