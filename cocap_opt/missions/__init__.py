"""Files of flights for other programs. To add a format: one module, and one line below.

A format's module has a function `write(flight, every)` that returns an `Export` (see `Writer`); a
module of missions for autopilots has `write(flight, every, autopilot)`. It is imported only when a
file of its kind is requested, so matplotlib is loaded only for drawing.
"""

from functools import partial
from importlib import import_module
from typing import NamedTuple

from cocap_opt.missions.export import Export, Writer

__all__ = ["FORMATS", "Export", "MissionFormat", "Writer"]


class MissionFormat(NamedTuple):
    """A file format to which flights are written.

    Attributes
    ----------
    module : module that writes it; a name that begins with a dot is in this package
    on_earth : True: it contains latitudes and longitudes, and needs a scene with a known position
        on the Earth
    has_dates : True: its times are dates, not only seconds
    autopilots : names of the autopilots for its missions, the default first; empty: it is not a
        mission of items
    takes_off : True: drones take off as part of the file
    """

    module: str
    on_earth: bool = False
    has_dates: bool = False
    autopilots: tuple[str, ...] = ()
    takes_off: bool = False

    def writer(self, autopilot: str | None = None, items: int | None = None) -> Writer:
        """Returns the function that writes it.

        Parameters
        ----------
        autopilot : one of `autopilots`; None: the default
        items : number of items that the autopilot's board can hold; None: the default
        """
        write = import_module(self.module, __name__).write
        if not self.autopilots:
            found: Writer = write
            return found
        from cocap_opt.missions.autopilots import AUTOPILOTS

        pilot = AUTOPILOTS[autopilot or self.autopilots[0]]
        return partial(write, autopilot=pilot if items is None else pilot.holding(items))


FORMATS: dict[str, MissionFormat] = {  # formats by file ending
    ".csv": MissionFormat(".table"),
    ".geojson": MissionFormat(".geojson", on_earth=True, has_dates=True),
    ".kml": MissionFormat(".kml", on_earth=True, has_dates=True),
    ".glb": MissionFormat(".gltf"),
    ".pdf": MissionFormat(".sheet", has_dates=True),
    ".plan": MissionFormat(
        ".qgroundcontrol", on_earth=True, autopilots=("px4", "ardupilot"), takes_off=True
    ),
    ".waypoints": MissionFormat(
        ".waypoint_list", on_earth=True, autopilots=("ardupilot",), takes_off=True
    ),
    ".skyc": MissionFormat(".skybrush", takes_off=True),
    ".crazyflie.csv": MissionFormat(".crazyflie", takes_off=True),
    ".opencv.json": MissionFormat(".opencv"),
    ".colmap.zip": MissionFormat(".colmap"),
    ".pose2sim.toml": MissionFormat(".pose2sim"),
}
