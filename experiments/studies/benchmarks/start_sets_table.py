"""The tables of planners over start sets: means and spreads, and their plan beside ours.

View reward per robot and step is J over the number of robots and of the steps that count: H,
the start included, in scenes of Greedy Perspectives. Their published mean is over H + 1 rows,
one of them a spurious 0, so that it is H / (H + 1) of that.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import stdev

import msgspec

from cocap_opt.experiments.results.files import save_csv, write
from cocap_opt.experiments.results.printing import PROVED, markdown, print_table
from cocap_opt.experiments.results.rows import Row
from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.documents import FileError
from cocap_opt.result import relative_gap

NOTES = """\
`reward`, `sd`, `bound` and `bound_free` are view reward per drone and step; J is the sum over all
drones and steps. Bounds are certified. `gap` is to the bound under the scene's collision rules,
only where all plans obey them; `gap_free` is to the bound without such rules, which holds for any
plan. `colliding` is the number of drones that take part in a conflict, `valid` the number of plans
without one, `sd` the sample's standard deviation. What has no value in every start set is left
out. Seconds are the planner's own; how long theirs took is not known.

Their program planned with tilts that its cache mixes up (`J as reported`), and with a bonus for
moves with dx + dy = 0; here every plan is evaluated with each drone's own tilt, without the bonus.
"""


class SetRun(msgspec.Struct, frozen=True):
    """A planner's run on a scene and start set, as far as the tables need it."""

    scene: str
    seed: int | None  # the start set; None: those of the scene's own file
    digest: str
    limit_seconds: float
    planner: str
    robots: int
    rows: int  # steps that count
    reward: float | None
    bound: float | None
    bound_free: float | None
    gap: float | None
    conflicts: int | None
    colliding: int | None
    reason: str
    seconds: float | None
    bound_reason: str
    reported: float | None
    reported_own_tilt: float | None

    @property
    def is_valid(self) -> bool:
        """Whether there is a plan that obeys the rules."""
        return self.conflicts == 0

    @property
    def gap_free(self) -> float | None:
        """Gap to the bound without rules, which holds for plans that break them, too."""
        if self.reward is None or self.bound_free is None:
            return None
        return relative_gap(self.reward, self.bound_free)

    def each(self, value: float | None) -> float | None:
        """A sum over robots and steps, for one robot and step."""
        return None if value is None else value / (self.robots * self.rows)


def typed(row: Row, name: str) -> SetRun:
    """A row of the file, checked.

    Raises
    ------
    FileError
        If it is no such row; one line, with the name of the file.
    """
    try:
        content = {key: None if value == "" else value for key, value in row.items()}
        return msgspec.convert(content, SetRun, strict=False)
    except msgspec.ValidationError as error:
        raise FileError(f"{name}: not a row of this table: {error}") from error


def publish(runs: Sequence[SetRun], limit: float, out: Path | None) -> None:
    """Print the tables, and write them as CSV and Markdown."""
    over_sets = mean_rows([run for run in runs if run.seed is not None])
    beside = peer_rows([run for run in runs if run.seed is None])
    tables = {
        f"view reward per drone and step over start sets (limit {limit:g} s)": over_sets,
        f"their plan and ours, from the starts of the scene's own file (limit {limit:g} s)": beside,
    }
    for title, rows in tables.items():
        if rows:
            print_table(title, rows)
    if out is None:
        return
    for name, rows in (("start_sets.csv", over_sets), ("peers.csv", beside)):
        if rows:
            save_csv(out / name, rows)
    parts = [f"## {title}\n\n{markdown(rows)}" for title, rows in tables.items() if rows]
    text = "\n".join([*parts, NOTES])
    write(out / "start_sets.md", lambda: write_atomically(out / "start_sets.md", text.encode()))


def mean_rows(runs: Sequence[SetRun]) -> list[Row]:
    """Per scene and planner: means and spreads over start sets."""
    keys = list(dict.fromkeys((run.scene, run.planner) for run in runs))
    return [
        {"scene": scene, "planner": planner}
        | _means([run for run in runs if (run.scene, run.planner) == (scene, planner)])
        for scene, planner in keys
    ]


def _means(runs: Sequence[SetRun]) -> Row:
    rewards = [run.each(run.reward) for run in runs]
    gaps = [run.gap for run in runs]
    return {
        "sets": len(runs),
        "reward": _mean(rewards),
        "sd": _of_all(lambda values: stdev(values) if len(values) > 1 else None, rewards),
        "colliding": _mean([run.colliding for run in runs]),
        "valid": sum(run.is_valid for run in runs),
        "bound": _mean([run.each(run.bound) for run in runs]),
        "proved": sum(run.bound_reason in PROVED for run in runs),
        "gap": _mean(gaps),
        "largest gap": _of_all(max, gaps),
        "bound_free": _mean([run.each(run.bound_free) for run in runs]),
        "gap_free": _mean([run.gap_free for run in runs]),
        "seconds": _mean([run.seconds for run in runs]),
    }


def peer_rows(runs: Sequence[SetRun]) -> list[Row]:
    """Their plan and ours, scene by scene.

    `J as reported` is theirs by their own pixels with the tilts that their cache mixes up,
    `J with own tilts` the same pixels with each robot's own: `reward` is by our evaluation.
    """
    theirs = {run.scene: run.reward for run in runs if run.reported is not None}
    return [
        {
            "scene": run.scene,
            "planner": run.planner,
            "reward": run.each(run.reward),
            "J": run.reward,
            "above theirs (%)": _difference(run.reward, theirs.get(run.scene)),
            "J as reported": run.reported,
            "J with own tilts": run.reported_own_tilt,
            "colliding": run.colliding,
            "bound": run.each(run.bound),
            "proved": run.bound_reason in PROVED,
            "gap": run.gap,
            "gap_free": run.gap_free,
            "seconds": run.seconds,
        }
        for run in runs
    ]


def _difference(value: float | None, other: float | None) -> float | None:
    return 100 * (value / other - 1) if value is not None and other else None


def _mean(values: Sequence[float | None]) -> float | None:
    return _of_all(lambda all_: math.fsum(all_) / len(all_), values)


def _of_all(
    statistic: Callable[[list[float]], float | None], values: Sequence[float | None]
) -> float | None:
    """A statistic where all have a value: those over different start sets mislead."""
    known = [value for value in values if value is not None]
    return statistic(known) if known and len(known) == len(values) else None
