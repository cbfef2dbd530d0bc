"""The cost and the savings of view search's discount gamma, which CoCap's paper does not state."""

from collections.abc import Iterator, Sequence
from functools import partial
from statistics import fmean
from typing import NamedTuple

from cocap_opt.experiments.lab.results import STORED, Results, load_csv, markdown
from cocap_opt.experiments.lab.studies.options import Out, Scenes, Seconds, Seeds
from cocap_opt.method import Method
from cocap_opt.model import compiled
from cocap_opt.output.printing import Listing
from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.view_search import GAMMA, Compounded, Undiscounted, ViewSearch
from cocap_opt.result import Reason
from cocap_opt.run.engine import run
from cocap_opt.run.options import Option
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import TimeLimit

_TABLE = "gamma.csv"
_KEPT = (0.95, 0.98)  # shares of J for which the row with the fewest views is named
_GAMMAS = (0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.995, 1.0)
_ORDERS: dict[str, type[Compounded | Undiscounted]] = {
    "cocap-vs": Compounded,
    "cocap-vs-undiscounted": Undiscounted,
}


class DiscountedRun(NamedTuple):
    """A run of view search: a row of gamma.csv."""

    planner: str
    gamma: float
    scene: str
    seed: int
    reward: float  # J, as a share of CoCap's J with value iteration
    views: float  # evaluated states, as a share of reachable states
    seconds: float
    reason: str


class _GammaMean(NamedTuple):
    """Means over scenes and seeds of one planner and gamma."""

    planner: str
    gamma: float
    reward: float
    views: float
    seconds: float
    ended: int  # runs that no limit stopped
    runs: int

    @classmethod
    def all_of(cls, runs: Sequence[DiscountedRun]) -> "list[_GammaMean]":
        """Returns the means, by planner and gamma."""
        groups: dict[tuple[str, float], list[DiscountedRun]] = {}
        for measured in runs:
            groups.setdefault((measured.planner, measured.gamma), []).append(measured)
        return [cls.of(*key, groups[key]) for key in sorted(groups)]

    @classmethod
    def of(cls, planner: str, gamma: float, runs: Sequence[DiscountedRun]) -> "_GammaMean":
        """Returns the means of some runs."""
        return cls(
            planner, gamma, fmean(r.reward for r in runs), fmean(r.views for r in runs),
            fmean(r.seconds for r in runs), sum(r.reason == Reason.FINISHED for r in runs),
            len(runs),
        )  # fmt: skip


def gamma(
    *, scene: Scenes = None, seeds: Seeds = "0-4", limit: Seconds = 60.0, out: Out = None
) -> None:
    """Measures, prints means over scenes and seeds, and writes all runs (gamma.csv)."""
    results, numbers = Results.into(out), Option("--seeds").numbers(seeds)
    runs = [
        measured
        for name in scene or ["corridor", "bottleneck"]
        for seed in numbers
        for measured in discounted_runs(name, seed, _GAMMAS, limit)
    ]
    Listing(
        "view search by gamma: J and views, as shares of those of value iteration",
        [mean._asdict() for mean in _GammaMean.all_of(runs)],
    ).print()
    results.save(_TABLE, runs)


def discounted_runs(
    scene: str, seed: int, gammas: Sequence[float], seconds: float
) -> Iterator[DiscountedRun]:
    """Plans a scene with each order of view search and each gamma.

    Parameters
    ----------
    seconds : time limit of each run
    """
    problem = load_scene(scene, seed)
    compiled(problem).prepare_all()
    whole, reachable = run(problem, "cocap").reward, compiled(problem).reachable_views
    for planner, order in _ORDERS.items():
        for gamma in gammas:
            method = Method(partial(cocap, low_level=ViewSearch(order(gamma))))
            judged = run(problem, method, TimeLimit(seconds), name=planner)
            yield DiscountedRun(
                planner, gamma, scene, seed, judged.reward / whole,
                judged.result.statistics["evaluated"] / reachable, judged.result.seconds,
                str(judged.reason),
            )  # fmt: skip


def _stored_means() -> list[_GammaMean]:
    return _GammaMean.all_of(load_csv(STORED / _TABLE, DiscountedRun, "gamma"))


def gammas_in_markdown() -> str:
    """Returns the stored means in Markdown: J and views of both orders by gamma."""
    means = {(mean.planner, mean.gamma): mean for mean in _stored_means()}
    return markdown([
        {
            "gamma": f"{gamma:g}",
            **{
                f"{planner}: {title}": f"{100 * getattr(means[planner, gamma], key):.0f} %"
                for planner in _ORDERS
                for key, title in (("reward", "J"), ("views", "views"))
            },
        }
        for gamma in _GAMMAS
    ])  # fmt: skip


def chosen_in_words() -> str:
    """States the gamma of `cocap-vs`, and which stored runs keep much of J with few views."""
    most, nearly_all = (_fewest_views(_stored_means(), kept) for kept in _KEPT)
    return f"`cocap-vs` uses {GAMMA:g}. Among rows that keep {most}; among those with {nearly_all}."


def _fewest_views(means: Sequence[_GammaMean], kept: float) -> str:
    best = min((mean for mean in means if mean.reward >= kept), key=lambda mean: mean.views)
    return (
        f"{100 * kept:g} % of J, `{best.planner}` with {best.gamma:g} evaluates the fewest views, "
        f"{100 * best.views:.0f} %"
    )
