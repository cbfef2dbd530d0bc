"""Figures of the paper's experiments, and the rewards per step that are stored for one of them."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cocap_opt.experiments.lab.results import load_csv
from cocap_opt.experiments.lab.studies.paper.conditions import (
    DRAWN,
    PUBLISHED,
    Corridor,
    Trial,
    planned,
)
from cocap_opt.experiments.lab.studies.paper.giving_way import Encounter
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.pictures.figures import MapFrame, draw_plan
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    FADED,
    GREEN,
    GREY,
    PURPLE,
    RED,
    SERIES,
    SMALL,
    TITLE,
    add_legend,
    draw_level,
    new_figure,
    set_frame,
    set_plain_log,
)  # fmt: skip
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check

CURVES = "curves.csv"
_COLOURS = {
    "greedy": FADED, "sequential": AMBER, "cocap": BLUE, "cocap-vs": GREEN,
    "sequential-rounds": RED, "cocap-lns": PURPLE,
}  # fmt: skip
_NAMES = {
    "greedy": "unconstrained (collides)", "sequential": "sequential",
    "cocap": "CoCap, value iteration", "cocap-vs": "CoCap, view search",
    "sequential-rounds": "sequential, then rounds", "cocap-lns": "cocap-lns",
}  # fmt: skip


class StepReward(NamedTuple):
    """The view reward of a plan at one step."""

    scene: str
    seed: int
    planner: str
    step: int
    reward: float  # sqrt(px/m2), or as the scene counts

    @classmethod
    def all_of(cls, problem: Problem, seed: int, planner: str, plan: Plan) -> list[Self]:
        """Returns the rewards of a plan at the steps 1..T."""
        rewards = check(problem, plan).reward_per_step
        return [cls(problem.name, seed, planner, t, r) for t, r in enumerate(rewards, start=1)]

    @classmethod
    def read(cls, path: Path) -> list[Self]:
        """Returns the rewards that are stored in a file."""
        return load_csv(path, cls, "paper")


Curves = dict[str, dict[int, list[float]]]  # rewards at the steps 1..T by planner and seed


def curves_of(rewards: Sequence[StepReward]) -> dict[str, Curves]:
    """Returns the curves of each scene."""
    found: dict[str, Curves] = {}
    for reward in sorted(rewards, key=lambda reward: reward.step):
        planners = found.setdefault(reward.scene, {})
        planners.setdefault(reward.planner, {}).setdefault(reward.seed, []).append(reward.reward)
    return found


def curves_figure(curves: Mapping[str, Curves]) -> Figure:
    """Draws mean rewards over seeds, a row per scene.

    On the left is the reward at each step, one standard deviation shaded; on the right the reward
    up to a step beside that of sequential planning on the same seeds, its bootstrap interval
    shaded.
    """
    figure = new_figure(9, 1 + 2.5 * len(curves))
    axes = figure.subplots(len(curves), 2, squeeze=False)
    for (left, right), (scene, planners) in zip(axes, curves.items(), strict=True):
        _draw_curves(left, planners)
        _draw_gains(right, planners)
        counts = sorted({len(rewards) for rewards in planners.values()})
        words = " to ".join(map(str, dict.fromkeys((counts[0], counts[-1]))))
        left.set_title(f"{scene} ({words} seeds)", fontsize=TITLE)
        left.set_ylabel("reward of a step")
        right.set_ylabel("reward so far (%)")
        for ax in (left, right):
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
            set_frame(ax)
    axes[0, 1].set_title("beside sequential planning", fontsize=TITLE)
    for ax in axes[-1]:
        ax.set_xlabel("step")
    add_legend(figure, axes[0, 0], columns=3)
    return figure


def _draw_curves(ax: Axes, planners: Curves) -> Axes:
    """Draws the mean and the spread of each planner's reward per step."""
    for planner, rewards in planners.items():
        if not rewards:
            continue
        values = np.array(list(rewards.values()))
        steps = np.arange(1, values.shape[1] + 1)
        mean, spread = values.mean(axis=0), values.std(axis=0, ddof=min(1, len(values) - 1))
        colour = _COLOURS.get(planner, "black")
        ax.fill_between(steps, mean - spread, mean + spread, color=colour, alpha=0.1, lw=0)
        ax.plot(steps, mean, color=colour, marker="o", ms=3, lw=1.6, label=_NAMES.get(planner))
    return ax


def _draw_gains(ax: Axes, planners: Curves) -> Axes:
    """Draws how much more each planner has up to a step than sequential planning, in %."""
    base = planners.get("sequential", {})
    for planner, rewards in planners.items():
        seeds = sorted(rewards.keys() & base.keys())
        if not seeds:
            continue
        total, of_base = (np.cumsum([r[s] for s in seeds], axis=1) for r in (rewards, base))
        gains = 100 * (total / np.where(of_base > 0, of_base, np.nan) - 1)
        steps = np.arange(1, gains.shape[1] + 1)
        means = [Mean.of(at_step[np.isfinite(at_step)].tolist() or [0.0]) for at_step in gains.T]
        colour = _COLOURS.get(planner, "black")
        ax.fill_between(steps, [m.low for m in means], [m.high for m in means], color=colour,
                        alpha=0.12, lw=0)  # fmt: skip
        ax.plot(steps, [m.value for m in means], color=colour, lw=1.6)
    return ax


