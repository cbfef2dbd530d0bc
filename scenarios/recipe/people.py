"""The people of a recipe: tracked by others, or walking along given legs."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.problem.problem import Actor, Shape
from cocap_opt.scenarios.recipe import tracks
from cocap_opt.scenarios.recipe.tables import Count, Point, Size, Table
from cocap_opt.scenarios.recipe.terrain import Terrain


class TracksTable(Table):
    """One of the tables `tracks` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`."""

    file: str
    columns: list[str] | None = None
    unit: Literal["m", "cm", "mm"] | None = None
    fps: float | None = None
    delimiter: str | None = None
    begin: float | None = None
    ids: Annotated[list[int | str], Meta(min_length=1)] | None = None
    count: Count | None = None
    at: Point = (0.0, 0.0)
    shape: Shape = tracks.BODY
    still: Size = tracks.STILL


class WalkTable(Table):
    """One of the tables `walk` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`."""

    points: Annotated[list[Point], Meta(min_length=1)]
    speed: Size = 1.2
    first: Size = 0.0
    shape: Shape = tracks.BODY


def tracked(
    given: TracksTable, folder: Path, terrain: Terrain, step: float, steps: int
) -> list[Actor]:
    """People of a file who are there at all steps, standing on the ground.

    Parameters
    ----------
    folder : of the file that the table names
    step : seconds between steps
    steps : horizon T

    Raises
    ------
    ProblemError
        If the file cannot be read or has no such people; one line.
    """
    found = tracks.read_tracks(
        folder / given.file, columns=given.columns, unit=given.unit, fps=given.fps,
        delimiter=given.delimiter,
    )  # fmt: skip
    begin, chosen = _chosen(given, found, step, steps)
    return [
        tracks.actor(
            track._replace(points=track.points + np.array(given.at)), begin, step, steps,
            shape=given.shape, still=given.still, ground=terrain.floor,
        )
        for track in chosen
    ]  # fmt: skip


def _chosen(
    given: TracksTable, found: list[tracks.Track], step: float, steps: int
) -> tuple[float, list[tracks.Track]]:
    """Time of step 0, and who is filmed."""
    if (given.ids is None) == (given.count is None):
        raise ProblemError("must have either ids or a count")
    candidates = found if given.ids is None else _named(given.ids, found)
    wanted = given.count or len(candidates)
    # Sets of those who are there change where someone appears.
    moments = sorted({time for track in candidates for time in tracks.appearances(track)})
    most = 0
    for begin in moments if given.begin is None else [given.begin]:
        there = tracks.present(candidates, begin, step, steps)
        if len(there) >= wanted:
            return begin, there[:wanted]
        most = max(most, len(there))
    when = "at no time" if given.begin is None else f"not from {given.begin:g} s on"
    who = ""
    if given.ids is not None:
        who = "; " + "; ".join(f"{c.id} is there {tracks.presence(c)}" for c in candidates[:4])
    raise ProblemError(
        f"begin: must be a time from which on all of {wanted} are there for {steps * step:g} s, "
        f"which they are {when}; at most {most} are{who}"
    )


def _named(ids: list[int | str], found: list[tracks.Track]) -> list[tracks.Track]:
    by_id = {track.id: track for track in found}
    for name in ids:
        if name not in by_id:
            raise ProblemError(f"ids: {name!r} is not in the file, which has {_some(by_id)}")
    if len(set(ids)) != len(ids):
        raise ProblemError("ids: must differ")
    return [by_id[name] for name in ids]


def _some(names: dict[int | str, tracks.Track]) -> str:
    shown = ", ".join(str(name) for name in list(names)[:5])
    return shown + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def walking(given: WalkTable, terrain: Terrain, step: float, steps: int) -> Actor:
    """Someone who walks along the legs of a table, and stands where they end.

    Parameters
    ----------
    step : seconds between steps
    steps : horizon T
    """
    points = _along(given, step, steps)
    floor = [terrain.floor(x, y) for x, y in points.tolist()]
    yaw = tracks.headings(points, tracks.STILL * step)
    return Actor(poses=np.column_stack([points, floor, yaw]), shape=given.shape)


def _along(given: WalkTable, step: float, steps: int) -> FloatArray:
    """Points [T+1, 2] (m) at the steps."""
    corners = np.array(given.points)
    behind = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    done = given.first + given.speed * step * np.arange(steps + 1)
    return np.column_stack([np.interp(done, behind, axis) for axis in corners.T])
