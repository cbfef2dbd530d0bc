"""Players of small scenes, and what their pages are told."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from strategies import plate, tiny

from cocap_opt.cli.main import main
from cocap_opt.planners import PLANNERS
from cocap_opt.player.player_plan import PlayerPlan
from cocap_opt.player.player_scene import PlayerScene
from cocap_opt.problem import (
    Actor,
    Airspace,
    Camera,
    Motion,
    Plan,
    Prism,
    Problem,
    Robot,
    State,
)
from cocap_opt.stop import never
from cocap_opt.world.workspace import HeightMap, Mesh

ROOT = Path(__file__).parents[2]
EVIL = (
    "</script><script>document.title='x'</script><!--"
    "<img src=http://x.y onerror=alert(1)>&amp;\u2028\"'`${1}"
)


def planned(problem: Problem, *names: str) -> list[tuple[str, Any]]:
    """Plans by these planners, each called like its planner."""
    return [(name, PLANNERS[name](problem, never).plan) for name in names]


def seen_by(problem: Problem, plan: Plan) -> Any:
    """Coverage [T+1, F] that faces are coloured by."""
    return PlayerPlan(PlayerScene(problem), problem, plan, None).seen


def told(page: str) -> dict[str, Any]:
    """What a page is told."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    assert found is not None
    data: dict[str, Any] = json.loads(found.group(1))
    return data


def crossing() -> tuple[Problem, Plan]:
    """Two drones that cross in the middle between four cells, which no rule of cells forbids."""
    motion, faces = Motion(layers=(5.0,), radius=1), [State(x, 0, 0, 0, 0) for x in (0, 1)]
    robots = tuple(Robot(start=start, motion=motion) for start in faces)
    problem = tiny().replace(
        height_map=HeightMap(heights=np.zeros((4, 4))), robots=robots, meshes=(), horizon=1
    )
    return problem, Plan(paths=((faces[0], State(1, 1, 0, 0, 0)), (faces[1], State(0, 1, 0, 0, 0))))


def hills() -> Problem:
    """Hills far from the origin with a house and a plate; two layers, a gimbal, a prism."""
    datum = 300 + 2.0 * np.arange(6)[:, None] + np.zeros((6, 5))
    heights = datum.copy()
    heights[2, 2] += 9.0
    heights[3, 1] += 1.0
    corner = (468_000.5, 5_120_000.25)
    motion = Motion(layers=(4.0, 8.0), radius=1)
    camera = Camera(tilts=(0.2, 0.7))
    x, y = corner
    return Problem(
        name="hills",
        height_map=HeightMap(heights=heights, datum=datum, origin=corner, resolution=2.0),
        meshes=(plate((x + 1, y + 1), (x + 3, y + 5), 306.5),),
        robots=(
            Robot(start=State(0, 0, 1, 3, 1), motion=motion, camera=camera),
            Robot(start=State(5, 4, 0, 0, 0), motion=motion, camera=camera),
        ),
        actors=(Actor(poses=np.array([[x + 9, y + 1 + t, 308.0, 0.1] for t in range(3)]),
                      shape=Prism(sides=5)),),
        horizon=2,
    )  # fmt: skip


def shut_in() -> Problem:
    """The hills with a zone to the sky and far below, a ceiling, and people kept clear of."""
    x, y = hills().height_map.origin
    zone = Mesh.box((x + 6, y + 6, -1e9), (x + 8, y + 8, 1e9))
    limits = Airspace(no_fly=(zone,), ceiling=9.0, people_aside=1.0, people_above=2.0)
    return hills().replace(airspace=limits, meshes=())


def run(*words: object) -> int:
    """Exit code of a command."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    return int(caught.value.code or 0)


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plan that has conflicts, and one that has none, of the bottleneck."""
    folder = tmp_path_factory.mktemp("plans")
    for name in ("greedy", "cocap"):
        assert run("plan", "bottleneck", "--planner", name, "-o", folder / f"{name}.json") == 0
    return folder
