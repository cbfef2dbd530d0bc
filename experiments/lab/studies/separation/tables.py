"""The tables of separation in Markdown: its certified price, and the time of the planners."""

import math
from collections.abc import Iterable, Sequence
from statistics import fmean, median

from cocap_opt.experiments.lab.studies.separation.points import SeparationPoint, between
from cocap_opt.experiments.tables.statistics import NONE
from cocap_opt.output.printing import markdown_table
from cocap_opt.result import relative_gap
from cocap_opt.stop import NO_LIMIT
from cocap_opt.text import counted

_MUCH = 2  # in multiples of the time without a separation
_PLANNERS = ("cocap", "cocap-lns")


def separation_in_markdown(points: Sequence[SeparationPoint]) -> str:
    """Returns the table of prices and the table of times, with a sentence below each."""
    wide = sorted({point.separation for point in points if point.separation})
    scenes = list(dict.fromkeys(point.scene for point in points))
    of_scene = {scene: [point for point in points if point.scene == scene] for scene in scenes}
    metres = [f"{apart:g} m" for apart in wide]
    prices = [
        ["price of", *metres],
        *([scene, *(f"{_price(of_scene[scene], apart)} %" for apart in wide)] for scene in scenes),
    ]
    times = [
        ["time of", "scene", "no separation", *metres, "gap"],
        *(
            [f"`{planner}`", scene, *_times(of_scene[scene], planner, wide)]
            for planner in _PLANNERS
            for scene in scenes
        ),
    ]
    seeds = len({point.seed for point in points})
    return (
        f"{_table(prices)}\n\n"
        f"Means over {counted(seeds, 'seed')}, as a range where a proof was stopped.\n\n"
        f"{_table(times)}\n\n"
        "CPU time without a separation (median), and at each separation as a multiple of "
        f"it (geometric mean; **bold** above {_MUCH}); \\*: the limit stopped "
        "some runs, so the multiple is unreliable. The gap to the certified bound is "
        "the mean over all runs.\n\n"
        f"{_verdict(points)}\n"
    )


def _table(lines: Sequence[Sequence[str]]) -> str:
    heads, *rows = lines
    return markdown_table([dict(zip(heads, row, strict=True)) for row in rows])


def _price(points: Sequence[SeparationPoint], apart: float) -> str:
    """Returns the mean price of a separation in one scene."""
    ends = [point.price(point.base(points)) for point in points if point.separation == apart]
    return between(fmean(low for low, _ in ends), fmean(high for _, high in ends))


def _times(points: Sequence[SeparationPoint], planner: str, wide: Iterable[float]) -> list[str]:
    """Returns the cells of one planner in one scene: its time, the multiples, its mean gap."""
    base = [point for point in points if not point.separation]
    cells = [f"{median(_seconds(p, planner) for p in base):.2g} s{_star(base, planner)}"]
    for apart in wide:
        at = [point for point in points if point.separation == apart]
        ratio = _times_the_base(at, points, planner)
        words = f"{ratio:.1f}" if ratio < 9.95 else f"{ratio:,.0f}"
        cells.append((f"**{words}**" if round(ratio, 1) > _MUCH else words) + _star(at, planner))
    gap = fmean(relative_gap(_value(point, planner), point.bound) for point in points)
    return [*cells, f"{100 * gap:.2f} %" if math.isfinite(gap) else NONE]


def _times_the_base(
    apart: Sequence[SeparationPoint], points: Sequence[SeparationPoint], planner: str
) -> float:
    """Returns a planner's time divided by that without a separation, as a geometric mean.

    Parameters
    ----------
    apart : points at one separation
    points : all points, including those without a separation
    """
    ratios = [_seconds(p, planner) / _seconds(p.base(points), planner) for p in apart]
    return math.exp(fmean(map(math.log, ratios)))


def _verdict(points: Sequence[SeparationPoint]) -> str:
    """States how often each planner takes at most `_MUCH` times as long."""
    parts = []
    for planner in _PLANNERS:
        pairs = [(p, p.base(points)) for p in points if p.separation]
        ended = [
            _seconds(p, planner) / _seconds(base, planner) for p, base in pairs
            if _limit(base, planner) == NO_LIMIT
        ]  # fmt: skip
        kept = sum(ratio <= _MUCH for ratio in ended)
        parts.append(f"`{planner}` in {kept} of {len(ended)} runs")
    return (
        f"At most {_MUCH} times the time without a separation, if no limit stopped the latter: "
        f"{' and '.join(parts)}."
    )


def _star(points: Iterable[SeparationPoint], planner: str) -> str:
    """Returns a mark if a limit stopped a planner."""
    return "\\*" if any(_limit(point, planner) != NO_LIMIT for point in points) else ""


def _seconds(point: SeparationPoint, planner: str) -> float:
    return point.cocap_seconds if planner == "cocap" else point.lns_seconds


def _limit(point: SeparationPoint, planner: str) -> str:
    return point.cocap_limit if planner == "cocap" else point.lns_limit


def _value(point: SeparationPoint, planner: str) -> float:
    return point.cocap if planner == "cocap" else point.lns
