"""The people of a recipe, tracked by others or walking along given legs."""

import logging
import math
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.problem import Actor, Shape
from cocap_opt.scenarios.recipe.earth import Projection
from cocap_opt.scenarios.recipe.pace import IMPOSSIBLE, pace_warning
from cocap_opt.scenarios.recipe.tables import Count, Heading, Point, Size, Table, Unit
from cocap_opt.scenarios.recipe.terrain import Terrain
from cocap_opt.scenarios.recipe.tracks import BODY, MOST_GAP, SLACK, STILL, Track

log = logging.getLogger(__name__)

_LEAST_WALK = 0.5  # of the scene's duration; who walks for less may be meant to walk on


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

    def actors(
        self, folder: Path, terrain: Terrain, step: float, steps: int, projection: Projection
    ) -> list[Actor]:
        """Reads the people of the file who are there at all steps, standing on the ground.

        Parameters
        ----------
        folder : of the file that the table names
        terrain : the ground
        step : seconds between steps
        steps : horizon T
        projection : makes metres of latitudes and longitudes

        Raises
        ------
        ProblemError
            If the file cannot be read or has no such people; one line.
        """
        tracks = Track.read_all(
            folder / self.file, columns=self.columns, unit=self.unit, fps=self.fps,
            delimiter=self.delimiter, projection=projection,
        )  # fmt: skip
        begin, chosen = self._chosen(tracks, step, steps)
        actors = [
            track._replace(points=track.points + np.array(self.at)).actor(
                begin, step, steps, shape=self.shape, still=self.still, ground=terrain.floor
            )
            for track in chosen
        ]
        names, causes = [f"id {track.id}" for track in chosen], "unit, fps, step and all its rows"
        if warning := pace_warning(names, actors, step, causes):
            log.warning("%s: %s", self.file, warning)
        return actors

    def _chosen(self, tracks: list[Track], step: float, steps: int) -> tuple[float, list[Track]]:
        """Returns the time (s) of step 0, and the people who are filmed."""
        if (self.ids is None) == (self.count is None):
            present = _present(tracks, steps * step, self.begin)
            raise ProblemError(f"must have either ids or a count; {present}")
        candidates = tracks if self.ids is None else _named(self.ids, tracks)
        wanted = self.count or len(candidates)
        # More people are there only from a time at which someone appears.
        moments = sorted({begin for track in candidates for begin, _ in track.spans()})
        most = 0
        for begin in moments if self.begin is None else [self.begin]:
            there = [track for track in candidates if track.is_there(begin, step, steps)]
            if len(there) >= wanted:
                if self.begin is None:
                    self._say_begin(candidates, wanted, begin, step * steps)
                return begin, there[:wanted]
            most = max(most, len(there))
        when = "at no time" if self.begin is None else f"not from {self.begin:g} s on"
        self._require_dense(candidates)
        shown = candidates if self.ids else [one for one in candidates if len(one.spans()) > 1]
        shown = shown or sorted(candidates, key=lambda track: track.times[0] - track.times[-1])
        who = "; ".join(f"{track.id} is there {track.presence()}" for track in shown[:4])
        self._require_lasting(candidates, wanted, step, steps, who)
        raise ProblemError(
            f"begin: must be a time from which on all of {wanted} are there for {steps * step:g} "
            f"s, which they are {when}; at most {most} are; {who}"
        )

    def _say_begin(self, tracks: list[Track], wanted: int, begin: float, seconds: float) -> None:
        """Says that step 0 is not where the tracks begin, and why, if it is so."""
        first = min(float(track.times[0]) for track in tracks)
        if begin <= first + SLACK:
            return
        late = next((track for track in tracks if not _is_there(track, first, seconds)), tracks[0])
        own = f", at their {begin:.12g} s" if abs(first) > SLACK else ""
        log.warning(
            "%s: step 0 is %.6g s into the tracks%s, because %d people are there for %.6g s only "
            "from then on; %s is there %s; begin names another time",
            self.file, begin - first, own, wanted, seconds, late.id, late.presence(),
        )  # fmt: skip

    def _require_lasting(
        self, tracks: list[Track], wanted: int, step: float, steps: int, who: str
    ) -> None:
        """Raises a ProblemError that names the steps for which so many people are there at once."""
        spans = [span for track in tracks for span in track.spans()]
        moments = {a for a, _ in spans} if self.begin is None else {self.begin}
        lasting = [
            sorted((b - t for a, b in spans if a <= t + SLACK and b >= t), reverse=True)[:wanted]
            for t in moments
        ]
        most = max((row[-1] for row in lasting if len(row) == wanted), default=-1.0)
        if most < 0:
            return
        fitting = math.floor((most + SLACK) / step)
        way_out = (
            f"steps = {fitting} would do"
            if fitting
            else "who stands may be a [[walk]] with one point and a heading"
        )
        since = "" if self.begin is None else f" from begin = {self.begin:g} s on"
        raise ProblemError(
            f"must have people for {steps} steps of {step:g} s, {steps * step:g} s, but the tracks "
            f"of {wanted} last {most:.6g} s at most{since}; {way_out}"
            f"{'' if self.begin is None else ', or another begin'}; {who}"
        )

    def _require_dense(self, tracks: list[Track]) -> None:
        """Raises a ProblemError if rows of a person are too far apart for following anybody."""
        ways = np.concatenate([np.zeros(0), *(np.diff(track.times) for track in tracks)])
        apart = float(np.median(ways)) if len(ways) else 0.0
        if apart <= MOST_GAP:
            return
        words = (
            f"rows of a person are {apart:.6g} s apart, and people are followed over at most "
            f"{MOST_GAP:g} s"
        )
        if self.fps is None or round(apart * self.fps) < 2:
            raise ProblemError(
                f"file: {words}; are its times right? A column of ms is named time [ms]"
            )
        frames = round(apart * self.fps)
        raise ProblemError(
            f"fps: must be the rate at which frame numbers count, {frames} times that of the rows, "
            f"for they go in steps of {frames}; at {self.fps:g} frames/s {words}"
        )


