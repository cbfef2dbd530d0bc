"""The tables of planners over start sets: means and spreads, and their plan beside ours.

View reward per drone and step is J over the number of drones and of the steps that count: H, the
start included, in scenes of Greedy Perspectives. Their published mean is over H + 1 rows, one of
them a spurious 0, so that it is H / (H + 1) of ours.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import stdev

from cocap_opt.experiments.results.files import save_bytes, save_csv
from cocap_opt.experiments.results.gap_table import PROVED
from cocap_opt.experiments.results.printing import Listing, Record
from cocap_opt.experiments.results.rows import Row
from cocap_opt.result import relative_gap

THEIRS = "theirs"  # in place of a planner's name

NOTES = """\
`reward`, `sd`, `bound` and `bound_free` are view reward per drone and step; J is the sum over all
drones and steps. Bounds are certified. `gap` is to the bound under the scene's collision rules,
only where all plans obey them; `gap_free` is to the bound without such rules, which holds for any
plan. `colliding` is the number of drones that take part in a conflict, `valid` the number of plans
without one, `sd` the sample's standard deviation. Columns without a value in every start set are
left empty. Seconds are the planner's own; the seconds of their program are not known.

Their program planned with tilts that its cache mixes up (`J as reported`), and with a bonus for
moves with dx + dy = 0; here every plan is evaluated with each drone's own tilt, without the bonus.
"""


# J of their plan by the pixels that their own program counted: with the tilts that its cache
# mixes up, and with each drone's own.
Reported = tuple[float, float]


@dataclass(frozen=True)
class SetTables:
    """Tables made of the rows of a sweep over start sets.

    Attributes
    ----------
    counted : steps that count, by scene
    reported : by scene, of scenes on which one of the plans is theirs
    """

    rows: Sequence[Row]
    counted: Mapping[str, int]
    reported: Mapping[str, Reported]

    def publish(self, limit: float, out: Path | None) -> None:
        """Prints the tables, and writes start_sets.csv, peers.csv and start_sets.md.

        Parameters
        ----------
        limit : s, that each plan and each bound had
        """
        tables = {
            "start_sets.csv": ("view reward per drone and step over start sets", self.over_sets()),
            "peers.csv": ("their plan and ours, from the starts of the scene's own file",
                          self.beside_theirs()),
        }  # fmt: skip
        shown = {name: Listing(f"{title} (limit {limit:g} s)", rows)
                 for name, (title, rows) in tables.items() if rows}  # fmt: skip
        for listing in shown.values():
            listing.print()
        if out is None:
            return
        for name, listing in shown.items():
            save_csv(out / name, listing.rows)
        parts = [f"## {listing.title}\n\n{listing.markdown}" for listing in shown.values()]
        save_bytes(out / "start_sets.md", "\n".join([*parts, NOTES]).encode())

    def over_sets(self) -> list[Record]:
        """Returns means and spreads over start sets, per scene and planner."""
        rows = [row for row in self.rows if row.scene not in self.reported]
        keys = list(dict.fromkeys((row.scene, row.planner) for row in rows))
        return [
            {"scene": scene, "planner": planner}
            | self._means([row for row in rows if (row.scene, row.planner) == (scene, planner)])
            for scene, planner in keys
        ]

    def beside_theirs(self) -> list[Record]:
        """Returns the rows of their plan and ours, scene by scene."""
        return [self._beside(row) for row in self.rows if row.scene in self.reported]

    def _beside(self, row: Row) -> Record:
        theirs = next((r for r in self.rows if (r.scene, r.planner) == (row.scene, THEIRS)), None)
        reported = self.reported[row.scene] if row.planner == THEIRS else None
        return {
            "scene": row.scene,
            "planner": row.planner,
            "reward": self._each(row, row.reward),
            "J": row.reward,
            "above theirs (%)": _difference(row.reward, None if theirs is None else theirs.reward),
            "J as reported": reported and reported[0],
            "J with own tilts": reported and reported[1],
            "colliding": row.colliding,
            "bound": self._each(row, row.bound),
            "proved": row.bound_reason in PROVED,
            "gap": row.gap,
            "gap_free": _gap_free(row),
            "seconds": row.seconds,
        }

    def _means(self, rows: Sequence[Row]) -> Record:
        rewards = [self._each(row, row.reward) for row in rows]
        gaps = [row.gap for row in rows]
        return {
            "sets": len(rows),
            "reward": _mean(rewards),
            "sd": _of_all(lambda values: stdev(values) if len(values) > 1 else None, rewards),
            "colliding": _mean([row.colliding for row in rows]),
            "valid": sum(row.valid for row in rows),
            "bound": _mean([self._each(row, row.bound) for row in rows]),
            "proved": sum(row.bound_reason in PROVED for row in rows),
            "gap": _mean(gaps),
            "largest gap": _of_all(max, gaps),
            "bound_free": _mean([self._each(row, row.bound_free) for row in rows]),
            "gap_free": _mean([_gap_free(row) for row in rows]),
            "seconds": _mean([row.seconds for row in rows]),
        }

    def _each(self, row: Row, value: float | None) -> float | None:
        """Returns a sum over drones and steps as a mean of one drone and step."""
        return None if value is None else value / (row.robots * self.counted[row.scene])


def _gap_free(row: Row) -> float | None:
    """Returns the gap to the bound without rules, which holds for plans that break them, too."""
    if row.reward is None or row.bound_free is None:
        return None
    return relative_gap(row.reward, row.bound_free)


def _difference(value: float | None, other: float | None) -> float | None:
    return 100 * (value / other - 1) if value is not None and other else None


def _mean(values: Sequence[float | None]) -> float | None:
    return _of_all(lambda all_: math.fsum(all_) / len(all_), values)


def _of_all(
    statistic: Callable[[list[float]], float | None], values: Sequence[float | None]
) -> float | None:
    """Returns a statistic if no value is missing: statistics over different start sets mislead."""
    known = [value for value in values if value is not None]
    return statistic(known) if known and len(known) == len(values) else None
