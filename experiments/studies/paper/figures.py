"""Figures of the paper's experiments."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cocap_opt.data import FloatArray
from cocap_opt.experiments.report.figures import (
    draw_frame,
    draw_plan,
)
from cocap_opt.experiments.studies.paper.giving_way import Encounter
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check

_COLOURS = {
    "greedy": "#8d99ae", "sequential": "#edae49", "cocap": "#30638e", "cocap-vs": "#66a182",
}  # fmt: skip
_AROUND = 2.0  # m
_NAMES = {
    "greedy": "unconstrained (collides)", "sequential": "sequential",
    "cocap": "CoCap, value iteration", "cocap-vs": "CoCap, view search",
}  # fmt: skip


def curves_figure(curves: Mapping[str, Mapping[str, Sequence[Sequence[float]]]]) -> Figure:
    """Draws the mean reward per step over seeds, one standard deviation shaded, a panel per scene.

    Parameters
    ----------
    curves : by scene and planner, the reward at each step of each seed's plan
    """
    figure = Figure(figsize=(5.4 * len(curves), 3.8), layout="constrained", dpi=130)
    for ax, (scene, planners) in zip(np.ravel(figure.subplots(1, len(curves))), curves.items(),
                                     strict=True):  # fmt: skip
        _draw_curves(ax, planners)
        counts = sorted({len(rewards) for rewards in planners.values()})
        words = " to ".join(map(str, dict.fromkeys((counts[0], counts[-1]))))
        ax.set_title(f"{scene} ({words} seeds)", fontsize=10)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    return figure


def _draw_curves(ax: Axes, planners: Mapping[str, Sequence[Sequence[float]]]) -> Axes:
    """Draws the mean and the spread of each planner's reward per step."""
    for k, (planner, rewards) in enumerate(planners.items()):
        if not rewards:
            continue
        values = np.array(rewards)
        steps = np.arange(1, values.shape[1] + 1) + 0.06 * k  # side by side, not on each other
        mean, spread = values.mean(axis=0), values.std(axis=0, ddof=min(1, len(values) - 1))
        colour = _COLOURS.get(planner, "black")
        ax.fill_between(steps, mean - spread, mean + spread, color=colour, alpha=0.12, lw=0)
        ax.plot(steps, mean, color=colour, marker="o", ms=3, lw=1.6, label=_NAMES.get(planner))
    ax.set_xlabel("step")
    ax.set_ylabel("view reward (mean, ± 1 sd shaded)")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(alpha=0.25)
    draw_frame(ax)
    return ax


def encounter_figure(problem: Problem, encounter: Encounter, plans: Mapping[str, Plan]) -> Figure:
    """Draws several plans side by side at the step at which two drones would collide.

    Parameters
    ----------
    plans : by planner
    """
    low, high = _extent(problem, plans.values())
    height = 1.2 + 4.0 * (high[1] - low[1]) / (high[0] - low[0])
    figure = Figure(figsize=(4.6 * len(plans), height), layout="constrained", dpi=130)
    for ax, (name, plan) in zip(np.ravel(figure.subplots(1, len(plans))), plans.items(),
                                strict=True):  # fmt: skip
        draw_plan(ax, problem, plan, encounter.step)
        ax.set_xlim(low[0], high[0])
        ax.set_ylim(low[1], high[1])
        verdict = check(problem, plan)
        words = f", {len(verdict.conflicts)} conflicts" if verdict.conflicts else ""
        ax.set_title(f"{_NAMES.get(name, name)}\nJ = {verdict.reward:,.0f}{words}", fontsize=9)
    i, k = encounter.robots
    figure.suptitle(
        f"{problem.name}, seed {encounter.seed}, step {encounter.step}: drones {i} and {k}",
        fontsize=10,
    )
    return figure


def _extent(problem: Problem, plans: Iterable[Plan]) -> tuple[FloatArray, FloatArray]:
    """Returns the corners (m) of the part of the map where drones fly and people walk."""
    centre = problem.height_map.centre
    places = [centre(s.x, s.y) for plan in plans for path in plan.paths for s in path]
    places += [(float(x), float(y)) for actor in problem.actors for x, y in actor.poses[:, :2]]
    origin = np.array(problem.height_map.origin)
    end = origin + np.array(problem.height_map.shape) * problem.height_map.resolution
    low, high = np.min(places, axis=0) - _AROUND, np.max(places, axis=0) + _AROUND
    return np.maximum(low, origin), np.minimum(high, end)


def scaling_figure(points: Mapping[str, Sequence[tuple[int, float, float]]]) -> Figure:
    """Draws time and reward against the number of drones, per planner.

    Parameters
    ----------
    points : by planner (drones, median seconds, mean reward in % of the certified bound
        without collisions)
    """
    figure = Figure(figsize=(9.6, 3.8), layout="constrained", dpi=130)
    left, right = figure.subplots(1, 2)
    for planner, some in points.items():
        robots, seconds, shares = zip(*some, strict=True)
        style = {"color": _COLOURS.get(planner, "black"), "marker": "o", "ms": 3.5, "lw": 1.5}
        left.plot(robots, seconds, label=_NAMES.get(planner, planner), **style)
        right.plot(robots, shares, label=_NAMES.get(planner, planner), **style)
    left.set_yscale("log")
    left.set_ylabel("time, median (s)")
    right.set_ylabel("mean reward, of the bound\nwithout collisions (%)")
    for ax in (left, right):
        ax.set_xlabel("drones")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.grid(alpha=0.25, which="both")
    figure.legend(
        *left.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8
    )
    return figure
