"""Tracks of several files on one clock: people who each recorded their own way."""

from collections import Counter
from pathlib import Path

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.tracks.times import Clock
from cocap_opt.scenarios.tracks.track import Track

_NANO = 10**9


def on_one_clock(files: dict[str, list[Track]]) -> list[Track]:
    """Returns the tracks of all files, with times that count from the same moment.

    Dates count from the first of all files; files without dates count as they stand. Where two
    files give a person the same id, people have the names of their files, if each file has one
    person.

    Parameters
    ----------
    files : tracks by the name of their file

    Raises
    ------
    ProblemError
        If some files have dates and others have none, or only some say how far they are from UTC;
        or if an id is in two files that have several people. One line.
    """
    clocks = {name: tracks[0].clock for name, tracks in files.items()}
    _require_comparable(clocks)
    first = min((clock.nanoseconds for clock in clocks.values() if clock), default=0)
    _require_names(files)
    count = Counter(track.id for tracks in files.values() for track in tracks)
    shared = []
    for name, tracks in files.items():
        for track in tracks:
            who = track.id if count[track.id] == 1 else Path(name).stem
            shared.append(_shifted(track, first)._replace(id=who))
    return shared


def _shifted(track: Track, first: int) -> Track:
    """Returns a track whose times count from a moment, in ns since 1970, if it has dates."""
    if track.clock is None:
        return track
    times = track.times + (track.clock.nanoseconds - first) / _NANO
    times.setflags(write=False)
    return track._replace(times=times, clock=track.clock._replace(nanoseconds=first))


def _require_comparable(clocks: dict[str, Clock | None]) -> None:
    kinds: dict[str, str] = {}
    for name, clock in clocks.items():
        kind = "numbers" if clock is None else "dates"
        if clock is not None and not clock.is_universal:
            kind = "dates without an offset"
        kinds.setdefault(kind, name)
    if len(kinds) > 1:
        said = " and ".join(f"{name} has {kind}" for kind, name in kinds.items())
        raise ProblemError(
            f"file: must be files on one clock, but {said}: times must all be numbers, dates with "
            "an offset such as Z, or dates without"
        )


def _require_names(files: dict[str, list[Track]]) -> None:
    """Raises a ProblemError if nothing tells people of several files apart."""
    where: dict[int | str, str] = {}
    for name, tracks in files.items():
        for track in tracks:
            other = where.setdefault(track.id, name)
            if other == name:
                continue
            alone = len(tracks) == len(files[other]) == 1
            if not alone or Path(name).stem == Path(other).stem:
                raise ProblemError(
                    f"file: {track.id!r} must not be in two files, {other} and {name}; give people "
                    "ids that differ"
                )
