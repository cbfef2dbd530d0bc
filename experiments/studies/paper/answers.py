"""What the measurements say of the paper's claims, in sentences and tables.

A claim about a mean holds where its whole confidence interval is on the right side of the
line, does not hold where it is on the wrong side, and is otherwise left open.
"""

import math
from collections.abc import Callable, Sequence
from statistics import median

from cocap_opt.experiments.results.rows import Row, bound_is_proved, obeys
from cocap_opt.experiments.results.statistics import Mean, mean
from cocap_opt.experiments.results.tables import NONE, Table, grouped, interval, percent, values
from cocap_opt.experiments.studies.paper.giving_way import Encounter
from cocap_opt.result import relative_gap
from cocap_opt.stop import Limit

CLOSE = 1.0  # % below the bound without collisions that is called close to it
PUBLISHED = {"sequential": 482.0, "cocap": 3981.0, "cocap-vs": 2.7}  # s, their corridor, 8 steps
SOURCE = "Rauniyar, Corah, Scherer 2024 (arXiv 2412.20695)"
HOLDS, FAILS, OPEN = "holds", "does not hold", "is left open by so many seeds"


def verdict_below(found: Mean, line: float) -> str:
    """Whether a mean is below a line, as far as its interval says."""
    if found.high < line:
        return HOLDS
    return FAILS if found.low > line else OPEN


def verdict_above(found: Mean, line: float) -> str:
    """Whether a mean is above a line, as far as its interval says."""
    return verdict_below(
        Mean(-found.value, -found.high, -found.low, found.spread, found.size), -line
    )


def closeness(scene: str, rows: Sequence[Row]) -> str:
    """Does CoCap come close to unconstrained performance?

    What it is below the certified bound without collisions is an upper limit of what it loses;
    what it is below the best plan found without collisions is a lower one.
    """
    own = [row for row in rows if row["planner"] == "cocap"]
    planned = [row for row in own if obeys(row) and row["gap_free"] is not None]
    if not planned:
        return f"{scene}: CoCap has no plan that obeys the rules; the claim cannot be tried."
    found = mean(percent(planned, "gap_free"))
    least = mean([100 * relative_gap(row["reward"], row["optimum_free"]) for row in planned])
    words = verdict_below(found, CLOSE)
    if words != HOLDS:
        words = FAILS if verdict_below(least, CLOSE) == FAILS else OPEN
    if len(planned) < len(own):
        words = f"{OPEN}, as it has no plan on {len(own) - len(planned)} of {len(own)}"
    return (
        f"{scene}: CoCap is {_text(found)} below the certified bound of planning without "
        f"collisions, at most {max(percent(planned, 'gap_free')):.2f} %. That it comes within "
        f"{CLOSE:g} % of unconstrained performance {words} (mean over {found.size} seeds)."
    )


def against_sequential(scene: str, rows: Sequence[Row]) -> str:
    """Is CoCap better than sequential planning?"""
    pairs = _pairs(rows, "cocap", "sequential", lambda row: row["reward"] if obeys(row) else None)
    if not pairs:
        return f"{scene}: there is no seed on which both planners have a plan."
    found = mean([100 * (a - b) / b for a, b in pairs])
    return (
        f"{scene}: CoCap's reward is {_text(found)} above that of sequential planning on the same "
        f"seeds (better on {sum(a > b for a, b in pairs)}, worse on {sum(a < b for a, b in pairs)} "
        f"of {len(pairs)}). That it outperforms sequential planning {verdict_above(found, 0.0)}."
    )


def sequential_failures(scene: str, rows: Sequence[Row]) -> str:
    """When does sequential planning fail?"""
    collides = {row["seed"] for row in rows if row["planner"] == "greedy" and row["conflicts"]}
    own = [row for row in rows if row["planner"] == "sequential"]
    without = sum(not obeys(row) for row in own)
    parts = []
    for words, chosen in (("with", True), ("without", False)):
        some = [row for row in own if obeys(row) and (row["seed"] in collides) == chosen]
        gaps = percent(some, "gap")
        said = _text(mean(gaps)) if gaps else NONE
        parts.append(f"{said} on the {len(gaps)} seeds {words} collisions in the greedy plan")
    return (
        f"{scene}: below the best certified bound, sequential planning is {' and '.join(parts)}; "
        f"it finds no plan on {without} of {len(own)} seeds."
    )


