import math
from itertools import cycle, product

import numpy as np
import pytest
from copies import Copy
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import problems
from scipy.optimize import linprog
from strategies import examples, plate

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.graph.networks import place_graph
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import (
    Actor,
    Camera,
    Cuboid,
    Motion,
    Problem,
    Robot,
    State,
    TriangulatedCuboid,
)
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import StateViews
from cocap_opt.world.columns import MARGIN, PROBE
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

FLAT = HeightMap(heights=np.zeros((6, 5)))
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


UNIT = Mesh.box((0, 0, 0), (1, 1, 1))


def moved(mesh: Mesh, by: tuple[float, float, float]) -> Mesh:
    """The mesh at another place."""
    return mesh.replace(vertices=mesh.vertices + np.array(by))


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one."""
    sizes = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        triangles=np.concatenate([m.triangles + k for m, k in zip(meshes, sizes, strict=False)]),
    )


def altitudes_in_cell(vertices: FloatArray, x: int, y: int) -> tuple[float, float] | None:
    """Lowest and highest altitude of a convex hull inside the closed unit square, by programs."""
    upper = np.concatenate([vertices[:, :2].T, -vertices[:, :2].T])
    limits = np.array([x + 1, y + 1, -x, -y]) - 1.01 * MARGIN
    ends = []
    for sign in (1.0, -1.0):
        found = linprog(
            sign * vertices[:, 2], upper, limits, np.ones((1, len(vertices))), [1.0],
            method="highs",
        )  # fmt: skip
        if not found.success:
            return None
        ends.append(sign * found.fun)
    return ends[0], ends[1]


coordinates = st.floats(-1.5, 6.5, allow_nan=False, width=32)


@pytest.mark.slow
@examples(12)
@given(st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=4, max_size=4))
def test_a_tetrahedron_is_solid_where_linear_programs_find_it(
    corners: list[tuple[float, float, float]],
) -> None:
    """In every cell a convex mesh has the altitudes that its hull has there, inside included."""
    vertices = np.array(corners)
    assume(abs(np.linalg.det(vertices[1:] - vertices[0])) > 1e-3)
    mesh = Mesh(vertices=vertices, triangles=TETRAHEDRON)
    columns = Workspace(FLAT, (mesh,)).columns
    for x, y in np.ndindex(FLAT.shape):
        wanted, found = altitudes_in_cell(vertices, x, y), columns.at(x, y)[1:]
        if wanted is None:
            # What reaches into a cell by less than the margin's rounding may count or not.
            assert all(high - low < 1e-2 for low, high in found)
        elif wanted[1] - wanted[0] > 1e-2:
            assert len(found) == 1
            np.testing.assert_allclose(found[0], wanted, atol=1e-3)


@examples(40)
@given(
    st.tuples(coordinates, coordinates, coordinates),
    st.tuples(*[st.floats(0.125, 4.0, width=32)] * 3),
    st.booleans(),
)
def test_a_box_blocks_the_cells_into_which_it_reaches(
    low: tuple[float, float, float], size: tuple[float, float, float], inward: bool
) -> None:
    """A box is solid over its own height in all cells that its inside meets, and no others."""
    high = tuple(a + b for a, b in zip(low, size, strict=True))
    mesh = Mesh.box(low, high)  # type: ignore[arg-type]
    if inward:
        mesh = mesh.replace(triangles=mesh.triangles[:, ::-1])
    columns = Workspace(FLAT, (mesh,)).columns
    for x, y in np.ndindex(FLAT.shape):
        meets = all(
            a < cell + 1 - 2 * MARGIN and b > cell + 2 * MARGIN
            for a, b, cell in ((low[0], high[0], x), (low[1], high[1], y))
        )
        touches = all(a <= cell + 1 and b >= cell for a, b, cell in
                      ((low[0], high[0], x), (low[1], high[1], y)))  # fmt: skip
        if meets:
            np.testing.assert_allclose(columns.at(x, y)[1:], [(low[2], high[2])], atol=1e-9)
        elif not touches:
            assert columns.at(x, y)[1:] == []


def test_a_wall_that_ends_at_a_cell_leaves_the_cell_free() -> None:
    """Solids that only touch a cell do not block it; thin plates block on both sides."""
    flying = Motion(layers=(3.0,))
    wall = Mesh.box((2.0, 0.0, 0.0), (3.0, 5.0, 8.0))
    free = flying.free_places(Workspace(FLAT, (wall,)))[0]
    assert [bool(row.all()) for row in free] == [True, True, False, True, True, True]
    sheet = Mesh(
        vertices=np.array([[2.0, 0, 0], [2, 5, 0], [2, 5, 8], [2, 0, 8]]),
        triangles=np.array([[0, 1, 2], [0, 2, 3]]),
    )
    free = flying.free_places(Workspace(FLAT, (sheet,)))[0]
    assert [bool(row.all()) for row in free] == [True, False, False, True, True, True]


@pytest.mark.parametrize("half", [0.0, 4e-7])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_closed_wall_without_thickness_blocks_both_sides(half: float, axis: int) -> None:
    """A wall of two faces on an edge between cells closes, and is nowhere solid: it is a plate."""
    low, high = [0.0, 0.0, 0.0], [5.0, 5.0, 8.0]
    low[axis], high[axis] = 2.0 - half, 2.0 + half
    wall = Mesh.box((low[0], low[1], low[2]), (high[0], high[1], high[2]))
    assert wall.is_solid
    free = Motion(layers=(3.0,)).free_places(Workspace(FLAT, (wall,)))[0]
    lines = free[:5, :5] if axis == 0 else free[:5, :5].T
    assert [bool(line.all()) for line in lines] == [True, False, False, True, True]


def test_overlapping_and_nested_boxes_are_one_solid() -> None:
    """The inside of a mesh of several boxes is that of any of them, overlaps included."""
    one, other = (
        Mesh.box((0.2, 0.2, 1.0), (2.8, 0.8, 4.0)),
        Mesh.box((1.2, 0.1, 3.0), (1.8, 0.9, 6.0)),
    )
    inner = Mesh.box((0.4, 0.4, 2.0), (0.6, 0.6, 3.0))
    columns = Workspace(FLAT, (joined(one, other, inner),)).columns
    assert columns.at(0, 0)[1:] == [(1.0, 4.0)]
    assert columns.at(1, 0)[1:] == [(1.0, 6.0)]


@pytest.mark.parametrize("turned", [0, 1])
def test_a_solid_that_is_inside_out_fills_what_it_overlaps(turned: int) -> None:
    """One of two overlapping boxes may be inside out; a cavity in one of them stays hollow."""
    boxes = [Mesh.box((0.2, 0.2, 1.0), (2.8, 2.8, 4.0)), Mesh.box((1.0, 0.1, 0.5), (4.5, 2.9, 3.0))]
    boxes[turned] = boxes[turned].replace(triangles=boxes[turned].triangles[:, ::-1])
    cavity = Mesh.box((2.9, 1.0, 1.0), (4.1, 2.0, 2.0))
    cavity = cavity.replace(triangles=cavity.triangles[:, :: 1 if turned == 1 else -1])
    mesh = joined(*boxes, cavity)
    columns = Workspace(FLAT, (mesh,)).columns
    assert mesh.is_solid
    assert columns.at(1, 1)[1:] == [(0.5, 4.0)]
    assert columns.at(3, 1)[1:] == [(0.5, 1.0), (2.0, 3.0)]


def test_a_doorway_is_free_below_its_lintel() -> None:
    """What is above one another in a cell are intervals of their own, and between is air."""
    lintel, roof = (
        Mesh.box((1.0, 1.0, 4.0), (2.0, 2.0, 5.0)),
        Mesh.box((0.0, 0.0, 9.0), (6.0, 5.0, 9.5)),
    )
    workspace = Workspace(FLAT, (joined(lintel, roof),))
    assert workspace.columns.at(1, 1) == [(-math.inf, 0.0), (4.0, 5.0), (9.0, 9.5)]
    free = Motion(layers=(2.0, 4.5, 7.0), clearance=0.5).free_places(workspace)
    assert free[:, 1, 1].tolist() == [True, False, True]
    free = Motion(layers=(2.0, 3.6, 8.6), clearance=0.5).free_places(workspace)
    assert free[:, 1, 1].tolist() == [True, False, False]


def test_a_vertex_on_the_probe_leaks_nowhere() -> None:
    """Whatever the numbers of its vertices, a mesh with one exactly where cells are probed is
    solid in its own columns only."""
    x, y = PROBE
    ring = [(0.2, 0.3), (0.9, 0.2), (0.8, 0.9), (0.3, 0.8)]
    vertices = np.array(
        [(x, y, 1.0), (x, y, 0.0), *((*p, 1.0) for p in ring), *((*p, 0.0) for p in ring)]
    )
    triangles = []
    for k in range(4):
        a, b = 2 + k, 2 + (k + 1) % 4
        triangles += [(0, a, b), (1, b + 4, a + 4), (a, a + 4, b), (b, a + 4, b + 4)]
    for seed in range(50):
        order = np.random.default_rng(seed).permutation(10)
        number = np.argsort(order)
        mesh = Mesh(vertices=vertices[order], triangles=number[np.array(triangles)])
        later = moved(mesh, (1.0, 0.0, 0.0)), moved(mesh, (1.0, 0.0, 5.0))
        assert mesh.is_solid
        columns = Workspace(FLAT, (joined(mesh, *later),)).columns
        assert columns.at(0, 0)[1:] == [(0.0, 1.0)]
        assert columns.at(1, 0)[1:] == [(0.0, 1.0), (5.0, 6.0)]


def test_nobody_climbs_through_a_deck() -> None:
    """A move between layers needs free air at all altitudes between, in all cells it passes."""
    deck = plate((0.0, 0.0), (3.0, 5.0), 4.0)
    motion = Motion(layers=(2.0, 6.0), headings=1)
    graph = place_graph(Workspace(FLAT, (deck,)), motion)
    assert not graph.has_edge((0, 1, 1), (1, 1, 1))
    assert not graph.has_edge((0, 4, 1), (1, 3, 1))  # cell 3 only touches the deck's edge
    assert graph.has_edge((0, 5, 1), (1, 4, 1))
    assert graph.has_edge((0, 1, 1), (0, 2, 1))
    assert graph.has_edge((1, 1, 1), (1, 2, 1))


@pytest.mark.parametrize(
    ("mesh", "solid"),
    [
        (Mesh.box((0, 0, 0), (1, 1, 1)), True),
        (plate((0, 0), (1, 1), 2.0), False),
        (joined(Mesh.box((0, 0, 0), (1, 1, 1)), plate((0, 0), (1, 1), 2.0)), False),
        (UNIT.replace(triangles=UNIT.triangles[1:]), False),
    ],
)  # fmt: skip
def test_a_mesh_is_solid_where_its_surface_closes(mesh: Mesh, solid: bool) -> None:
    """One missing triangle makes a solid a surface."""
    assert mesh.is_solid == solid


def test_two_sides_that_cancel_make_no_solid() -> None:
    """Walls drawn from both sides, with other diagonals, close and hold nothing: it is said."""
    box = Mesh.box((0, 0, 0), (2, 2, 2))
    sides = box.triangles.reshape(-1, 2, 3)
    corners = np.column_stack([sides[:, 0], sides[:, 1, 2]])  # four of each side
    other = corners[:, [0, 3, 1, 1, 3, 2]].reshape(-1, 3)  # from inside, by the other diagonal
    both = box.replace(triangles=np.concatenate([box.triangles, other]))
    assert not both.is_solid and len(both.parts) == 1
    beside = joined(both, moved(box, (5.0, 0.0, 0.0)))
    solid, rest = beside.parts
    assert not beside.is_solid and solid.is_solid and not rest.is_solid
    assert solid.corners[..., 0].min() == 5.0


def test_wrong_meshes_are_refused_in_words() -> None:
    """Vertices, numbers of vertices and sizes are checked where a mesh is made."""
    vertices = np.zeros((3, 3))
    with pytest.raises(ProblemError, match="vertices: must have 3 columns"):
        Mesh(vertices=np.zeros((3, 2)), triangles=np.array([[0, 1, 2]]))
    for wrong in ([[0, 1, 3]], [[0, -1, 2]], [[0, 1, 1.5]]):
        with pytest.raises(ProblemError, match=r"triangles: must be numbers of vertices, 0..2"):
            Mesh(vertices=vertices, triangles=np.array(wrong))
    with pytest.raises(ProblemError, match=r"datum: must have 6 x 5 cells"):
        FLAT.replace(datum=np.zeros((5, 6)))


# -- the same scene in other words --------------------------------------------------------


def scene(height_map: HeightMap, meshes: tuple[Mesh, ...] = (), up: float = 0.0) -> Problem:
    """Two drones, of two layers, and a person on a map of 6 x 5 cells."""
    motion = Motion(headings=4, layers=(3.0, 5.0))
    camera = Camera(width=400, height=300, focal=200.0, tilts=(0.6,))
    poses = [[3.3 + 0.4 * t, 2.6, up, 0.5 * t] for t in range(4)]
    return Problem(
        name="",
        height_map=height_map,
        meshes=meshes,
        robots=(
            Robot(start=State(0, 0), motion=motion, camera=camera),
            Robot(start=State(5, 4, 1, 2), motion=motion, camera=camera),
        ),
        actors=(Actor(poses=np.array(poses)),),
        horizon=3,
    )


def coverage_of_all(problem: Problem) -> FloatArray:
    """Coverage of all free states of the first robot at step 2."""
    robot = problem.robots[0]
    graph = TimeGraph.of(problem.workspace, robot.motion, 1)
    views = StateViews.of(FaceGeometry(problem), problem, graph, robot.camera)
    states = np.flatnonzero(np.tile(graph.free, graph.n_orientations))
    return views.coverage(2, states)


@examples(12)
@given(st.lists(st.sampled_from([0.0, 0.0, 2.0, 4.0, 9.0]), min_size=30, max_size=30))
def test_columns_of_a_map_and_boxes_are_the_same(heights: list[float]) -> None:
    """A map's columns made of boxes on flat ground block the same moves and hide the same."""
    tops = np.reshape(heights, (6, 5))
    tops[[0, 5], [0, 4]] = 0.0
    boxes = [
        Mesh.box((x, y, -1.0), (x + 1, y + 1, tops[x, y]))
        for x, y in product(range(6), range(5))
        if tops[x, y] > 0
    ]
    as_map, as_boxes = scene(HeightMap(heights=tops)), scene(FLAT, tuple(boxes))
    motion = as_map.robots[0].motion
    one, other = (place_graph(problem.workspace, motion) for problem in (as_map, as_boxes))
    assert set(one.edges) == set(other.edges)
    np.testing.assert_allclose(
        coverage_of_all(as_map), coverage_of_all(as_boxes), rtol=1e-9, atol=1e-9
    )


