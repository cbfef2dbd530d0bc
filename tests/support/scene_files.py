"""Small scene files of other projects, which tests write, read and damage."""

import json
from pathlib import Path
from typing import Any

# A seq.yaml of Greedy Perspectives: two robots and one actor on 6 x 4 cells, two moves.
SEQUENCE = """\
planner:
  world:
    time: {horizon: 3, stepSize: 0.3}
    state_resolution: {heading: 8, gridSize: 1}
    map: {file: elsewhere/tiny/map.npy, gridSize: 1}
    actors:
      - actor:
          geometry: {width: 9, length: 9, height: 9}
          trajectory: [[2, 3.5, 0], [3, 3.5, 0.1], [4, 3.5, 0.2], [5, 3.5, 0.3]]
    agents:
      - agent:
          startPose: [1.5, 0, 5, 0]
          camera: {intrinsics: [2500, 4000, 3000], tilt: 1.4}
      - agent:
          startPose: [4, 1, 6, -1]
          camera: {intrinsics: [1000, 400, 300], tilt: 1.2}
"""
STARTS = "x,y,z,theta\n0,0,5,0\n1,0,5,0\n0,1 ,5,3.1415\n1,1,5,3.4\n"

# A seq.yaml of one robot and one actor on 4 x 4 cells, one move.
SMALL_SEQUENCE = """\
planner:
  world:
    time: {horizon: 2}
    state_resolution: {heading: 8}
    map: {file: map.npy, gridSize: 1}
    actors: [{actor: {trajectory: [[2, 3.5, 0], [3, 3.5, 0]]}}]
    agents:
      - agent: {startPose: [1.5, 0, 5, 0], camera: {intrinsics: [2500, 4000, 3000], tilt: 1}}
"""


def actor(x: float, y: float, yaw: float, weight: float = 1.0) -> dict[str, Any]:
    """An actor in a frame."""
    return {"location": [x, y, 0.3], "rotation": [9.0, 9.0, yaw], "weight": weight}


def solution(*paths: list[tuple[int, int, str]]) -> dict[str, Any]:
    """A solution file."""
    return {
        "value": 0.0,
        "elements": [
            [k + 1, [{"state": {"x": x, "y": y, "heading": h}, "depth": t + 1, "horizon": 3}
                     for t, (x, y, h) in enumerate(path)]]
            for k, path in enumerate(paths)
        ],
    }  # fmt: skip


def write_hughes(place: Path) -> Path:
    """Make the folder of a scene of two actors, three frames and two robots."""
    place.mkdir(parents=True)
    frames = [[actor(3 + t, 4, 0.1 * t), actor(6, 6.5, 2.0, weight=t)] for t in range(3)]
    scene = {
        "scene": {"scale": {"x": 8.0, "y": 7.0, "z": 9.0}}, "filename": "", "robot_fovs": [1.0],
        "sense_dist": 1.0, "num_targets": 2, "num_robots": 9, "num_frames": 3,
        "actor_positions": frames,
    }  # fmt: skip
    (place / "scene.json").write_text(json.dumps(scene))
    paths = [[(1, 1, "NE"), (3, 2, "NE"), (3, 4, "E")], [(8, 7, "W"), (8, 7, "SW"), (6, 7, "SW")]]
    (place / "solution_greedy.json").write_text(json.dumps(solution(*paths)))
    return place
