"""Files of flights that others read, by the ending of their names."""

from cocap_opt.missions.crazyflie import crazyflie
from cocap_opt.missions.export import Export, MissionWriter, Writer
from cocap_opt.missions.geojson import geojson
from cocap_opt.missions.gltf import gltf
from cocap_opt.missions.kml import kml
from cocap_opt.missions.qgroundcontrol import ardupilot_plan, px4_plan
from cocap_opt.missions.sheet import sheet
from cocap_opt.missions.skybrush import skybrush
from cocap_opt.missions.table import table
from cocap_opt.missions.waypoint_list import waypoint_list

WRITERS: dict[str, Writer] = {
    ".csv": table,
    ".geojson": geojson,
    ".kml": kml,
    ".glb": gltf,
    ".pdf": sheet,
    ".plan": px4_plan,
    ".waypoints": waypoint_list,
    ".skyc": skybrush,
    ".crazyflie.csv": crazyflie,
}
# Writers of missions by the autopilot that they are for, the usual one first.
FOR_AUTOPILOTS: dict[str, dict[str, MissionWriter]] = {
    ".plan": {"px4": px4_plan, "ardupilot": ardupilot_plan},
    ".waypoints": {"ardupilot": waypoint_list},
}
DATED = ".geojson", ".kml", ".pdf"  # those that hold dates, not seconds alone

__all__ = ["DATED", "FOR_AUTOPILOTS", "WRITERS", "Export", "MissionWriter", "Writer"]
