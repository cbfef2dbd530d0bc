"""The tables and sentences of the study, made only from its rows."""

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from statistics import fmean
from typing import NamedTuple

import numpy as np

from cocap_opt.experiments.lab.results import markdown
from cocap_opt.experiments.lab.studies.quality.plans import is_good
from cocap_opt.experiments.lab.studies.quality.rows import PersonStep, PlanRow
from cocap_opt.experiments.tables.statistics import NONE
from cocap_opt.output.printing import Record
from cocap_opt.text import counted

_NEAR = 0.1  # largest difference of the median of measured over predicted from 1
_ANGLES = (0, 10, 30, 90)  # degrees
_COARSE = "tiny-"  # scenes whose cameras have 60 px of focal length
_LARGE = 100.0  # ratios above it say no more than that
_FEWEST = 5  # smallest number of different plans for a rank correlation

_Instance = tuple[str, int]


class _Agreement(NamedTuple):
    """Rank correlations of J with a quality, means over instances, for all and for good plans."""

    every: float
    good: float


_MEASURES: dict[str, Callable[[PlanRow], float]] = {
    "two views": lambda row: row.by_two,
    "two at 30 degrees": lambda row: row.apart,
    "accuracy": lambda row: -row.median,
}


def accuracy_rows(steps: Sequence[PersonStep]) -> list[Record]:
    """Returns, for each scene, ratios of measured to predicted errors: median, 10 and 90 %."""
    scenes = list(dict.fromkeys(_scene(step) for step in steps))
    return [
        {"scene": scene} | _ratios([step for step in steps if _scene(step) == scene])
        for scene in scenes
    ]


def angle_rows(steps: Sequence[PersonStep]) -> list[Record]:
    """Returns the same ratios by the angle between rays, for scenes with fine cameras."""
    rows: list[Record] = []
    for low, high in pairwise(_ANGLES):
        within = [
            step for step in _fine(steps) if low <= step.angle < high or step.angle == high == 90
        ]
        if within:
            rows.append({"angle": f"{low:g} to {high:g} degrees"} | _ratios(within))
    return rows


def agreement_rows(plans: Sequence[PlanRow]) -> list[Record]:
    """Returns, for each scene, the rank correlations of J with the qualities of a shoot."""
    rows: list[Record] = []
    fine = [plan for plan in plans if not plan.scene.startswith(_COARSE)]
    for scene in dict.fromkeys(plan.scene for plan in fine):
        of_scene = [plan for plan in fine if plan.scene == scene]
        found = _agreements(of_scene)
        if any(math.isfinite(part) for both in found.values() for part in both):
            row: Record = {"scene": scene}
            for kind in _Agreement._fields:
                for name, both in found.items():
                    row[f"{name}, {_KINDS[kind]}"] = _signed(getattr(both, kind))
            rows.append(row)
    return rows


_KINDS = {"every": "all", "good": "good"}


def choice_rows(plans: Sequence[PlanRow]) -> list[Record]:
    """Returns, for each scene, views by two in the plan with the largest J, and the most views."""
    rows: list[Record] = []
    for scene in dict.fromkeys(plan.scene for plan in plans):
        choices = [
            _Choice.of(group) for (name, _), group in _instances(plans).items() if name == scene
        ]
        if not scene.startswith(_COARSE):
            rows.append(
                {
                    "scene": scene,
                    "two views, plan of largest J": _percent(c.first.by_two for c in choices),
                    "two views, plan with most of them": _percent(c.best.by_two for c in choices),
                    "J of the latter": _percent(
                        (c.best.reward / c.first.reward for c in choices), 1
                    ),
                }
            )
    return rows


class _Choice(NamedTuple):
    """The plan of an instance with the largest J, and the plan with the most views by two."""

    first: PlanRow
    best: PlanRow

    @classmethod
    def of(cls, plans: Sequence[PlanRow]) -> "_Choice":
        """Returns both plans; of plans with equal views, the one with the larger J."""
        first = max(plans, key=lambda plan: plan.reward)
        return cls(first, max(plans, key=lambda plan: (plan.by_two, plan.reward)))


