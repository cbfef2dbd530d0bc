"""The planning problem: scene data, checked once when it is created, and plans for it.

The names below are the vocabulary of all other modules: `from cocap_opt.problem import Problem`.
"""

from cocap_opt.problem.actor import Actor
from cocap_opt.problem.airspace import Airspace
from cocap_opt.problem.camera import AnyCamera, Camera, Cone
from cocap_opt.problem.goals import AnyGoal, GoalArea, goal_cells, may_end
from cocap_opt.problem.land_cover import LandCover
from cocap_opt.problem.motion import Cell, Motion, State, Stride
from cocap_opt.problem.objective import COVERAGE_VERSION, Objective, Views, require_visible_share
from cocap_opt.problem.plan import (
    Conflict,
    Ending,
    PassConflict,
    Plan,
    SwapConflict,
    VertexConflict,
)
from cocap_opt.problem.problem import Problem
from cocap_opt.problem.robot import Limits, Robot
from cocap_opt.problem.rules import BODY, NO_RULES, SEPARATION, VERTEX_ONLY, CollisionRules
from cocap_opt.problem.scene import Earth, SceneData
from cocap_opt.problem.shapes import Cuboid, Prism, Shape, TriangulatedCuboid
from cocap_opt.problem.starts import AnyStart, StartArea, StartSet, StartStates
from cocap_opt.problem.takes import Take

__all__ = [
    "BODY",
    "COVERAGE_VERSION",
    "NO_RULES",
    "SEPARATION",
    "VERTEX_ONLY",
    "Actor",
    "Airspace",
    "AnyCamera",
    "AnyGoal",
    "AnyStart",
    "Camera",
    "Cell",
    "CollisionRules",
    "Cone",
    "Conflict",
    "Cuboid",
    "Earth",
    "Ending",
    "GoalArea",
    "LandCover",
    "Limits",
    "Motion",
    "Objective",
    "PassConflict",
    "Plan",
    "Prism",
    "Problem",
    "Robot",
    "SceneData",
    "Shape",
    "StartArea",
    "StartSet",
    "StartStates",
    "State",
    "Stride",
    "SwapConflict",
    "Take",
    "TriangulatedCuboid",
    "VertexConflict",
    "Views",
    "goal_cells",
    "may_end",
    "require_visible_share",
]
