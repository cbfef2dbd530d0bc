"""A comparison of teams: two cells of a sweep for each team, and the rows made of them.

An exact method, whose certificate proves the bound, solves each team twice: for the scene's J, and
for views alone, i.e. for how many drones see each person.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any, NamedTuple, Self

from cocap_opt.data import LARGEST, ProblemError
from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.sweeps.sweep import NOBODY, Hired, sweep
from cocap_opt.experiments.tables.layout import Paths
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.teams import TEAMS, TeamRow, grouped, records
from cocap_opt.footage.quality import Assumptions, Quality
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.output.files import save_csv
from cocap_opt.problem import Plan, Problem, Views
from cocap_opt.result import Reason, relative_gap
from cocap_opt.run.engine import BOUND_METHOD
from cocap_opt.run.judged import finite
from cocap_opt.run.options import Option, UsageError
from cocap_opt.run.quality_bound import QualityBound
from cocap_opt.run.teams import MOST_DRONES, TeamChoice, seen_alone
from cocap_opt.scenarios.hardware import CAMERAS


class Asked(NamedTuple):
    """A request: the teams to compare, and when a person counts as seen.

    Attributes
    ----------
    drones : numbers of drones
    cameras : names of cameras; None for the scene's camera
    heights : flight heights (m); None for the scene's heights
    seen_by : smallest number of drones that must see a person
    at_least : smallest share of a person that a drone must see; None for the scene's share
    """

    drones: Sequence[int]
    cameras: Sequence[str | None] = (None,)
    heights: Sequence[float | None] = (None,)
    seen_by: int = 2
    at_least: float | None = None

    @classmethod
    def of(
        cls,
        drones: Iterable[int],
        cameras: Iterable[str] | None,
        heights: Iterable[float] | None,
        seen_by: int,
        at_least: float | None,
        name: Callable[[str], str] = str,
    ) -> Self:
        """Returns a request, after checking it.

        Parameters
        ----------
        name : returns the name of a parameter as users write it, e.g. the option `--drones`

        Raises
        ------
        UsageError
            If a value is out of range; the message names the parameter.
        """
        option = Option(name("drones"))
        for field, several in ("drones", drones), ("camera", cameras), ("heights", heights):
            if several is not None and not several:
                example = "name" if field == "camera" else "number"
                raise UsageError(f"{name(field)}: must be at least one {example}")
        numbers = [option.require_whole(number, 1, MOST_DRONES) for number in drones]
        names: list[str | None] = [None] if cameras is None else list(dict.fromkeys(cameras))
        for camera in names:
            if camera is not None:
                Option(name("camera")).require_one_of(camera, CAMERAS)
        flown: list[float | None] = [None] if heights is None else list(dict.fromkeys(heights))
        for height in flown:
            if height is not None and not abs(height) <= LARGEST:
                raise UsageError(f"{name('heights')}: must be numbers of metres, not {height!r}")
        try:
            Views(cameras=seen_by, at_least=0.3 if at_least is None else at_least)
        except ProblemError as error:
            field, _, words = str(error).partition(": ")
            raise UsageError(f"{name(field)}: {words}") from error
        return cls(list(dict.fromkeys(numbers)), names, flown, seen_by, at_least)

    @property
    def teams(self) -> Iterator[TeamChoice]:
        """All teams, grouped by camera and height."""
        for camera, height, drones in product(self.cameras, self.heights, sorted(self.drones)):
            yield TeamChoice(drones, camera, height)


class TeamCells(NamedTuple):
    """A team and its cells; an impossible team has no cells, but a message in `refused`."""

    team: TeamChoice
    reward: Instance | None = None
    views: Instance | None = None
    refused: str = ""

    @classmethod
    def of(
        cls, problem: Problem, seed: int, team: TeamChoice, asked: Asked, settings: Settings
    ) -> "TeamCells":
        """Returns a team with its cells; without cells if the scene cannot have such a team."""
        try:
            scene = team.scene(problem)
            scenes = scene, seen_alone(scene, asked.seen_by, asked.at_least)
        except ProblemError as error:
            return cls(team, refused=str(error))
        reward, views = (Instance(scene, seed, [BOUND_METHOD], settings) for scene in scenes)
        return cls(team, reward, views)

    @property
    def instances(self) -> list[Instance]:
        """The instances of its cells, if any."""
        return [instance for instance in (self.reward, self.views) if instance is not None]


class ComparedTeams(NamedTuple):
    """A row for each team, in order, and whether all of them were computed before any Ctrl-C."""

    rows: list[TeamRow]
    is_complete: bool


def team_settings(time_limit: float, work_limit: int | None, kept: bool) -> Settings:
    """Returns settings with the limits of each of a team's two problems, excluding coverage."""
    return Settings(
        time_limit=time_limit, bound_time_limit=0.0, work_limit=work_limit, kept=kept,
        proves_itself=True,
    )  # fmt: skip


