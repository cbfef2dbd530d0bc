"""Plans beside takes: J in each, what a plan for one loses in another, what hedging costs.

A plan for a take alone is the best one known if people are sure to walk so. It keeps away from the
people of all takes as every plan does, so that each plan can be flown in each take.
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
    """Returns J of a plan in each take [K], by the referee; their mean is J."""
    return tuple(check(problem.of_take(k), plan).reward for k in range(len(problem.takes)))


def take_rows(problem: Problem, plan: Plan | None) -> list[dict[str, Any]]:
    """Returns a row for each take, with J and the quality of a plan there; none without takes."""
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
    """The best plan that is known for one take, or for all of them.

    Attributes
    ----------
    made_for : name of the take, or "all takes"
    plan : the plan; None if none is known
    rewards : J in each take [K]
    mean : J on average over the takes
    bound : proved: no plan that is safe in all takes has more J in that take, or on average
    certificate : of the bound; None where it has none
    problem : that the certificate is of
    seconds : of the search
    limit : that ended the search before its plan was proved; None if none did
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
    """Plans for each take alone and a plan for all, each in every take.

    Attributes
    ----------
    problem : with takes
    plans : of each take [K]
    hedged : of all takes, the best on average that is known
    """

    problem: Problem
    plans: tuple[PlanForTake, ...]
    hedged: PlanForTake

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each plan, J in each take and on average; the last has what no plan exceeds."""
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
        from pandas import DataFrame  # slow to import

        return DataFrame(self.rows)

    @property
    def foreknowledge(self) -> float:
        """Bound on the mean J if the take is known before planning: of the takes' bounds."""
        both = zip(self.problem.takes, self.plans, strict=True)
        return math.fsum(take.probability * row.bound for take, row in both if take.probability)

    def sentences(self) -> Iterator[str]:
        """Yields in words what plans for one take lose, and what hedging costs."""
        hedged, takes = self.hedged, self.problem.takes
        if hedged.plan is None:
            yield "no plan is known that is safe in all takes"
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
        """Describes it in a notebook."""
        return f"<pre>{html.escape(str(self))}</pre>"


def _loss(reward: float, of: float) -> float:
    """Returns the share of J that is missing; none of nothing."""
    return (of - reward) / of if of > 0 else 0.0


def _at_most(reward: float, bound: float, digits: int) -> str:
    """Returns in words how large a share of J is missing at most, by a bound."""
    if not math.isfinite(bound):
        return "not proved by how much at most"
    if is_attained(bound, reward):
        return "proved, no plan is better"
    return f"proved: {told_gap(_loss(reward, bound), digits)}"


def if_sure(problem: Problem, k: int) -> Problem:
    """Returns the problem in which people are sure to walk as in one take.

    Where drones keep a distance to people, those of the other takes stay, whom nobody films.
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
    """Returns plans for each take alone and for all, each in every take, with certified bounds.

    Parameters
    ----------
    problem : with takes
    seconds : for each plan, the coverage included
    stop : a further stopping criterion
    method : an exact method
    show : told what is planned next
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
        # Of a search that was cut short another one may know a better plan.
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
