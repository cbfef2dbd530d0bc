"""cocap-opt: plan the views of several camera drones, and prove how good the plans are.

    >>> import cocap_opt as co
    >>> problem = co.load("bottleneck", seed=0)
    >>> result = co.plan(problem, "cocap", time_limit=10)
    >>> best = co.solve(problem, time_limit=60, start=result)
    >>> co.verify(problem, result.plan, best.certificate).gap
    >>> co.show(problem, result, best)

Every name below is imported when it is first used, so no solver is loaded before it is needed. An
argument of the wrong type raises a TypeError that names the argument.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cocap_opt.api.covering import coverage, coverage_digest
    from cocap_opt.api.explaining import explain, replans
    from cocap_opt.api.files import load, read, save
    from cocap_opt.api.filming import quality, quality_bound
    from cocap_opt.api.flying import robustness, trajectory
    from cocap_opt.api.fronts import front
    from cocap_opt.api.hedging import compare_takes
    from cocap_opt.api.judging import check, verify
    from cocap_opt.api.measuring import gap
    from cocap_opt.api.methods import bound, plan, solve
    from cocap_opt.api.showing import show
    from cocap_opt.api.teaming import team
    from cocap_opt.api.variants import rest, takes, with_starts, with_views
    from cocap_opt.console.versions import show_versions
    from cocap_opt.data import ProblemError
    from cocap_opt.experiments.report.teams import Teams
    from cocap_opt.files.documents import FileError
    from cocap_opt.footage.quality import Quality
    from cocap_opt.formulations import BOUNDS, EXACT
    from cocap_opt.formulations.certificates.format import (
        CertificateError,
        CertificateFile,
        ProofFile,
    )
    from cocap_opt.formulations.result import CertifiedResult, Snapshot
    from cocap_opt.planners import PLANNERS, Planner
    from cocap_opt.player.player import Player
    from cocap_opt.problem import (
        COVERAGE_VERSION,
        NO_RULES,
        VERTEX_ONLY,
        Actor,
        Airspace,
        Camera,
        CollisionRules,
        Cone,
        Cuboid,
        Earth,
        GoalArea,
        LandCover,
        Limits,
        Motion,
        Objective,
        PassConflict,
        Plan,
        Prism,
        Problem,
        Robot,
        StartArea,
        StartStates,
        State,
        SwapConflict,
        Take,
        TriangulatedCuboid,
        VertexConflict,
        Views,
    )
    from cocap_opt.referee import Verdict
    from cocap_opt.result import Reason, Result, UnsupportedError
    from cocap_opt.run.front import Front
    from cocap_opt.run.judged import RefereeError
    from cocap_opt.run.quality_bound import QualityBound
    from cocap_opt.run.replanning import Replanned
    from cocap_opt.run.verified import Verified
    from cocap_opt.scenarios import FORMATS, SCENES
    from cocap_opt.stop import FirstOf, Limit, Stop, TimeLimit, WorkLimit, never
    from cocap_opt.world.workspace import HeightMap, Mesh

    __version__: str

# The module of each name.
_MODULES = {
    "cocap_opt.referee": ("Verdict",),
    "cocap_opt.data": ("ProblemError",),
    "cocap_opt.run.front": ("Front",),
    "cocap_opt.run.judged": ("RefereeError",),
    "cocap_opt.run.quality_bound": ("QualityBound",),
    "cocap_opt.run.replanning": ("Replanned",),
    "cocap_opt.run.verified": ("Verified",),
    "cocap_opt.api.covering": ("coverage", "coverage_digest"),
    "cocap_opt.api.explaining": ("explain", "replans"),
    "cocap_opt.api.fronts": ("front",),
    "cocap_opt.api.hedging": ("compare_takes",),
    "cocap_opt.api.files": ("load", "read", "save"),
    "cocap_opt.api.filming": ("quality", "quality_bound"),
    "cocap_opt.api.flying": ("robustness", "trajectory"),
    "cocap_opt.api.judging": ("check", "verify"),
    "cocap_opt.api.measuring": ("gap",),
    "cocap_opt.api.methods": ("bound", "plan", "solve"),
    "cocap_opt.api.showing": ("show",),
    "cocap_opt.api.teaming": ("team",),
    "cocap_opt.api.variants": ("rest", "takes", "with_starts", "with_views"),
    "cocap_opt.console.versions": ("show_versions",),
    "cocap_opt.player.player": ("Player",),
    "cocap_opt.experiments.report.teams": ("Teams",),
    "cocap_opt.files.documents": ("FileError",),
    "cocap_opt.footage.quality": ("Quality",),
    "cocap_opt.formulations": ("BOUNDS", "EXACT"),
    "cocap_opt.formulations.certificates.format": (
        "CertificateError", "CertificateFile", "ProofFile",
    ),
    "cocap_opt.formulations.result": ("CertifiedResult", "Snapshot"),
    "cocap_opt.planners": ("PLANNERS", "Planner"),
    "cocap_opt.problem": (
        "COVERAGE_VERSION", "NO_RULES", "VERTEX_ONLY", "Actor", "Airspace", "Camera",
        "CollisionRules", "Cone", "Cuboid", "Earth", "GoalArea", "LandCover", "Limits", "Motion",
        "Objective", "PassConflict", "Plan", "Prism", "Problem", "Robot", "StartArea",
        "StartStates", "State", "SwapConflict", "Take", "TriangulatedCuboid", "VertexConflict",
        "Views",
    ),
    "cocap_opt.result": ("Reason", "Result", "UnsupportedError"),
    "cocap_opt.scenarios": ("FORMATS", "SCENES"),
    "cocap_opt.stop": ("FirstOf", "Limit", "Stop", "TimeLimit", "WorkLimit", "never"),
    "cocap_opt.world.workspace": ("HeightMap", "Mesh"),
}  # fmt: skip
_HOME = {name: module for module, names in _MODULES.items() for name in names}

# Written out, as type checkers read it without running code.
__all__ = [
    "BOUNDS", "COVERAGE_VERSION", "EXACT", "FORMATS", "NO_RULES", "PLANNERS", "SCENES",
    "VERTEX_ONLY", "Actor", "Airspace", "Camera", "CertificateError", "CertificateFile",
    "CertifiedResult", "CollisionRules", "Cone", "Cuboid", "Earth", "FileError", "FirstOf",
    "Front", "GoalArea", "HeightMap", "Limit", "Limits", "Mesh", "Motion", "Objective",
    "PassConflict", "Plan", "Planner", "Player", "Prism", "Problem", "ProblemError", "ProofFile",
    "Quality", "QualityBound", "Reason", "RefereeError", "Result", "Robot", "Snapshot", "StartArea",
    "StartStates", "State", "Stop", "SwapConflict", "Take", "Teams", "TimeLimit",
    "TriangulatedCuboid", "UnsupportedError", "Verdict", "Verified", "VertexConflict", "Views",
    "WorkLimit", "bound", "check", "compare_takes", "coverage", "coverage_digest", "explain",
    "front", "gap", "load", "never", "plan", "quality", "quality_bound", "read", "replans", "rest",
    "robustness", "save", "show", "show_versions", "solve", "takes", "team", "trajectory", "verify",
    "with_starts", "with_views",
]  # fmt: skip

if not TYPE_CHECKING:  # otherwise type checkers would accept any misspelt name

    def __getattr__(name: str) -> Any:
        """Import a name when it is first used."""
        if name == "__version__":  # pyproject.toml defines it
            from importlib.metadata import version  # slow to import

            return version("cocap-opt")
        if name == "PAPER_RULES":  # a former name, which did not say that swaps are allowed
            raise AttributeError(
                "PAPER_RULES is now VERTEX_ONLY, which allows swaps; built-in scenes have "
                "CollisionRules(), vertex and swap"
            )
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """List all public names, loaded or not."""
    return sorted({"__version__", "__doc__", *_HOME})
