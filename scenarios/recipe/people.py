"""The people of a recipe, who follow recorded tracks or walk along given legs."""

import json
import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from cocap_opt.data import LARGEST, FloatArray, ProblemError
from cocap_opt.problem import Actor, Shape
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.maps.terrain import Terrain
from cocap_opt.scenarios.tables import (
    Count,
    Factor,
    Heading,
    Point,
    Size,
    Table,
    TimeUnit,
    Unit,
)
from cocap_opt.scenarios.text import rectangle
from cocap_opt.scenarios.tracks import (
    BODY,
    MOST_GAP,
    SLACK,
    STILL,
    Track,
    off_walk,
    on_one_clock,
    swerve_of,
)
from cocap_opt.scenarios.tracks.times import SINCE_1970, Epoch, likely_unit
from cocap_opt.text import distance, pair, plain

log = logging.getLogger(__name__)

FASTEST = 12.0  # m/s; nobody runs faster, and few riders are faster
IMPOSSIBLE = 100.0  # m/s; above it, a unit, a frame rate or a step must be wrong

Takes = str | Annotated[list[str], Meta(min_length=1)] | None  # None: all

_REACH = 100.0  # m off the map; people farther away are not filmed
_MOSTLY = 0.5  # share of all intervals between rows; if more are long, rows are too far apart
_LONGEST = 60.0  # s; longest interval in which a straight walk may be intended
_SWERVE = 0.5  # m; people who leave the straight walk by less are where the scene has them
_MOST_FILMED, _FEW = 8, 2  # people in an example of whom to film: all, or a few of more
_LEAST_WALK = 0.5  # share of the scene's duration; a shorter walk may be unintended