@examples(12)
@given(
    st.lists(st.sampled_from([0.0, 0.0, 2.0, 4.0, 9.0]), min_size=30, max_size=30),
    st.sampled_from([-3.0, 250.0, 1024.0]),
)
def test_lifting_everything_changes_nothing(heights: list[float], up: float) -> None:
    """Ground, actors, meshes and the datum of flight heights lifted together: the same scene."""
    tops = np.reshape(heights, (6, 5))
    tops[[0, 5], [0, 4]] = 0.0
    beam = Mesh.box((2.2, 0.0, 2.5), (2.7, 5.0, 3.5))
    below = scene(HeightMap(heights=tops), (beam,))
    lifted = HeightMap(heights=tops + up, datum=np.full((6, 5), up))
    above = scene(lifted, (moved(beam, (0, 0, up)),), up)
    motion = below.robots[0].motion
    one, other = (place_graph(problem.workspace, motion) for problem in (below, above))
    assert set(one.edges) == set(other.edges)
    np.testing.assert_allclose(coverage_of_all(below), coverage_of_all(above), rtol=1e-6)


def test_cells_of_points_are_those_of_each_point() -> None:
    """On the map, on its lines and off it."""
    height_map = HeightMap(heights=np.zeros((4, 3)), resolution=0.5, origin=(100.0, -7.0))
    points = np.mgrid[99.0:103.0:0.25, -8.0:-4.0:0.25, 1:2].reshape(3, -1).T
    cells = height_map.cells_of(points)
    assert cells.tolist() == [list(height_map.cell_of(x, y)) for x, y, _ in points.tolist()]
    assert height_map.cells_of(points[:6].reshape(2, 3, 3)).shape == (2, 3, 2)