class WalkTable(Table):
    """One of the tables `walk` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`."""

    points: Annotated[list[Point], Meta(min_length=1)]
    name: str | None = None
    speed: Size = 1.2
    first: Size = 0.0
    heading: Heading | None = None
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
        if self.speed > IMPOSSIBLE:  # a short way may end before it shows
            raise ProblemError(f"speed: must be at most {IMPOSSIBLE:g} m/s, not {self.speed:g}")
        points = self._along(step, steps)
        floor = [terrain.floor(x, y) for x, y in points.tolist()]
        yaw = Track.headings(points, STILL * step)
        if self.heading is not None:
            yaw[:] = math.radians(self.heading)
        actor = Actor(poses=np.column_stack([points, floor, yaw]), shape=self.shape, name=self.name)
        x, y = self.points[0]
        if warning := pace_warning(
            [f"the walk from ({x:g}, {y:g}) m"], [actor], step, "speed and step"
        ):
            log.warning("%s", warning)
        if words := self._rest(step * steps):
            log.warning("the walk from (%g, %g) m %s", x, y, words)
        return actor

    def _rest(self, seconds: float) -> str:
        """Returns a warning about a person who stands for most of the scene after a walk."""
        way = float(np.hypot(*np.diff(np.array(self.points), axis=0).T).sum()) - self.first
        if not way > 0 or not self.speed:
            return ""
        ends = way / self.speed
        if ends >= _LEAST_WALK * seconds:
            return ""
        return (
            f"ends after {ends:.3g} of {seconds:.3g} s, and the person stands there: are speed and "
            "points right?"
        )

    def _along(self, step: float, steps: int) -> FloatArray:
        """Returns the points [T+1, 2] (m) at the steps."""
        corners = np.array(self.points)
        behind = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        if self.first > behind[-1] * (1 + 1e-9):
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
            raise ProblemError(f"ids: {name!r} is not in the file, which has {_listed(tracks)}")
    if len(set(ids)) != len(ids):
        raise ProblemError("ids: must differ")
    return [by_id[name] for name in ids]


def _present(tracks: list[Track], seconds: float, begin: float | None) -> str:
    """Says who is in a file, and when most of them are there for some seconds."""
    spans = np.array([span for track in tracks for span in track.spans()])
    lasting = spans[spans[:, 1] - spans[:, 0] >= seconds - SLACK]
    words = f"the file has {len(tracks)} people ({_listed(tracks)})"
    moments = np.unique(lasting[:, 0]) if begin is None else np.array([begin])
    # Who is there at a moment has come by then, and does not leave before the seconds are over.
    counts = np.searchsorted(np.sort(lasting[:, 0]), moments + SLACK, side="right")
    counts -= np.searchsorted(np.sort(lasting[:, 1]), moments + seconds - SLACK)
    if not len(lasting) or counts.max() == 0:
        return f"{words}; nobody is there for {seconds:g} s" + (
            "" if begin is None else f" from {begin:g} s on"
        )
    best = float(moments[np.argmax(counts)])
    there = [
        track
        for track in tracks
        if any(a <= best + SLACK and best + seconds - SLACK <= b for a, b in track.spans())
    ]
    listed = f"{len(there)} ({_listed(there)})" if len(there) < len(tracks) else "all"
    return f"{words}; {listed} are there for {seconds:g} s from {best:.12g} s on"


def _is_there(track: Track, begin: float, seconds: float) -> bool:
    """Returns True if a person is there without a gap for some seconds."""
    return any(a <= begin + SLACK and begin + seconds <= b + SLACK for a, b in track.spans())


def _listed(tracks: list[Track]) -> str:
    shown = ", ".join(str(track.id) for track in tracks[:5])
    return shown + (f" and {len(tracks) - 5} more" if len(tracks) > 5 else "")