class TracksTable(Table):
    """One of the tables `tracks` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    file: str | Annotated[list[str], Meta(min_length=1)]  # several files share one clock
    columns: list[str] | None = None
    unit: Unit | None = None
    fps: float | None = None
    delimiter: str | None = None
    time_unit: TimeUnit | None = None
    gap: Annotated[float, Meta(gt=0, le=LARGEST)] | None = None
    begin: float | None = None
    ids: Annotated[list[int | str], Meta(min_length=1)] | None = None
    count: Count | None = None
    turn: Heading = 0.0  # degrees from x to y, about x = y = 0
    at: Point = (0.0, 0.0)
    shape: Shape = BODY
    views_weight: Factor | None = None
    still: Size = STILL
    take: Takes = None

    def actors(
        self, folder: Path, terrain: Terrain, step: float, steps: int, projection: MapProjection
    ) -> tuple[list[Actor], Epoch | None]:
        """Reads the people of the files who are present at all steps, standing on the ground.

        Also returns the moment of step 0 if times are dates.

        Parameters
        ----------
        folder : folder of the files that the table names
        terrain : the ground
        step : seconds between steps
        steps : horizon T
        projection : converts latitudes and longitudes to metres

        Raises
        ------
        ProblemError
            If a file cannot be read or has no such people; the message is one line.
        """
        tracks = self._tracks(folder, projection)
        begin, chosen = self._chosen(tracks, step, steps)
        actors = [
            track._replace(points=self._placed(track.points)).actor(
                begin, step, steps, shape=self.shape, still=self.still, ground=terrain.floor
            )
            for track in chosen
        ]
        names, causes = [f"id {track.id}" for track in chosen], "unit, fps, step and all its rows"
        if warning := _pace_warning(names, actors, step, causes):
            log.warning("%s: %s", self._named, warning)
        if warning := _swerve_warning(chosen, begin, step, steps):
            log.warning("%s: %s", self._named, warning)
        shown = [f"file: {self._named}: {name}" for name in names]
        _require_near_map(shown, actors, terrain, "`at` moves people, `origin` of [map] the map")
        clock = chosen[0].clock
        return actors, clock and clock.later(begin)

    def _placed(self, points: FloatArray) -> FloatArray:
        """Returns the points [n, 2] (m) of a track where they are on the map."""
        if self.turn:
            cos, sin = math.cos(math.radians(self.turn)), math.sin(math.radians(self.turn))
            points = points @ np.array([[cos, sin], [-sin, cos]])
        placed: FloatArray = points + np.array(self.at)
        return placed

    @property
    def _files(self) -> list[str]:
        return [self.file] if isinstance(self.file, str) else self.file

    @property
    def _named(self) -> str:
        return ", ".join(self._files)

    def _tracks(self, folder: Path, projection: MapProjection) -> list[Track]:
        """Returns the tracks of all files."""
        if len(set(self._files)) < len(self._files):
            raise ProblemError("file: must be different files")
        files = {
            name: Track.read_all(
                folder / name, columns=self.columns, unit=self.unit, fps=self.fps,
                delimiter=self.delimiter, time_unit=self.time_unit, gap=self.gap,
                projection=projection,
            )
            for name in self._files
        }  # fmt: skip
        return files[self._files[0]] if len(files) == 1 else on_one_clock(files)

    def _begin(self, tracks: list[Track]) -> float | None:
        """Returns the requested second of step 0, which may count from 1970 like the file."""
        clock = tracks[0].clock
        if self.begin is None or clock is None or self.begin < SINCE_1970:
            return self.begin
        return self.begin - clock.nanoseconds / 1e9

    def _chosen(self, tracks: list[Track], step: float, steps: int) -> tuple[float, list[Track]]:
        """Returns the time (s) of step 0, and the people to film."""
        wished = self._begin(tracks)
        if (self.ids is None) == (self.count is None):
            there, present = _present(tracks, steps * step, wished)
            if self.count is not None:
                raise ProblemError(f"must have ids or a count, not both; {present}")
            shown = there or tracks
            shown = shown if len(shown) <= _MOST_FILMED else shown[:_FEW]
            ids = ", ".join(json.dumps(track.id, ensure_ascii=False) for track in shown)
            raise ProblemError(
                f"must say who is filmed: write ids = [{ids}] or count = {len(shown)} in "
                f"[[tracks]]; {present}"
            )
        candidates = tracks if self.ids is None else _named(self.ids, tracks)
        wanted = self.count or len(candidates)
        # The number of people present only grows at times at which someone appears.
        moments = sorted({begin for track in candidates for begin, _ in track.spans()})
        most = 0
        for begin in moments if wished is None else [wished]:
            there = [track for track in candidates if track.is_there(begin, step, steps)]
            if len(there) >= wanted:
                if wished is None:
                    self._say_begin(candidates, wanted, begin, step * steps)
                return begin, there[:wanted]
            most = max(most, len(there))
        when = "at any time" if wished is None else f"from {wished:.12g} s on"
        self._require_dense(candidates)
        shown = candidates if self.ids else [who for who in candidates if len(who.spans()) > 1]
        shown = shown or sorted(candidates, key=lambda track: track.times[0] - track.times[-1])
        who = "; ".join(f"id {track.id} is present {track.presence()}" for track in shown[:4])
        self._require_lasting(candidates, wanted, step, steps, wished, who)
        raise ProblemError(
            f"begin: must be the start of {steps * step:g} s in which {wanted} people are present, "
            f"but {when} only {most} are; {who}"
        )

    def _say_begin(self, tracks: list[Track], wanted: int, begin: float, seconds: float) -> None:
        """Logs that step 0 is not at the beginning of the tracks, and the reason."""
        first = min(float(track.times[0]) for track in tracks)
        if begin <= first + SLACK:
            return
        late = next((track for track in tracks if not _is_there(track, first, seconds)), tracks[0])
        when = f", at their {begin:.12g} s" if abs(first) > SLACK else ""
        log.warning(
            "%s: step 0 is %.6g s into the tracks%s, because only then are %d people present for "
            "%.6g s; id %s is present %s; set begin to choose another time",
            self._named, begin - first, when, wanted, seconds, late.id, late.presence(),
        )  # fmt: skip

    def _require_lasting(
        self, tracks: list[Track], wanted: int, step: float, steps: int, begin: float | None,
        who: str,
    ) -> None:  # fmt: skip
        """Raises ProblemError, naming the number of steps for which enough people are present at
        once, if they ever are.
        """
        spans = [span for track in tracks for span in track.spans()]
        moments = {a for a, _ in spans} if begin is None else {begin}
        lasting = [
            sorted((b - t for a, b in spans if a <= t + SLACK and b >= t), reverse=True)[:wanted]
            for t in moments
        ]
        most = max((row[-1] for row in lasting if len(row) == wanted), default=-1.0)
        if most < 0:
            return
        fitting = math.floor((most + SLACK) / step)
        way_out = (
            f"set steps = {fitting}"
            if fitting
            else "for a person who stands, use a [[walk]] with one point and a heading"
        )
        together = (
            "nobody is present" if wanted == 1 else f"no {wanted} people are present together"
        )
        since = "" if begin is None else f" from begin = {begin:.12g} s on"
        raise ProblemError(
            f"must have people for {steps} steps of {step:g} s, {steps * step:g} s, but "
            f"{together} for more than {most:.6g} s{since}; {way_out}"
            f"{'' if begin is None else ', or another begin'}; {who}"
        )

    def _require_dense(self, tracks: list[Track]) -> None:
        """Raises ProblemError if rows of a person are too far apart to follow anybody."""
        ways = np.concatenate([np.zeros(0), *(np.diff(track.times) for track in tracks)])
        lost = np.concatenate([np.zeros(0, bool), *(track.lost() for track in tracks)])
        apart = float(np.median(ways)) if len(ways) else 0.0
        if not len(lost) or lost.mean() < _MOSTLY:
            return
        most = MOST_GAP if self.gap is None else self.gap
        words = (
            f"rows of a person are {apart:.6g} s apart, and people are followed over at most "
            f"{most:g} s"
        )
        if self.fps is None or round(apart * self.fps) < 2:
            raise ProblemError(f"file: {words}; {self._way_out(apart)}")
        frames = round(apart * self.fps)
        raise ProblemError(
            f"fps: must be the rate of frame numbers, {frames} times the rate of rows, as frame "
            f"numbers increase by {frames} per row; at {self.fps:g} frames/s {words}"
        )

    def _way_out(self, apart: float) -> str:
        """Suggests options of the recipe for rows of a person that are this far apart (s)."""
        unit = likely_unit(apart) if self.time_unit is None and self.fps is None else None
        ways = []
        if unit not in (None, "s"):
            ways.append(f'if they are in {unit}, set time_unit = "{unit}"')
        if not ways or apart <= _LONGEST:
            ways.append(f"gap = {math.ceil(apart)} lets people walk straight for that long")
        return f"are its times right? {'; '.join(ways)}"


class WalkTable(Table):
    """One of the tables `walk` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    points: Annotated[list[Point], Meta(min_length=1)]
    name: str | None = None
    speed: Size = 1.2
    first: Size = 0.0
    heading: Heading | None = None
    shape: Shape = BODY
    views_weight: Factor | None = None
    take: Takes = None

    def actor(self, terrain: Terrain, step: float, steps: int) -> Actor:
        """Returns a person who walks along the legs, and stands still at the end.

        Parameters
        ----------
        terrain : the ground
        step : seconds between steps
        steps : horizon T

        Raises
        ------
        ProblemError
            If the walk begins beyond its end, is far off the map, or is impossibly fast.
        """
        if self.speed > IMPOSSIBLE:  # a short walk may end before the speed shows
            raise ProblemError(f"speed: must be at most {IMPOSSIBLE:g} m/s, not {self.speed:g}")
        points = self._along(step, steps)
        floor = [terrain.floor(x, y) for x, y in points.tolist()]
        yaw = Track.headings(points, STILL * step)
        if self.heading is not None:
            yaw[:] = math.radians(self.heading)
        actor = Actor(
            poses=np.column_stack([points, floor, yaw]), shape=self.shape, name=self.name,
            swerve=self._swerve(points, step),
        )  # fmt: skip
        x, y = self.points[0]
        walk = f"the walk of {self.name}" if self.name else f"the walk from {pair(x, y)} m"
        if warning := _pace_warning([walk], [actor], step, "speed and step"):
            log.warning("%s", warning)
        _require_near_map(["points:"], [actor], terrain, "`origin` of [map] moves the map")
        if words := self._rest(step * steps):
            log.warning("%s %s", walk, words)
        return actor

    def _rest(self, seconds: float) -> str:
        """Returns a warning about a person who stands still for most of the scene after a walk."""
        way = float(np.hypot(*np.diff(np.array(self.points), axis=0).T).sum()) - self.first
        if not way > 0 or not self.speed:
            return ""
        ends = way / self.speed
        if ends >= _LEAST_WALK * seconds:
            return ""
        return (
            f"ends after {ends:.4g} of {seconds:.4g} s, and then the person stands still: are "
            "speed and points right?"
        )

    def _swerve(self, walk: FloatArray, step: float) -> float:
        """Returns the largest distance (m) of the legs from a straight walk [T+1, 2] (m) by steps.

        Parameters
        ----------
        step : seconds between steps
        """
        if not self.speed:
            return 0.0
        corners, behind = self._corners()
        reached = (behind - self.first) / self.speed
        times = step * np.arange(len(walk), dtype=np.float64)
        return swerve_of(off_walk(times, walk, reached, corners)[0])

    def _corners(self) -> tuple[FloatArray, FloatArray]:
        """Returns the corners [n, 2] (m) of the legs, and the way [n] (m) up to each of them."""
        corners = np.array(self.points)
        return corners, np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])

    def _along(self, step: float, steps: int) -> FloatArray:
        """Returns the points [T+1, 2] (m) at the steps."""
        corners, behind = self._corners()
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


