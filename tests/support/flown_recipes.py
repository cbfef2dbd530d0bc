"""Random recipes of drones with limits, as people write them: for flights that are never refused.

`python tests/support/flown_recipes.py 300` plans and flies so many and counts what is refused, by
kind.
"""

import argparse
import logging
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

import cocap_opt as co
from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.flight.flights import Flight, LimitError
from cocap_opt.scenarios.hardware import AIRFRAMES, CAMERAS

_LOWEST = 4.0  # m, the lowest layer


def drawn_recipe(rng: np.random.Generator, folder: Path) -> Path:
    """Returns the path of a random recipe, written into a folder together with its files."""
    width, depth = (int(n) for n in rng.integers(16, 33, size=2))
    step = float(rng.choice([0.5, 1.0, 1.0, 1.0, 2.0, 3.0]))
    steps, has_terrain = int(rng.integers(3, 9)), rng.random() < 0.4
    lines = [f"steps = {steps}"]
    if step != 1 or rng.random() < 0.5:
        lines.append(f"step = {step:g}")
    if has_terrain and rng.random() < 0.3:
        lines.append('flight = "above-ground"')
    lines += _map(rng, folder, width, depth, has_terrain)
    if rng.random() < 0.4:
        lines += _walls(rng, folder, width, depth)
    for _ in range(int(rng.integers(1, 4))):
        lines += _walk(rng, width, depth)
    most = int(rng.integers(1, 7))
    while most > 0:
        count = int(rng.integers(1, most + 1))
        lines += _drones(rng, width, depth, count)
        most -= count
    if rng.random() < 0.3:
        x, y = rng.integers(0, width - 6), rng.integers(0, depth - 6)
        corners = [[int(x), int(y)], [int(x) + 5, int(y)], [int(x) + 5, int(y) + 4]]
        lines += ["[[no_fly]]", f"polygon = {corners}"]
        if rng.random() < 0.5:
            lines.append(f"top = {float(rng.choice([3.0, 6.0, 12.0]))}")
    lines += _airspace(rng, has_terrain)
    if rng.random() < 0.5:
        lines += ["[rules]", f"separation = {float(rng.choice([1.5, 2.0, 3.0]))}"]
        if rng.random() < 0.3:
            lines.append("vertical = 2.0")
    if rng.random() < 0.4:
        lines += ["[objective]", "views = { cameras = 2 }"]
    path = folder / "scene.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _map(
    rng: np.random.Generator, folder: Path, width: int, depth: int, has_terrain: bool
) -> list[str]:
    resolution = float(rng.choice([0.5, 1.0, 1.0, 2.0]))
    stated = [f"resolution = {resolution:g}"] if rng.random() < 0.6 else []
    if not has_terrain:
        return ["[map]", f"size = [{width}, {depth}]", *stated]
    x, y = np.meshgrid(np.arange(width), np.arange(depth), indexing="ij")
    slope = float(rng.choice([0.05, 0.3, 1.0]))
    ways = rng.normal(size=(3, 2)) * 0.15
    hills = sum(np.sin(a * x + b * y + rng.random()) for a, b in ways) * 2
    ground = 100 + slope * (x * rng.random() + hills)
    houses = np.where(rng.random((width, depth)) < 0.03, rng.uniform(2, 9), 0.0)
    _write(folder / "terrain.asc", ground)
    if rng.random() < 0.3:
        return ["[map]", 'file = "terrain.asc"', 'heights = "absolute"', 'ground = "surface"',
                *stated]  # fmt: skip
    _write(folder / "surface.asc", ground + houses)
    return ["[map]", 'file = "surface.asc"', 'heights = "absolute"', 'ground = "terrain.asc"',
            *stated]  # fmt: skip


def _write(path: Path, values: FloatArray) -> None:
    """Writes heights [X, Y] as an ASCII grid, the north first."""
    width, depth = values.shape
    head = f"ncols {width}\nnrows {depth}\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    rows = [" ".join(f"{value:.3f}" for value in row) for row in values.T[::-1]]
    path.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


def _walls(rng: np.random.Generator, folder: Path, width: int, depth: int) -> list[str]:
    """Writes a ground plan of one to three houses as WKT."""
    parts = []
    for _ in range(int(rng.integers(1, 4))):
        x, y = rng.integers(1, width - 7), rng.integers(1, depth - 7)
        a, b = x + rng.integers(2, 6), y + rng.integers(2, 6)
        parts.append(f"(({x} {y}, {a} {y}, {a} {b}, {x} {b}, {x} {y}))")
    text = f"MULTIPOLYGON ({', '.join(parts)})"
    (folder / "houses.wkt").write_text(text, encoding="utf-8")
    height = float(rng.choice([3.0, 8.0]))
    return ["[[walls]]", 'file = "houses.wkt"', 'unit = "m"', 'polygons = "obstacles"',
            f"height = {height}"]  # fmt: skip


