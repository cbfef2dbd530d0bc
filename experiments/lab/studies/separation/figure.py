"""The figure of separation: its certified price, and the time that plans and proofs take."""

from collections.abc import Callable, Sequence
from itertools import cycle
from statistics import median

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cocap_opt.experiments.lab.studies.separation.points import SeparationPoint
from cocap_opt.pictures.style import (
    GREY,
    LABEL,
    MARKS,
    SERIES,
    WIDTH,
    add_legend,
    new_figure,
    set_frame,
    set_plain_log,
)  # fmt: skip


def separation_figure(points: Sequence[SeparationPoint]) -> Figure:
    """Draws the price of separation, and CPU times relative to those without a separation."""
    figure = new_figure(WIDTH, 7)
    (price, plan), (lns, proof) = figure.subplots(2, 2)
    scenes = list(dict.fromkeys(point.scene for point in points))
    for scene, *style in zip(scenes, cycle(SERIES), cycle(MARKS), strict=False):
        of_scene = [point for point in points if point.scene == scene]
        _draw_price(price, of_scene, scene, style)
        _draw_times(plan, of_scene, style, lambda point: point.cocap_seconds)
        _draw_times(lns, of_scene, style, lambda point: point.lns_seconds)
        _draw_times(proof, of_scene, style, lambda point: point.proof_seconds)
    price.set_title("certified price\n(% of J without it)", fontsize=LABEL)
    titles = {plan: "CoCap", lns: "cocap-lns", proof: "the proof, or its limit"}
    for ax, title in titles.items():
        ax.set_title(f"time of {title}\n(that without it is 1)", fontsize=LABEL)
        set_plain_log(ax, "y")
        ax.axhline(1, color=GREY, lw=0.8, ls=":")
    for ax in (price, plan, lns, proof):
        ax.set_xticks(sorted({point.separation for point in points if point.separation}))
        ax.xaxis.set_major_formatter("{x:g}")
        set_frame(ax)
    most = max(20, plan.get_ylim()[1])
    for ax in (plan, lns, proof):
        ax.set_ylim(0.2, most)
    for ax in (lns, proof):
        ax.set_xlabel("separation (m)")
    add_legend(figure, price, columns=3)
    return figure


def _draw_price(
    ax: Axes, points: Sequence[SeparationPoint], scene: str, style: Sequence[str]
) -> None:
    """Draws the median over seeds; the band shows the certified range of the price."""
    colour, mark = style
    wide = sorted({point.separation for point in points if point.separation})
    ends = [[p.price(p.base(points)) for p in points if p.separation == apart] for apart in wide]
    least = [median(low for low, _ in prices) for prices in ends]
    most = [median(high for _, high in prices) for prices in ends]
    ax.fill_between(wide, least, most, color=colour, alpha=0.2, lw=0)
    ax.plot(wide, [(a + b) / 2 for a, b in zip(least, most, strict=True)], color=colour,
            marker=mark, ms=6, lw=1.2, label=scene)  # fmt: skip


def _draw_times(
    ax: Axes,
    points: Sequence[SeparationPoint],
    style: Sequence[str],
    seconds: Callable[[SeparationPoint], float],
) -> None:
    """Draws the median over seeds of the time relative to that without a separation."""
    colour, mark = style
    wide = sorted({point.separation for point in points if point.separation})
    ratios = [
        median(seconds(p) / seconds(p.base(points)) for p in points if p.separation == apart)
        for apart in wide
    ]
    ax.plot(wide, ratios, color=colour, marker=mark, ms=6, lw=1.2)
