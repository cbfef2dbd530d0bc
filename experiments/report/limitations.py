"""Limitations of the results of a sweep, derived from the results themselves."""

from collections.abc import Iterator, Mapping, Sequence

from cocap_opt.experiments.sweeps.cells import FAILED
from cocap_opt.experiments.sweeps.results import RunFile
from cocap_opt.experiments.tables.rows import SAMPLED_COVERAGE, GapRow
from cocap_opt.experiments.tables.statistics import ENOUGH
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import CollisionRules

_ALWAYS = (
    "Rewards come from the coverage model: the area of a face's projection, clipped to the image, "
    "minus what columns, convex meshes and other people hide of it. Bounds and optima hold for "
    "these numbers; they are not measurements of a real camera's image.",
    "People and obstacles are given and known in advance: people do not avoid drones, and no drone "
    "is late.",
    "Certificates cover rounding errors in the bound, but not in the coverage.",
)


def limitations(
    rows: Sequence[GapRow], run: RunFile, rules: Mapping[str, CollisionRules]
) -> list[str]:
    """Returns sentences; those about these results come before those about all results.

    Parameters
    ----------
    rules : collision rules of the scenes whose files are in the folder, by the scenes' names
    """
    return [
        *_of_coverage(rows),
        *_of_seeds(rows),
        *_of_bounds(rows),
        *_of_plans(rows),
        *_of_rules(rules),
        *_of_times(run),
        *_ALWAYS,
    ]


def _of_coverage(rows: Sequence[GapRow]) -> Iterator[str]:
    scenes = dict.fromkeys(row.scene for row in rows if row.coverage == SAMPLED_COVERAGE)
    if scenes:
        yield (
            f"In {', '.join(scenes)}, coverage behind meshes that are not convex is sampled with "
            "rays; the gaps do not include the sampling error."
        )


def _of_seeds(rows: Sequence[GapRow]) -> Iterator[str]:
    seeds = {
        scene: len({row.seed for row in rows_of_scene})
        for (scene,), rows_of_scene in GapRow.grouped(rows, "scene").items()
    }
    single = [scene for scene, count in seeds.items() if count == 1]
    few = [scene for scene, count in seeds.items() if 1 < count < ENOUGH]
    if single:
        yield f"{', '.join(single)}: one seed only, a single case."
    if few:
        yield f"{', '.join(few)}: fewer than {ENOUGH} seeds, too few for intervals."
    if len(single) + len(few) < len(seeds):
        yield (
            "Intervals are percentile bootstrap intervals over seeds. They describe other seeds of "
            "a scene, not other scenes, and are somewhat too short if there are few seeds."
        )


def _of_bounds(rows: Sequence[GapRow]) -> Iterator[str]:
    first = {row.key: row for row in rows}.values()
    open_ = [row for row in first if row.bound is not None and not row.bound_is_proved]
    none = sum(row.bound is None for row in first)
    if open_:
        yield (
            f"{len(open_)} of {len(first)} bounds are not proved to be the optimum: plans may be "
            "closer to the optimum than their gaps to these bounds show."
        )
    if none:
        yield f"{none} of {len(first)} scenes and seeds have no bound, and so no gaps."


def _of_plans(rows: Sequence[GapRow]) -> Iterator[str]:
    for (planner,), runs in GapRow.grouped(rows, "planner").items():
        lost = sum(not row.valid for row in runs)
        if lost == len(runs):
            yield f"No plan of {planner} obeys the rules; it has no gaps."
        elif lost:
            yield (
                f"{lost} of {len(runs)} runs of {planner} have no plan that obeys the rules. Its "
                "mean gap is over the others, which may be the easier ones."
            )
        late = sum(row.overrun is not None for row in runs)
        if late:
            yield (
                f"{late} of {len(runs)} runs of {planner} exceeded their time limit by more than a "
                "quarter of it plus one second: it had more time than other planners."
            )
    failed = sum(row.reason in FAILED for row in rows)
    if failed:
        yield f'{failed} of {len(rows)} runs failed; "What failed" lists them.'


def _of_rules(rules: Mapping[str, CollisionRules]) -> Iterator[str]:
    """Yields, for each collision rule, whether drones can be in conflict between steps."""
    for rule in dict.fromkeys(rules.values()):
        scenes = ", ".join(scene for scene in rules if rules[scene] == rule)
        if rule.none:
            yield f"In {scenes}, no rule keeps drones apart, so there are no conflicts."
        elif rule.separation:
            yield (
                f"In {scenes}, drones must keep a {rule} at every moment: two drones that come "
                "closer between steps, e.g. where they cross, are in conflict, too."
            )
        else:
            yield (
                f"In {scenes}, the collision rule is {rule}, which looks only at cells and steps: "
                "two drones that cross diagonally between two steps are not in conflict."
            )


def _of_times(run: RunFile) -> Iterator[str]:
    workers = ", ".join(dict.fromkeys(part.workers for part in run.runs))
    lazy = ", ".join(sorted(name for name, planner in PLANNERS.items() if planner.lazy))
    yield (
        f"Seconds are wall-clock times, measured by {workers}; other load on the machine increases "
        "them. Coverage of all states is computed before any limit starts, and its seconds are "
        f"listed separately. Planners that evaluate views one by one ({lazy}) compute coverage "
        "while they run, so their seconds include it."
    )
