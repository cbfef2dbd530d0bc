"""The compiled kernel finds what NumPy's way finds, which is the oracle here."""

import logging
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import NotLoaded, of_views
from pool import problems
from strategies import examples
from takes import in_takes
from test_culling import all_states, close_ups, graph_of, hills, rough_maps

from cocap_opt import compiling
from cocap_opt.compiling import Kernel, functions, marks
from cocap_opt.data import BoolArray, IntArray
from cocap_opt.model import Model
from cocap_opt.problem import (
    Actor,
    Camera,
    Cuboid,
    Motion,
    Prism,
    Problem,
    Robot,
    State,
)
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Clock, Stop, TimeLimit, never
from cocap_opt.vision import coverage, sights, views
from cocap_opt.vision.coverage import CoverageTable, GrowingTable
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.seen import SeenColumns, SeenFaces, SeenPeople
from cocap_opt.vision.viewpoints import Viewpoints
from cocap_opt.vision.views import StateViews
from cocap_opt.world.workspace import HeightMap, Mesh

pytestmark = [
    pytest.mark.long,  # the kernel is compiled first, in a fresh environment
    pytest.mark.skipif(not compiling.is_there(), reason="needs the extra [fast]"),
]


@pytest.fixture(scope="module")
def kernel() -> Kernel:
    """A process in which the kernel is loaded."""
    found = of_views()
    found.load()
    return found


def seen(problem: Problem, nodes: IntArray, use: Kernel) -> tuple[SeenColumns, SeenPeople]:
    """What the first robot's camera sees, where the kernel is loaded or not."""
    graph = graph_of(problem)
    found = StateViews.of(FaceGeometry(problem), problem, graph, problem.robots[0].camera)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sights, "KERNEL", use)
        return found.seen(nodes), found.people(nodes)


def assert_same(problem: Problem, nodes: IntArray, kernel: Kernel) -> None:
    """Both see the same pixels to the last bit, and the same solid angles but for rounding."""
    ours, theirs = seen(problem, nodes, kernel), seen(problem, nodes, of_views(NotLoaded))
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(mine[0], other[0])
        np.testing.assert_array_equal(mine[1], other[1])
    np.testing.assert_array_equal(ours[0].amounts, theirs[0].amounts)
    np.testing.assert_allclose(ours[1].visible, theirs[1].visible, rtol=1e-9)
    np.testing.assert_allclose(ours[1].unhidden, theirs[1].unhidden, rtol=1e-9)


ANY = st.one_of(
    close_ups(), rough_maps(), hills(), problems(),
    in_takes(problems()).map(lambda drawn: drawn.problem),
)  # fmt: skip


@examples(120)
@given(ANY, st.data())
def test_the_kernel_sees_what_numpy_sees(
    kernel: Kernel, problem: Problem, data: st.DataObject
) -> None:
    """From close by, over rough ground and hills, in any order of the views, and twice."""
    graph = graph_of(problem)
    states = data.draw(st.permutations(all_states(problem).tolist()))[:40]
    steps = data.draw(st.lists(st.integers(0, problem.horizon), min_size=1, max_size=2))
    nodes = np.sort([t * graph.n_states + s for t in steps for s in states])
    assert_same(problem, nodes, kernel)


@examples(40)
@given(ANY, st.data())
def test_rows_of_a_part_are_those_of_the_whole_table(
    kernel: Kernel, problem: Problem, data: st.DataObject
) -> None:
    """With states of some steps and places only, by the kernel and without it, bit by bit.

    Nothing is looked at of others.
    """
    graph = graph_of(problem)
    states, steps = all_states(problem), problem.horizon + 1
    whole = np.zeros((steps, graph.n_states), dtype=bool)
    whole[:, states] = True
    part = np.zeros_like(whole)
    for step in data.draw(st.sets(st.integers(0, problem.horizon))):
        kept = data.draw(st.one_of(st.just(states.tolist()), st.sets(st.sampled_from(states))))
        part[step, list(kept)] = True
    part[-1] &= data.draw(st.booleans())
    for use in (kernel, of_views(NotLoaded)):
        found = StateViews.of(FaceGeometry(problem), problem, graph, problem.robots[0].camera)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sights, "KERNEL", use)
            table = grown(found, whole)
            looked = list[Viewpoints]()
            patch.setattr(found, "look", partial(noted, looked, found.look))
            rows = grown(found, part)
        asked = [at.nodes(np.arange(len(at.looks)), graph.n_places, len(whole[0])) for at in looked]
        wanted = np.flatnonzero(part)
        np.testing.assert_array_equal(np.sort(np.concatenate([wanted[:0], *asked])), wanted)
        np.testing.assert_array_equal(rows.nodes, np.intersect1d(table.nodes, wanted))
        for node in rows.nodes.tolist():
            for ours, theirs in zip(rows.row(node), table.row(node), strict=True):
                assert ours.tobytes() == theirs.tobytes()


