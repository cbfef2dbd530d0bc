"""lab-camera-optimizer in its own Python: its placements of cameras, and its scores."""

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cocap_opt.experiments.lab.studies.tripods.rooms import Mounted, Room
from cocap_opt.files.documents import FileError

_SCRIPT = Path(__file__).with_name("theirs.py")
_RANGE = 12.0  # m, more than the distance of any point of the rooms from a wall that sees it
_STEP = 0.5  # m between mounting places, as ours
_SEED = 0


class Placed(NamedTuple):
    """Cameras that the program placed, their score by the program, and its CPU time in seconds."""

    cameras: list[Mounted]
    score: float
    seconds: float


class Program(NamedTuple):
    """The program.

    Attributes
    ----------
    python : the Python interpreter that has it installed
    """

    python: Path

    def place(self, room: Room, number: int) -> Placed:
        """Returns the program's placement of so many cameras."""
        (found,) = self._asked(room, {"place": [number], "score": []})["placed"]
        return Placed([Mounted(*c) for c in found["cameras"]], found["score"], found["seconds"])

    def score(self, room: Room, placements: Sequence[Sequence[Mounted]]) -> list[float]:
        """Returns the program's score of each placement."""
        scores: list[float] = self._asked(room, {"place": [], "score": placements})["scores"]
        return scores

    def _asked(self, room: Room, question: dict[str, Any]) -> dict[str, Any]:
        document = question | {
            "config": configuration(room), "walk": room.walk, "analysis": room.analysis,
            "points": room.points, "seed": _SEED,
        }  # fmt: skip
        try:
            done = subprocess.run(
                [self.python, "-I", _SCRIPT], input=json.dumps(document),
                capture_output=True, text=True, check=False,
            )  # fmt: skip
        except OSError as error:
            raise FileError(f"--theirs: {self.python} cannot be run: {error.strerror}") from error
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            words = "must be a Python with lab-camera-optimizer 1.2.1"
            raise FileError(f"--theirs: {words}, not {self.python}: {last}")
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer


def configuration(room: Room) -> dict[str, Any]:
    """Returns a room in the form of the program's configuration files."""
    across, upright = room.lens
    x, y = room.size
    return {
        "room": {"corners": [[0, 0], [x, 0], [x, y], [0, y]], "height": room.ceiling},
        "obstacles": [
            {"type": "rect", "bounds": box, "height": room.ceiling} for box in room.pillars
        ],
        "subject": {"height": room.person},
        "camera_sets": [{
            "id": "wall", "mounting": "wall",
            "fov_h_landscape": across, "fov_v_landscape": upright,
            "fov_h_portrait": upright, "fov_v_portrait": across,
            "max_range": _RANGE, "min_range": 0.5,
            "height_options": room.heights, "min_spacing": room.spacing,
        }],
        "capture_zones": [],
        "optimization": {
            "target_coverage": room.target, "bilateral_weight": room.bilateral,
            "vertical_coverage_threshold": room.whole, "restarts_per_combo": room.restarts,
            "wall_step": _STEP, "distance_quality_factor": room.decay, "algo": "greedy_1opt",
        },
    }  # fmt: skip
