"""The cost and the savings of view search's discount gamma, of which CoCap's paper is silent."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cocap_opt.experiments.lab.stored_results import STORED
from cocap_opt.model import compiled
from cocap_opt.output.files import make_folder, save_csv
from cocap_opt.output.printing import Listing
from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.view_search import GAMMA, Compounded, Undiscounted, ViewSearch
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import TimeLimit

if TYPE_CHECKING:
    import pandas as pd

_TABLE = "gamma.csv"
_KEPT = (0.95, 0.98)  # shares of J for which it is asked what needs the fewest views
_GAMMAS = (0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.995, 1.0)
_ORDERS: dict[str, type[Compounded | Undiscounted]] = {
    "cocap-vs": Compounded,
    "cocap-vs-undiscounted": Undiscounted,
}


def gamma(
    scenes: Sequence[str], seeds: Sequence[int], seconds: float, out: Path | None = None
) -> None:
    """Measures, prints means over scenes and seeds, and writes all runs (gamma.csv).

    Parameters
    ----------
    seconds : time limit of each run
    """
    make_folder(out)
    measured = _measured(scenes, seeds, _GAMMAS, seconds)
    means = _means(measured).to_dict("records")
    Listing(
        "view search by gamma: J and views, as shares of those of value iteration", means
    ).print()
    if out is not None:
        save_csv(out / _TABLE, measured.to_dict("records"))


def _measured(
    scenes: Sequence[str], seeds: Sequence[int], gammas: Sequence[float], seconds: float
) -> "pd.DataFrame":
    """Plans scenes with each order of view search and each gamma.

    Parameters
    ----------
    seconds : time limit of each run

    Returns
    -------
    DataFrame
        A row per planner, gamma, scene and seed: `reward` (J as a share of CoCap's with value
        iteration), `views` (states evaluated as a share of those that are reachable), `seconds`
        and `reason`.
    """
    import pandas as pd

    rows = []
    for scene in scenes:
        for seed in seeds:
            problem = load_scene(scene, seed)
            compiled(problem).prepare_all()
            whole, reachable = cocap(problem), compiled(problem).reachable_views
            for planner, order in _ORDERS.items():
                for gamma in gammas:
                    run = _run(problem, order(gamma), seconds)
                    rows.append(
                        {
                            "planner": planner, "gamma": gamma, "scene": scene, "seed": seed,
                            "reward": run.value / whole.value,
                            "views": run.statistics["evaluated"] / reachable,
                            "seconds": run.seconds, "reason": str(run.reason),
                        }
                    )  # fmt: skip
    return pd.DataFrame(rows)


def _means(measured: "pd.DataFrame") -> "pd.DataFrame":
    """Returns means over scenes and seeds by planner and gamma, and how many runs ended in time."""
    groups = measured.groupby(["planner", "gamma"])
    table = groups[["reward", "views", "seconds"]].mean()
    table["ended"] = groups["reason"].agg(lambda reasons: int((reasons == "finished").sum()))
    table["runs"] = groups.size()
    return table.reset_index()


def gammas_in_markdown() -> str:
    """Returns the stored means in Markdown: J and views of both orders by gamma, and a note."""
    import pandas as pd

    means = _means(pd.read_csv(STORED / _TABLE)).set_index(["planner", "gamma"])
    rows = [
        {
            "gamma": f"{gamma:g}",
            **{
                f"{planner}: {title}": f"{100 * means.loc[(planner, gamma), key]:.0f} %"
                for planner in _ORDERS
                for key, title in (("reward", "J"), ("views", "views"))
            },
        }
        for gamma in _GAMMAS
    ]
    return Listing("", rows).markdown


def chosen_in_words() -> str:
    """Says which gamma `cocap-vs` takes, and which stored runs keep much of J for few views."""
    import pandas as pd

    means = _means(pd.read_csv(STORED / _TABLE))
    said = [_fewest_views(means[means["reward"] >= kept], kept) for kept in _KEPT]
    most, nearly_all = said
    return f"`cocap-vs` takes {GAMMA:g}. Of all rows that keep {most}; of those with {nearly_all}."


def _fewest_views(means: "pd.DataFrame", kept: float) -> str:
    best = means.loc[means["views"].idxmin()]
    return (
        f"{100 * kept:g} % of J, that of `{best['planner']}` with {best['gamma']:g} looks at the "
        f"fewest views, {100 * best['views']:.0f} %"
    )


def _run(problem: Problem, discount: Compounded | Undiscounted, seconds: float) -> Result:
    return cocap(problem, TimeLimit(seconds), low_level=ViewSearch(discount))
