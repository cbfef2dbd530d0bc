"""Pictures of bounds: their curves, their progress, and their parts."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cocap_opt.experiments.lab.manual import one_face, worked
from cocap_opt.experiments.lab.manual.node_pictures import COLOURS
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    FADED,
    LABEL,
    PURPLE,
    RED,
    TEAL,
    TITLE,
    WIDTH,
    add_legend,
    draw_level,
    new_figure,
    set_frame,
)

_LEAST = 0.01  # % of the optimum, where the axis of reports begins


def draw_curves() -> Figure:
    """Draws what relaxations think that two drones with a share in one view see."""
    found = one_face.curves()
    figure = new_figure(WIDTH, 3.8)
    ax = set_frame(figure.add_subplot())
    ax.plot(found.share, found.concave, color=RED, lw=1.8, label="root of the mean (concave)")
    ax.plot(found.share, found.single_view, color=AMBER, lw=1.8, label="single-view cut")
    ax.plot(found.share, found.cut, color=PURPLE, lw=1.8, ls="--", label="envelope cut")
    least = np.minimum(np.minimum(found.concave, found.single_view), found.cut)
    ax.fill_between(found.share, least, color=TEAL, alpha=0.12, lw=0, label="allowed by all three")
    ax.plot((0, 0.5, 1), found.plans, "o", color="black", ms=6, label="plans", zorder=4)
    ax.set(xlabel="share of each of two drones in the view", ylabel="root of the face",
           xlim=(-0.02, 1.02), ylim=(0, 24))  # fmt: skip
    add_legend(figure, ax, columns=2)
    return figure


def draw_rounds() -> Figure:
    """Draws how far bound and plan are from the optimum, pricing round by pricing round.

    A hollow mark is at the optimum. Plans with less than half of the optimal J are left out: the
    search may begin with any plan.
    """
    example = worked.bottleneck()
    best = example.staged.target
    figure = new_figure(WIDTH, 3.5)
    ax = set_frame(figure.add_subplot())
    draw_level(ax, 1.15 * _LEAST, "the optimum")
    rounds = range(1, len(example.progress) + 1)
    for name, words, sign, mark, colour, size in (
        ("bound", "bound, above the optimum", 1, "o", BLUE, 5),
        ("value", "best plan, below it", -1, "s", AMBER, 8),
    ):
        known = [
            (k, max(sign * 100 * (getattr(told, name) - best) / best, _LEAST))
            for k, told in zip(rounds, example.progress, strict=True)
            if name == "bound" or told.value > best / 2
        ]
        ax.plot(*zip(*known, strict=True), "-", color=colour, marker=mark, ms=size, label=words,
                mfc="white" if known[0][1] == _LEAST else colour, mew=1.4, zorder=3 - sign / 2,
                clip_on=False)  # fmt: skip
        reached = [(k, gap) for k, gap in known if gap == _LEAST]
        ax.plot(*zip(*reached, strict=True), mark, mfc="white", mec=colour, ms=size, mew=1.4,
                zorder=3.2 - sign / 2, clip_on=False)  # fmt: skip
    ax.set(yscale="log", xlabel="reports of the search, in order", ylabel="% of the optimum",
           ylim=(_LEAST, 100), xlim=(0.5, len(rounds) + 0.5))  # fmt: skip
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.yaxis.set_major_formatter("{x:g}")
    add_legend(figure, ax)
    return figure


def draw_states_left() -> Figure:
    """Draws how many states a better plan may visit, step by step, stage by stage."""
    figure = new_figure(WIDTH, 3.5)
    ax = set_frame(figure.add_subplot())
    for stage, colour, mark in zip(worked.stages(), (FADED, AMBER, TEAL), "sDo", strict=False):
        steps = np.arange(1, len(stage.left))
        ax.plot(steps, stage.left[1:], mark, ms=8, color=colour, label=stage.words)
    ax.set(yscale="log", xlabel="step", ylabel="states", xticks=steps, ylim=(1, None))
    ax.yaxis.set_major_formatter("{x:,.0f}")
    add_legend(figure, ax)
    return figure


def draw_tangent() -> Figure:
    """Draws the root of a face, and what the doorway's certificate allows for it."""
    multipliers, t = worked.doorway_multipliers(), worked.doorway().horizon
    alpha, beta = multipliers.alpha[t][0], multipliers.beta[t][0]
    constant = worked.doorway_parts().faces.reshape(t + 1, -1)[t, 0]
    pixels = np.linspace(0, 620, 300)
    figure = new_figure(WIDTH, 3.5)
    ax = set_frame(figure.add_subplot())
    ax.plot(pixels, np.sqrt(pixels), color=BLUE, lw=2, label="the root")
    ax.plot(pixels, alpha * np.sqrt(pixels) + beta * pixels + constant, color=RED, lw=1.8,
            label="credits and constant")  # fmt: skip
    touch = 15.0**2 + 12.0**2
    ax.plot(touch, np.sqrt(touch), "o", color="black", label="the best plan's pixels")
    ax.set(xlabel="pixels on the front at step 3, all drones together (px/m2)", ylabel="reward",
           xlim=(0, 620), ylim=(0, 27))  # fmt: skip
    add_legend(figure, ax, columns=2)
    return figure


