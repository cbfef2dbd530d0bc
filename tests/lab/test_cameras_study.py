"""The study of two cameras on each person: its rows, and what is stored of it."""

from pathlib import Path

import pytest

from cocap_opt.experiments.lab.results import STORED, load_csv
from cocap_opt.experiments.lab.studies.cameras import (
    AskedPlans,
    cameras,
    cost_in_markdown,
    directions_in_words,
    proofs_in_markdown,
)


def assert_sound(row: AskedPlans) -> None:
    """Plan <= best plan <= bound, and no plan sees more than is possible or proved."""
    rounding = 1e-9 * row.bound
    assert row.planned <= row.value + rounding <= row.bound + 2 * rounding
    assert 0 <= row.views <= row.most and 0 <= row.best_views <= row.most
    assert row.by_two >= row.apart
    if row.asked == "first":
        assert row.best_views <= row.most_proved + 1e-9


def test_a_scene_is_planned_for_each_objective(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """People first have the most views, pixels alone the most J, and all rows are written."""
    cameras(scene=["tiny-doorway"], seeds="0", limit=5.0, out=tmp_path)
    rows = load_csv(tmp_path / "cameras.csv", AskedPlans, "cameras")
    assert [row.asked for row in rows] == ["pixels", "pixels and views", "first"]
    for row in rows:
        assert_sound(row)
        assert row.is_proved
    assert rows[0].best_reward >= rows[1].best_reward >= rows[2].best_reward
    assert rows[0].best_views <= rows[1].best_views <= rows[2].best_views
    assert "tiny-doorway" in capsys.readouterr().out


def test_what_is_stored_is_sound() -> None:
    """Pages are made of it."""
    rows = load_csv(STORED / "cameras.csv", AskedPlans, "cameras")
    for row in rows:
        assert_sound(row)
    assert {row.scene for row in rows} == {"corridor", "bottleneck", "passage", "field"}
    assert "bottleneck" in cost_in_markdown() and "field" in proofs_in_markdown()
    assert "degrees apart" in directions_in_words()
