"""Plans flown in a third-party simulator, and how much of distances and of J remains."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results
from cocap_opt.experiments.lab.studies.flight.figure import flight_figure
from cocap_opt.experiments.lab.studies.flight.runs import FlightRun, flown
from cocap_opt.experiments.lab.studies.flight.simulation import span
from cocap_opt.experiments.lab.studies.flight.tables import listings, sentences
from cocap_opt.experiments.lab.studies.options import Out, positive_seconds
from cocap_opt.output.printing import print_texts
from cocap_opt.run.options import Option, UsageError

_SCENES = ("bridge", "passage")
_TABLE = "flight.csv"
_STORM = 30.0  # m/s, the strongest wind that can be simulated


def flight(
    *scenes: Annotated[str, Parameter(help="scenes or recipes (default: bridge, passage)")],
    seeds: Annotated[str, Parameter(help="seeds of the scenes and of the gusts")] = "0-2",
    wind: Annotated[
        list[float] | None,
        Parameter(negative="", consume_multiple=True, help="wind speeds, m/s (default: 0 5 10)"),
    ] = None,
    step: Annotated[
        float | None,
        positive_seconds(
            help="seconds of a step, if the scene defines none (default: from PX4's limits)"
        ),
    ] = None,
    out: Out = None,
    stored: Annotated[
        bool, Parameter(negative="", help="print the stored results instead of simulating")
    ] = False,
) -> None:
    """Simulates flights, writes rows (flight.csv) as they are made, and prints the results."""
    winds = [0.0, 5.0, 10.0] if wind is None else wind
    if not all(0 <= speed <= _STORM for speed in winds):
        raise UsageError(f"--wind: must be 0..{_STORM:g} m/s")
    numbers = Option("--seeds").numbers(seeds)
    if stored and scenes:
        raise UsageError("--stored: must be given without scenes, as it prints the stored ones")
    chosen = scenes or _SCENES
    tell(stored_flights() if stored else _simulated(chosen, numbers, winds, step, out), out)


def stored_flights() -> list[FlightRun]:
    """Returns the stored runs."""
    return FlightRun.read(STORED / _TABLE)


def _simulated(
    scenes: Sequence[str],
    seeds: Sequence[int],
    winds: Sequence[float],
    step: float | None,
    out: Path | None,
) -> list[FlightRun]:
    """Simulates flights; raises FileError if the simulator is not installed."""
    span()  # fails here, if at all
    runs: list[FlightRun] = []
    for scene in scenes:
        for seed in seeds:
            for run in flown(scene, seed, winds, step):
                runs.append(run)
                say(
                    f"{run.scene} seed {seed}, {run.flight}, {run.wind:g} m/s: off by "
                    f"{run.error_most:.2f} m at most"
                )
                Results.into(out).save(_TABLE, runs)  # not earlier, as a scene may be rejected
    return runs


def tell(runs: Sequence[FlightRun], out: Path | None = None) -> None:
    """Prints tables and sentences, and draws the figure (flight.png)."""
    for listing in listings(runs):
        listing.print()
    print_texts([], sentences(runs))
    Results.into(out).draw("flight.png", partial(flight_figure, runs))