def grown(views: StateViews, reachable: BoolArray) -> CoverageTable:
    """The table of all these states, which counts as whole."""
    table = GrowingTable(views, views.graph.n_places, reachable, 0, threads=2)
    table.grow()
    assert table.steps == len(reachable)
    return table.table()


def noted(
    looked: list[Viewpoints], look: Callable[[Viewpoints], SeenFaces], at: Viewpoints
) -> SeenFaces:
    """What views see, of which a list is kept."""
    looked.append(at)
    return look(at)


@pytest.mark.parametrize("scene", ["corridor-tight", "bottleneck", "passage", "field", "bridge"])
def test_tables_are_the_same(scene: str, kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole tables, made by threads, in batches of another size, to the last bit."""
    tables: list[list[CoverageTable]] = []
    for use in (kernel, of_views(NotLoaded)):
        monkeypatch.setattr(sights, "KERNEL", use)
        model = Model(load_scene(scene, 1), use_cache=False)
        model.prepare_all()
        tables.append([model.coverage(robot_class) for robot_class in model.classes])
    for ours, theirs in zip(*tables, strict=True):
        for mine, other in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(mine, other)


def test_numpy_takes_over_where_there_is_no_room(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a person is cut into more pieces than the kernel has room for."""
    problem = load_scene("bottleneck", 0)
    nodes = graph_of(problem).n_states + all_states(problem)
    expected = seen(problem, nodes, of_views(NotLoaded))
    from cocap_opt.vision.compiled_sight import CompiledSight

    monkeypatch.setattr(CompiledSight, "at_step", lambda *_: None)
    found = seen(problem, nodes, kernel)
    for ours, theirs in zip([*found[0], *found[1]], [*expected[0], *expected[1]], strict=True):
        np.testing.assert_array_equal(ours, theirs)


def behind_posts(*actors: Actor) -> Problem:
    """A drone before 600 posts with a wide body behind them, after other actors."""
    y = 25.0 + 0.025 * (np.arange(600) - 299.5)
    posts = tuple(Mesh.box((25.5, a - 0.005, 0.0), (25.51, a + 0.005, 6.0)) for a in y.tolist())
    wide = Cuboid(length=0.5, width=30.0, height=8.0)
    return Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((60, 50))),
        robots=(Robot(start=State(0, 25), motion=Motion(radius=0), camera=Camera(tilts=(0.0,))),),
        actors=(
            *actors,
            Actor(poses=np.tile([40.5, 25.0, 0.0, 0.0], (2, 1)), shape=wide),
        ),
        meshes=posts,
        horizon=1,
    )


