"""Takes that are drawn: they keep the spread that is stated, and the scene stays one."""

import logging

import numpy as np
import pytest
from strategies import WALL, standing

import cocap_opt as co
from cocap_opt.data import FloatArray
from cocap_opt.plausibility import buried

STEPS = 20


def walking(speed: float = 1.0, n: int = 1) -> tuple[co.Actor, ...]:
    """People who walk along x, side by side, by so many metres a step."""
    rows = np.zeros((n, STEPS + 1, 4))
    rows[..., 0] = 30 + speed * np.arange(STEPS + 1)
    rows[..., 1] = 30.5 + 3 * np.arange(n)[:, None]
    return tuple(co.Actor(poses=poses) for poses in rows)


def scene(actors: tuple[co.Actor, ...], heights: FloatArray | None = None) -> co.Problem:
    """A square of 80 m, with steps of half a second."""
    return co.Problem(
        name="square",
        height_map=co.HeightMap(heights=np.zeros((80, 80)) if heights is None else heights),
        robots=(co.Robot(start=co.State(2, 2)),),
        actors=actors,
        horizon=STEPS,
        step=0.5,
    )


def test_draws_have_the_spread_that_is_stated() -> None:
    """Delays in seconds, shifts in metres, speeds as a share; the mean is the track."""
    problem = scene(walking())
    track = problem.actors[0].poses
    late = [x for k in range(4) for x in _late(co.takes(problem, 100, delay=2.0, seed=k), track)]
    assert np.std(late) == pytest.approx(2.0, rel=0.15) and abs(np.mean(late)) < 0.4
    drawn = co.takes(problem, 100, aside=1.5, seed=1).actors[1:]
    left = [float(actor.poses[7, 1] - track[7, 1]) for actor in drawn]
    assert np.std(left) == pytest.approx(1.5, rel=0.2) and abs(np.mean(left)) < 0.5
    drawn = co.takes(problem, 100, speed=0.2, seed=2).actors[1:]
    speeds = [float(actor.poses[3, 0] - actor.poses[2, 0]) for actor in drawn]
    assert np.std(speeds) == pytest.approx(0.2, rel=0.2) and abs(np.mean(speeds) - 1) < 0.06


def _late(problem: co.Problem, track: FloatArray) -> list[float]:
    """Delays (s) of all drawn takes in the middle of a track along x of 1 m a step."""
    return [float(track[10, 0] - actor.poses[10, 0]) * 0.5 for actor in problem.actors[1:]]


def test_late_people_stand_before_they_begin_and_after_they_end() -> None:
    """They do not walk on, and never backwards."""
    problem = co.takes(scene(walking()), 60, delay=3.0, speed=0.5, seed=3)
    for actor in problem.actors:
        steps = np.diff(actor.poses[:, 0])
        assert (steps >= -1e-12).all()
        assert actor.poses[:, 0].min() >= 30 and actor.poses[:, 0].max() <= 30 + STEPS


def test_who_is_faster_walks_on_where_the_track_does() -> None:
    """A track may go on after the scene's last step."""
    (actor,) = walking()
    longer = actor.replace(
        poses=np.concatenate([actor.poses, actor.poses[1:] + np.array([20.0, 0, 0, 0])])
    )
    drawn = co.takes(scene((longer,)), 60, speed=0.2, seed=3)
    ends = np.array([actor.poses[STEPS, 0] for actor in drawn.actors])
    assert ends.max() > 30 + STEPS + 1 and len(set(ends)) == 60