def time_answer(scene: str, rows: Sequence[Row], coverage: float) -> str:
    """Is view search so much faster than value iteration?

    Value iteration needs the coverage of all states, which is computed before it; view search
    computes what it touches while it runs. So that is added here to the former's time.

    Parameters
    ----------
    coverage : s, of all states of one seed of the scene, on one thread
    """
    pairs = _pairs(rows, "cocap", "cocap-vs", lambda row: row["seconds"])
    if not pairs:
        return f"{scene}: not both low levels were timed."
    ours = [median(times) for times in zip(*pairs, strict=True)]
    log_ratio = mean([math.log((a + coverage) / b) for a, b in pairs if b > 0])
    ratio, low, high = (math.exp(log_ratio[k]) for k in range(3))
    theirs = PUBLISHED["cocap"] / PUBLISHED["cocap-vs"]
    reach = f" [{low:.2g}, {high:.2g}]" if log_ratio.size > 1 else ""
    return (
        f"{scene}: CoCap takes {ours[0]:.3f} s with value iteration, after {coverage:.3f} s for "
        f"the coverage of all states, and {ours[1]:.3f} s with view search (medians). The former "
        f"takes {ratio:.2g}{reach} times as long as the latter (geometric mean); published are "
        f"{theirs:,.0f} times. That view search is the faster one "
        f"{verdict_above(log_ratio, 0.0)} here."
    )


def scaling_answer(rows: Sequence[Row], limit: float) -> list[str]:
    """What more drones cost: a sentence per team size."""
    sentences = []
    for (scene,), some in grouped(rows, "scene").items():
        parts = []
        for planner in ("sequential", "cocap"):
            own = [row for row in some if row["planner"] == planner]
            gaps = percent([row for row in own if obeys(row)], "gap")
            stopped = sum(row["limit"] == Limit.TIME for row in own)
            words = f", stopped by the limit of {limit:g} s on {stopped}" if stopped else ""
            gap = f"{_text(mean(gaps))} below the bound" if gaps else "without a plan"
            parts.append(f"{planner} is {gap} on {len(gaps)} of {len(own)} seeds{words}")
        sentences.append(f"{scene}: {'; '.join(parts)}.")
    return sentences


def _pairs(
    rows: Sequence[Row], first: str, second: str, figure: Callable[[Row], float | None]
) -> list[tuple[float, float]]:
    """A figure of two planners on the seeds on which both have it."""
    found: dict[str, dict[int, float]] = {first: {}, second: {}}
    for row in rows:
        if row["planner"] in found and (number := figure(row)) is not None:
            found[row["planner"]][row["seed"]] = number
    common = sorted(found[first].keys() & found[second].keys())
    return [(found[first][seed], found[second][seed]) for seed in common]


def comparison_table(scene: str, rows: Sequence[Row]) -> Table:
    """Published seconds beside ours, and what only bounds can say."""
    table = []
    for planner in PUBLISHED:
        own = [row for row in rows if row["planner"] == planner]
        planned = [row for row in own if obeys(row)]
        table.append(
            {
                "scene": scene,
                "planner": planner,
                "published (s)": f"{PUBLISHED[planner]:g}" if scene == "corridor" else NONE,
                "ours (s)": interval(values(own, "seconds"), 3),
                "seeds": f"{len(planned)} of {len(own)}",
                "reward": interval(values(planned, "reward"), 0),
                "below the best bound (%)": interval(percent(planned, "gap"), 3),
                "below the free bound (%)": interval(percent(planned, "gap_free"), 3),
                "bound proved optimal": f"{sum(map(bound_is_proved, own))} of {len(own)}",
            }
        )
    return table


def giving_table(planner: str, some: Sequence[Encounter]) -> dict[str, str]:
    """How often the earlier and the later drone of an encounter gives way, and at what cost."""
    earlier = [100 * e.given_up[0] for e in some if e.earlier_gives_way]
    return {
        "planner": planner,
        "encounters": str(len(some)),
        "only the earlier flies elsewhere": str(sum(e.moved == (True, False) for e in some)),
        "only the later": str(sum(e.moved == (False, True) for e in some)),
        "both": str(sum(all(e.moved) for e in some)),
        "earlier gives up own reward": str(len(earlier)),
        "share given up (%)": interval(earlier, 2),
        "most (%)": f"{max(earlier):.2f}" if earlier else NONE,
    }


def _text(found: Mean) -> str:
    reach = f" [{found.low:.2f}, {found.high:.2f}]" if found.size > 1 else ""
    return f"{found.value:.2f} %{reach}"
