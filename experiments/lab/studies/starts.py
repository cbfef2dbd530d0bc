"""The value of start sets: proved optima from stated, random, greedy and best starts."""

from collections.abc import Iterator
from statistics import fmean
from typing import NamedTuple

from cocap_opt.experiments.lab.results import STORED, Results, load_csv, markdown
from cocap_opt.experiments.lab.studies.options import Out, Scenes, Seconds, Seeds
from cocap_opt.experiments.sweeps.start_choices import CHOICES, StartChoices
from cocap_opt.output.printing import Listing
from cocap_opt.problem import Problem
from cocap_opt.result import Reason
from cocap_opt.run.engine import BOUND_METHOD, run
from cocap_opt.run.options import Option
from cocap_opt.run.start_sets import FREE, RANDOM
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import TimeLimit

_TABLE = "starts.csv"


class Optimum(NamedTuple):
    """The best plan from one set of starts: a row of starts.csv."""

    scene: str
    seed: int
    starts: str
    number: int  # number of the set of random starts
    reward: float
    bound: float
    seconds: float
    reason: str


class _StartMean(NamedTuple):
    """Means over seeds of one scene and choice of starts."""

    scene: str
    starts: str
    share: float  # J as a share of the bound from any start, for the best of several sets
    average: float  # the same, mean over all sets
    seeds: int
    proved: int
    runs: int
    seconds: float

    @classmethod
    def all_of(cls, optima: list[Optimum]) -> "list[_StartMean]":
        """Returns the means, by scene and choice in the order of the rows."""
        bounds = {(row.scene, row.seed): row.bound for row in optima if row.starts == FREE}
        groups: dict[tuple[str, str], dict[int, list[Optimum]]] = {}
        for row in optima:
            groups.setdefault((row.scene, row.starts), {}).setdefault(row.seed, []).append(row)
        found = []
        for (scene, starts), by_seed in groups.items():
            rows = [row for of_seed in by_seed.values() for row in of_seed]
            best = [
                max(row.reward for row in of_seed) / bounds[scene, seed]
                for seed, of_seed in by_seed.items()
            ]
            every = [row.reward / bounds[scene, row.seed] for row in rows]
            proved = sum(row.reason == Reason.OPTIMAL for row in rows)
            seconds = fmean(row.seconds for row in rows)
            found.append(
                cls(
                    scene,
                    starts,
                    fmean(best),
                    fmean(every),
                    len(by_seed),
                    proved,
                    len(rows),
                    seconds,
                )
            )
        return found


def starts(
    *, scene: Scenes = None, seeds: Seeds = "0-9", limit: Seconds = 60.0, out: Out = None
) -> None:
    """Measures, prints means over seeds, and writes the optimum of each set (starts.csv)."""
    results, numbers = Results.into(out), Option("--seeds").numbers(seeds)
    optima = [
        optimum
        for name in scene or ["corridor", "bottleneck", "bridge"]
        for seed in numbers
        for optimum in optima_of(name, seed, load_scene(name, seed), limit)
    ]
    Listing(
        "best plans by where drones start, as shares of the bound from any start",
        [mean._asdict() for mean in _StartMean.all_of(optima)],
    ).print()
    results.save(_TABLE, optima)


def optima_of(scene: str, seed: int, problem: Problem, seconds: float) -> Iterator[Optimum]:
    """Finds the best plan from each set of starts of a scene.

    Parameters
    ----------
    seconds : time limit of each search
    """
    choices = StartChoices.of({(scene, seed): problem}, CHOICES)
    by_name = {(variant.name, key[1]): variant for key, variant in choices.problems.items()}
    ((_, group),) = choices.groups.items()
    for choice, names in group.items():
        for key in names:
            judged = run(by_name[key], BOUND_METHOD, TimeLimit(seconds))
            yield Optimum(
                scene, seed, choice, key[1] if choice == RANDOM else 0, judged.reward,
                judged.result.bound, judged.result.seconds, str(judged.reason),
            )  # fmt: skip


def stored_optima() -> list[Optimum]:
    """Returns the stored rows."""
    return load_csv(STORED / _TABLE, Optimum, "starts")


def starts_in_markdown() -> str:
    """Returns the stored means in Markdown: a row for each scene, in % of the proved bound."""
    means = _StartMean.all_of(stored_optima())
    table = []
    for scene in dict.fromkeys(mean.scene for mean in means):
        of = {mean.starts: mean for mean in means if mean.scene == scene}
        table.append(
            {
                "scene": scene,
                **{
                    choice: f"{100 * mean.share:.1f} %"
                    for choice, mean in of.items()
                    if choice != RANDOM
                },
                "random, on average": f"{100 * of[RANDOM].average:.1f} %",
                "random, best of ten": f"{100 * of[RANDOM].share:.1f} %",
                "proved": f"{sum(mean.proved for mean in of.values())} of "
                f"{sum(mean.runs for mean in of.values())}",
                "seconds, free": f"{of[FREE].seconds:.1f}",
            }
        )
    return markdown(table)
