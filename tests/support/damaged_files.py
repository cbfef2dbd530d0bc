"""Damaged certificates and proofs against cocap-check: a hunt for a bound below the optimum.

`python tests/support/damaged_files.py 100000` damages files of small scenes so often, each at
random in one to three places, and asks the checker of each: it refuses the file, or what it proves
is no less than the optimum. A tenth are changed without harm: these it must accept.
"""

import argparse
import copy
import json
import math
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from cocap_opt.files.documents import Document
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.independent import instance_of
from cocap_opt.formulations.independent.cocap_check import (
    DAMAGED,
    ONE,
    Instance,
    Refused,
    answer,
    bound_of_file,
)
from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene

NAMES = ("tiny-doorway", "tiny-queue", "tiny-trap", "tiny-share", "tiny-give-way", "tiny-head-on")


class Base(NamedTuple):
    """A file that is right, its instance and the optimum."""

    instance: Instance
    optimum: float  # -infinity: there is no plan
    file: dict[str, Any]


def document(file: Document, folder: Path) -> dict[str, Any]:
    """A file as the checker reads it; it is written into a folder."""
    path = folder / "file.json"
    file.save(path)
    read: dict[str, Any] = json.loads(path.read_text())
    return read


def bases() -> Iterator[Base]:
    """Yields certificates and proofs of small scenes."""
    scenes: list[Problem] = [load_scene(name, 0) for name in NAMES]
    scenes += [load_scene(name, 1).replace(horizon=3) for name in ("corridor", "corridor-tight")]
    with tempfile.TemporaryDirectory() as folder:
        for problem in scenes:
            instance = Instance(instance_of(compiled(problem)))
            best = EXACT["branch-and-price"](problem)
            bounds = "alone", "online", "envelope", "column-generation"
            others = [BOUNDS[name](problem) for name in bounds]
            for result in (EXACT["searchless"](problem), best, *others):
                if result.certificate is not None:
                    file = document(result.certificate, Path(folder))
                    yield Base(instance, best.value, file)


def places(document: Any) -> list[tuple[Any, Any]]:
    """Returns each place of a document: what holds it, and its key there."""
    found, todo = [], [document]
    while todo:
        holder = todo.pop()
        keys = holder.keys() if isinstance(holder, dict) else range(len(holder))
        for key in keys:
            found.append((holder, key))
            if isinstance(holder[key], (dict, list)):
                todo.append(holder[key])
    return found


def changed(value: Any, other: Any, draw: random.Random) -> Any:
    """Returns something else in place of a value, maybe another part of the file."""
    if type(value) in (int, float):
        factor = draw.choice([-1, 0, 0.5, 0.999, 1.001, 2, 1e9, 1e-9, 1e308])
        more = draw.choice([-1, 1, 1e-9])
        strange = draw.choice([True, "1", None, [], {}, 1e300, -1])
        return draw.choice([value * factor, value + more, strange])
    strange = draw.choice([None, [], {}, 0, "cells", "swap", "leaf", "branch"])
    return draw.choice([copy.deepcopy(other), strange])


def damage(file: dict[str, Any], draw: random.Random) -> dict[str, Any]:
    """Returns a copy with up to three places changed."""
    file = copy.deepcopy(file)
    for _ in range(draw.randint(1, 3)):
        holder, key = draw.choice(places(file))
        from_where = draw.choice(places(file))
        other = from_where[0][from_where[1]]
        if draw.random() < 0.15 and isinstance(holder, list):
            holder.insert(draw.randrange(len(holder) + 1), copy.deepcopy(other))
        elif draw.random() < 0.15:
            del holder[key]
        else:
            holder[key] = changed(holder[key], other, draw)
    return file


def vary(file: dict[str, Any], draw: random.Random) -> dict[str, Any]:
    """Returns a copy that proves as much, or little less, and claims no more than that."""
    file = copy.deepcopy(file)
    for holder, key in places(file):
        if key in ("rows", "cuts", "state_cuts") and isinstance(holder, dict):
            draw.shuffle(holder[key])
        if key == "beta" and draw.random() < 0.5:
            holder[key] = [[v * (1 + 1e-9 * draw.random()) for v in row] for row in holder[key]]
    if file["bound"] is not None:
        file["bound"] += 1e-3 * (1 + abs(file["bound"]))
    keys = [*file]
    draw.shuffle(keys)
    spaced = json.dumps({key: file[key] for key in keys}, indent=draw.choice([None, 0, 3]))
    again: dict[str, Any] = json.loads(spaced)
    return again


def judge(base: Base, file: dict[str, Any], harmless: bool) -> str:
    """Asks the checker; returns its answer. It fails if a bound or a claim is below the optimum."""
    try:
        bound, _ = bound_of_file(base.instance, file)
        proves = -math.inf if bound is None else bound / ONE
        assert proves >= base.optimum - 1e-9 * abs(base.optimum), (proves, base.optimum)
        _, is_part = answer(base.instance, file)
    except (Refused, *DAMAGED):
        assert not harmless, "a harmless change was refused"
        return "refused"
    claim = -math.inf if file["bound"] is None else file["bound"]
    assert is_part or claim >= base.optimum, "a claim below the optimum was accepted"
    return "accepted, as it proves no less"


def hunt(count: int, seed: int) -> Counter[str]:
    """Damages so many files; the first that fools the checker is raised."""
    draw, known, counts = random.Random(seed), [*bases()], Counter[str]()
    begin = time.monotonic()
    for n in range(count):
        base, harmless = draw.choice(known), draw.random() < 0.1
        file = vary(base.file, draw) if harmless else damage(base.file, draw)
        try:
            counts[("harmless: " if harmless else "") + judge(base, file, harmless)] += 1
        except AssertionError:
            Path("damaged.json").write_text(json.dumps(file))
            raise
        if not (n + 1) % 5000:
            seconds = time.monotonic() - begin
            sys.stderr.write(f"{n + 1:,} files, {seconds:.0f} s: {dict(counts)}\n")
    return counts


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    sys.stdout.write(f"{dict(hunt(given.count, given.seed))}\n")
