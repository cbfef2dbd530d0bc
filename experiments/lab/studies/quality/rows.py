"""The rows of the study: a person-step whose joints are triangulated, and a plan."""

import math
from pathlib import Path
from typing import NamedTuple, Self

from cocap_opt.experiments.lab.results import load_csv


class PersonStep(NamedTuple):
    """A person at a step: errors of their joints, predicted and measured, in mm (RMS)."""

    scene: str
    seed: int
    planner: str
    step: int
    person: int
    cameras: int  # number of cameras that see the person
    angle: float  # degrees, the widest angle between two rays
    middle: float  # predicted for the person's middle, as `quality` reports it
    predicted: float  # predicted for the joints, by the same model
    measured: float  # error of least squares
    library: float  # error of aniposelib's linear method; nan if it is not installed
    predicted_posed: float  # with errors of the poses, too
    measured_posed: float
    kept: float  # share of the joints that two of these cameras have in the picture, unhidden
    predicted_kept: float  # for these joints, from the cameras that see them; nan without any

    @classmethod
    def read(cls, path: Path) -> list[Self]:
        """Returns the rows that are stored in a file."""
        return load_csv(path, cls, "quality")


class PlanRow(NamedTuple):
    """A plan: its J, and its quality over the person-steps that count."""

    scene: str
    seed: int
    planner: str
    reward: float  # J
    by_two: float  # share of person-steps seen by two drones or more
    apart: float  # share that two see from at least 30 degrees apart
    median: float  # mm, median error of a point

    @classmethod
    def read(cls, path: Path) -> list[Self]:
        """Returns the rows that are stored in a file."""
        return load_csv(path, cls, "quality")


def rounded(value: float, digits: int = 5) -> float:
    """Returns a number with so many digits, for files that people read."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else value