def _present(tracks: list[Track], seconds: float, begin: float | None) -> tuple[list[Track], str]:
    """Returns who is present for some seconds when most people are, and describes who is in a file,
    and that time.
    """
    spans = np.array([span for track in tracks for span in track.spans()])
    lasting = spans[spans[:, 1] - spans[:, 0] >= seconds - SLACK]
    noun = "person" if len(tracks) == 1 else "people"
    words = f"the file has {len(tracks)} {noun} ({_listed(tracks)})"
    moments = np.unique(lasting[:, 0]) if begin is None else np.array([begin])
    # A person present for the whole period has appeared by its beginning, and does not leave before
    # its end.
    counts = np.searchsorted(np.sort(lasting[:, 0]), moments + SLACK, side="right")
    counts -= np.searchsorted(np.sort(lasting[:, 1]), moments + seconds - SLACK)
    if not len(lasting) or counts.max() == 0:
        since = "" if begin is None else f" from {begin:g} s on"
        return [], f"{words}; nobody is present for {seconds:g} s{since}"
    best = float(moments[np.argmax(counts)])
    there = [
        track
        for track in tracks
        if any(a <= best + SLACK and best + seconds - SLACK <= b for a, b in track.spans())
    ]
    listed = f"{len(there)} ({_listed(there)})" if len(there) < len(tracks) else "all"
    return there, f"{words}; {listed} are present for {seconds:g} s from {best:.12g} s on"