def sentences(steps: Sequence[PersonStep], plans: Sequence[PlanRow]) -> list[str]:
    """Returns sentences on the predicted error, and on what speaks for and against J."""
    return [*_on_accuracy(steps), *_on_objective(plans)]


def accuracy_in_markdown(steps: Sequence[PersonStep]) -> str:
    """Returns the tables of accuracy and the sentences below them."""
    parts = [
        markdown(accuracy_rows(steps)),
        markdown(angle_rows(steps)),
        _listed(_on_accuracy(steps)),
    ]
    return "\n\n".join(parts)


def objective_in_markdown(plans: Sequence[PlanRow]) -> str:
    """Returns the tables that compare J with quality, and the sentences below them."""
    parts = [
        markdown(agreement_rows(plans)),
        markdown(choice_rows(plans)),
        _listed(_on_objective(plans)),
    ]
    return "\n\n".join(parts)


def _on_accuracy(steps: Sequence[PersonStep]) -> list[str]:
    fine = _fine(steps)
    if not fine:
        return []
    ratio = _spread(step.measured / step.predicted for step in fine)
    middle = _spread(step.measured / step.middle for step in fine)
    posed = _spread(step.measured_posed / step.predicted_posed for step in fine)
    kept = [step.kept for step in fine]
    far = "at most" if abs(middle[1] - 1) <= _NEAR else "more than"
    said = [
        f"Over {counted(len(fine), 'person-step')}, the error of least squares is {_told(middle)} "
        f"times the reported error, that of the person's middle: the median is off by {far} "
        f"{100 * _NEAR:g} %. It is {_told(ratio)} times the error predicted for the joints "
        f"themselves, and {_told(posed)} times with errors of the poses.",
    ]
    if known := [step for step in fine if math.isfinite(step.library)]:
        library = _spread(step.library / step.measured for step in known)
        said.append(
            f"The library's linear method has {_told(library)} times the error of least squares."
        )
    less = [step.predicted_kept / step.predicted for step in fine if step.kept > 0]
    said.append(
        f"A drone counts if it sees 30 % of a person. In fact, {100 * fmean(kept):.0f} % of the "
        "joints are in two pictures with nothing in front of them. Their error is "
        f"{_told(_spread(less))} times that of joints which all counted drones see."
    )
    return said


def _on_objective(plans: Sequence[PlanRow]) -> list[str]:
    fine = [plan for plan in plans if not plan.scene.startswith(_COARSE)]
    found = _agreements(fine)
    groups = [group for group in _instances(fine).values() if len(_distinct(group)) >= _FEWEST]
    if not groups:
        return []
    good = [[plan for plan in group if is_good(plan.planner)] for group in groups]
    choices = [_Choice.of(group) for group in good if group]
    beaten = [choice for choice in choices if choice.best.by_two > choice.first.by_two]
    every, among = ({name: _signed(getattr(both, kind)) for name, both in found.items()}
                    for kind in _Agreement._fields)  # fmt: skip
    said = [
        f"For J: over all plans, bad ones included, ranks by J agree with those by two views "
        f"({every['two views']}), by two at 30 degrees ({every['two at 30 degrees']}) and by "
        f"accuracy ({every['accuracy']}; 1 is the same order, 0 none). Random and hovering "
        "drones, which see hardly anybody, account for much of this.",
        f"Against J: among plans that maximise J, the agreement is only {among['two views']}, "
        f"{among['two at 30 degrees']} and {among['accuracy']}. In {len(beaten)} of "
        f"{len(choices)} instances, another of these plans shows more person-steps to two "
        "drones than the plan of largest J.",
    ]
    if beaten:
        more = fmean(100 * (c.best.by_two - c.first.by_two) for c in beaten)
        price = fmean(100 * (1 - c.best.reward / c.first.reward) for c in beaten)
        left = fmean(100 * (1 - c.first.by_two) for c in choices)
        said.append(
            f"The gain is {more:.0f} % of all person-steps, and costs {price:.1f} % of J. On "
            "average over all instances, the plan of largest J leaves "
            f"{left:.0f} % of person-steps to one drone or none."
        )
    return said