def _walk(rng: np.random.Generator, width: int, depth: int) -> list[str]:
    points = (rng.random((2, 2)) * [width - 2, depth - 2] + 1).round(1).tolist()
    if rng.random() < 0.2:
        return ["[[walk]]", f"points = {points[:1]}", "heading = 30"]
    return ["[[walk]]", f"points = {points}", f"speed = {rng.uniform(0.4, 1.6):.2f}"]


def _drones(rng: np.random.Generator, width: int, depth: int, count: int) -> list[str]:
    airframe = str(rng.choice(sorted(AIRFRAMES)))
    lines = ["[[drones]]", f'airframe = "{airframe}"', f'camera = "{rng.choice(sorted(CAMERAS))}"']
    layers = [[_LOWEST], [_LOWEST, 6.0], [_LOWEST, 5.0, 6.0]][int(rng.integers(3))]
    draw = rng.random()
    if draw < 0.2:
        lines += [f"count = {count}", 'starts = { area = "anywhere" }']
    elif draw < 0.4:
        at = rng.permutation(width * depth)[:count]
        places = [f"{{ x = {k % width + 0.5}, y = {k // width + 0.5} }}" for k in at.tolist()]
        lines.append(f"starts = [{', '.join(places)}]")
    else:
        lines.append(f"count = {count}")
        if rng.random() < 0.5:
            lines.append("near = 15")
    if rng.random() < 0.5:
        lines.append("tilts = [10, 40]")
    if rng.random() < 0.3:
        name = str(rng.choice(["acceleration", "speed", "yaw_rate", "climb"]))
        value = {"acceleration": [1.5, 3, 8], "speed": [1.5, 4], "yaw_rate": [50, 90],
                 "climb": [1, 2.5]}[name]  # fmt: skip
        lines.append(f"limits = {{ {name} = {float(rng.choice(value))} }}")
    motion: dict[str, Any] = {"layers": layers}
    if rng.random() < 0.4:
        motion["radius"] = int(rng.integers(1, 4))
    if rng.random() < 0.3:
        motion |= {"headings": int(rng.choice([8, 12, 16])), "turn": int(rng.integers(1, 3))}
    if rng.random() < 0.3:
        motion["clearance"] = 0.5
    if rng.random() < 0.9:
        lines += ["[drones.motion]", *(f"{key} = {value}" for key, value in motion.items())]
    return lines


def _airspace(rng: np.random.Generator, has_terrain: bool) -> list[str]:
    lines = []
    if rng.random() < 0.4:
        lines.append(f"ceiling = {float(rng.choice([6.0, 30.0]))}")
    if rng.random() < 0.6:
        lines.append(f"people = {float(rng.choice([1.5, 3.0, 4.0]))}")
        if rng.random() < 0.3:
            lines.append("over_people = 2.0")
    return ["[airspace]", *lines] if lines else []


def fate(path: Path, seconds: float = 2.0, planner: str | None = None) -> tuple[str, str]:
    """Plans and flies a recipe; returns where it ends and what is said.

    It ends at `recipe`, `plan`, `limits`, `people`, `matter`, `drones`, or is `flown` or
    `hovering`.
    """
    try:
        problem = co.load(path, seed=0)
    except (ProblemError, FileError) as error:
        return "recipe", str(error)
    try:
        result = co.plan(problem, **({} if planner is None else {"planner": planner}),
                         time_limit=seconds)  # fmt: skip
    except ValueError as error:
        return "plan", str(error)
    plan = result.plan
    if plan is None:
        return "plan", f"no plan: {result}"
    try:
        flight = Flight.of(problem, plan, smooth=True)
    except LimitError as error:
        return "limits", error.words
    except ProblemError as error:
        words = str(error)
        kind = "people" if " to person" in words.split(",")[0] else "matter"
        return ("drones" if words.split(":")[1].startswith(" drones") else kind), words
    words = f"J {flight.verdict.reward:.3f}, {flight.slowed} slowed, limit {result.limit}"
    return ("hovering" if plan.stays else "flown"), words


def main() -> None:
    """Plans and flies recipes and counts what becomes of them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seeds", type=int, nargs="*", help="in place of the first so many")
    parser.add_argument("--planner")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--seconds", type=float, default=2.0)
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    ends = Counter[str]()
    for seed in options.seeds or range(options.first, options.first + options.count):
        with tempfile.TemporaryDirectory() as name:
            folder = options.keep / str(seed) if options.keep else Path(name)
            folder.mkdir(parents=True, exist_ok=True)
            begun = time.monotonic()
            path = drawn_recipe(np.random.default_rng(seed), folder)
            end, words = fate(path, options.seconds, options.planner)
        ends[end] += 1
        row = f"{seed} {time.monotonic() - begun:.1f} s {end} {words}"
        sys.stdout.write(row.replace(str(path), "scene.toml") + "\n")
        sys.stdout.flush()
    sys.stdout.write(f"{dict(ends)}\n")


if __name__ == "__main__":
    main()
