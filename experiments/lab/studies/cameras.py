"""The price in J of two cameras on each person, and their effect on proofs.

Each scene is planned three times: for pixels alone, with views at their default weight, and with
views before all pixels. Each time, the recommended planner makes a plan, and branch-and-price
starts from it. Seconds and limits are CPU time, excluding coverage.
"""

import math
from collections.abc import Iterator, Sequence
from statistics import fmean, median
from typing import NamedTuple

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results, load_csv, markdown
from cocap_opt.experiments.lab.studies.options import Out, Scenes, Seconds, Seeds
from cocap_opt.experiments.lab.studies.runs import ProcessorLimit
from cocap_opt.footage.quality import Quality
from cocap_opt.model import compiled
from cocap_opt.output.printing import Listing, Record
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason, relative_gap
from cocap_opt.run.engine import BOUND_METHOD, run
from cocap_opt.run.front import Front
from cocap_opt.run.options import Option
from cocap_opt.scenarios import load_scene
from cocap_opt.text import counted
from cocap_opt.vision.default_weights import FIRST, with_views

_TABLE = "cameras.csv"
_SCENES = {"corridor": "0-4", "bottleneck": "0-9", "passage": "0-4", "field": "0-4"}
_PIXELS, _VIEWS = "pixels", "pixels and views"
_ASKED = (_PIXELS, _VIEWS, FIRST)


class AskedPlans(NamedTuple):
    """The plans and the bound of one scene and objective: a row of cameras.csv.

    J is without views, V with two cameras and a weight of 1, in all columns but the last five.
    """

    scene: str
    seed: int
    asked: str  # pixels, pixels and views, or first
    most: float  # the largest conceivable V
    reward: float  # J of the recommended planner's plan
    views: float  # V of it
    best_reward: float  # J of the best plan, which branch-and-price found
    best_views: float
    by_two: float  # share of person-steps that two drones see in that plan
    apart: float  # share that they see from at least 30 degrees apart
    weight: float  # weight of a view, mean over people; 0 without views
    planned: float  # value of the objective, for the recommended planner's plan
    value: float  # value of the objective, for the best plan
    bound: float
    seconds: float  # seconds of branch-and-price
    reason: str  # why branch-and-price ended

    @property
    def is_proved(self) -> bool:
        """True if the best plan is proved optimal."""
        return self.reason == Reason.OPTIMAL

    @property
    def most_proved(self) -> float:
        """The largest V of any plan that the bound allows, if views come before pixels.

        All people of these scenes have importance 1, so V is a whole number.
        """
        return min(self.most, math.floor(self.bound / self.weight))


def cameras(
    *, scene: Scenes = None, seeds: Seeds = "", limit: Seconds = 120.0, out: Out = None
) -> None:
    """Measures, prints, and writes the table (cameras.csv)."""
    results = Results.into(out)
    rows: list[AskedPlans] = []
    for name in scene or _SCENES:
        for seed in Option("--seeds").numbers(seeds or _SCENES.get(name, "0-4")):
            rows += _asked_plans(load_scene(name, seed), seed, limit)
            results.save(_TABLE, rows)  # after each scene, in case the study is stopped
    Listing("what two cameras on each person cost", _cost_rows(rows)).print()
    Listing("what they change in proofs", _proof_rows(rows)).print()


def _asked_plans(problem: Problem, seed: int, limit: float) -> Iterator[AskedPlans]:
    """Plans a scene for each objective; each method has the limit."""
    without = problem.replace(objective=problem.objective.replace(views=None))
    variants = {
        _PIXELS: without,
        _VIEWS: with_views(without),
        FIRST: with_views(without, weight=FIRST),
    }
    front = Front.of(without)
    for asked, variant in variants.items():
        compiled(variant).prepare_all()
        planned = run(variant, RECOMMENDED, ProcessorLimit(limit))
        stop = ProcessorLimit(limit)
        best = run(variant, BOUND_METHOD, stop, start=planned.result.plan)
        seconds, plans = stop.seconds, [planned.result.plan, best.result.plan]
        (reward, views), (best_reward, best_views) = (_values(front, plan) for plan in plans)
        seen = Quality.of(without, plans[1]).summary
        given = variant.objective.views
        weight = 0.0 if given is None else fmean(given.weights(len(problem.actors)))
        row = AskedPlans(
            problem.name, seed, asked, front.most_views, reward, views, best_reward, best_views,
            seen.by_two, seen.apart, weight, planned.reward, best.reward, best.result.bound,
            seconds, str(best.reason),
        )  # fmt: skip
        say(f"{problem.name} seed {seed}, {asked}: {row.reason} after {seconds:.1f} s")
        yield row


