"""Forecasts, before coverage begins, whether a limit suffices for it, and what would."""

import logging
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from cocap_opt.console.progress import Watch
from cocap_opt.console.streams import without_warnings
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import CertificateFile, Leaf, ProofFile
from cocap_opt.method import Method
from cocap_opt.model import CoverageEstimate, Model, compiled
from cocap_opt.problem import Problem
from cocap_opt.run.engine import record_of
from cocap_opt.scenarios import FORMATS, SCENES
from cocap_opt.stop import Stop, TimeLimit, never

if TYPE_CHECKING:
    from cocap_opt.scenarios.recipe.lighter import Change

_log = logging.getLogger(__name__)

_PRICING = 2e-7  # s per state and step in the search of a certificate's best paths: measured
_GIGABYTE = 1e9
# Factors on an estimate: the smallest limit that causes no warning, and the advised limit.
_ENOUGH, _AMPLE = 1.2, 1.7
_TRIES = 3  # changes of a kind that are tried
_BEFORE = "scene and estimate, before the time limit begins"
_LONG = 20.0  # s; longer durations are announced if there is no limit
_SLOWEST = 1e-3  # s per view; more than any known scene has needed
_NEAR = 0.75  # share of the limit that advised changes may take
# Share of the limit, and s, after which no further change is tried: for a large scene each takes
# long.
_TRYING, _LONGEST_TRYING = 0.2, 10.0


class Forecast(NamedTuple):
    """The time needed before the search: for coverage, and for planning each drone once.

    Attributes
    ----------
    coverage : estimate for the missing coverage
    planning : time to plan each drone once, s
    """

    coverage: CoverageEstimate
    planning: float = 0.0

    @classmethod
    def of(cls, model: Model) -> Self:
        """Makes the forecast for a model from a sample of its views.

        Raises
        ------
        ProblemError
            If coverage is larger than the memory.
        """
        return cls(model.tables.estimate(), model.planning_seconds)

    def fits(self, seconds: float, margin: float = _ENOUGH) -> bool:
        """Returns True if a limit leaves time to plan each drone after coverage is complete."""
        return margin * self.coverage.seconds + self.planning <= seconds

    @property
    def seconds(self) -> float:
        """Sum of both times in s."""
        return self.coverage.seconds + self.planning

    @property
    def ample(self) -> float:
        """A time limit in s that suffices, with two digits."""
        seconds = max(_AMPLE * self.coverage.seconds + 2 * self.planning, 1.0)
        unit = 10.0 ** (math.floor(math.log10(seconds)) - 1)
        return math.ceil(seconds / unit) * unit

    @property
    def words(self) -> str:
        """Time and memory in words."""
        parts, size = [], max(self.coverage.memory / _GIGABYTE, 0.1)
        if self.coverage.views:
            parts.append(f"coverage takes {about(self.coverage.seconds)} and {size:.1f} GB")
        if self.planning >= 1 or not parts:
            parts.append(f"a first plan of all drones takes {about(self.planning)}")
        return ", ".join(parts)

    def doubts(self, seconds: float, option: str, recipe: "RecipeTrial | None") -> str:
        """Returns why a limit does not suffice and what would, in one line; empty if it suffices.

        Parameters
        ----------
        seconds : the limit
        option : the option that sets the limit, e.g. "--time-limit"
        recipe : the recipe whose changes are tried; None if the scene has no recipe
        """
        if self.fits(seconds):
            return ""
        limit = duration(seconds) if seconds >= 1 else f"{seconds:.2g} s"
        problem = f"too long for a limit of {limit}, so drones may stay at their starts"
        ways = [f"{option} {self.ample:g}"]
        trying = TimeLimit(min(_TRYING * seconds, _LONGEST_TRYING))
        changes = () if recipe is None else recipe.that_fit(self, _NEAR * seconds, trying)
        ways += [f"{change.words} ({about(found.seconds)})" for change, found in changes]
        return f"{self.words}, {problem}; use {'; or '.join(ways)}"


def duration(seconds: float) -> str:
    """Returns seconds in words, with two digits."""
    if seconds < 1:
        return "0 s" if seconds == 0 else "less than 1 s"
    if seconds < 120:
        return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"
    minutes = seconds / 60
    return f"{minutes:.0f} min" if minutes < 120 else f"{minutes / 60:.2g} h"


def about(seconds: float) -> str:
    """Returns estimated seconds in words."""
    return duration(seconds) if seconds < 1 else f"about {duration(seconds)}"


