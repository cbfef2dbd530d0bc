"""Findings on the evaluation of other projects, in sentences: reported rewards compared with J.

Sentences on all scenes come from reading their programs; sentences on one scene, from the numbers
stored with it.
"""

import math
from collections.abc import Iterator, Sequence

from cocap_opt.experiments.lab.studies.others.tables import Compared, signed_percent

_NAMED = 8  # most frames that a sentence lists
_THEIR_BEST = "their-multipleroundsgreedy"

# Findings on all scenes of a project.
ON_GREEDY_PERSPECTIVES = (
    "Greedy Perspectives: their coverage cache ignores whose camera asks, so that the reported "
    "rewards mix the drones' tilts; here each drone has its own.",
    "Their planner also gets 100 for each move with dx + dy = 0, which our reward does not "
    "include; their published means are over one row too many, a spurious 0.",
)
ON_HUGHES = (
    "Hughes et al.: their planners also get 0.02 for keeping the heading and 0.01 for keeping the "
    "cell, which our reward does not include. They have no rule against collisions, so bound and "
    "planners here have none either, and drones that share a cell are not in conflict.",
    "Their formation flies between the cells and starts in formation, not where the others start.",
    "In their published scene cluster the first two frames of ppa_evaluation.csv come from another "
    "version of their program.",
)


def findings(compared: Sequence[Compared], of_hughes: bool) -> list[str]:
    """Returns the findings on the scenes of one project."""
    general = ON_HUGHES if of_hughes else ON_GREEDY_PERSPECTIVES
    on_scene = _on_frames if of_hughes else _on_tilts
    sentences = [sentence for found in compared for sentence in on_scene(found)]
    return [*general, *sentences, *(_against_their_best(compared) if of_hughes else ())]


def _on_tilts(compared: Compared) -> Iterator[str]:
    """Yields the effect of their cache's tilts, and the difference of our evaluator."""
    for planner in compared.case.published.values():
        worth = compared.reward(planner.name)
        if worth is None or planner.reported is None:
            continue
        name, reported = compared.case.problem.name, math.fsum(planner.reported)
        if planner.own_tilts is None:
            yield f"{name}: their program reported {reported:,.1f}; J is {_than(worth, reported)}."
            continue
        by_own_tilts = math.fsum(planner.own_tilts)
        yield (
            f"{name}: their program reported {reported:,.1f}; by its own pixels with each drone's "
            f"own tilt, the reward is {_than(by_own_tilts, reported)}. Our J is "
            f"{_than(worth, by_own_tilts)} than that."
        )


def _on_frames(compared: Compared) -> Iterator[str]:
    """Yields the frames at which stored rewards are not those of the stored solutions."""
    name, agreeing, frames = compared.case.problem.name, [], compared.case.counted_steps
    for source in compared.case.published.values():
        rewards, planner = compared.by_us.get(source.name), source.name.removeprefix("their-")
        if rewards is None or source.reported is None:
            continue
        off = compared.off(source)
        if not off:
            agreeing.append(planner)
            continue
        worst = max(
            (abs(source.reported[t - 1] / rewards[t - 1] - 1) for t in off if rewards[t - 1]),
            default=math.inf,
        )
        yield (
            f"{name}: the stored rewards of {planner} are not those of its stored solution at "
            f"{_frames(off)} of {frames}, by up to {_percent(worst)}."
        )
    if agreeing:
        yield (
            f"{name}: the stored rewards of {', '.join(agreeing)} are those of the stored "
            f"solutions, at all {frames} frames."
        )


def _against_their_best(compared: Sequence[Compared]) -> Iterator[str]:
    """Yields on how many scenes each of our planners reaches their multi-round planner's reward."""
    scenes = [scene for scene in compared if scene.reward(_THEIR_BEST) is not None]
    ours = dict.fromkeys(
        row.planner
        for scene in scenes
        for row in scene.rows
        if row.planner not in scene.case.published
    )
    for planner in ours:
        above = [_above_their_best(scene, planner or "") for scene in scenes]
        least = min((share for share in above if share is not None), default=None)
        reached = sum(share is not None and share >= 0 for share in above)
        if least is not None:
            percent = signed_percent(100 * least)
            yield (
                f"{planner} reaches the reward of {_THEIR_BEST.removeprefix('their-')} on "
                f"{reached} of {len(scenes)} scenes; the smallest difference is {percent}."
            )


def _above_their_best(compared: Compared, planner: str) -> float | None:
    theirs, ours = compared.reward(_THEIR_BEST), compared.reward(planner)
    return None if ours is None or not theirs else ours / theirs - 1


def _than(value: float, other: float) -> str:
    """Describes by how much a value is higher or lower than another."""
    share = 100 * (value / other - 1)
    return f"{abs(share):.2f} % {'more' if share >= 0 else 'less'}"


def _percent(share: float) -> str:
    """Returns a share in %, with two digits if it is small."""
    return f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:,.0f} %"


def _frames(numbers: Sequence[int]) -> str:
    more = f" and {len(numbers) - _NAMED} more" if len(numbers) > _NAMED else ""
    return f"frames {', '.join(map(str, numbers[:_NAMED]))}{more}"
