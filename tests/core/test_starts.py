"""Drones that choose their start: their states, and a first choice that keeps the rules."""

import math
from itertools import product

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples, rules, tiny

import cocap_opt as co
from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations import EXACT
from cocap_opt.formulations.column_generation.master.flow_paths import StartChoice, mixture_of_flow
from cocap_opt.mixtures.columns import Column
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import (
    NO_RULES,
    VERTEX_ONLY,
    Airspace,
    CollisionRules,
    Motion,
    Plan,
    Problem,
    Robot,
    StartArea,
    StartStates,
    State,
)
from cocap_opt.problem.placement import UndecidedError, places_apart
from cocap_opt.referee import _Referee, check
from cocap_opt.result import Reason
from cocap_opt.stop import never
from cocap_opt.world.workspace import HeightMap


def anywhere(problem: Problem) -> Problem:
    """The same problem, whose drones choose their starts among all free states."""
    robots = tuple(robot.replace(start=StartArea()) for robot in problem.robots)
    return problem.replace(robots=robots)


@examples(60)
@given(problem=problems())
def test_starts_are_the_states_in_which_the_referee_lets_drones_be(problem: Problem) -> None:
    """Of an area all free states that it holds are starts, and no others."""
    width, depth = problem.height_map.shape
    referee = _Referee(problem)
    for robot, starts in zip(problem.robots, problem.starts, strict=True):
        sizes = (width, depth, *robot.orientation_sizes)
        found = [
            state
            for state in (State(*indices) for indices in product(*map(range, sizes)))
            if robot.may_start_in(state)
            and not referee._misplaced(robot, state)
            and not _is_near(referee, robot, state)
        ]  # fmt: skip
        assert list(starts) == sorted(found)


def _is_near(referee: _Referee, robot: Robot, state: State) -> bool:
    return any(words.startswith("step 0 is") for words in referee._near_people(robot, (state,)))


def some_cells() -> st.SearchStrategy[list[tuple[int, int]]]:
    """A few cells of a small map."""
    cells = st.tuples(st.integers(0, 3), st.integers(0, 2))
    return st.lists(cells, min_size=1, max_size=4, unique=True)


@examples(200)
@given(
    sets=st.lists(
        some_cells(),
        min_size=1,
        max_size=4,
    ),
    kept=rules(1.0),
)  # fmt: skip
def test_a_choice_of_places_is_found_where_there_is_one(
    sets: list[list[tuple[int, int]]], kept: CollisionRules
) -> None:
    """It is one of all choices that keep the rules, and there is none where none of them does."""
    places = [np.array([(x, y, 0.0) for x, y in sorted(cells)]) for cells in sets]
    able = [
        chosen for chosen in product(*map(range, map(len, places))) if _apart(kept, places, chosen)
    ]
    found = places_apart(kept, places)
    assert (found is None) == (not able)
    assert found is None or tuple(found) in able


def _apart(kept: CollisionRules, places: list[FloatArray], chosen: tuple[int, ...]) -> bool:
    at = [own[k] for own, k in zip(places, chosen, strict=True)]
    return not any(kept.too_near(at[i] - at[k]) for i in range(len(at)) for k in range(i))


def test_too_many_drones_for_their_places_are_counted_not_tried() -> None:
    """Sixty drones and fifty-nine cells: a search through all choices would take ages."""
    row = np.array([(x, 0.0, 0.0) for x in range(59)])
    assert places_apart(CollisionRules(), [row] * 60) is None
    assert places_apart(CollisionRules(), [row] * 59) == list(range(59))


def test_a_search_for_places_gives_up() -> None:
    """Pairs of cells in a row that no counting proves to be too few."""
    grid = np.array([(x, y, 0.0) for x in range(14) for y in range(14)])
    with pytest.raises(UndecidedError):
        places_apart(CollisionRules(separation=2.9), [grid] * 26)


def test_a_scene_without_room_for_all_is_refused() -> None:
    """In one line, where it is made; a scene with just enough room is not."""
    problem = tiny()
    cells = ((0, 0), (0, 1))
    robots = tuple(robot.replace(start=StartArea(cells=cells)) for robot in problem.robots)
    assert {state[:2] for state in problem.replace(robots=robots).first_starts} == set(cells)
    with pytest.raises(ProblemError, match=r"^robots: must have a start .* no such choice exists$"):
        problem.replace(robots=(*robots, robots[0]))
    assert len(problem.replace(robots=(*robots, robots[0]), rules=NO_RULES).first_starts) == 3