def test_numpy_takes_over_behind_very_many_posts(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More shadows fall on parts of a person than the kernel has room for, which it notices."""
    from cocap_opt.vision.compiled_sight import CompiledSight

    problem = behind_posts()
    graph, found = graph_of(problem), list[object]()
    nodes = graph.n_states + np.array([graph.index(State(0, 25))])
    at_step = CompiledSight.at_step

    def noted(*arguments: Any) -> object:
        found.append(at_step(*arguments))
        return found[-1]

    monkeypatch.setattr(CompiledSight, "at_step", noted)
    assert_same(problem, nodes, kernel)
    assert found and all(part is None for part in found)
    assert len(seen(problem, nodes, kernel)[0].rows)


def test_what_the_kernel_gave_up_leaves_nothing_behind(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It had seen somebody by then; the next view, from elsewhere, sees nobody."""
    monkeypatch.setattr(sights, "KERNEL", kernel)
    problem = behind_posts(Actor(poses=np.tile([8.5, 25.0, 0.0, 0.0], (2, 1))))
    graph = graph_of(problem)
    views = StateViews.of(FaceGeometry(problem), problem, graph, problem.robots[0].camera)
    before, away = (
        graph.n_states + graph.index(State(x, 25, heading=h)) for x, h in [(0, 0), (59, 0)]
    )
    assert set(views.people(np.array([before])).people.tolist()) == {0, 1}
    assert not len(views.people(np.array([away])).people)


def test_views_with_and_without_people_take_turns(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The room for people is not lost where only that for faces has to grow in between."""
    monkeypatch.setattr(sights, "KERNEL", kernel)
    crowd = [
        Actor(poses=np.tile([10.5 + k % 8, 20.5 + k // 8, 0.0, 0.0], (2, 1))) for k in range(40)
    ]
    camera = Camera(tilts=(0.0,))
    problem = Problem(
        name="", height_map=HeightMap(heights=np.zeros((60, 50))), actors=tuple(crowd), horizon=1,
        robots=(Robot(start=State(0, 22), motion=Motion(radius=0), camera=camera),),
    )  # fmt: skip
    graph = graph_of(problem)

    def found(views: StateViews, cells: list[int], people: bool) -> list[IntArray]:
        nodes = np.array([graph.n_states + graph.index(State(x, 22)) for x in cells])
        return [*(views.people(nodes) if people else views.seen(nodes))]

    def fresh() -> StateViews:
        return StateViews.of(FaceGeometry(problem), problem, graph, camera)

    same = fresh()
    away, near = [*range(40, 52)], [*range(10)]
    for cells, people in ((away, True), (near, False), (near[:2], True)):
        for ours, theirs in zip(
            found(same, cells, people), found(fresh(), cells, people), strict=True
        ):
            np.testing.assert_array_equal(ours, theirs)


def test_plain_views_use_no_compiled_code(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever checks bounds trusts NumPy's way alone."""
    monkeypatch.setattr(sights, "KERNEL", kernel)
    from cocap_opt.vision import compiled_sight

    monkeypatch.setattr(compiled_sight, "CompiledSight", None)
    problem = load_scene("corridor", 0)
    Model(problem, plain=True).prepare_all()
    with pytest.raises(TypeError):
        Model(problem, use_cache=False).prepare_all()


def loads_or_compiles(use: Kernel, kept: bool, patch: pytest.MonkeyPatch) -> None:
    """Lets a kernel do neither really."""

    def load() -> bool:
        use.is_loaded = kept
        return kept

    def compile_(stop: Stop) -> None:
        use.is_loaded = True

    patch.setattr(use, "_load_kept", load)
    patch.setattr(use, "_made", compile_)


@pytest.mark.parametrize(
    ("work", "left", "kept", "loaded", "told"),
    [
        (0.5, np.inf, True, False, False), (5.0, np.inf, True, True, False),
        (5.0, np.inf, False, False, False), (500.0, np.inf, False, True, True),
        (500.0, 10.0, False, False, False), (500.0, 10.0, True, True, False),
    ],
)  # fmt: skip
def test_the_kernel_is_loaded_or_compiled_where_that_is_repaid(
    work: float, left: float, kept: bool, loaded: bool, told: bool,
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    """Little work stays with NumPy; compiling, which takes long, is said, and kept to a limit."""

    use = of_views()
    loads_or_compiles(use, kept, monkeypatch)
    stop = TimeLimit(left) if left < np.inf else never
    with caplog.at_level(logging.WARNING):
        use.prepare(work, stop)
    assert use.is_loaded == loaded
    assert ("compiled" in caplog.text) == told


class Hurried(Clock):
    """Shows ten seconds more whenever it is looked at."""

    looks = 0

    @property
    def seconds(self) -> float:
        """Ten for each look."""
        self.looks += 1
        return 10.0 * self.looks


@pytest.mark.parametrize("slow", [True, False])
def test_a_table_that_takes_long_is_compiled_in_its_midst(
    slow: bool, kernel: Kernel, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """By the time that its first batches take, which is said; the table is that of NumPy's way."""
    assert kernel.is_loaded
    problem = load_scene("passage", 0)
    graph, horizon = graph_of(problem), problem.horizon
    whole = np.zeros((horizon + 1, graph.n_states), dtype=bool)
    whole[:, all_states(problem)] = True
    monkeypatch.setattr(views.PinholeViews, "batch", 500)
    tables, spent = list[CoverageTable](), list[float]()
    for use in (of_views(NotLoaded), of_views()):
        loads_or_compiles(use, False, monkeypatch)
        monkeypatch.setattr(sights, "KERNEL", use)
        if slow:
            monkeypatch.setattr(coverage, "Clock", Hurried)
        monkeypatch.setattr(use, "spend", spent.append)
        spent.extend([-1.0] * len(tables))
        found = StateViews.of(FaceGeometry(problem), problem, graph, problem.robots[0].camera)
        with caplog.at_level(logging.WARNING):
            tables.append(grown(found, whole))
    assert use.is_loaded == slow == ("compiled first" in caplog.text)
    by_numpy, of_second = len(spent[: spent.index(-1.0)]), len(spent[spent.index(-1.0) + 1 :])
    assert 0 < of_second < by_numpy if slow else of_second == by_numpy
    for ours, theirs in zip(*tables, strict=True):
        assert ours.tobytes() == theirs.tobytes()


def test_many_small_views_load_the_kernel_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """But never compile it: nobody knows whether there will be more."""

    for kept in (False, True):
        use = of_views()
        loads_or_compiles(use, kept, monkeypatch)
        for _ in range(100):
            use.spend(0.02)
        assert use.is_loaded == kept


def test_without_numba_nothing_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """NumPy's way is there everywhere."""
    monkeypatch.setattr(functions, "is_there", lambda: False)
    use = of_views()
    use.prepare(1e9, never)
    assert not use.is_loaded


def test_meshes_that_are_not_convex_are_seen_by_rays(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel knows of no rays, and is not asked."""
    problem = load_scene("bridge", 0)
    rough = problem.meshes[0].replace(triangles=problem.meshes[0].triangles[:-1])
    monkeypatch.setattr(sights, "KERNEL", kernel)
    graph = graph_of(problem)
    found = StateViews.of(
        FaceGeometry(problem.replace(meshes=(rough,))), problem, graph, problem.robots[0].camera
    )
    assert not found._pinhole.may_be_compiled


@pytest.mark.parametrize("sides", [3, 41, 64])
def test_people_of_many_sides_have_room(sides: int, kernel: Kernel) -> None:
    """Faces may have more corners than the kernel has cuts for; nothing is written beside."""
    problem = load_scene("bottleneck", 0)
    prism = Prism(apothem=0.4, height=1.8, sides=sides)
    actors = tuple(actor.replace(shape=prism) for actor in problem.actors)
    problem = problem.replace(actors=actors)
    nodes = graph_of(problem).n_states + all_states(problem)
    assert_same(problem, nodes, kernel)


def test_numba_that_fails_leaves_it_to_numpy(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Said once; and nobody tries again in this process."""

    def fails(module: str) -> None:
        raise ImportError("numba needs NumPy 1.26 or less")

    monkeypatch.setattr(Kernel, "is_kept", True)
    monkeypatch.setattr(functions, "kept_functions", fails)
    monkeypatch.setattr(marks, "unmark", lambda _: None)
    use = of_views()
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            use.prepare(100.0, never)
    assert not use.is_loaded
    assert caplog.text.count("takes longer: numba fails (ImportError: numba needs NumPy") == 1


def test_a_kernel_that_is_not_kept_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps ask at every step, and a look at the disk takes longer than some of these."""
    looks = []

    def is_kept(kernel: Kernel) -> bool:
        looks.append(kernel)
        return False

    monkeypatch.setattr(Kernel, "is_kept", property(is_kept))
    use = of_views()
    for _ in range(100):
        use.spend(1.0)
    assert looks == [use]
