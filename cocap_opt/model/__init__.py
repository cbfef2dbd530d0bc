"""Problems compiled for planners and formulations: robot classes, their graphs and coverage.

`model` contains the classes and the queries about them; `places` the places of robots and the
conflicts among these, `path_cells` the cells that a path passes; `coverage_tables` computes and
caches the coverage, which problems that differ only in their rules share; `coverage_estimate`
estimates its cost in advance.
"""

from cocap_opt.model.coverage_estimate import CoverageEstimate
from cocap_opt.model.coverage_tables import Path
from cocap_opt.model.model import Model, compiled, compiled_anew, share_coverage
from cocap_opt.model.path_cells import PathCells
from cocap_opt.model.places import RobotClass

__all__ = [
    "CoverageEstimate",
    "Model",
    "Path",
    "PathCells",
    "RobotClass",
    "compiled",
    "compiled_anew",
    "share_coverage",
]
