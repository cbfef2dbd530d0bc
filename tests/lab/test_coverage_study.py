"""The measurement of what views cost: its town, and its table."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from studies import rows_of, study

from cocap_opt.experiments.lab.studies.coverage import coverage as coverage_module
from cocap_opt.experiments.lab.studies.coverage.town import HOUSE, PACE, town
from cocap_opt.model import Model


@pytest.mark.parametrize("resolution", [1.0, 2.5])
def test_a_town_is_what_it_says(resolution: float) -> None:
    """Houses of 8 to 20 m; people walk in the streets at their pace; drones reach all streets."""
    problem = town(0, robots=6, actors=6, cells=60, steps=40, resolution=resolution)
    heights = problem.height_map.heights
    houses = heights[heights > 0]
    assert HOUSE[0] <= houses.min() <= houses.max() <= HOUSE[1]
    assert 0.1 < (heights > 0).mean() < 0.5
    for actor in problem.actors:
        steps = np.hypot(*np.diff(actor.poses[:, :2], axis=0).T)
        assert (steps <= PACE * (1 + 1e-9)).all()
        for x, y in actor.poses[:, :2].tolist():
            assert heights[problem.height_map.cell_of(x, y)] == 0.0
    model = Model(problem, use_cache=False)
    (robot_class,) = model.classes
    assert model.reachable(robot_class)[-1].sum() == 8 * (heights == 0).sum()


@pytest.mark.slow
def test_the_command_measures_coverage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each row is measured in its own process; the file has all of its columns."""
    build = partial(town, cells=24, resolution=2.5)
    changes = {"above": coverage_module._above_roofs, "hills": coverage_module._on_hills}
    small = {name: (build, change) for name, change in changes.items()}
    monkeypatch.setattr(coverage_module, "SCENES", small)
    monkeypatch.setattr(coverage_module, "ACTORS", 2)
    assert study("coverage", "--robots", "2", "--steps", "2", "--out", tmp_path) == 0
    rows = rows_of(tmp_path / "coverage.csv")
    assert [row["scene"] for row in rows] == [*small]
    for row in rows:
        assert int(row["states"]) > 0
        assert 0 <= float(row["seen (%)"]) <= 100
        assert all(float(row[key]) > 0 for key in ("processor (s)", "peak (GB)", "us", "us, by 1"))


def test_on_hills_people_stand_on_the_ground() -> None:
    """Houses and flight heights rise with the ground, and so do people."""
    flat = town(0, robots=1, actors=2, cells=24, steps=3, resolution=2.5)
    hilly = coverage_module._on_hills(flat)
    ground = hilly.height_map.datum
    assert ground is not None and np.ptp(ground) > coverage_module.HILL
    assert hilly.height_map.heights - ground == pytest.approx(flat.height_map.heights)
    for actor in hilly.actors:
        for x, y, z, _ in actor.poses.tolist():
            assert z == ground[hilly.height_map.cell_of(x, y)]
