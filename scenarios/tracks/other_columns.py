"""Checks of the columns that are not read, since they may say what those that are read mean.

They may number recordings, name reference systems, or hold the fractions of seconds; others mark
rows of people who are lost, which are left out.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, ProblemError
from cocap_opt.scenarios.earth import same_system, short_name
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.earth.units import utm_of
from cocap_opt.scenarios.tables import PER_SECOND
from cocap_opt.scenarios.tracks.layout import Name, Places, is_number, spelt

# Columns of numbers of recordings, places or days: in each of them ids may count anew, and one time
# may be another moment; spelt as in `layout`, without "id", "name", "number" and the like at the
# end.
_RECORDINGS = {"scene", "scenario", "recording", "rec", "record", "sequence", "seq", "video", "vid",
               "clip", "experiment", "exp", "trial", "run", "session", "dataset", "take", "camera",
               "cam", "file", "trackfile", "log", "bag", "source", "case", "episode", "segment",
               "chunk", "batch", "split", "fold", "repetition", "rep", "match", "game", "period",
               "half", "floor", "level", "storey", "story", "location", "place", "site", "map",
               "city", "date", "day"}  # fmt: skip
_NUMBERING = re.compile(
    r"(?:ids?|names?|no|nr|num(?:ber)?|index|idx|key|token|uuid|hash|label|path|file)$"
)
# Columns that say what was tracked, and words for what is not people.
_KINDS = {"class", "classname", "type", "agenttype", "agentclass", "objecttype", "objectclass",
          "objecttypename", "objtype", "label", "category", "categoryname", "kind", "roadusertype",
          "participanttype", "vehicletype", "trafficparticipant", "species"}  # fmt: skip
_NOT_PEOPLE = {"car", "cars", "truck", "trucks", "bus", "buses", "van", "vans", "vehicle",
               "vehicles", "cart", "carts", "tram", "train", "trailer", "lorry", "taxi", "suv",
               "motorcycle", "motorbike", "bicycle", "robot", "robots", "drone", "static",
               "background", "construction", "dog", "animal"}  # fmt: skip
# Columns of the direction in which people look.
_FACING = {"heading", "yaw", "theta", "orientation", "facing", "bearing", "facingangle", "psi",
           "bodyorientation", "headorientation", "direction"}  # fmt: skip
# Columns that mark rows without a person, and the value that does so: 1 or 0.
_MARKS = {"lost": 1, "islost": 1, "outside": 1, "isoutside": 1,
          "valid": 0, "isvalid": 0, "present": 0, "ispresent": 0}  # fmt: skip
_NO, _YES = {"false", "no", "f", "n"}, {"true", "yes", "t", "y"}
_CODES = {"epsg", "epsgcode", "crs", "srid", "srs"}
_CODE = re.compile(r"(?:EPSG\s*:{0,2}\s*)?(\d{4,6})(?:\.0*)?", re.IGNORECASE)
_ZONES = {"zone", "utmzone", "zonenumber", "utmzonenumber"}
_ZONE = re.compile(r"(\d{1,2})(?:\.0*)?\s*([A-Z]?)", re.IGNORECASE)


class OtherColumns(NamedTuple):
    """The columns of a file of tracks, by name.

    Attributes
    ----------
    names : of all columns
    places : of those that are read, by role
    fields : the fields of the column at a place, each with its line number
    """

    names: Sequence[str]
    places: Places
    fields: Callable[[int], Iterator[tuple[int, str]]]

    def require_one_recording(self) -> None:
        """Raises a ProblemError if the rows are of several recordings, where an id is not one
        person.

        It would join people who have nothing but their id in common, and show people of different
        recordings at once.
        """
        for place in self._of_recordings():
            all_rows = [field for _, field in self.fields(place)]
            found = dict.fromkeys(all_rows)
            if 1 < len(found) < max(len(all_rows), 3):  # else it numbers the rows
                first, other, *_ = found
                raise ProblemError(
                    f"{self.names[place]}: must be the same in all rows, as ids or times may count "
                    f"anew in each, but is {first[:20]!r} and {other[:20]!r}; keep the rows of one "
                    f"or, if all ids are of different people at one time, {self._without(place)}"
                )

    def require_whole_times(self) -> None:
        """Raises a ProblemError if a column beside that of times has the fractions of a second."""
        for place, name in enumerate(self.names):
            role, unit = Name.of(name)
            if role != "time" or unit in (None, "s") or place == self.places.get("time"):
                continue
            values = self._numbers(place)
            if len(values) and values.min() >= 0 and 0 < values.max() < PER_SECOND[unit]:
                raise ProblemError(
                    f"{name}: must be added to the times, as it looks like their fractions of a "
                    f"second; if it does not count, {self._without(place)}"
                )

    def require_system(self, projection: MapProjection) -> None:
        """Raises a ProblemError if a column names another reference system than the scene's."""
        earth = projection.earth
        if earth is None or earth.origin is not None:
            return
        for place in self._called(_CODES):
            for line, field in self.fields(place):
                code = _CODE.fullmatch(field)
                if code and not same_system(earth.crs, f"EPSG:{code[1]}"):
                    raise self._other_system(place, line, field, short_name(earth.crs))
        zone = utm_of(earth.crs)
        if zone is None:
            return
        for place in self._called(_ZONES):
            for line, field in self.fields(place):
                found = _ZONE.fullmatch(field)
                if found and not _is_zone(zone, int(found[1]), found[2].upper()):
                    raise self._other_system(place, line, field, short_name(earth.crs))

    def lost(self) -> dict[str, BoolArray]:
        """Returns the rows [n] in which columns mark people as lost, by the columns' names."""
        found = {}
        for place in self._called(_MARKS):
            mark = _MARKS[spelt(self.names[place])]
            words = [field.lower() for _, field in self.fields(place)]
            numbers = {"0": 0, "1": 1, **dict.fromkeys(_NO, 0), **dict.fromkeys(_YES, 1)}
            values = [numbers.get(word.removesuffix(".0")) for word in words]
            if None not in values:
                found[self.names[place]] = np.array([value == mark for value in values])
        return found

    def not_people(self) -> str:
        """Names a column and the things in it that are not people; empty if there are none."""
        for place in self._called(_KINDS):
            kinds = dict.fromkeys(field for _, field in self.fields(place))
            others = [
                kind
                for kind in kinds
                if not _NOT_PEOPLE.isdisjoint(re.findall("[a-z]+", _split(kind).lower()))
            ]
            if others:
                return f"column {self.names[place]} has {', '.join(map(repr, others[:4]))}"
        return ""

    def facing(self) -> str | None:
        """Returns the name of a column that says where people look; None if there is none."""
        return next((self.names[place] for place in self._called(_FACING)), None)

    def _of_recordings(self) -> Iterator[int]:
        """Yields the places of unread columns that may number recordings."""
        for place in self._unread():
            word = spelt(self.names[place])
            while word not in _RECORDINGS and (shorter := _NUMBERING.sub("", word)) != word:
                word = shorter
            if word in _RECORDINGS:
                yield place

    def _called(self, words: Iterable[str]) -> Iterator[int]:
        """Yields the places of unread columns with one of these names, spelt in any way."""
        return (place for place in self._unread() if spelt(self.names[place]) in words)

    def _unread(self) -> Iterator[int]:
        return (k for k in range(len(self.names)) if k not in self.places.values())

    def _numbers(self, place: int) -> FloatArray:
        """Returns the values [n] of a column; none if one of them is no number."""
        words = [field for _, field in self.fields(place)]
        return np.array(words, dtype=np.float64) if all(map(is_number, words)) else np.zeros(0)

    def _other_system(self, place: int, line: int, field: str, system: str) -> ProblemError:
        return ProblemError(
            f"line {line}, {self.names[place]}: must be the reference system of the scene, "
            f"{system}, not {field[:20]}: convert x and y, e.g. with pyproj or cs2cs"
        )

    def _without(self, place: int) -> str:
        """Returns the advice to leave a column out."""
        kept = ", ".join(f'"{"-" if k == place else name}"' for k, name in enumerate(self.names))
        return f"set columns = [{kept}] in [[tracks]]"


def _split(word: str) -> str:
    """Returns a word with blanks before capitals, as in ArticulatedTruck."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", word)


def _is_zone(zone: tuple[int, bool], number: int, letter: str) -> bool:
    """Returns True if a zone of UTM is this one; S is the south, or a band of the north."""
    band_is_north = letter >= "N"
    return zone[0] == number and (letter in ("", "S") or zone[1] == band_is_north)
