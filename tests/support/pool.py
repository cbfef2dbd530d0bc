"""Small random problems that all properties share, stored with their optima by brute force.

Most of the time of a property went into drawing problems and going through their plans. So
properties take theirs from `tests/data/pool.jsonl`, one problem a line, which this command draws
anew, the same ones as long as the strategies (and hypothesis) stay:

    python tests/support/pool.py --draw

`tests/test_pool.py` says when that is due, and searches the stored optima again. The properties
that carry the most still draw their own (`drawn_problems`), and a hunt for bugs
(COCAP_OPT_EXAMPLES, HYPOTHESIS_PROFILE) draws anew for all.
"""

import ast
import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Collection, Iterable
from functools import cache
from pathlib import Path
from typing import Literal

import brute_force
import hypothesis
import msgspec
import strategies
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from strategies import MOST_PLANS, SHARE, drawn_meetings, drawn_problems, number_of_plans

from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.documents import Document, decode_document, encode
from cocap_opt.problem import COVERAGE_VERSION, Plan, Problem

FILE = Path(__file__).parents[1] / "data" / "pool.jsonl"
COMMAND = "python tests/support/pool.py --draw"
HUNT = SHARE > 1 or "HYPOTHESIS_PROFILE" in os.environ
# How many problems of each kind are stored, and how many are used where not all examples are.
STORED = {"alone": 50, "teams": 80, "meetings-2": 45, "meetings-3": 35}
USED = {"alone": 12, "teams": 20, "meetings-2": 10, "meetings-3": 8} if SHARE < 1 else STORED
KINDS = {
    "alone": drawn_problems(st.just(1), over_time=True),
    "teams": drawn_problems(st.sampled_from([2, 3]), over_time=True),
    "meetings-2": drawn_meetings(2),
    "meetings-3": drawn_meetings(3),
}


class Drawn(Document, frozen=True, kw_only=True):
    """A problem that was drawn, and what brute force has found of it.

    Attributes
    ----------
    kind : the strategy, a key of `KINDS`
    number : the seed of the draw
    plans : how many combinations of paths it has
    value : J of the best plan that obeys the rules; None if there is none
    plan : that plan
    problem : the problem
    """

    format: Literal["cocap-opt test problem"] = "cocap-opt test problem"
    version: Literal[1] = 1
    kind: str
    number: int
    plans: int
    value: float | None
    plan: Plan | None
    problem: Problem

    @property
    def optimum(self) -> brute_force.Optimum:
        """The best plan and its J, as brute force returns them."""
        return brute_force.Optimum(self.plan, -math.inf if self.value is None else self.value)


class Head(Document, frozen=True, kw_only=True):
    """The first line of the file: the digest of what drew and solved, and hypothesis's version."""

    format: Literal["cocap-opt test pool"] = "cocap-opt test pool"
    version: Literal[1] = 1
    digest: str
    hypothesis: str


def problems(
    robots: Collection[int] = (1, 2, 3),
    most_plans: int = MOST_PLANS,
    goals: bool = True,
    over_time: bool = False,
) -> st.SearchStrategy[Problem]:
    """Problems of several classes, rules, goals and layers; see `drawn_problems`."""
    if HUNT:
        team = [n for n in (2, 2, 3, 1) if n in robots]
        return drawn_problems(st.sampled_from(team), most_plans, goals, over_time)

    def fits(drawn: Drawn) -> bool:
        problem = drawn.problem
        return (
            len(problem.robots) in robots
            and drawn.plans <= most_plans
            and (goals or all(robot.goal is None for robot in problem.robots))
            and (over_time or not problem.objective.over_time)
        )

    return st.deferred(lambda: st.sampled_from(_problems_of(filter(fits, (*_alone(), *_teams())))))


def meetings(team: int = 2) -> st.SearchStrategy[Problem]:
    """Robots in one another's way, two or three; see `drawn_meetings`."""
    if HUNT:
        return drawn_meetings(team)
    return st.deferred(lambda: st.sampled_from(_problems_of(_meetings(team))))


def _problems_of(pool: Iterable[Drawn]) -> list[Problem]:
    return [drawn.problem for drawn in pool]


