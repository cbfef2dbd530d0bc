"""The measurements of the price of separation: a row per scene, seed and separation."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

from cocap_opt.experiments.lab.results import load_csv
from cocap_opt.output.printing import Record
from cocap_opt.result import relative_gap
from cocap_opt.stop import NO_LIMIT


class SeparationPoint(NamedTuple):
    """The measurements at one separation of one instance."""

    scene: str
    seed: int
    separation: float  # m; 0: no separation, only the scene's own rules
    cocap: float  # J
    cocap_seconds: float  # CPU time
    cocap_limit: str
    lns: float  # J of the recommended planner, cocap-lns
    lns_seconds: float
    lns_limit: str
    best: float  # J of the best plan
    bound: float  # certified
    proof_seconds: float  # CPU time
    proof_limit: str

    @classmethod
    def read(cls, path: Path) -> list[Self]:
        """Returns the measurements that are stored in a file."""
        return load_csv(path, cls, "separation")

    def base(self, points: "Sequence[SeparationPoint]") -> "SeparationPoint":
        """Returns the point of the same instance without a separation."""
        return next(
            point for point in points
            if (point.scene, point.seed, point.separation) == (self.scene, self.seed, 0)
        )  # fmt: skip

    def price(self, base: "SeparationPoint") -> tuple[float, float]:
        """Returns the certified smallest and largest price, in % of the optimum of `base`.

        The J of a plan and a bound enclose each optimum; if both are proved, so is the price.
        """
        least = 1 - self.bound / base.best
        most = 1 - self.best / base.bound
        return 100 * max(least, 0.0), 100 * max(most, 0.0)

    @staticmethod
    def listed(points: "Sequence[SeparationPoint]") -> list[Record]:
        """Returns the rows of the table, one per point."""
        rows: list[Record] = []
        for point in points:
            base = point.base(points)
            rows.append(
                {
                    "scene": point.scene, "seed": point.seed,
                    "separation": f"{point.separation:g} m" if point.separation else "none",
                    "best J": f"{point.best:,.2f}",
                    "gap %": f"{100 * relative_gap(point.best, point.bound):.3f}",
                    "price %": between(*point.price(base)) if point.separation else "",
                    "CoCap's gap %": f"{100 * relative_gap(point.cocap, point.bound):.3f}",
                    "CoCap s": _seconds(point.cocap_seconds, point.cocap_limit),
                    "cocap-lns' gap %": f"{100 * relative_gap(point.lns, point.bound):.3f}",
                    "cocap-lns s": _seconds(point.lns_seconds, point.lns_limit),
                    "proof s": _seconds(point.proof_seconds, point.proof_limit),
                }
            )  # fmt: skip
        return rows


def between(least: float, most: float) -> str:
    """Returns a range of percentages in words, or one percentage if both ends are equal."""
    return f"{most:.2f}" if most - least < 0.005 else f"{least:.2f} to {most:.2f}"


def _seconds(seconds: float, limit: str) -> str:
    words = f"{seconds:.2f}" if math.isfinite(seconds) else "-"
    return words if limit == NO_LIMIT else f"{words} *"
