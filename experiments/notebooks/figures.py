"""Figures of the notebooks. Each drawing function takes an axes and returns it."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from cocap_opt.check import Verdict
from cocap_opt.experiments.notebooks.tables import above, differences_by_person
from cocap_opt.experiments.report.figures import draw_frame
from cocap_opt.experiments.studies.paper.figures import COLOURS
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem

DARK = 0.6  # of the largest difference, from which on numbers on it are white
MARKERS = "osD^vPX"
LEAST = 100 * OPTIMALITY  # %, from which on a bound is called tight
EXTRA = {"optimum": "#d1495b"}  # colours of what is no planner


def draw_tightness(ax: Axes, found: Mapping[str, CertifiedResult], optimum: float) -> Axes:
    """How far each bound is above the optimum, against the time that it takes."""
    for k, (name, result) in enumerate(found.items()):
        height = max(above(result.bound, optimum), LEAST)
        ax.plot(
            result.seconds, height, marker=MARKERS[k % len(MARKERS)], ms=8, ls="", color=f"C{k}",
            mec="black", mew=0.5, zorder=3, label=name,
        )  # fmt: skip
    ax.axhline(LEAST, color="grey", lw=1, ls=":", zorder=1)
    ax.annotate(
        "called optimal", (0.01, LEAST), xycoords=("axes fraction", "data"), xytext=(0, 3),
        textcoords="offset points", fontsize=7.5, color="grey",
    )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.margins(0.08, 0.12)
    ax.legend(loc="lower left", bbox_to_anchor=(0.01, 0.14), fontsize=8, frameon=False)
    ax.set_xlabel("seconds")
    ax.set_ylabel("bound above the optimum (%)")
    ax.grid(alpha=0.25)
    return draw_frame(ax)


def draw_rewards(ax: Axes, verdicts: Mapping[str, Verdict]) -> Axes:
    """Reward per step of several plans."""
    for name, verdict in verdicts.items():
        steps = np.arange(1, len(verdict.reward_per_step) + 1)
        colour = {**COLOURS, **EXTRA}.get(name, "black")
        ax.plot(steps, verdict.reward_per_step, marker="o", ms=4, color=colour, label=name)
    ax.set_xlabel("step")
    ax.set_ylabel("view reward")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.legend(fontsize=8, frameon=False)
    ax.grid(alpha=0.25)
    return draw_frame(ax)


def draw_differences(ax: Axes, problem: Problem, plan: Plan, best: Plan) -> Axes:
    """Where a plan has less than a better one (red) and where more (blue), by person and step."""
    more = differences_by_person(problem, plan, best)[1:].T  # the start is the same for all
    most = float(np.abs(more).max(initial=1e-9))
    ax.imshow(more, cmap="RdBu", vmin=-most, vmax=most, aspect="auto")
    for (person, step), value in np.ndenumerate(more):
        colour = "white" if abs(value) > DARK * most else "black"
        words = f"{value:+,.0f}" if abs(value) >= 0.5 else "0"
        ax.text(step, person, words, ha="center", va="center", fontsize=8, color=colour)
    ax.set_xticks(range(more.shape[1]), [str(t + 1) for t in range(more.shape[1])])
    ax.set_yticks(range(more.shape[0]), [f"person {j}" for j in range(more.shape[0])])
    ax.set_xlabel("step")
    ax.tick_params(length=0)
    return ax
