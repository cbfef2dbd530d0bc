"""Tables of simulated flights, and conclusions in sentences made from the numbers."""

import math
from collections.abc import Iterator, Sequence
from statistics import fmean
from typing import NamedTuple

from cocap_opt.experiments.lab.results import markdown
from cocap_opt.experiments.lab.studies.flight.runs import SMOOTH, STRAIGHT, FlightRun
from cocap_opt.output.printing import Listing, Record
from cocap_opt.problem import SEPARATION

_NOTE = (
    "error: mean and largest distance of drones from their planned positions; late: best-fitting "
    "and largest delay along the path; drones, walls: smallest distance between two drones, and to "
    "obstacles and ground, planned and flown; J: of the filmed views, at the steps (in % of the "
    "plan's J) and including the time between them (in % of the flight's)"
)


class _Summary(NamedTuple):
    """The flights of one kind in one wind, over the seeds of a scene.

    Attributes
    ----------
    kept, kept_between : share of J that is filmed, mean
    """

    error_mean: float
    error_most: float
    late_mean: float
    late_most: float
    apart: tuple[float, float]
    clear: tuple[float, float]
    kept: float
    kept_between: float

    @classmethod
    def of(cls, runs: Sequence[FlightRun]) -> "_Summary":
        """Returns means, and the worst errors and distances."""
        return cls(
            fmean(run.error_mean for run in runs),
            max(run.error_most for run in runs),
            fmean(run.late_mean for run in runs),
            max(run.late_most for run in runs),
            (min(run.apart_planned for run in runs), min(run.apart_flown for run in runs)),
            (min(run.clear_planned for run in runs), min(run.clear_flown for run in runs)),
            fmean(run.kept for run in runs),
            fmean(run.kept_between for run in runs),
        )

    @property
    def is_team(self) -> bool:
        """True if there are at least two drones."""
        return self.apart[0] < math.inf

    def row(self) -> Record:
        """Returns the columns of a table."""
        return {
            "error (m)": f"{self.error_mean:.2f}, {self.error_most:.2f}",
            "late (s)": f"{self.late_mean:.2f}, {self.late_most:.2f}",
            "drones (m)": f"{self.apart[0]:.2f}, {self.apart[1]:.2f}" if self.is_team else "-",
            "walls (m)": f"{self.clear[0]:.2f}, {self.clear[1]:.2f}",
            "J (%)": f"{100 * self.kept:.1f}, {100 * self.kept_between:.1f}",
        }


def listings(runs: Sequence[FlightRun]) -> list[Listing]:
    """Returns a table of smooth flights, and one of straight ones."""
    found = []
    for flight in (SMOOTH, STRAIGHT):
        of_kind = [run for run in runs if run.flight == flight]
        rows = [
            {"scene": scene, "wind": f"{wind:g}", **summary.row()}
            for (scene, _, wind), summary in _summaries(of_kind)
        ]
        found.append(Listing(f"{flight} flights in RotorPy, wind in m/s", rows))
    return [found[0], found[1]._replace(notes=[_NOTE])]


def sentences(runs: Sequence[FlightRun]) -> list[str]:
    """Returns a sentence on each scene, and some on the separation of recipes."""
    return [*_on_scenes(runs), *_on_separation(runs)]


def flights_in_markdown(runs: Sequence[FlightRun]) -> str:
    """Returns both tables as one in Markdown, and a note that explains its columns."""
    rows = [
        {"scene": scene, "flight": flight, "wind (m/s)": f"{wind:g}", **summary.row()}
        for (scene, flight, wind), summary in _summaries(runs)
    ]
    return f"{markdown(rows)}\n{_capital(_NOTE)}.\n"


def _on_scenes(runs: Sequence[FlightRun]) -> Iterator[str]:
    for scene in dict.fromkeys(run.scene for run in runs):
        of_scene = [run for run in runs if run.scene == scene]
        calm, stormy = min(run.wind for run in of_scene), max(run.wind for run in of_scene)
        words = [
            _on_wind([run for run in of_scene if run.wind == wind], wind)
            for wind in dict.fromkeys((calm, stormy))
        ]
        steps = " to ".join(
            dict.fromkeys(f"{end(run.step for run in of_scene):g}" for end in (min, max))
        )
        yield f"{scene} (steps of {steps} s): {'; '.join(words)}."


def _on_wind(runs: Sequence[FlightRun], wind: float) -> str:
    """Describes the outcome of a scene's flights in a wind."""
    found = {
        flight: _Summary.of([run for run in runs if run.flight == flight])
        for flight in dict.fromkeys(run.flight for run in runs)
    }
    smooth, straight = found[SMOOTH], found[STRAIGHT]
    near = f"{smooth.clear[1]:.2f} m from walls" if smooth.clear[1] else "into walls"
    return (
        f"in {_air(wind)} smooth flights deviate by at most {smooth.error_most:.2f} m and come "
        f"{near}, straight ones deviate by at most {straight.error_most:.2f} m; they film "
        f"{100 * smooth.kept_between:.1f} and {100 * straight.kept_between:.1f} % of J"
    )


def _on_separation(runs: Sequence[FlightRun]) -> Iterator[str]:
    """Yields how much of the recipes' separation the largest errors of smooth flights leave."""
    width = max(run.span for run in runs)
    enough = []
    for wind in dict.fromkeys(run.wind for run in runs):
        smooth = [run for run in runs if run.flight == SMOOTH and run.wind == wind]
        most = max(run.error_most for run in smooth)
        lost = [run.apart_planned - run.apart_flown for run in smooth if run.robots > 1]
        left = SEPARATION - 2 * most
        fits = left >= width
        enough += [wind] if fits else []
        yield (
            f"In {_air(wind)} the largest error of smooth flights is {most:.2f} m. If two drones "
            f"err by this much towards each other, {_left(left)} of the {SEPARATION:g} m is left, "
            f"which is {'enough' if fits else 'too little'} for vehicles {width:g} m wide; "
            f"{_up(width + 2 * most):g} m would {'suffice' if fits else 'be needed'}. "
            f"The smallest distance in a team fell by at most {max([*lost, 0.0]):.2f} m."
        )
    winds = f"{'up to' if any(enough) else 'in'} {_air(max(enough))}" if enough else "in none"
    yield f"So {SEPARATION:g} m is enough {winds}."


def _summaries(runs: Sequence[FlightRun]) -> Iterator[tuple[tuple[str, str, float], _Summary]]:
    """Yields scene, kind of flight and wind, with a summary over the seeds."""
    for key in dict.fromkeys((run.scene, run.flight, run.wind) for run in runs):
        yield key, _Summary.of([run for run in runs if (run.scene, run.flight, run.wind) == key])


def _air(wind: float) -> str:
    return f"{wind:g} m/s of wind" if wind else "still air"


def _left(metres: float) -> str:
    return f"{metres:.2f} m" if metres > 0 else "nothing"


def _up(metres: float) -> float:
    """Returns metres, rounded up to tenths."""
    return math.ceil(10 * metres - 1e-9) / 10


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
