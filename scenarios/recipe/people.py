"""The people of a recipe, tracked by others or walking along given legs."""

import logging
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.problem import Actor, Shape
from cocap_opt.scenarios.recipe.pace import pace_doubt
from cocap_opt.scenarios.recipe.tables import Count, Point, Size, Table, Unit
from cocap_opt.scenarios.recipe.terrain import Terrain
from cocap_opt.scenarios.recipe.tracks import BODY, STILL, Track

log = logging.getLogger(__name__)


class TracksTable(Table):
    """One of the tables `tracks` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`."""

    file: str
    columns: list[str] | None = None
    unit: Unit | None = None
    fps: float | None = None
    delimiter: str | None = None
    begin: float | None = None
    ids: Annotated[list[int | str], Meta(min_length=1)] | None = None
    count: Count | None = None
    at: Point = (0.0, 0.0)
    shape: Shape = BODY
    still: Size = STILL

    def actors(self, folder: Path, terrain: Terrain, step: float, steps: int) -> list[Actor]:
        """Reads the people of the file who are there at all steps, standing on the ground.

        Parameters
        ----------
        folder : of the file that the table names
        terrain : the ground
        step : seconds between steps
        steps : horizon T

        Raises
        ------
        ProblemError
            If the file cannot be read or has no such people; one line.
        """
        tracks = Track.read_all(
            folder / self.file, columns=self.columns, unit=self.unit, fps=self.fps,
            delimiter=self.delimiter,
        )  # fmt: skip
        begin, chosen = self._chosen(tracks, step, steps)
        actors = [
            track._replace(points=track.points + np.array(self.at)).actor(
                begin, step, steps, shape=self.shape, still=self.still, ground=terrain.floor
            )
            for track in chosen
        ]
        names, causes = [f"id {track.id}" for track in chosen], "unit, fps, step and all its rows"
        if doubt := pace_doubt(names, actors, step, causes):
            log.warning("%s: %s", self.file, doubt)
        return actors

    def _chosen(self, tracks: list[Track], step: float, steps: int) -> tuple[float, list[Track]]:
        """Returns the time (s) of step 0, and the people who are filmed."""
        if (self.ids is None) == (self.count is None):
            raise ProblemError("must have either ids or a count")
        candidates = tracks if self.ids is None else _named(self.ids, tracks)
        wanted = self.count or len(candidates)
        # More people are there only from a time at which someone appears.
        moments = sorted({time for track in candidates for time in track.appearances()})
        most = 0
        for begin in moments if self.begin is None else [self.begin]:
            there = [track for track in candidates if track.is_there(begin, step, steps)]
            if len(there) >= wanted:
                return begin, there[:wanted]
            most = max(most, len(there))
        when = "at no time" if self.begin is None else f"not from {self.begin:g} s on"
        who = ""
        if self.ids is not None:
            who = "; " + "; ".join(f"{c.id} is there {c.presence()}" for c in candidates[:4])
        raise ProblemError(
            f"begin: must be a time from which on all of {wanted} are there for {steps * step:g} "
            f"s, which they are {when}; at most {most} are{who}"
        )


class WalkTable(Table):
    """One of the tables `walk` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`."""

    points: Annotated[list[Point], Meta(min_length=1)]
    speed: Size = 1.2
    first: Size = 0.0
    shape: Shape = BODY

    def actor(self, terrain: Terrain, step: float, steps: int) -> Actor:
        """Returns a person who walks along the legs, and stands where they end.

        Parameters
        ----------
        terrain : the ground
        step : seconds between steps
        steps : horizon T

        Raises
        ------
        ProblemError
            If the way begins beyond its end, or nobody could be so fast.
        """
        points = self._along(step, steps)
        floor = [terrain.floor(x, y) for x, y in points.tolist()]
        yaw = Track.headings(points, STILL * step)
        actor = Actor(poses=np.column_stack([points, floor, yaw]), shape=self.shape)
        x, y = self.points[0]
        if doubt := pace_doubt(
            [f"the walk from ({x:g}, {y:g}) m"], [actor], step, "speed and step"
        ):
            log.warning("%s", doubt)
        return actor

    def _along(self, step: float, steps: int) -> FloatArray:
        """Returns the points [T+1, 2] (m) at the steps."""
        corners = np.array(self.points)
        behind = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        if self.first > behind[-1]:
            raise ProblemError(
                f"first: must be at most {behind[-1]:.6g} m, the length of the way, not "
                f"{self.first:g}"
            )
        done = self.first + self.speed * step * np.arange(steps + 1)
        return np.column_stack([np.interp(done, behind, axis) for axis in corners.T])


def _named(ids: list[int | str], tracks: list[Track]) -> list[Track]:
    by_id = {track.id: track for track in tracks}
    for name in ids:
        if name not in by_id:
            raise ProblemError(f"ids: {name!r} is not in the file, which has {_listed(by_id)}")
    if len(set(ids)) != len(ids):
        raise ProblemError("ids: must differ")
    return [by_id[name] for name in ids]


def _listed(names: dict[int | str, Track]) -> str:
    shown = ", ".join(str(name) for name in list(names)[:5])
    return shown + (f" and {len(names) - 5} more" if len(names) > 5 else "")
