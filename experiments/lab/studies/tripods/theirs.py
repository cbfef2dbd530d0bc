"""Calls lab-camera-optimizer in a Python that has it: reads a request as JSON, writes the answer.

That Python runs this file as a script, which imports nothing from this project. A request has
`config` (the program's own configuration), `walk`, `analysis`, `points`, `place` (numbers of
cameras to place), `score` (placements to score) and `seed`. The answer has the cameras, their score
and the seconds for each number in `place`, and the scores of the placements in `score`.
"""

import contextlib
import json
import random
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import Any


def main() -> None:
    """Answers one document of standard input."""
    asked = json.load(sys.stdin)
    with contextlib.redirect_stdout(sys.stderr):  # the program prints
        answer = {
            "placed": [_placed(asked, number) for number in asked["place"]],
            "scores": [_score(asked, cameras) for cameras in asked["score"]],
        }
    json.dump(answer, sys.stdout)


def _loaded(asked: dict[str, Any], number: int) -> tuple[Any, dict[str, Any]]:
    """Returns the program's configuration, and its state of the zone."""
    config = asked["config"]
    config["camera_sets"][0]["count_max"] = number
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "room.yaml"
        path.write_text(json.dumps(config))  # JSON is YAML
        loaded = import_module("core.config_loader").load_config(str(path))
    first, last = asked["analysis"]
    walls = import_module("core.room").build_wall_segments(
        loaded.ROOM_CORNERS, loaded.obstacles, loaded.ROOM_HEIGHT
    )
    state = {
        "walk_y": asked["walk"], "walk_x_start": first, "walk_x_end": last,
        "analysis_x_start": first, "analysis_x_end": last,
        "sts_x": (first + last) / 2, "sts_y": asked["walk"], "wall_segments": walls,
    }  # fmt: skip
    return loaded, state


def _placed(asked: dict[str, Any], number: int) -> dict[str, Any]:
    """Makes the program place so many cameras."""
    config, state = _loaded(asked, number)
    points = [tuple(point) for point in asked["points"]]
    random.seed(asked["seed"])
    begin = time.process_time()
    options = config.opt
    walls, tripods = import_module("core.candidates").generate_candidates(
        config, state, options.wall_step, options.angle_steps, options.tripod_grid_step, points
    )
    cameras, _, score, *_ = import_module("core.greedy").greedy_place_cameras(
        walls, tripods, points, config, state, n_restarts=options.restarts_per_combo, quiet=True
    )
    seconds = time.process_time() - begin
    return {"cameras": cameras, "score": score, "seconds": seconds}


def _score(asked: dict[str, Any], cameras: list[Any]) -> float:
    """Makes the program score cameras."""
    config, state = _loaded(asked, len(cameras))
    points = [tuple(point) for point in asked["points"]]
    scoring = import_module("core.scoring")
    mounted = [tuple(camera) for camera in cameras]
    return float(scoring.score_configuration(mounted, [], points, config, state)[0])


if __name__ == "__main__":
    main()