@pytest.mark.parametrize(("start", "words"), [
    (StartArea(cells=((9, 0),)), r"robots\[0\].start.cells: must lie inside the map of 4 x 3"),
    (StartArea(layers=(1,)), r"robots\[0\].start.layers: must be 0..0, not 1"),
    (StartArea(headings=(0, 4)), r"robots\[0\].start.headings: must be 0..3, not 4"),
    (StartArea(pitches=(-1,)), r"robots\[0\].start.pitches: must be 0..0, not -1"),
    (StartArea(cells=((1, 1),)), r"robots\[0\].start: must have a cell in which the drone may be"),
    ([State(0, 0), State(1, 1)], r"robots\[0\].start.states\[1\]: cell \(1, 1\) is blocked"),
    ([State(0, 0), State(0, 9)], r"robots\[0\].start.states\[1\].y: must be 0..2, not 9"),
])  # fmt: skip
def test_starts_that_cannot_be_are_named(start: object, words: str) -> None:
    """The message has the field and what is allowed."""
    problem = tiny()
    with pytest.raises(ProblemError, match=words):
        problem.replace(robots=(problem.robots[0].replace(start=start), problem.robots[1]))


def test_choices_that_come_down_to_one_state_are_checked_like_fixed_starts() -> None:
    """Two drones in one cell at step 0 are refused, be it an area that has only that."""
    problem = tiny()
    first, second = problem.robots
    area = second.replace(start=StartArea(cells=((0, 0),), headings=(0,)))
    with pytest.raises(ProblemError, match=r"robots\[1\].start: is 0.00 m from robots\[0\].start"):
        problem.replace(robots=(first, area))
    wrong = second.replace(start=StartArea(cells=((0, 99),)))
    with pytest.raises(ProblemError, match=r"robots\[1\].start.cells: must lie inside the map"):
        problem.replace(robots=(first.replace(start=StartArea()), wrong))


def test_the_order_of_states_is_none() -> None:
    """Two drones with the same choices are alike, however these are listed."""
    here, there = State(0, 0), State(0, 1)
    assert StartStates(states=(here, there)) == StartStates(states=(there, here))


def test_random_starts_without_rules_differ() -> None:
    """Each drone draws by itself; with rules, so that they keep them."""
    problem = anywhere(tiny()).replace(rules=NO_RULES)
    drawn = [co.with_starts(problem, "random", seed).first_starts for seed in range(8)]
    assert any(a != b for a, b in drawn)


def test_a_flow_of_nobody_has_no_paths() -> None:
    """Also where drones choose their start, and no arc says where."""
    model = compiled(anywhere(tiny()))
    assert mixture_of_flow(model, {}).columns == []


def test_a_fixed_start_is_none_of_the_choices_of_others() -> None:
    """Of a class in which one drone is bound to a state that another may choose, too.

    Both must end in one cell, so there is no plan, and the proof of that needs flows of both.
    """
    motion = Motion(headings=1, turn=0)
    choosing = Robot(start=StartArea(), motion=motion, goal=(0, 0))
    problem = Problem(
        name="one goal", height_map=HeightMap(heights=np.zeros((2, 1)), resolution=4.0),
        robots=(choosing, choosing.replace(start=State(1, 0))), actors=(), horizon=1,
        rules=VERTEX_ONLY,
    )  # fmt: skip
    model = compiled(problem)
    plan = Plan(paths=((State(1, 0), State(0, 0)),) * 2)
    columns = [Column.of(model, i, path) for i, path in enumerate(model.paths(plan))]
    flow = {arc: 2.0 for column in columns for arc in column.arcs}
    choice = StartChoice(0, 0, columns[0].path[0])
    mixture = mixture_of_flow(model, flow, starting={choice: 1.0})
    assert mixture.amounts.tolist() == [1.0, 1.0]
    assert EXACT["branch-and-price"](problem).reason is Reason.INFEASIBLE


@pytest.mark.parametrize("made", [
    lambda: StartStates(states=()), lambda: StartStates(states=(State(0, 0), State(0, 0))),
    lambda: StartArea(cells=()), lambda: StartArea(headings=(1, 1)),
    lambda: StartArea(layers=(0.5,)), lambda: StartArea(cells=((0, 0.5),)),
])  # fmt: skip
def test_sets_that_are_none_are_refused(made: type) -> None:
    """Empty ones, those with something twice, and fractions."""
    with pytest.raises(ProblemError):
        made()