def draw_parts() -> Figure:
    """Draws the numbers that the doorway's bound is the sum of, above J of its best plan."""
    parts = worked.doorway_parts()
    pieces = [(f"front, step {t}", value, colour) for t, value, colour in zip(
        (1, 2, 3), parts.faces[parts.faces > 0], ("#b9cfe0", "#8fb2cd", BLUE), strict=True)
    ]  # fmt: skip
    pieces.append(("rule", parts.rows, AMBER))
    pieces += [(f"drone {i}", value, COLOURS[i]) for i, value in enumerate(parts.paths)]
    figure = new_figure(WIDTH, 2.3)
    ax = set_frame(figure.add_subplot(), "x")
    left = 0.0
    for words, value, colour in pieces:
        ax.barh(1, value, left=left, color=colour, edgecolor="white", label=words)
        left += value
    ax.barh(0, worked.planned(worked.doorway(), "joint").value, color=FADED)
    ax.set_yticks([0, 1], ["J of the best plan", "the bound"])
    add_legend(figure, ax, columns=3)
    return figure


def draw_losses() -> Figure:
    """Draws the loss of drones by each move, and the excess of the bound for each person."""
    explanation = worked.explained().explanation
    figure = new_figure(WIDTH, 3.8)
    top, bottom = figure.subplots(2, 1, sharex=True)
    people = worked.overestimates()
    for ax, amounts, noun in ((top, explanation.losses(), "drone"), (bottom, people, "person")):
        shares = 100 * amounts / explanation.bound
        ax.imshow(shares, cmap="OrRd", aspect="auto", vmin=0, vmax=max(shares.max(), 1e-9))
        for (row, step), share in np.ndenumerate(shares):
            if share >= 0.005:
                dark = share > 0.6 * shares.max()
                ax.text(step, row, f"{share:.2f}", fontsize=LABEL, ha="center", va="center",
                        color="white" if dark else "black")  # fmt: skip
        ax.set_yticks(range(len(shares)), [f"{noun} {i}" for i in range(len(shares))])
    bottom.set_xticks(range(people.shape[1]))
    bottom.set_xlabel("step")
    top.set_title("cost of the move after each step (% of the bound)", fontsize=TITLE)
    bottom.set_title("overestimate of a person's reward (% of the bound)", fontsize=TITLE)
    return figure


def draw_trade_off() -> Figure:
    """Draws the plans of a trade-off between J and views, and where it is proved that none is."""
    figure = new_figure(WIDTH, 3.5)
    worked.trade_off().plot(set_frame(figure.add_subplot(), grid=None))
    return figure