def test_nobody_walks_into_a_wall_or_off_the_map(caplog: pytest.LogCaptureFixture) -> None:
    """Draws that do are drawn again; who is walled in walks as given, and that is said."""
    heights = np.zeros((80, 80))
    heights[:, 31] = heights[:, 28] = WALL
    problem = scene(walking(), heights)
    drawn = co.takes(problem, 30, aside=1.0, seed=0)
    assert not any(buried(drawn.workspace, actor, STEPS) for actor in drawn.actors)
    assert len({actor.poses[0, 1] for actor in drawn.actors}) > 25
    assert all(29.5 <= actor.poses[0, 1] <= 30.5 for actor in drawn.actors)
    heights[:, 29:32] = WALL
    heights[:, 30] = 0
    with caplog.at_level(logging.WARNING):
        narrow = co.takes(scene(walking(), heights), 3, aside=5.0, seed=0)
    tracked = problem.actors[0].poses
    assert all((actor.poses == tracked).all() for actor in narrow.actors)
    assert "takes: person 0 in take 1 and 1 more walk as given: 50 draws" in caplog.text


def test_people_of_a_take_are_not_within_each_other() -> None:
    """However wide the spread."""
    drawn = co.takes(scene(walking(n=3)), 20, aside=2.0, delay=1.0, seed=5)
    for k in range(20):
        people = [actor.poses[:, :2] for actor in drawn.of_take(k).actors]
        for i, here in enumerate(people):
            for there in people[:i]:
                assert np.hypot(*(here - there).T).min() > 0.4


def test_nobody_is_put_too_near_to_a_fixed_start() -> None:
    """Else the scene would be none."""
    problem = scene((standing(8.5, 2.5, 0.0, 1.57, steps=STEPS),))
    drawn = co.takes(problem.replace(airspace=co.Airspace(people_aside=4.0)), 40, aside=2.0)
    assert min(actor.poses[0, 0] for actor in drawn.actors) > 6.4


def test_some_may_be_those_who_vary() -> None:
    """The others are in all takes, as they are."""
    problem = scene(walking(n=2))
    drawn = co.takes(problem, 3, aside=0.5, people=[1], probabilities=[0.5, 0.3, 0.2])
    assert [actor.take for actor in drawn.actors] == [
        name for take in drawn.takes for name in (take.name, take.name)
    ]
    first = [actor for actor in drawn.actors if actor.poses[0, 1] == 30.5]
    assert len(first) == 3 and len(drawn.distinct_people) == 4
    assert drawn.chances.tolist() == [0.5, 0.5, 0.3, 0.3, 0.2, 0.2]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "delay: must be more than 0 if aside and speed are 0"),
        ({"delay": -1}, r"delay: must be 0\.\.3600 s, not -1"),
        ({"speed": 2}, r"speed: must be 0\.\.1, not 2"),
        ({"aside": 1, "count": 1}, r"count: must be 2\.\.100 takes, not 1"),
        ({"aside": 1, "people": []}, "people: must name a person, or be left out"),
        ({"aside": 1, "people": [0.5]}, "people: must be a whole number"),
        ({"aside": 1, "people": [0, 0]}, "people: must be different numbers"),
        ({"aside": 1, "people": [3]}, r"people: must be 0\.\.0, not 3"),
        ({"aside": 1, "probabilities": [1]}, "probabilities: must be one for each of 3 takes"),
        ({"aside": 1, "probabilities": [1, 1, 1]}, "takes: probabilities must sum to 1, not 3"),
    ],
)
def test_what_cannot_be_drawn_is_refused(given: dict[str, object], words: str) -> None:
    """In a line that names the argument."""
    with pytest.raises(co.ProblemError, match=words):
        co.takes(scene(walking()), **given)  # type: ignore[arg-type]


def test_delays_need_seconds() -> None:
    """Without a step length, shifts are drawn and delays are not."""
    problem = scene(walking()).replace(step=None)
    with pytest.raises(co.ProblemError, match=r"^delay: must be 0 s, as the scene defines no"):
        co.takes(problem, delay=1.0)
    assert len(co.takes(problem, aside=1.0).takes) == 3
    with pytest.raises(co.ProblemError, match=r"^problem: must have no takes yet$"):
        co.takes(co.takes(problem, aside=1.0), aside=1.0)
    with pytest.raises(
        co.ProblemError, match=r"^problem: must have people, who can walk differently$"
    ):
        co.takes(problem.replace(actors=()), aside=1.0)