def _ratios(steps: Sequence[PersonStep]) -> Record:
    """Returns the columns of the tables of accuracy."""
    return {
        "person-steps": len(steps),
        "predicted": _millimetres(float(np.median([step.predicted for step in steps]))),
        "measured / predicted": _told(_spread(s.measured / s.predicted for s in steps)),
        "measured / reported": _told(_spread(s.measured / s.middle for s in steps)),
        "library / least squares": _told(_spread(s.library / s.measured for s in steps)),
        "with pose errors": _told(_spread(s.measured_posed / s.predicted_posed for s in steps)),
        "joints kept": f"{100 * fmean(step.kept for step in steps):.0f} %",
    }


def _millimetres(length: float) -> str:
    """Returns a length with three digits, without an exponent."""
    return f"{float(f'{length:.3g}'):,g} mm"


def _spread(ratios: Iterable[float]) -> tuple[float, float, float]:
    """Returns 10 %, median and 90 % of the ratios that are not nan; nan if there are none."""
    known = [ratio for ratio in ratios if math.isfinite(ratio)]
    if not known:
        return math.nan, math.nan, math.nan
    low, middle, high = np.quantile(known, [0.1, 0.5, 0.9]).tolist()
    return low, middle, high


def _told(spread: tuple[float, float, float]) -> str:
    """Returns a median with 10 and 90 % in brackets."""
    if not math.isfinite(spread[1]):
        return NONE
    if spread[0] >= _LARGE:
        return f"above {_LARGE:g}"
    low, middle, high = (f"{x:.2f}" if x < _LARGE else f"above {_LARGE:g}" for x in spread)
    return f"{middle} ({low} to {high})"


def _scene(step: PersonStep) -> str:
    """Returns the scene's name; scenes with coarse cameras share one name."""
    return _COARSE.rstrip("-") if step.scene.startswith(_COARSE) else step.scene


def _fine(steps: Sequence[PersonStep]) -> list[PersonStep]:
    return [step for step in steps if not step.scene.startswith(_COARSE)]


def _instances(plans: Sequence[PlanRow]) -> dict[_Instance, list[PlanRow]]:
    """Returns the plans of each scene and seed."""
    groups: dict[_Instance, list[PlanRow]] = {}
    for plan in plans:
        groups.setdefault((plan.scene, plan.seed), []).append(plan)
    return groups


def _distinct(plans: Iterable[PlanRow]) -> list[PlanRow]:
    """Returns the plans without repetitions of plans with the same numbers."""
    return list({plan[3:]: plan for plan in plans}.values())


def _agreements(plans: Sequence[PlanRow]) -> dict[str, _Agreement]:
    """Returns the mean rank correlations over instances, by measure."""
    groups = _instances(plans).values()
    good = [[plan for plan in group if is_good(plan.planner)] for group in groups]
    return {
        name: _Agreement(
            *(_mean(_correlation(g, measure) for g in each) for each in (groups, good))
        )
        for name, measure in _MEASURES.items()
    }


def _correlation(plans: Iterable[PlanRow], measure: Callable[[PlanRow], float]) -> float:
    """Returns Spearman's rank correlation of J and a measure; nan if it is undefined."""
    from scipy.stats import spearmanr  # slow to import

    distinct = [plan for plan in _distinct(plans) if not math.isnan(measure(plan))]
    measured = [measure(plan) for plan in distinct]
    if len(distinct) < _FEWEST or len(set(measured)) == 1:
        return math.nan
    return float(spearmanr([plan.reward for plan in distinct], measured).statistic)


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return fmean(known) if known else math.nan


def _signed(value: float) -> str:
    return f"{value:+.2f}" if math.isfinite(value) else NONE


def _percent(shares: Iterable[float], digits: int = 0) -> str:
    return f"{100 * fmean(shares):.{digits}f} %"


def _listed(said: Sequence[str]) -> str:
    return "\n".join(f"- {sentence}" for sentence in said)
