"""Files of flights that others read, by the ending of their names."""

from cocap_opt.experiments.missions.mission import Mission, Writer
from cocap_opt.experiments.missions.table import table

WRITERS: dict[str, Writer] = {".csv": table}

__all__ = ["WRITERS", "Mission", "Writer"]