def test_a_set_of_one_is_a_fixed_start() -> None:
    """The very same problem, to the digest; an area of one state gives the same plan and bound."""
    problem = tiny()
    listed, areas = (
        problem.replace(robots=tuple(map(change, problem.robots)))
        for change in (
            lambda robot: robot.replace(start=[robot.start]),
            lambda robot: robot.replace(
                start=StartArea(
                    cells=((robot.start.x, robot.start.y),), headings=(robot.start.heading,)
                )
            ),
        )
    )
    assert problem_digest(listed) == problem_digest(problem)
    assert not areas.has_free_starts and areas.first_starts == problem.first_starts
    before, after = co.solve(problem), co.solve(areas)
    assert (after.plan, after.value, after.bound) == (before.plan, before.value, before.bound)


def test_files_keep_choices_of_starts(tmp_path: object) -> None:
    """Areas and states are read as they were written, and the plan beside them is for them."""
    problem = tiny()
    first, second = problem.robots
    chosen = problem.replace(
        robots=(
            first.replace(start=StartArea(cells=((0, 0), (0, 1)), headings=(0, 1))),
            second.replace(start=[State(3, 2), State(3, 1, heading=2)]),
        )
    )
    path = f"{tmp_path}/scene.json"
    co.save(path, chosen)
    again = co.load(path)
    assert again.robots == chosen.robots
    assert problem_digest(again) == problem_digest(chosen) != problem_digest(problem)
    content = msgspec.json.decode(msgspec.json.encode(second.replace(start=StartArea())))
    assert content["start"]["type"] == "area"


def test_a_plan_must_start_where_it_may() -> None:
    """The referee says so of fixed starts, and of those to be chosen."""
    problem = anywhere(tiny())
    plan = co.plan(problem, "sequential").plan
    assert plan is not None and check(problem, plan).valid
    assert any("must start at" in words for words in check(tiny(), plan).violations)
    turned = [path[0]._replace(heading=(path[0].heading + 1) % 4) for path in plan.paths]
    near = tuple(
        robot.replace(start=[state, state._replace(heading=(state.heading + 1) % 4)])
        for robot, state in zip(problem.robots, turned, strict=True)
    )
    words = check(problem.replace(robots=near), plan).violations
    assert len(words) == 2 and all(
        "must start in one of its starts, not at" in each for each in words
    )


def test_free_starts_are_worth_no_less_than_fixed_ones() -> None:
    """The proved optimum from any start is above that from stated ones, and from random ones."""
    problem = co.load("tiny-doorway")
    best = co.solve(co.with_starts(problem))
    assert best.reason is co.Reason.OPTIMAL
    assert best.value > co.solve(problem).value * 1.0001
    for seed in range(3):
        drawn = co.with_starts(problem, "random", seed)
        assert not drawn.has_free_starts
        assert co.solve(drawn).value <= best.value * (1 + 1e-9)
    greedy = co.with_starts(problem, "greedy")
    assert co.solve(greedy).value <= best.value * (1 + 1e-9)
    assert greedy.name == f"{problem.name}, greedy starts"
    with pytest.raises(ValueError, match="starts: must be free, random or greedy"):
        co.with_starts(problem, "best")  # type: ignore[arg-type]


def test_random_starts_are_out_of_the_choices_and_differ() -> None:
    """Each seed has its own; all keep the rules, and orders of drones are no choice."""
    problem = anywhere(tiny())
    drawn = [co.with_starts(problem, "random", seed).first_starts for seed in range(6)]
    assert len(set(drawn)) > 1 and drawn[0] == co.with_starts(problem, "random").first_starts
    assert all(
        state in starts
        for chosen in drawn
        for state, starts in zip(chosen, problem.starts, strict=True)
    )


def test_drones_first_start_where_they_may_stay() -> None:
    """People come by at one start; the plan in which nobody moves begins at the other."""
    problem = tiny()
    comes = np.array([[14.0, 10.0, 0.0, 0.0], [2.0, 2.0, 0.0, 0.0], [2.0, 2.0, 0.0, 0.0]])
    robot = problem.robots[0].replace(start=[State(0, 0), State(0, 2)])
    alone = problem.replace(
        robots=(robot,),
        actors=(problem.actors[0].replace(poses=comes),),
        airspace=Airspace(people_aside=3.0),
    )
    assert alone.first_starts == (State(0, 2),)


@pytest.mark.parametrize("name", [name for name in PLANNERS if name != "joint"])
def test_all_planners_choose_starts(name: str) -> None:
    """Each has a plan from starts that are allowed; most are better than from the stated ones."""
    problem = anywhere(tiny())
    result = PLANNERS[name](problem, never)
    assert result.plan is not None
    verdict = check(problem, result.plan)
    assert not verdict.violations
    assert math.isclose(verdict.reward, result.value, rel_tol=1e-9)
