"""Flies plans in a simulator by others, and tells what is left of distances and of J."""

from collections.abc import Sequence
from pathlib import Path

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.studies.flight.figure import flight_figure
from cocap_opt.experiments.lab.studies.flight.runs import Run, flown
from cocap_opt.experiments.lab.studies.flight.simulation import span
from cocap_opt.experiments.lab.studies.flight.tables import listings, sentences
from cocap_opt.output.files import (
    make_folder,
    save_bytes,
    save_csv,
)
from cocap_opt.output.printing import print_texts
from cocap_opt.pictures.figures import picture

SCENES = ("bridge", "passage")
TABLE = "flight.csv"


def flight(
    scenes: Sequence[str],
    seeds: Sequence[int],
    winds: Sequence[float],
    step: float | None = None,
    out: Path | None = None,
) -> list[Run]:
    """Simulates, and writes the rows (flight.csv) as they come.

    Parameters
    ----------
    winds : m/s
    step : s, of scenes that say no duration; None: what the vehicle can fly

    Raises
    ------
    FileError
        If the simulator is not installed.
    """
    span()  # which needs it
    runs: list[Run] = []
    for scene in scenes:
        for seed in seeds:
            for run in flown(scene, seed, winds, step):
                runs.append(run)
                say(
                    f"{run.scene} seed {seed}, {run.flight}, {run.wind:g} m/s: off by "
                    f"{run.error_most:.2f} m at most"
                )
                if out is not None:
                    make_folder(out)  # not before, for a scene may be refused
                    save_csv(out / TABLE, [one._asdict() for one in runs])
    return runs


def tell(runs: Sequence[Run], out: Path | None = None) -> None:
    """Prints tables and sentences, and draws the figure (flight.png)."""
    for listing in listings(runs):
        listing.print()
    print_texts([], sentences(runs))
    if out is not None:
        make_folder(out)
        save_bytes(out / "flight.png", picture(flight_figure(runs), ".png"))
