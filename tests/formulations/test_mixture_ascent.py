"""Mixture ascent: bounds and columns without a master."""

from itertools import islice

import numpy as np
import pytest
from ascent import raised_mixtures
from brute_force import optimum
from counting import either
from hypothesis import given, reject
from pool import problems
from strategies import examples

from cocap_opt.formulations.certificates import Pricing
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene


@examples(8)
@given(either(problems()))
def test_every_mixture_gives_a_bound_and_whole_robots(problem: Problem) -> None:
    """The multipliers' certificate bounds all plans; each robot is shared out among its columns."""
    search = Search(compiled(problem))
    if search.alone.bound == -np.inf:
        reject()
    for mixture, value, priced in islice(
        raised_mixtures(search),
        3,
    ):
        robots = [column.robot for column in mixture.columns]
        amounts = np.bincount(robots, mixture.amounts, len(problem.robots))
        assert amounts == pytest.approx(np.ones(len(problem.robots)), abs=0.01)
        bound = Pricing.of(search.model, priced.duals.certificate(search.model)).bound
        assert bound == pytest.approx(priced.bound, rel=1e-9, abs=1e-6)
        assert bound >= value - 1e-6 * abs(value) - 1e-6
        assert bound >= optimum(problem).value - 1e-6


@pytest.mark.parametrize("scene", ["corridor", "bottleneck"])
def test_a_mixture_is_raised_to_what_a_master_finds(scene: str) -> None:
    """After some steps, value and bound enclose the same columns' master within a third of 1 %."""
    search = Search(compiled(load_scene(scene, 0)))
    steps = raised_mixtures(search)
    mixture, value, priced = list(islice(steps, 12))[-1]
    master = Master(search.model, penalty=1e6)
    for column in mixture.columns:
        master.add(column)
    assert value <= master.solve().value * (1 + 1e-6)
    assert priced.bound - value <= 0.003 * value
