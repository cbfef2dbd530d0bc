"""Problems compiled for planners and formulations: robot classes, their graphs and coverage.

`model` has the classes and what is asked of them; `places` says where robots can be and what
conflicts there, `path_cells` which cells a path passes; `coverage_tables` makes and keeps the
coverage, which problems that differ in their rules share; `coverage_estimate` says before what it
costs.
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
