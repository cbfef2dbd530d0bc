"""The speed of the player: frames per second while it plays or turns, and the cost of a frame.

The cost is the CPU time of the page's main thread, as a share of 1/30 s, so that a busy machine
hardly changes it. The study needs Chromium, like `pictures`.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

from cyclopts import Parameter

from cocap_opt.experiments.lab.studies.options import chromium
from cocap_opt.output.printing import Listing, Record
from cocap_opt.player.player import Player
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene

_SIZE = 1400, 900  # px
_WARM, _MEASURED = 3.0, 6.0  # s, before and while frames are counted
_WANTED = 30.0  # frames per second
_COUNT = """
window.pictures = 0;
const count = () => { window.pictures += 1; requestAnimationFrame(count); };
count();
"""
_PLAY = """
const speed = document.getElementById("speed");
speed.value = "2";
speed.dispatchEvent(new Event("change"));
document.getElementById("play").click();
"""
_TURN = """
const view = document.querySelector("canvas.view"), box = view.getBoundingClientRect();
const drag = (kind, x) => view.dispatchEvent(new PointerEvent(kind, {
  pointerId: 1, clientX: box.left + 300 + x, clientY: box.top + 200, buttons: 1,
}));
view.setPointerCapture = () => {};
drag("pointerdown", 0);
let at = 0;
const turn = () => {
  at += 1;
  drag("pointermove", 250 * Math.sin(at / 80));
  requestAnimationFrame(turn);
};
turn();
"""
# Names, keys to press first, and the script that starts the movement.
_ROWS = (
    ("play", "", _PLAY), ("with a drone's picture", "d", _PLAY), ("following a drone", "df", _PLAY),
    ("turning it", "", _TURN),
)  # fmt: skip


def frames(
    scene: Annotated[str, Parameter(help="built-in scene")] = "field-large",
    *,
    planner: Annotated[str, Parameter(help="planner of the plan to play")] = "greedy",
    drones: Annotated[
        int | None, Parameter(help="number of drones, e.g. 18 (default: all)")
    ] = None,
) -> None:
    """Prints a table of how fast a scene's plan is drawn while it plays or turns."""
    problem = load_scene(scene, 0)
    problem = problem.replace(robots=problem.robots[:drones])
    plan = run(problem, planner).result.plan
    assert plan is not None
    with chromium("frames"), TemporaryDirectory() as folder:
        page = Path(folder) / "player.html"
        Player(problem, [(planner, plan)]).save(page)
        rows = [_measured(page, *row) for row in _ROWS]
    title = f"{problem.name}, {len(problem.robots)} drones: {_SIZE[0]} x {_SIZE[1]} px"
    Listing(title, rows).print()


def _measured(page: Path, name: str, keys: str, moving: str) -> Record:
    from cocap_opt.experiments.lab.studies.pictures import Browser

    with Browser.opened(page, _SIZE) as browser:
        browser.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
        browser.press(keys)
        browser.execute_script(_COUNT + moving)
        time.sleep(_WARM)
        begin, pictures, busy = time.perf_counter(), *_spent(browser)
        time.sleep(_MEASURED)
        seconds, after = time.perf_counter() - begin, _spent(browser)
    count = after[0] - pictures
    return {
        "view": name,
        "frames per second": round(count / seconds, 1),
        "CPU time, of 1/30 s": f"{100 * _WANTED * (after[1] - busy) / count:.0f} %",
    }


def _spent(browser: Any) -> tuple[int, float]:
    """Returns the number of frames that were drawn, and the main thread's CPU time (s)."""
    metrics = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    busy = {metric["name"]: metric["value"] for metric in metrics}["TaskDuration"]
    return browser.execute_script("return window.pictures"), busy