class RecipeTrial(NamedTuple):
    """A recipe for which changes are tried, by sampling the coverage of each changed scene."""

    path: Path
    seed: int
    problem: Problem

    @classmethod
    def of(cls, scene: str, seed: int, problem: Problem) -> Self | None:
        """Returns the recipe of a scene, given by name or file; None for all other scenes."""
        path = Path(scene)
        if not scene or scene in SCENES or not FORMATS["recipe"].scenes.has(path):
            return None
        return cls(path, seed, problem)

    def that_fit(
        self, now: Forecast, seconds: float, stop: Stop = never
    ) -> "list[tuple[Change, Forecast]]":
        """Returns the mildest change of each kind that fits a limit.

        If no single change suffices, the result is a combination of several kinds.

        Parameters
        ----------
        stop : once it is reached, no further change is tried; the first one always is
        """
        from cocap_opt.scenarios.recipe.lighter import Change, lighter  # takes long to import

        def expected(change: "Change") -> bool:
            return change.share * (_AMPLE * now.coverage.seconds + now.planning) <= seconds

        kinds = lighter(self.path, self.problem)
        together = (Change.all_of(changes) for changes in _combined(kinds))
        found = list[tuple[Change, Forecast] | None]()
        for changes in filter(None, ([*filter(expected, kind)] for kind in kinds)):
            if found and stop.reached():
                break
            found.append(self._first(changes, seconds, stop))
        if not any(found) and not (found and stop.reached()):
            found = [self._first([*filter(expected, together)], seconds, stop)]
        return [tried for tried in found if tried is not None]

    def _first(
        self, changes: "Sequence[Change]", seconds: float, stop: Stop
    ) -> "tuple[Change, Forecast] | None":
        """Returns the first change that fits; None if the first few do not."""
        for number, change in enumerate(changes[:_TRIES]):
            if number and stop.reached():
                return None
            try:
                with without_warnings("cocap_opt.scenarios"):
                    forecast = Forecast.of(Model(change.scene(self.path, self.seed)))
            except ProblemError:  # the change does not fit the recipe's other fields
                continue
            if forecast.fits(seconds, _AMPLE):
                return change, forecast
        return None


def _combined(kinds: "Sequence[Sequence[Change]]") -> "Iterator[list[Change]]":
    """Yields combinations of changes, with milder changes and fewer kinds first."""
    given = [kind for kind in kinds if kind]
    for level in range(max(map(len, given), default=0)):
        chosen = [kind[min(level, len(kind) - 1)] for kind in given]
        for count in range(2, len(chosen) + 1):
            yield chosen[:count]


def warn_of_checking(
    model: Model, files: Sequence[CertificateFile | ProofFile], seconds: float
) -> None:
    """Warns, before checking begins, if a limit will hardly suffice to check bounds.

    Coverage is recomputed, and each leaf of a proof takes a search for every class. The additional
    time of staged certificates is unknown.

    Parameters
    ----------
    model : the model with which they are checked
    """
    files = [file for file in files if file.digest == problem_digest(model.problem)]
    if not files:  # other files are rejected at once
        return
    try:
        coverage = model.tables.estimate()
    except ProblemError:  # it does not fit into memory, which the check itself reports
        return
    states = sum(c.graph.n_states for c in model.classes) * (model.problem.horizon + 1)
    leaves = sum(map(_leaves, files))
    forecast = Forecast(coverage, leaves * states * _PRICING)
    if not forecast.fits(seconds):
        _log.warning(
            "%s: checking takes %s, including %s for coverage, but the limit is %s; use "
            "--time-limit %g",
            model.problem.name, about(forecast.seconds), duration(coverage.seconds),
            duration(seconds), forecast.ample,
        )  # fmt: skip


def _leaves(file: CertificateFile | ProofFile) -> int:
    """Returns the number of leaves of a proof, or 1 for a certificate."""
    if isinstance(file, ProofFile):
        return sum(isinstance(node, Leaf) for node in file.nodes)
    return 1


def warn_of_limit(
    problem: Problem,
    method: str | Method[Any],
    seconds: float,
    seed: int | None = None,
    option: str = "--time-limit",
    scene: str = "",
    watch: Watch | None = None,
) -> None:
    """Warns, before coverage begins, if a limit will hardly suffice for it.

    If there is no limit, it announces how long coverage takes, if that is long.

    Parameters
    ----------
    method : a method that needs the coverage of all states
    watch : shows that this time does not count towards a limit
    """
    if watch is not None:
        watch.show(_BEFORE)
    if record_of(method).lazy or _is_little(compiled(problem), seconds):
        return
    try:
        forecast = Forecast.of(compiled(problem))
    except ProblemError:  # it does not fit into memory, which the method itself reports
        return
    words, whose = "", problem.name if seed is None else f"{problem.name}, seed {seed}"
    if math.isfinite(seconds):
        recipe = RecipeTrial.of(scene, seed or 0, problem)
        words = forecast.doubts(seconds, option, recipe)
    elif forecast.seconds > _LONG:
        words = f"{forecast.words}; stop it early with Ctrl-C or {option.removesuffix(' =')}"
    if words:
        _log.warning("%s: %s", whose, words)


def warn_before_limits(
    problem: Problem, seed: int, cell_limit: float = math.inf, cores: int = 1
) -> None:
    """Announces, before a sweep, how long coverage without a time limit takes, if that is long.

    Parameters
    ----------
    cell_limit : time after which a worker gives up, s
    cores : number of cores used here per core of a worker

    Raises
    ------
    ProblemError
        If coverage is larger than the memory.
    """
    model = compiled(problem)
    if _is_little(model, _LONG):
        return
    coverage = model.tables.estimate()
    forecast = Forecast(coverage._replace(seconds=cores * coverage.seconds))
    words = f"{problem.name}, seed {seed}: {forecast.words}"
    if not forecast.fits(cell_limit):
        _log.warning(
            "%s, but workers are stopped after %s; use --cell-limit %g",
            words, duration(cell_limit), cell_limit + forecast.ample,
        )  # fmt: skip
    elif forecast.seconds > _LONG:
        _log.warning("%s, before any time limit begins", words)


def _is_little(model: Model, seconds: float) -> bool:
    """Returns True if coverage is computed faster than it can be estimated, so no message is
    needed.
    """
    if model.planning_seconds > 1:  # there are so many states that counting the views takes long
        return False
    most = _SLOWEST * model.reachable_views + model.planning_seconds
    return most <= min(seconds, _LONG)
