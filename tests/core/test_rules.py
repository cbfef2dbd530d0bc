"""Collision rules: closest approach of moves, against dense sampling, ties included."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.problem import Cell, CollisionRules, Motion
from cocap_opt.problem.rules import TOLERANCE

STEPS = np.linspace(0.0, 1.0, 4001)
grid = st.integers(-4, 4).map(lambda n: 0.5 * n)
number = st.one_of(grid, st.floats(-4.0, 4.0))
ways = st.tuples(number, number, number).map(np.array)


@examples(165)
@given(ways, ways, st.sampled_from([0.5, 1.0, 2.0, 2.5]), st.sampled_from([0.0, 0.5, 1.0, 3.0]))
def test_moves_conflict_where_dense_samples_do(
    before: FloatArray, after: FloatArray, separation: float, vertical: float
) -> None:
    """What samples find is found, and what is found is found by samples, or nearly."""
    rules = CollisionRules(separation=separation, vertical=vertical)
    along = before + STEPS[:, None] * (after - before)
    found = bool(rules.pass_too_near(before, after))
    if rules.too_near(along).any():
        assert found
    if found:  # between two samples robots come closer by less than the way between them
        slack = float(np.linalg.norm(after - before)) / len(STEPS)
        wider = CollisionRules(
            separation=separation + slack, vertical=vertical + slack * (vertical > 0)
        )
        assert wider.too_near(along).any()
        share = float(rules.closest(before, after)[0])
        assert 0 <= share <= 1
        at = before + share * (after - before)
        assert rules.too_near(at) or np.linalg.norm(at) < separation + vertical + slack


@pytest.mark.parametrize("separation", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("size", [0.1, 0.25, 0.5, 1.0])
def test_robots_exactly_so_far_apart_keep_the_separation(separation: float, size: float) -> None:
    """Side by side, head on to a stop, and passing: on a grid ties are the rule."""
    far = max(1, round(separation / size))  # cells
    separation = far * size
    rules = CollisionRules(separation=separation)
    ends = [
        (Cell(0, 0), Cell(1, 0), Cell(0, far), Cell(1, far)),
        (Cell(0, 0), Cell(1, 0), Cell(far + 2, 0), Cell(far + 1, 0)),
        (Cell(0, 0), Cell(1, 0), Cell(1, far), Cell(0, far)),
    ]
    for a, b, c, d in ends:
        places = [np.array([cell.x * size, cell.y * size, 5.0]) for cell in (a, b, c, d)]
        assert not rules.moves_conflict((places[0], places[1]), (places[2], places[3]))
        nearer = rules.replace(separation=separation + 10 * TOLERANCE)
        assert nearer.moves_conflict((places[0], places[1]), (places[2], places[3]))


@pytest.mark.slow
def test_a_separation_contains_the_other_rules() -> None:
    """Whatever breaks the vertex or the swap rule breaks any separation; crossing does, too."""
    papers, apart = CollisionRules(), CollisionRules(vertex=True, swap=False, separation=0.01)
    cells = list(product(range(3), repeat=2))
    crossed = False
    for a, c in product(cells, repeat=2):
        for (i, j), (u, v) in product(product((-1, 0, 1), repeat=2), repeat=2):
            ends = [a, (a[0] + i, a[1] + j), c, (c[0] + u, c[1] + v)]
            p, q, r, s = (np.array([*end, 0.0]) for end in ends)
            both = [bool(rules.moves_conflict((p, q), (r, s))) for rules in (papers, apart)]
            assert both[1] or not both[0]
            crossed |= both[1] and not both[0]
    assert crossed
    assert len(Motion().moves) == 9


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"vertical": 1.0}, "vertical: must be 0 if there is no separation"),
        ({"separation": -1.0}, "separation: must be"),
        ({"separation": 1e-7}, "separation: must be 0 or more than"),
        ({"vertex": False, "swap": False, "separation": 1.0}, "vertex: must be true"),
    ],
)
def test_rules_that_make_no_sense_are_refused(change: dict[str, float], words: str) -> None:
    """One line with the field and what is allowed."""
    with pytest.raises(ProblemError, match=words):
        CollisionRules(**change)  # type: ignore[arg-type]
