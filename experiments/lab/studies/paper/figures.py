"""Figures of the paper's experiments, and the rewards per step that one of them needs."""

from collections.abc import Iterable, Mapping, Sequence
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
from cocap_opt.pictures.figures import draw_plan
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    FADED,
    GREEN,
    GREY,
    LABEL,
    MARKS,
    PURPLE,
    RED,
    SERIES,
    TITLE,
    WIDTH,
    add_legend,
    new_figure,
    set_frame,
    set_plain_log,
)  # fmt: skip
from cocap_opt.problem import Plan, Problem
from cocap_opt.problem.map_frame import MapFrame
from cocap_opt.referee import check
from cocap_opt.text import counted

CURVES = "curves.csv"
_HEADING, _MARK_ROW = 1.9, 0.125  # rows of a heading among marks, and inches of a row
_NEAR, _LEAST_HALF = 2.5, 5.0  # m, around an encounter, and at least from its middle
_COLOURS = {
    "greedy": FADED, "sequential": AMBER, "cocap": BLUE, "cocap-vs": GREEN,
    "sequential-rounds": RED, "cocap-lns": PURPLE,
}  # fmt: skip
_LINES = {"greedy": ":", "cocap-vs": "--", "sequential-rounds": "-.", "cocap-lns": (0, (6, 1))}
_NAMES = {
    "greedy": "unconstrained\n(collides)", "sequential": "sequential",
    "cocap": "CoCap,\nvalue iteration", "cocap-vs": "CoCap, view search",
    "sequential-rounds": "sequential,\nthen rounds", "cocap-lns": "cocap-lns",
}  # fmt: skip


class StepReward(NamedTuple):
    """The view reward of a plan at one step."""

    scene: str
    seed: int
    planner: str
    step: int
    reward: float  # px^0.5/m, or the unit of the scene's rewards

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
    """Draws the reward up to each step relative to sequential planning, a panel per scene.

    Lines are means over the seeds that both planners have; shaded areas are bootstrap intervals.
    """
    rows = len(curves) // 2 + 1  # the last panel, or half of a row, has the legend
    figure = new_figure(WIDTH, 0.3 + 1.9 * rows)
    panels = np.ravel(figure.subplots(rows, 2, squeeze=False))
    for ax, (scene, planners) in zip(panels, curves.items(), strict=False):
        _draw_gains(ax, planners)
        counts = sorted({len(rewards) for rewards in planners.values()})
        words = " to ".join(map(str, dict.fromkeys((counts[0], counts[-1]))))
        ax.set_title(f"{scene} ({words} seeds)", fontsize=LABEL)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        set_frame(ax)
    for ax in panels[len(curves) :]:
        ax.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    panels[len(curves)].legend(handles, labels, loc="center", fontsize=LABEL, frameon=False)
    figure.supxlabel("step", fontsize=LABEL)
    figure.supylabel("reward so far, above sequential planning (%)", fontsize=LABEL)
    return figure


def _draw_gains(ax: Axes, planners: Curves) -> Axes:
    """Draws how far each planner's reward up to a step is above sequential planning's, in %."""
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
        ax.plot(steps, [m.value for m in means], color=colour, lw=1.8, ls=_LINES.get(planner, "-"),
                label=_NAMES.get(planner, planner))  # fmt: skip
    return ax