def _values(front: Front, plan: Plan) -> tuple[float, float]:
    """Returns J and V of a plan, which must obey the rules."""
    point = front.point(plan)
    if point is None:
        raise RuntimeError("the plan breaks a rule")
    return point.reward, point.views


def _by_scene(rows: Sequence[AskedPlans]) -> Iterator[tuple[str, dict[str, list[AskedPlans]]]]:
    """Yields the name of each scene, and its rows by objective, in the order of seeds."""
    order = [*_SCENES, *(row.scene for row in rows)]
    for name in sorted({row.scene for row in rows}, key=order.index):
        of_scene = [row for row in rows if row.scene == name]
        yield name, {asked: [row for row in of_scene if row.asked == asked] for asked in _ASKED}


def _cost_rows(rows: Sequence[AskedPlans]) -> list[Record]:
    """Returns the views of the recommended planner's plans, and the J given up for them."""
    found: list[Record] = []
    for name, groups in _by_scene(rows):
        best = [row.best_reward for row in groups[_PIXELS]]
        for asked, group in groups.items():
            lost = fmean(1 - row.reward / most for row, most in zip(group, best, strict=True))
            most = fmean(row.most_proved / row.most for row in groups[FIRST])
            found.append({
                "scene": name,
                "seeds": len(group),
                "asked": asked,
                "views (%)": 100 * fmean(row.views / row.most for row in group),
                "at most (%)": 100 * most,
                "less J (%)": 100 * lost,
                "below the bound (%)": 100 * fmean(
                    relative_gap(row.planned, row.bound) for row in group
                ),
                "by two (%)": 100 * fmean(row.by_two for row in group),
                "30 degrees apart (%)": 100 * fmean(row.apart for row in group),
            })  # fmt: skip
    return found


def _proof_rows(rows: Sequence[AskedPlans]) -> list[Record]:
    """Returns the numbers of proved optima with and without views, and their times."""
    found: list[Record] = []
    for name, groups in _by_scene(rows):
        both = [*zip(groups[_PIXELS], groups[_VIEWS], strict=True)]
        ratios = [b.seconds / a.seconds for a, b in both if a.is_proved and b.is_proved]
        found.append({
            "scene": name,
            "seeds": len(both),
            **{
                f"proved, {asked}": sum(row.is_proved for row in groups[asked])
                for asked in (_PIXELS, _VIEWS)
            },
            "seconds, pixels": median(a.seconds for a, _ in both),
            "seconds, pixels and views": median(b.seconds for _, b in both),
            "ratio": median(ratios) if ratios else math.nan,
            "largest gap (%)": 100 * max(relative_gap(b.value, b.bound) for _, b in both),
        })  # fmt: skip
    return found


def _stored() -> list[AskedPlans]:
    return load_csv(STORED / _TABLE, AskedPlans, "cameras")


def cost_in_markdown() -> str:
    """Returns the price of two cameras on each person, from stored plans."""
    return markdown([_short(row) for row in _cost_rows(_stored())])


def proofs_in_markdown() -> str:
    """Compares stored proofs with and without views, in Markdown."""
    return markdown([_short(row) for row in _proof_rows(_stored())])


def directions_in_words() -> str:
    """States how many person-steps two drones see, and from two directions, in stored plans."""
    plans = [row for row in _stored() if row.asked == _VIEWS]
    by_two, apart = (100 * fmean(getattr(row, key) for row in plans) for key in ("by_two", "apart"))
    return (
        f"With views at their default weight, two drones see {by_two:.1f} % of person-steps, the "
        f"mean over {counted(len(plans), 'plan')}, and {apart:.1f} % from at least 30 degrees apart"
    )


def _short(row: Record) -> Record:
    """Returns the cells of a row for pages."""
    return {key: f"{x:.2f}" if isinstance(x, float) else x for key, x in row.items()}
