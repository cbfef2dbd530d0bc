"""Stored results that a change of the code's shape must not change, and the command that compares.

    python tests/support/golden.py compare [SCENE:SEED..]     all that are stored if none is named
    python tests/support/golden.py store                      after a change that is meant

Numbers are compared as they are, to the last bit; plans and certificates by digests. Another
release of NumPy, SciPy or Clarabel may round otherwise, so their versions are stored, too. What
does not end by itself runs under a limit of work, which is the same on every machine. The scenes of
other people are looked for where the tests look for them.
"""

import argparse
import hashlib
import json
import math
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
from others import DATA

from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates.format import CertificateFile
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import NO_RULES, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Result
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, Stop, WorkLimit, never

STORED = Path(__file__).parents[1] / "golden" / "results.jsonl"
MADE_WITH = STORED.with_name("made_with.json")
LIBRARIES = ("numpy", "scipy", "clarabel")
# Units of work for scenes whose searches do not end soon, and for view search's trees.
WORK = {"field": 30, "passage": 60, "merge/seq.yaml": 30, "large/seq.yaml": 12}
STARTS = ("sequential", "cocap")  # planners whose better plan bounds and proofs begin with
TREE_WORK, VIEW_SEARCH_WORK = 2000, 40
Record = dict[str, Any]


def stored() -> list[Record]:
    """All stored records."""
    return [json.loads(line) for line in STORED.read_text().splitlines()]


def versions() -> dict[str, str]:
    """Releases of the libraries that compute the results."""
    return {name: version(name) for name in LIBRARIES}


def records_of(scene: str, seed: int) -> Iterator[Record]:
    """Run all planners and the main bounds on a scene, and record what comes out."""
    foreign = scene.endswith(".yaml")
    problem = load_scene(str(DATA / "greedy_perspectives" / scene) if foreign else scene, seed)
    compiled(problem).prepare_all()
    best: Result | None = None
    for name, planner in PLANNERS.items():
        if name == "cocap-vs" or (name == "joint" and len(problem.robots) > 2):
            continue
        result = planner(problem, _limit_of(name, scene))
        yield _record(scene, seed, name, result)
        is_start = name in STARTS and result.plan is not None
        if is_start and check(problem, result.plan).valid:
            best = result if best is None or result.value > best.value else best
    start = None if best is None else best.plan
    for name in ("alone", "online", "column-generation"):
        yield _record(scene, seed, name, BOUNDS[name](problem, _work(scene), start))
    solve = EXACT["branch-and-price"]
    yield _record(scene, seed, "branch-and-price", solve(problem, _work(scene), start))
    free: Problem = problem.replace(rules=NO_RULES)
    yield _record(scene, seed, "branch-and-price-free", solve(free, _work(scene)))


def _work(scene: str) -> Stop:
    return WorkLimit(WORK[scene]) if scene in WORK else never


def _limit_of(planner: str, scene: str) -> Stop:
    if planner.startswith("cocap-vs"):
        return WorkLimit(VIEW_SEARCH_WORK)
    is_tree = planner.startswith("cocap") and planner != "cocap-lns"
    return WorkLimit(TREE_WORK) if is_tree and scene in WORK else never


def _record(scene: str, seed: int, method: str, result: Result) -> Record:
    certificate = result.certificate if isinstance(result, CertifiedResult) else None
    body = None
    if certificate is not None:
        single = isinstance(certificate, CertificateFile)
        body = msgspec.json.encode(certificate.certificate if single else certificate.nodes)
    return {
        "scene": scene, "seed": seed, "method": method, "value": _finite(result.value),
        "bound": _finite(result.bound), "reason": str(result.reason),
        "limit": Limit.written(result.limit),
        "message": result.message, "statistics": dict(result.statistics),
        "plan": _digest_of_plan(result.plan), "certificate": body and _digest(body),
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _digest_of_plan(plan: Plan | None) -> str | None:
    if plan is None:
        return None
    paths = [[list(state) for state in path] for path in plan.paths]
    return _digest(json.dumps(paths).encode())


def compare(scene: str, seed: int) -> list[str]:
    """Differences between what is stored of a scene and what comes out now, a line each."""
    known = {r["method"]: r for r in stored() if (r["scene"], r["seed"]) == (scene, seed)}
    found = {r["method"]: r for r in records_of(scene, seed)}
    return [
        f"{scene}:{seed} {method} {key}: stored {known[method][key]!r}, now {found[method][key]!r}"
        for method in known
        for key in known[method]
        if known[method][key] != found[method][key]
    ]


def main() -> None:
    """Compare or store, scene by scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=["compare", "store"])
    parser.add_argument("case", nargs="*", help="SCENE:SEED")
    options = parser.parse_args()
    cases = list(dict.fromkeys((r["scene"], r["seed"]) for r in stored()))
    if options.case:
        cases = [(s, int(n)) for s, n in (case.rsplit(":", 1) for case in options.case)]
    if options.what == "store":
        lines = [json.dumps(r) + "\n" for case in cases for r in records_of(*case)]
        STORED.write_text("".join(lines))
        MADE_WITH.write_text(json.dumps(versions()) + "\n")
        return
    wrong = 0
    for case in cases:
        lines = compare(*case)
        wrong += len(lines)
        print(f"{case[0]}:{case[1]}", "the same" if not lines else "DIFFERENT", flush=True)  # noqa: T201
        print("\n".join(lines), end="\n" if lines else "")  # noqa: T201
    raise SystemExit(1 if wrong else 0)


if __name__ == "__main__":
    main()
