"""J of random plans by an instance is the referee's, to twelve digits.

A thousand plans in the second suite, a quarter of them in the main one, as of properties.
"""

from pathlib import Path

import numpy as np
import pytest
from damaged_files import document
from strategies import SHARE

from cocap_opt.files.documents import PlanFile
from cocap_opt.formulations.independent import cocap_check, instance_of
from cocap_opt.formulations.independent.cocap_check import ONE, Instance
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Plan
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene

PLANS = {
    "tiny-doorway": 300,
    "tiny-share": 300,
    "tiny-trap": 100,
    "corridor": 300,
}  # valid plans to compare, by scene
MOST_TRIES = 4  # walks drawn for each of them; some meet another drone's


def walked(model: Model, rng: np.random.Generator) -> Plan | None:
    """Returns one random walk for each drone, or None if a walk ends where nothing goes on."""
    paths = []
    for robot, robot_class in enumerate(model.class_of):
        states = [int(rng.choice(model.starts(robot)))]
        for t in range(model.problem.horizon):
            after = robot_class.graph.successors(t, states[-1])
            if not len(after):
                return None
            states.append(int(rng.choice(after)))
        paths.append(tuple(robot_class.graph.state(state) for state in states))
    return Plan(paths=tuple(paths))


@pytest.mark.long
@pytest.mark.parametrize("name", PLANS)
def test_random_plans_are_worth_the_same(name: str, tmp_path: Path) -> None:
    """The instance and the referee part by at most 1e-12 of J; none of the plans is refused."""
    problem = load_scene(name)
    model, rng = compiled(problem), np.random.default_rng(7)
    known = Instance(instance_of(model))
    compared, count = 0, round(PLANS[name] * SHARE)
    for _ in range(MOST_TRIES * count):
        plan = walked(model, rng)
        if plan is None or not (verdict := check(problem, plan)).valid:
            continue
        spec = document(PlanFile.of(problem, plan, 0.0, "test"), tmp_path)
        value = cocap_check.value_of_plan(known, spec) / ONE
        assert value == pytest.approx(verdict.reward, rel=1e-12, abs=1e-15)
        compared += 1
        if compared == count:
            return
    pytest.fail(f"{name}: only {compared} of {count} plans keep the rules")
