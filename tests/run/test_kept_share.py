"""Plans that keep the share of views that is asked for."""

import pytest
from trade_offs import crossroads

import cocap_opt as co
from cocap_opt.run.front import Front
from cocap_opt.run.view_share import missed_share


def test_views_weigh_more_until_the_share_is_kept() -> None:
    """J alone looks at one person, who pays more; two thirds of views need the two others."""
    problem = crossroads()
    for share, views in ((0.3, 2.0), (0.6, 4.0)):
        asked = co.with_views(problem, cameras=1, weight=1.0, share=share)
        result = co.plan(asked)
        assert result.plan is not None and not missed_share(asked, result.plan)
        point = Front.of(asked).point(result.plan)
        assert point is not None and point.views == views
        assert result.value == pytest.approx(point.reward + views)  # by the scene's own weight
        assert ("times the weight" in result.message) == (share == 0.6)


def test_a_share_that_no_plan_keeps_is_said() -> None:
    """The plan is that of the scene's own weight."""
    asked = co.with_views(co.load("tiny-doorway"), weight=1.0, share=1.0)
    result = co.plan(asked)
    without = asked.objective.views
    assert without is not None and result.plan is not None
    alone = asked.replace(objective=asked.objective.replace(views=without.replace(share=None)))
    assert result.value == co.plan(alone).value
    assert "fewer than 100 %" in result.message