def ablation_figure(effects: Mapping[str, Sequence[tuple[str, Mean]]]) -> Figure:
    """Draws what each part adds, a line per part, a mark with its interval per scene.

    Parameters
    ----------
    effects : by part, the scenes with what the part adds there
    """
    figure = new_figure(9.6, 1.2 + 0.62 * len(effects))
    ax = figure.subplots()
    scenes = list(dict.fromkeys(scene for means in effects.values() for scene, _ in means))
    colours = dict(zip(scenes, [*SERIES, "black"] * len(scenes), strict=False))
    for n, means in enumerate(effects.values()):
        for k, (scene, mean) in enumerate(means):
            ends = [[mean.value - mean.low], [mean.high - mean.value]]
            ax.errorbar([mean.value], [n + 0.12 * (k - len(means) / 2)], xerr=np.nan_to_num(ends),
                        fmt="D" if scene == scenes[-1] else "o", color=colours[scene], ms=4,
                        lw=1.3, label=scene if n == 0 else None)  # fmt: skip
    ax.axvline(0, color=GREY, lw=0.8)
    ax.set_yticks(range(len(effects)), list(effects), fontsize=SMALL)
    ax.invert_yaxis()
    ax.set_xscale("symlog", linthresh=0.1)
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_xlabel("adds to J, in % of the certified bound (mean and 95 % bootstrap interval)")
    set_frame(ax, "x")
    add_legend(figure, ax)
    return figure


def conditions_figure(trials: Sequence[Trial]) -> Figure:
    """Draws CoCap's gain over sequential planning on random corridors by each parameter."""
    drawn = planned([trial for trial in trials if trial.stage == DRAWN])
    names = Corridor._fields
    figure = new_figure(9, 6)
    panels = np.ravel(figure.subplots(2, math.ceil(len(names) / 2), sharey=True))
    for ax in panels[len(names) :]:
        ax.set_axis_off()
    for ax, name in zip(panels, names, strict=False):
        values = [getattr(trial.corridor, name) for trial in drawn]
        levels = sorted(set(values))
        gains = np.array([trial.gain() for trial in drawn])
        where = np.array([levels.index(value) for value in values])
        ax.plot(where, gains, "_", ms=14, mew=0.8, color=FADED, alpha=0.6)
        means = [gains[where == n].mean() for n in range(len(levels))]
        ax.plot(range(len(levels)), means, "D", ms=5, color=BLUE)
        draw_level(ax, PUBLISHED, f"published: {PUBLISHED:g}" if ax is panels[0] else "")
        ax.set_xticks(
            range(len(levels)), [str(level).removesuffix(".0") for level in levels], fontsize=SMALL
        )
        ax.set_xlabel(f"{name} (m)" if name in ("width", "length", "height") else name)
        set_frame(ax, "y")
    panels[0].set_yscale("symlog", linthresh=1)
    panels[0].set_ylim(min(0.0, *gains.tolist()) - 0.2, 2 * max(PUBLISHED, *gains.tolist()))
    panels[0].yaxis.set_major_formatter("{x:g}")
    for ax in panels[:: len(panels) // 2]:
        ax.set_ylabel("CoCap above sequential (%)")
    return figure


def encounter_figure(problem: Problem, encounter: Encounter, plans: Mapping[str, Plan]) -> Figure:
    """Draws several plans side by side at the step at which two drones would collide.

    Parameters
    ----------
    plans : by planner
    """
    frame = MapFrame.of(problem, plans.values())
    width, depth = frame.size
    height = 1.2 + 4.0 * depth / width
    figure = new_figure(4.6 * len(plans), height)
    for ax, (name, plan) in zip(np.ravel(figure.subplots(1, len(plans))), plans.items(),
                                strict=True):  # fmt: skip
        draw_plan(ax, problem, plan, encounter.step, frame)
        verdict = check(problem, plan)
        words = f", {len(verdict.conflicts)} conflicts" if verdict.conflicts else ""
        ax.set_title(f"{_NAMES.get(name, name)}\nJ = {verdict.reward:,.0f}{words}", fontsize=9)
    i, k = encounter.robots
    figure.suptitle(
        f"{problem.name}, seed {encounter.seed}, step {encounter.step}: drones {i} and {k}",
        fontsize=TITLE,
    )
    return figure


def scaling_figure(points: Mapping[str, Sequence[tuple[int, float, float]]]) -> Figure:
    """Draws time and reward against the number of drones, per planner.

    Parameters
    ----------
    points : by planner (drones, median seconds, mean reward in % of the certified bound
        without collisions)
    """
    figure = new_figure(9.6, 3.8)
    left, right = figure.subplots(1, 2)
    for planner, measured in points.items():
        robots, seconds, shares = zip(*measured, strict=True)
        style = {"color": _COLOURS.get(planner, "black"), "marker": "o", "ms": 3.5, "lw": 1.5}
        left.plot(robots, seconds, label=_NAMES.get(planner, planner), **style)
        right.plot(robots, shares, label=_NAMES.get(planner, planner), **style)
    set_plain_log(left, "y")
    left.set_ylabel("time, median (s)")
    right.set_ylabel("mean reward, of the bound\nwithout collisions (%)")
    for ax in (left, right):
        ax.set_xlabel("drones")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        set_frame(ax)
    add_legend(figure, left)
    return figure
