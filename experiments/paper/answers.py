"""What the measurements say of the paper's claims, in sentences and tables.

A claim about a mean holds where its whole confidence interval is on the right side of the
line, does not hold where it is on the wrong side, and is otherwise left open.
"""

from collections.abc import Sequence
from statistics import median

from experiments.paper.giving_way import Encounter
from experiments.rows import Row
from experiments.statistics import Mean, mean
from experiments.tables import NONE, Table, interval, obeys

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
    """Does CoCap come close to unconstrained performance?"""
    gaps = _percent(rows, "cocap", "gap_free")
    if not gaps:
        return f"{scene}: CoCap has no plan that obeys the rules; the claim cannot be tried."
    found = mean(gaps)
    words = verdict_below(found, CLOSE)
    return (
        f"{scene}: CoCap is {_text(found)} below the certified bound of planning without "
        f"collisions, at most {max(gaps):.2f} %. That it comes within {CLOSE:g} % of "
        f"unconstrained performance {words} (mean over {found.size} seeds)."
    )


def against_sequential(scene: str, rows: Sequence[Row]) -> str:
    """Is CoCap better than sequential planning?"""
    reward = {
        planner: {row["seed"]: row["reward"] for row in rows
                  if row["planner"] == planner and obeys(row)}
        for planner in ("cocap", "sequential")
    }  # fmt: skip
    common = sorted(reward["cocap"].keys() & reward["sequential"].keys())
    if not common:
        return f"{scene}: there is no seed on which both planners have a plan."
    pairs = [(reward["cocap"][seed], reward["sequential"][seed]) for seed in common]
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
        gaps = [
            100 * row["gap"]
            for row in own
            if obeys(row) and row["gap"] is not None and (row["seed"] in collides) == chosen
        ]
        said = _text(mean(gaps)) if gaps else NONE
        parts.append(f"{said} on the {len(gaps)} seeds {words} collisions in the greedy plan")
    return (
        f"{scene}: below the best certified bound, sequential planning is {' and '.join(parts)}; "
        f"it finds no plan on {without} of {len(own)} seeds."
    )


def time_answer(scene: str, rows: Sequence[Row]) -> str:
    """Is view search so much faster than value iteration?"""
    seconds = {name: _seconds(rows, name) for name in PUBLISHED}
    if not all(seconds.values()):
        return f"{scene}: not all planners were timed."
    ours = {name: median(values) for name, values in seconds.items()}
    theirs = PUBLISHED["cocap"] / PUBLISHED["cocap-vs"]
    ratio = ours["cocap"] / ours["cocap-vs"]
    words = HOLDS if ratio > 1 else FAILS
    return (
        f"{scene}: CoCap takes {ours['cocap']:.3f} s with value iteration and "
        f"{ours['cocap-vs']:.3f} s with view search (medians; coverage, which the former needs of "
        f"all states, is computed before), a ratio of {ratio:.2g}; published are {theirs:,.0f}. "
        f"That view search is the faster one {words} here."
    )


def comparison_table(scene: str, rows: Sequence[Row]) -> Table:
    """Published seconds beside ours, and what only bounds can say."""
    table = []
    for planner in PUBLISHED:
        own = [row for row in rows if row["planner"] == planner]
        gaps = _percent(own, planner, "gap")
        rewards = [row["reward"] for row in own if obeys(row)]
        seconds = _seconds(own, planner)
        table.append(
            {
                "scene": scene,
                "planner": planner,
                "published (s)": f"{PUBLISHED[planner]:g}" if scene == "corridor" else NONE,
                "ours, median (s)": f"{median(seconds):.3f}" if seconds else NONE,
                "reward": interval(rewards, 0),
                "below the best bound (%)": interval(gaps, 3),
                "below the free bound (%)": interval(_percent(own, planner, "gap_free"), 3),
                "bound proved optimal": f"{sum(r['bound_reason'] == 'optimal' for r in own)} "
                f"of {len(own)}",
            }
        )
    return table


def giving_table(planner: str, some: Sequence[Encounter]) -> dict[str, str]:
    """How often the earlier and the later drone of an encounter gives way, and at what cost."""
    earlier = [100 * e.given_up[0] for e in some if e.earlier_gives_way]
    return {
        "planner": planner,
        "encounters": str(len(some)),
        "earlier drone flies elsewhere": str(sum(e.moved[0] for e in some)),
        "later drone flies elsewhere": str(sum(e.moved[1] for e in some)),
        "earlier gives up own reward": str(len(earlier)),
        "share given up (%)": interval(earlier, 2),
        "most (%)": f"{max(earlier):.2f}" if earlier else NONE,
    }


def _percent(rows: Sequence[Row], planner: str, key: str) -> list[float]:
    return [
        100 * row[key]
        for row in rows
        if row["planner"] == planner and obeys(row) and row[key] is not None
    ]


def _seconds(rows: Sequence[Row], planner: str) -> list[float]:
    own = (row for row in rows if row["planner"] == planner)
    return [row["seconds"] for row in own if row["seconds"] is not None]


def _text(found: Mean) -> str:
    reach = f" [{found.low:.2f}, {found.high:.2f}]" if found.size > 1 else ""
    return f"{found.value:.2f} %{reach}"