def test_drones_follow_the_terrain_above_its_datum() -> None:
    """Flight heights are above the datum: over a hill the camera is higher, and J differs."""
    hill = np.zeros((6, 5))
    hill[2:4] = 2.0
    follows = scene(HeightMap(heights=hill, datum=hill))
    level = scene(HeightMap(heights=hill))
    assert follows.robots[0].motion.free_places(follows.workspace).all()
    plan = PLANNERS["greedy"](follows, never).plan
    assert plan is not None
    assert check(follows, plan).violations == ()
    assert check(follows, plan).reward != check(level, plan).reward


def test_a_cliff_is_not_flown_through() -> None:
    """From below a cliff to above it is no move where the line between meets the rock."""
    cliff = np.zeros((6, 5))
    cliff[3:] = 10.0
    workspace = Workspace(HeightMap(heights=cliff, datum=cliff))
    graph = place_graph(workspace, Motion(layers=(5.0, 12.0)))
    assert graph.has_node((0, 3, 2))
    assert not graph.has_edge((0, 2, 2), (0, 3, 2))
    assert not graph.has_edge((0, 3, 2), (0, 2, 2))
    assert graph.has_edge((1, 2, 2), (1, 3, 2))


# -- copies -------------------------------------------------------------------------------

COPIES = [
    Copy(1),
    Copy(2),
    Copy(3),
    Copy(mirror=True),
    Copy(1, mirror=True),
    Copy(shift=(500600.988, 4794197.109, 0.0)),
    Copy(3, mirror=True, shift=(-317.25, 4.794e6, 312.7)),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("copy", "name"), [*zip(COPIES, cycle(["bridge", "corridor"]), strict=False)], ids=str
)
def test_copies_of_a_scene_have_the_same_j(copy: Copy, name: str) -> None:
    """A turned, mirrored or shifted plan has the J of the plan, and planners find it."""
    problem = load_scene(name, 3).replace(horizon=4)
    other = copy.problem(problem)
    for planner in ("greedy", "cocap", "cocap-vs"):
        plan = PLANNERS[planner](problem, never).plan
        assert plan is not None
        reward = check(problem, plan).reward
        assert check(other, copy.plan(plan, problem)).reward == pytest.approx(reward, rel=1e-8)
        assert PLANNERS[planner](other, never).value == pytest.approx(reward, rel=1e-8)