def compare_teams(
    problem: Problem,
    seed: int,
    asked: Asked,
    settings: Settings,
    folder: Path | None = None,
    hired: Hired = NOBODY,
    retry: bool = False,
    quiet: bool = False,
) -> ComparedTeams:
    """Solves all teams; with a folder writes teams.csv.

    Parameters
    ----------
    settings : made by `team_settings`
    folder : folder of a sweep, whose stored cells are used; None to keep nothing
    retry : True to compute failed cells in the folder again
    quiet : True to show no progress

    Raises
    ------
    ProblemError
        If all of these teams are impossible; it has the message of the first one.
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet.
    """
    cells = [TeamCells.of(problem, seed, team, asked, settings) for team in asked.teams]
    instances = [instance for each in cells for instance in each.instances]
    if not instances:
        raise ProblemError(cells[0].refused)
    swept = sweep(instances, folder, hired, retry, quiet=quiet, title="team")
    published = {row.key: row for row in swept}
    rows = _with_gains([_row(problem, seed, each, asked, published, folder) for each in cells])
    if folder is not None:
        save_csv(folder / TEAMS, records(rows))
    return ComparedTeams(rows, all(instance.is_finished for instance in instances))


def _row(
    problem: Problem,
    seed: int,
    cells: TeamCells,
    asked: Asked,
    published: dict[tuple[str, int | None], GapRow],
    folder: Path | None,
) -> TeamRow:
    team = cells.team
    row = TeamRow(
        scene=problem.name, seed=seed, drones=team.drones, camera=team.camera or "",
        height=team.height, cameras=asked.seen_by, message=cells.refused,
    )  # fmt: skip
    if cells.reward is None or cells.views is None:
        return row
    limits = QualityBound.of(cells.reward.problem, asked.seen_by, asked.at_least)
    found = published.get(cells.reward.key)
    if found is not None:
        row = replace(row, digest=found.digest, reason=found.reason, **_rewarded(found))
        if (plan := cells.reward.plan(BOUND_METHOD)) is not None:
            row = replace(row, **_filmed(cells.reward.problem, plan, limits))
        row = replace(row, **_files(found, folder, "plan", "certificate"))
    seen = published.get(cells.views.key)
    if seen is not None:
        limits = _bounded(limits, seen)
        most = limits.most(asked.seen_by).share
        row = replace(row, seen_bound=most, reason_seen=seen.reason)
        if (plan := cells.views.plan(BOUND_METHOD)) is not None:
            share = _filmed(cells.views.problem, plan, limits)["seen"]
            row = replace(row, seen_most=share)
        row = replace(row, **_files(seen, folder, "plan_seen", "certificate_seen"))
    return replace(row, message=_messages(found, seen))


def _rewarded(found: GapRow) -> dict[str, Any]:
    reward = found.reward if found.valid else None
    gap = None
    if reward is not None and found.bound is not None:
        gap = finite(relative_gap(reward, found.bound))
    return {"reward": reward, "bound": found.bound, "gap": gap}


def _messages(*found: GapRow | None) -> str:
    """Returns the messages of rows without a plan, each once."""
    words = (row.message for row in found if row is not None and not row.valid)
    return "; ".join(dict.fromkeys(filter(None, words)))


def _filmed(problem: Problem, plan: Plan, limits: QualityBound) -> dict[str, Any]:
    """Returns the quality of a plan, by the names of columns."""
    assumptions = Assumptions(at_least=limits.at_least)
    quality = Quality.of(problem, plan, assumptions=assumptions)
    places = [
        problem.where(robot, path) for robot, path in zip(problem.robots, plan.paths, strict=True)
    ]
    return {
        "seen": finite(limits.share(quality, limits.cameras)),
        "apart": finite(quality.summary.apart),
        "median_error": finite(quality.summary.median),
        "flight_seconds": None if problem.step is None else problem.step * problem.horizon,
        "metres": max(map(_length, places)),
    }


def _length(places: Iterable[Sequence[float]]) -> float:
    return math.fsum(math.dist(a, b) for a, b in pairwise(places))


def _bounded(limits: QualityBound, seen: GapRow) -> QualityBound:
    """Returns limits that use the bound on views, counted up to the requested number of drones."""
    unknown = CertifiedResult(None, -math.inf, Reason.FINISHED, bound=math.inf)
    bound = math.inf if seen.bound is None else seen.bound
    fewer = min(limits.cameras, len(limits.problem.robots)) - 1
    return replace(limits, results=(*[unknown] * fewer, replace(unknown, bound=bound)))


def _files(found: GapRow, folder: Path | None, plan: str, certificate: str) -> dict[str, Any]:
    if folder is None:
        return {}
    name = Paths(found).plan.as_posix() if found.reward is not None else ""
    return {plan: name, certificate: found.certificate}


def _with_gains(rows: Sequence[TeamRow]) -> list[TeamRow]:
    """Returns rows with their gains over the same team with one drone fewer."""
    known = {
        (row.camera, row.height, row.drones): row.reward for group in grouped(rows) for row in group
    }
    found = []
    for row in rows:
        fewer = 0.0 if row.drones == 1 else known.get((row.camera, row.height, row.drones - 1))
        if fewer is not None:
            gain = None if row.reward is None else row.reward - fewer
            most = None if row.bound is None else row.bound - fewer
            row = replace(row, gain=gain, gain_bound=most)
        found.append(row)
    return found