def ablation_figure(effects: Mapping[str, Sequence[tuple[str, Mean]]]) -> Figure:
    """Draws what each part adds: a block per part, and a mark with an interval per scene.

    Parameters
    ----------
    effects : by part, the scenes with what the part adds there
    """
    scenes = list(dict.fromkeys(scene for means in effects.values() for scene, _ in means))
    block = 1 + _HEADING + len(scenes)  # rows
    figure = new_figure(WIDTH, 1.2 + _MARK_ROW * block * len(effects))
    ax = figure.subplots()
    styles = dict(zip(scenes, zip([*SERIES, "black"], MARKS, strict=True), strict=False))
    for n, (part, means) in enumerate(effects.items()):
        heading = part.splitlines()[-1]
        ax.text(0, n * block + _HEADING / 2, heading, fontsize=LABEL, va="center",
                transform=ax.get_yaxis_transform(), in_layout=False,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
        if n:
            ax.axhline(n * block - 0.5, color=FADED, lw=0.5)
        for scene, mean in means:
            ends = [[mean.value - mean.low], [mean.high - mean.value]]
            colour, mark = styles[scene]
            ax.errorbar([mean.value], [n * block + _HEADING + 0.5 + scenes.index(scene)],
                        xerr=np.nan_to_num(ends), fmt=mark, color=colour, ms=5.5, lw=1.6,
                        label=scene if n == 0 else None)  # fmt: skip
    ax.plot([0, 0], [0, 1], color=GREY, lw=0.8, zorder=0, transform=ax.get_xaxis_transform())
    ax.set(yticks=[], ylim=(block * len(effects) - 0.5, -0.5))
    ax.spines["left"].set_visible(False)
    ax.set_xscale("symlog", linthresh=0.1)
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_xlabel("adds to J, in % of the certified bound\n(mean and 95 % bootstrap interval)")
    set_frame(ax, "x")
    add_legend(figure, ax, columns=2)
    return figure


def conditions_figure(trials: Sequence[Trial]) -> Figure:
    """Draws CoCap's gain over sequential planning on random corridors by each parameter."""
    drawn = planned([trial for trial in trials if trial.stage == DRAWN])
    names = Corridor._fields
    rows = len(names) // 2 + 1  # the last panel, or half of a row, has the legend
    figure = new_figure(WIDTH, 2.0 * rows)
    panels = np.ravel(figure.subplots(rows, 2, sharey=True))
    for ax, name in zip(panels, names, strict=False):
        values = [getattr(trial.corridor, name) for trial in drawn]
        levels = sorted(set(values))
        gains = np.array([trial.gain() for trial in drawn])
        where = np.array([levels.index(value) for value in values])
        ax.plot(where, gains, "_", ms=14, mew=1.2, color=FADED, label="a corridor")
        means = [gains[where == n].mean() for n in range(len(levels))]
        ax.plot(range(len(levels)), means, "D", ms=7, color=BLUE, mec="white", label="their mean")
        ax.axhline(PUBLISHED, color=RED, lw=1.2, ls="--", label=f"published: {PUBLISHED:g} %")
        ax.set_xticks(range(len(levels)), [str(level).removesuffix(".0") for level in levels])
        ax.set_xlim(-0.5, len(levels) - 0.5)
        ax.set_xlabel(f"{name} (m)" if name in ("width", "length", "height") else name)
        set_frame(ax, "y")
    panels[0].set_yscale("symlog", linthresh=1)
    panels[0].set_ylim(min(0.0, *gains.tolist()) - 0.2, 2 * max(PUBLISHED, *gains.tolist()))
    panels[0].yaxis.set_major_formatter("{x:g}")
    for ax in panels[len(names) :]:
        ax.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    panels[len(names)].legend(handles, labels, loc="center", fontsize=LABEL, frameon=False)
    figure.supylabel("J of CoCap above sequential planning (%)", fontsize=LABEL)
    return figure


def encounter_figure(problem: Problem, encounter: Encounter, plans: Mapping[str, Plan]) -> Figure:
    """Draws several plans around two drones, at the step at which these would collide.

    Parameters
    ----------
    plans : by planner
    """
    frame = _around(problem, encounter, plans.values())
    width, depth = frame.size
    figure = new_figure(WIDTH, 1.28 + (WIDTH - 0.6) / len(plans) * depth / width)
    panels = figure.subplots(1, len(plans), sharex=True, sharey=True)
    for ax, (name, plan) in zip(np.ravel(panels), plans.items(), strict=True):
        draw_plan(ax, problem, plan, encounter.step, frame)
        verdict = check(problem, plan)
        words = counted(len(verdict.conflicts), "conflict")
        ax.set_title(f"{name}\nJ = {verdict.reward:,.0f}\n{words}", fontsize=LABEL)
        for robot in encounter.robots:
            state = plan.paths[robot][encounter.step]
            ax.plot(*problem.height_map.centre(state.x, state.y), "o", mfc="none", mec=AMBER,
                    mew=3, ms=19, zorder=7)  # fmt: skip
        ax.xaxis.set_major_locator(MaxNLocator(4, integer=True))
        ax.label_outer()
    i, k = encounter.robots
    words = f"{problem.name}, seed {encounter.seed}: drones {i} and {k} at step {encounter.step}"
    figure.suptitle(words, fontsize=TITLE)
    return figure


def _around(problem: Problem, encounter: Encounter, plans: Iterable[Plan]) -> MapFrame:
    """Returns the part of the map around two drones up to their encounter, in all plans."""
    paths = [plan.paths[robot] for plan in plans for robot in encounter.robots]
    places = [problem.height_map.centre(s.x, s.y) for p in paths for s in p[: encounter.step + 1]]
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    middle, half = (low + high) / 2, max(*(high - low) / 2 + _NEAR, _LEAST_HALF)
    return MapFrame(middle - half, middle + half)


def scaling_figure(points: Mapping[str, Sequence[tuple[int, float, float]]]) -> Figure:
    """Draws time and reward against the number of drones, per planner.

    Parameters
    ----------
    points : by planner (drones, median seconds, mean reward in % of the certified bound
        without collisions)
    """
    figure = new_figure(WIDTH, 5.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    for planner, measured in points.items():
        robots, seconds, shares = zip(*measured, strict=True)
        style = {"color": _COLOURS.get(planner, "black"), "marker": "o", "ms": 3.5, "lw": 1.5}
        top.plot(robots, seconds, label=_NAMES.get(planner, planner), **style)
        bottom.plot(robots, shares, label=_NAMES.get(planner, planner), **style)
    set_plain_log(top, "y")
    top.set_ylabel("time, median (s)")
    bottom.set_ylabel("mean reward, of the bound\nwithout collisions (%)")
    bottom.set_xlabel("drones")
    for ax in (top, bottom):
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        set_frame(ax)
    add_legend(figure, top, columns=2)
    return figure