def _is_there(track: Track, begin: float, seconds: float) -> bool:
    """Returns True if a person is present without a gap for some seconds."""
    return any(a <= begin + SLACK and begin + seconds <= b + SLACK for a, b in track.spans())


def _listed(tracks: list[Track]) -> str:
    shown = ", ".join(str(track.id) for track in tracks[:5])
    return shown + (f" and {len(tracks) - 5} more" if len(tracks) > 5 else "")


def _require_near_map(
    names: Sequence[str], actors: Sequence[Actor], terrain: Terrain, way_out: str
) -> None:
    """Rejects people who are far off the map at all steps; people may walk onto the map or off it.

    Parameters
    ----------
    names : names of the people in messages
    way_out : how to move people or the map, in words
    """
    first, last = terrain.height_map.ends
    for name, actor in zip(names, actors, strict=True):
        points = actor.poses[:, :2]
        away = np.hypot(*(points - points.clip(first, last)).T)
        if away.min() > _REACH:
            x, y = points[away.argmin()].tolist()
            raise ProblemError(
                f"{name} must come within {_REACH:g} m of the map, {rectangle(first, last)}, but "
                f"{pair(x, y)} m is the nearest, {distance(away.min())} away; "
                f"{way_out}"
            )


def _pace_warning(names: Sequence[str], actors: Sequence[Actor], step: float, causes: str) -> str:
    """Returns a warning about the first person who is too fast; empty if nobody is.

    Parameters
    ----------
    names : names of the people in messages
    step : seconds between steps
    causes : possible causes, in words

    Raises
    ------
    ProblemError
        If the speed is impossible on the ground.
    """
    warnings = []
    for name, actor in zip(names, actors, strict=True):
        ways = np.hypot(*np.diff(actor.poses[:, :2], axis=0).T)
        t = int(np.argmax(ways))
        speed = ways[t] / step
        pace = plain(float(f"{speed:.4g}"))
        words = f"moves by {distance(ways[t])} from step {t} to {t + 1}, {pace} m/s"
        if speed > IMPOSSIBLE:
            raise ProblemError(
                f"{name} must be slower than {IMPOSSIBLE:g} m/s, but {words}: are {causes} right?"
            )
        if speed > FASTEST:
            warnings.append(f"{name} {words}")
    if not warnings:
        return ""
    more = f"; {len(warnings)} of {len(actors)} people are so fast" if len(warnings) > 1 else ""
    return f"{warnings[0]}{more}: are {causes} right?"


def _swerve_warning(tracks: Sequence[Track], begin: float, step: float, steps: int) -> str:
    """Returns a warning about who leaves the straight walk from step to step the farthest; empty if
    nobody leaves it by much.

    Parameters
    ----------
    tracks : people who are present at all steps
    begin : time of step 0, s
    step : seconds between steps
    steps : horizon T
    """
    swerves = [(*track.swerve(begin, step, steps), track.id) for track in tracks]
    others = sum(away > _SWERVE for away, _, _ in swerves) - 1
    if others < 0:
        return ""
    away, time, who = max(swerves, key=lambda swerve: swerve[0])
    noun = "other" if others == 1 else "others"
    more = f" (and {others} {noun} by more than {_SWERVE:g} m)" if others else ""
    return (
        f"id {who} is up to {distance(away)} off the straight walk between steps, "
        f"{time - begin:.4g} s after step 0{more}; drones that keep a distance to people keep that "
        "much more: shorter steps make it less"
    )