def _alone() -> list[Drawn]:
    return kept("alone")


def _teams() -> list[Drawn]:
    return kept("teams")


def _meetings(team: int) -> list[Drawn]:
    return kept(f"meetings-{team}")


@cache
def kept(kind: str) -> list[Drawn]:
    """Problems of a kind that properties pick from; those of few plans are first.

    Of problems in which there is little to choose, or nobody to see, a few are kept.
    """
    drawn = [found for found in stored() if found.kind == kind and found.number < USED[kind]]
    dull = [found for found in drawn if not found.problem.actors or found.plans < 4]
    chosen = [found for found in drawn if found not in dull] + dull[: USED[kind] // 6]
    return sorted(chosen, key=lambda found: found.plans)


@cache
def stored() -> list[Drawn]:
    """All stored problems, whose optima brute force then remembers."""
    lines = FILE.read_bytes().splitlines()[1:]
    found = [decode_document(line, f"{FILE.name}:{n}", Drawn) for n, line in enumerate(lines, 2)]
    for drawn in found:
        brute_force.remember(drawn.problem, drawn.optimum)
    return found


def head() -> Head:
    """The first line of the file."""
    return decode_document(FILE.read_bytes().splitlines()[0], f"{FILE.name}:1", Head)


def draw(kind: str, number: int) -> Drawn:
    """Draws a problem by its kind and number, and goes through all its plans.

    Each comes from a run of its own: in one run more than half are the same, or nearly, for
    hypothesis varies what it has drawn.
    """
    found: list[Problem] = []

    @seed(number)
    @settings(
        max_examples=2,  # the first is the simplest one
        database=None,
        deadline=None,
        derandomize=False,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(KINDS[kind])
    def keep(problem: Problem) -> None:
        found.append(problem)

    keep()
    plan, value = brute_force.search(found[-1])
    return Drawn(
        kind=kind,
        number=number,
        plans=number_of_plans(found[-1]),
        value=None if plan is None else value,
        plan=plan,
        problem=found[-1],
    )


def line_of(document: Document) -> bytes:
    """A line of the file."""
    return bytes(msgspec.json.format(encode(document), indent=-1))


def digest() -> str:
    """Digest of what the stored problems and optima come from.

    It is of the code of strategies and brute force, of the counts, and of the version of coverage;
    comments, docstrings and imports are left out. That the modules below still give the same
    optima is not told from their text: a test goes through all plans again.
    """
    code = [_code_of(Path(module.__file__)) for module in (strategies, brute_force)]
    made_of = json.dumps([*code, STORED, COVERAGE_VERSION])
    return hashlib.sha256(made_of.encode()).hexdigest()


def _code_of(path: Path) -> str:
    """The code of a module without docstrings, comments, and where its imports come from."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        if documented and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    tree.body = [node for node in tree.body if not isinstance(node, ast.Import | ast.ImportFrom)]
    return ast.unparse(tree)  # as text: the fields of a dump differ between versions of Python


def store() -> None:
    """Draws all problems, goes through their plans, and writes the file."""
    first = Head(digest=digest(), hypothesis=hypothesis.__version__)
    rows = [draw(kind, number) for kind, count in STORED.items() for number in range(count)]
    FILE.parent.mkdir(exist_ok=True)
    write_atomically({FILE: b"".join(line_of(row) + b"\n" for row in (first, *rows))})


def drawn_elsewhere(every: int) -> list[bytes]:
    """Lines of some stored problems, drawn again in a process of its own.

    hypothesis draws other numbers where other modules of the project are loaded.
    """
    command = [sys.executable, __file__, "--draw-some", str(every)]
    done = subprocess.run(command, capture_output=True, check=True)
    return done.stdout.splitlines()


def draw_some(every: int) -> None:
    """Draws some of the stored problems, and prints their lines."""
    for drawn in stored()[::every]:
        sys.stdout.write(line_of(draw(drawn.kind, drawn.number)).decode() + "\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--draw-some"]:
        draw_some(int(sys.argv[2]))
    elif sys.argv[1:] == ["--draw"]:
        store()
    else:
        sys.exit(f"usage: {COMMAND}")