def without_sides(problem: Problem) -> Problem:
    """The problem with four headings, no goals, and actors and moves whose sides are alike."""
    robots = [
        robot.replace(
            motion=robot.motion.replace(headings=4),
            start=start._replace(heading=start.heading % 4),
            goal=None,
        )
        for robot, start in zip(problem.robots, problem.first_starts, strict=True)
    ]
    actors = [actor.replace(weights=None) for actor in problem.actors]
    # The diagonals of a mirrored one are not its own.
    actors = [
        actor.replace(shape=Cuboid()) if isinstance(actor.shape, TriangulatedCuboid) else actor
        for actor in actors
    ]
    # dx + dy = 0 rewards one diagonal, which a turned or mirrored move leaves.
    objective = problem.objective.replace(balanced=0.0)
    return problem.replace(robots=tuple(robots), actors=tuple(actors), objective=objective)


@examples(15)
@given(problems(), st.integers(0, 3), st.booleans())
def test_copies_of_problems_have_the_same_j(problem: Problem, quarters: int, mirror: bool) -> None:
    """The same of random problems, for the plan of one planner."""
    assume(not problem.has_free_starts)  # whose cells a copy would have to turn, too
    problem, copy = without_sides(problem), Copy(quarters, mirror)
    plan = PLANNERS["greedy"](problem, never).plan
    assert plan is not None
    one = check(problem, plan)
    other = check(copy.problem(problem), copy.plan(plan, problem))
    assert other.violations == one.violations == ()
    assert len(other.conflicts) == len(one.conflicts)
    assert other.reward == pytest.approx(one.reward, rel=1e-6, abs=1e-6)


def test_a_solid_that_touches_the_map_from_outside_leaves_its_cells_free() -> None:
    """What only touches a cell does not block it, at the edge of the map as elsewhere."""
    around = Mesh.box((-1.0, 0.0, 0.0), (0.0, 5.0, 8.0)), Mesh.box((0.0, 5.0, 0.0), (6.0, 6.0, 8.0))
    assert Motion(layers=(3.0,)).free_places(Workspace(FLAT, around)).all()
