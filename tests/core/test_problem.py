"""Problem data: what is refused, and that nothing changes once made."""

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import WALL, examples, standing, tiny

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import SceneFile, encode, problem_digest
from cocap_opt.planners import PLANNERS
from cocap_opt.planners.greedy import greedy
from cocap_opt.problem import (
    NO_RULES,
    VERTEX_ONLY,
    Actor,
    Camera,
    Cell,
    CollisionRules,
    Cuboid,
    GoalArea,
    Motion,
    Objective,
    Prism,
    Problem,
    Robot,
    Shape,
    State,
    TriangulatedCuboid,
    Views,
)
from cocap_opt.stop import never
from cocap_opt.world.workspace import HeightMap

NAN, INF = math.nan, math.inf
BOX = [[0.0, 0.0], [0.0, 0.0]]


def with_robot(**changes: Any) -> Problem:
    """The tiny instance with its first robot changed."""
    first, second = tiny().robots
    return tiny().replace(robots=(first.replace(**changes), second))


def with_start(*start: int) -> Problem:
    """The tiny instance with another start of its first robot."""
    return with_robot(start=State(*start))


WRONG: list[tuple[str, Callable[[], object]]] = [
    ("heights", lambda: HeightMap(heights=np.zeros(3))),
    ("heights", lambda: HeightMap(heights=np.zeros((2, 2, 2)))),
    ("heights", lambda: HeightMap(heights=np.zeros((0, 2)))),
    ("heights", lambda: HeightMap(heights=[[0.0], [0.0, 1.0]])),  # type: ignore[arg-type]
    ("heights", lambda: HeightMap(heights=[["high"]])),  # type: ignore[arg-type]
    ("heights", lambda: HeightMap(heights=None)),  # type: ignore[arg-type]
    ("heights", lambda: HeightMap(heights=np.array([[0.0, NAN]]))),
    ("heights", lambda: HeightMap(heights=np.array([[INF, 0.0]]))),
    ("heights", lambda: HeightMap(heights=np.array([[-INF, 0.0]]))),
    ("resolution", lambda: HeightMap(heights=BOX, resolution=0.0)),
    ("resolution", lambda: HeightMap(heights=BOX, resolution=-1.0)),
    ("resolution", lambda: HeightMap(heights=BOX, resolution=NAN)),
    ("resolution", lambda: HeightMap(heights=BOX, resolution=INF)),
    ("resolution", lambda: HeightMap(heights=BOX, resolution=1e-300)),
    ("resolution", lambda: HeightMap(heights=BOX, resolution=2e9)),
    ("heights", lambda: HeightMap(heights=np.array([[0.0, 1e300]]))),
    ("origin", lambda: HeightMap(heights=BOX, origin=(0.0, 1e300))),
    ("origin", lambda: HeightMap(heights=BOX, origin=(NAN, 0.0))),
    ("origin", lambda: HeightMap(heights=BOX, origin=(0.0, -INF))),
    ("radius", lambda: Motion(radius=-1)),
    ("radius", lambda: Motion(radius=17)),
    ("radius", lambda: Motion(radius=NAN)),  # type: ignore[arg-type]
    ("headings", lambda: Motion(headings=0)),
    ("headings", lambda: Motion(headings=361)),
    ("headings", lambda: Motion(headings=INF)),  # type: ignore[arg-type]
    ("turn", lambda: Motion(turn=-1)),
    ("turn", lambda: Motion(turn=10_001)),
    ("climb", lambda: Motion(climb=-1)),
    ("climb", lambda: Motion(climb=10**30)),
    ("pitch_turn", lambda: Motion(pitch_turn=-1)),
    ("pitch_turn", lambda: Motion(pitch_turn=10**400)),
    ("pitch_turn", lambda: Motion(pitch_turn=NAN)),  # type: ignore[arg-type]
    ("clearance", lambda: Motion(clearance=-0.1)),
    ("clearance", lambda: Motion(clearance=NAN)),
    ("clearance", lambda: Motion(clearance=INF)),
    ("clearance", lambda: Motion(clearance=1e300)),
    ("layers", lambda: Motion(layers=())),
    ("layers", lambda: Motion(layers=(5.0, 5.0))),
    ("layers", lambda: Motion(layers=(5.0, 3.0))),
    ("layers", lambda: Motion(layers=(NAN,))),
    ("layers", lambda: Motion(layers=(5.0, INF))),
    ("layers", lambda: Motion(layers=(5.0, 1e300))),
    ("width", lambda: Camera(width=0)),
    ("width", lambda: Camera(width=-400)),
    ("width", lambda: Camera(width=10**30)),
    ("width", lambda: Camera(width=NAN)),  # type: ignore[arg-type]
    ("height", lambda: Camera(height=0)),
    ("height", lambda: Camera(height=100_001)),
    ("height", lambda: Camera(height=-INF)),  # type: ignore[arg-type]
    ("focal", lambda: Camera(focal=0.0)),
    ("focal", lambda: Camera(focal=-1.0)),
    ("focal", lambda: Camera(focal=NAN)),
    ("focal", lambda: Camera(focal=INF)),
    ("focal", lambda: Camera(focal=2e9)),
    ("focal", lambda: Camera(focal=1e-300)),
    ("focal", lambda: Camera(focal=10**400)),
    ("tilts", lambda: Camera(tilts=())),
    ("tilts", lambda: Camera(tilts=(0.0, 1.6))),
    ("tilts", lambda: Camera(tilts=(-1.6,))),
    ("tilts", lambda: Camera(tilts=(NAN,))),
    ("tilts", lambda: Camera(tilts=(INF,))),
    ("length", lambda: Cuboid(length=0.0)),
    ("length", lambda: Cuboid(length=INF)),
    ("length", lambda: Cuboid(length=1e-300)),
    ("length", lambda: Cuboid(length=1e300)),
    ("width", lambda: Cuboid(width=-1.0)),
    ("height", lambda: Cuboid(height=NAN)),
    ("length", lambda: TriangulatedCuboid(length=-2.0)),
    ("height", lambda: TriangulatedCuboid(height=0.0)),
    ("sides", lambda: Prism(sides=2)),
    ("sides", lambda: Prism(sides=65)),
    ("sides", lambda: Prism(sides=NAN)),  # type: ignore[arg-type]
    ("apothem", lambda: Prism(apothem=0.0)),
    ("apothem", lambda: Prism(apothem=NAN)),
    ("height", lambda: Prism(height=-INF)),
    ("poses", lambda: Actor(poses=np.zeros(4))),
    ("poses", lambda: Actor(poses=np.zeros((3, 3)))),
    ("poses", lambda: Actor(poses=np.zeros((0, 4)))),
    ("poses", lambda: Actor(poses=np.full((3, 4), NAN))),
    ("poses", lambda: Actor(poses=np.full((3, 4), INF))),
    ("poses", lambda: Actor(poses=np.full((3, 4), 1e300))),
    ("poses", lambda: Actor(poses=[[0, 0, 0, 0], [0, 0]])),  # type: ignore[arg-type]
    ("poses", lambda: Actor(poses="here")),  # type: ignore[arg-type]
    ("weights", lambda: Actor(poses=np.zeros((3, 4)), weights=(1.0,))),
    ("weights", lambda: Actor(poses=np.zeros((3, 4)), weights=())),
    ("weights", lambda: Actor(poses=np.zeros((3, 4)), weights=(1.0,) * 6)),
    ("weights", lambda: Actor(poses=np.zeros((3, 4)), weights=(1.0, 1.0, 1.0, 1.0, -1.0))),
    ("weights", lambda: Actor(poses=np.zeros((3, 4)), weights=(1.0, 1.0, 1.0, 1.0, NAN))),
    ("weights", lambda: Actor(poses=np.zeros((3, 4)), weights=(INF, 1.0, 1.0, 1.0, 1.0))),
    ("weights", lambda: Actor(poses=np.zeros((3, 4)), weights=(1.0, 1.0, 1.0, 1.0, 1.1e12))),
    ("separation", lambda: CollisionRules(separation=-1.0)),
    ("separation", lambda: CollisionRules(separation=NAN)),
    ("separation", lambda: CollisionRules(separation=INF)),
    ("separation", lambda: CollisionRules(separation=1e300)),
    ("vertex", lambda: CollisionRules(vertex=False)),
    ("vertex", lambda: CollisionRules(vertex=False, swap=False, separation=2.0)),
    ("stationarity", lambda: Objective(stationarity=-1.0)),
    ("stationarity", lambda: Objective(stationarity=NAN)),
    ("stationarity", lambda: Objective(stationarity=INF)),
    ("stationarity", lambda: Objective(stationarity=1.1e12)),
    ("keep_cell", lambda: Objective(keep_cell=-1.0)),
    ("keep_heading", lambda: Objective(keep_heading=NAN)),
    ("balanced", lambda: Objective(balanced=INF)),
    ("horizon", lambda: tiny().replace(horizon=0)),
    ("horizon", lambda: tiny().replace(horizon=-3)),
    ("horizon", lambda: tiny().replace(horizon=NAN)),
    ("robots", lambda: tiny().replace(robots=())),
    ("face_samples", lambda: tiny().replace(face_samples=0)),
    ("face_samples", lambda: tiny().replace(face_samples=65)),
    ("face_samples", lambda: tiny().replace(face_samples=INF)),
    ("actors[0].poses", lambda: tiny().replace(horizon=3)),  # has poses for three steps only
    ("actors[1].poses", lambda: tiny().replace(actors=(standing(0, 0, 0, 0), standing(0, 0, 0, 0, steps=1)))),  # noqa: E501
    ("robots[0].start.x", lambda: with_start(-1, 0)),
    ("robots[0].start.x", lambda: with_start(4, 0)),
    ("robots[0].start.y", lambda: with_start(0, -1)),
    ("robots[0].start.y", lambda: with_start(0, 3)),
    ("robots[0].start.layer", lambda: with_start(0, 0, 1)),
    ("robots[0].start.layer", lambda: with_start(0, 0, -1)),
    ("robots[0].start.heading", lambda: with_start(0, 0, 0, 4)),
    ("robots[0].start.heading", lambda: with_start(0, 0, 0, -1)),
    ("robots[0].start.pitch", lambda: with_start(0, 0, 0, 0, 1)),
    ("robots[0].start.pitch", lambda: with_start(0, 0, 0, 0, -1)),
    ("robots[0].start", lambda: with_start(1, 1)),  # in the wall
    ("robots[0].start", lambda: with_robot(motion=Motion(headings=4, clearance=5.0))),
    ("robots[1].start", lambda: with_start(3, 2)),  # where the second robot starts
    ("robots[1].start", lambda: tiny().replace(rules=CollisionRules(separation=99.0))),
    ("robots[0].goal", lambda: with_robot(goal=(-1, 0))),
    ("robots[0].goal", lambda: with_robot(goal=(4, 0))),
    ("robots[0].goal", lambda: with_robot(goal=(0, 3))),
    ("robots[0].goal", lambda: with_robot(goal=(1, 1))),
    ("robots[0].goal", lambda: with_robot(goal=(NAN, 0))),
]  # fmt: skip


@pytest.mark.parametrize(("field", "make"), WRONG, ids=[field for field, _ in WRONG])
def test_wrong_value_is_refused_and_the_field_named(field: str, make: Callable[[], object]) -> None:
    """A wrong value is a ProblemError of one line that starts with the field's path."""
    with pytest.raises(ProblemError) as caught:
        make()
    message = str(caught.value)
    assert message.startswith(f"{field}:") or message.startswith(f"{field} ")
    assert "\n" not in message


def test_a_name_is_text() -> None:
    """A name from bytes that are no text can be written, and two such names stay different.

    None steers a terminal or begins a line.
    """
    names = [tiny().replace(name=name).name for name in ("\udcff", "\udcfe", "M\xfcnchen \u4e2d")]
    assert names == ["\\udcff", "\\udcfe", "M\xfcnchen \u4e2d"]
    assert tiny().replace(name="a\x1b[2J\n\u202eb").name == r"a\x1b[2J\n\u202eb"
    encode(SceneFile(problem=tiny().replace(name="\udcff")))
    with pytest.raises(ProblemError, match="name: must be text"):
        tiny().replace(name=3)


NOT_WHOLE: list[tuple[str, Callable[[], object]]] = [
    ("radius", lambda: Motion(radius=1.5)),  # type: ignore[arg-type]
    ("headings", lambda: Motion(headings=7.5)),  # type: ignore[arg-type]
    ("turn", lambda: Motion(turn=INF)),  # type: ignore[arg-type]
    ("climb", lambda: Motion(climb=INF)),  # type: ignore[arg-type]
    ("pitch_turn", lambda: Motion(pitch_turn=INF)),  # type: ignore[arg-type]
    ("width", lambda: Camera(width=INF)),  # type: ignore[arg-type]
    ("height", lambda: Camera(height=INF)),  # type: ignore[arg-type]
    ("sides", lambda: Prism(sides=4.5)),  # type: ignore[arg-type]
    ("face_samples", lambda: tiny().replace(face_samples=2.5)),
    ("horizon", lambda: tiny().replace(horizon=1.5)),
    ("horizon", lambda: tiny().replace(horizon=INF, actors=())),
    ("robots[0].start.x", lambda: with_start(0.5, 0)),  # type: ignore[arg-type]
    ("robots[0].start.heading", lambda: with_start(0, 0, 0, 0.5)),  # type: ignore[arg-type]
    ("robots[0].goal", lambda: with_robot(goal=(0.5, 0))),
]


@pytest.mark.parametrize(("field", "make"), NOT_WHOLE, ids=[field for field, _ in NOT_WHOLE])
def test_counts_and_indices_are_whole_numbers(field: str, make: Callable[[], object]) -> None:
    """A count or an index that is infinite or a fraction is a ProblemError naming the field."""
    with pytest.raises(ProblemError) as caught:
        make()
    assert str(caught.value).startswith(field)


NOT_NUMBERS: list[tuple[str, Callable[[], object]]] = [
    ("heights", lambda: HeightMap(heights=[["1.5"]])),  # type: ignore[arg-type]
    ("heights", lambda: HeightMap(heights=[[10**400]])),  # type: ignore[arg-type]
    ("poses", lambda: Actor(poses=[["0", "0", "0", "0"]])),  # type: ignore[arg-type]
    ("heights", lambda: HeightMap(heights=np.array([[1j]]))),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("field", "make"), NOT_NUMBERS, ids=[field for field, _ in NOT_NUMBERS])
def test_arrays_hold_numbers(field: str, make: Callable[[], object]) -> None:
    """Text, complex numbers and integers beyond float64 in an array are a ProblemError."""
    with pytest.raises(ProblemError) as caught:
        make()
    assert str(caught.value).startswith(field)


def test_numpy_numbers_are_numbers() -> None:
    """A number from NumPy, such as np.radians(10), makes the same problem as a plain one."""
    plain, (first, second) = tiny(), tiny().robots
    motion = Motion(headings=np.int64(4), layers=tuple(np.array([5.0])))  # type: ignore[arg-type]
    camera = Camera(
        width=np.int32(400),  # type: ignore[arg-type]
        height=np.int64(300),  # type: ignore[arg-type]
        focal=np.float32(200.0),  # type: ignore[arg-type]
        tilts=(np.float64(0.6),),
    )
    robots = (
        Robot(start=State(*np.array([0, 0])), motion=motion, camera=camera),
        second.replace(motion=motion, camera=camera),
    )
    problem = plain.replace(robots=robots, horizon=np.int64(2))
    assert encode(SceneFile(problem=problem)) == encode(SceneFile(problem=plain))
    assert problem_digest(problem) == problem_digest(plain)
    assert problem.robots == (first, second)
    assert greedy(problem).plan == greedy(plain).plan


LISTS: dict[str, Callable[[], Problem]] = {
    "layers": lambda: with_robot(motion=Motion(headings=4, layers=[5.0])),  # type: ignore[arg-type]
    "tilts": lambda: with_robot(camera=Camera(tilts=[0.6])),  # type: ignore[arg-type]
    "goal": lambda: with_robot(goal=[0, 1]),
    "start": lambda: with_robot(start=(0, 0)),
    "robots": lambda: tiny().replace(robots=list(tiny().robots)),
    "actors": lambda: tiny().replace(actors=list(tiny().actors)),
}


@pytest.mark.parametrize("field", LISTS)
def test_lists_for_tuples_are_taken_or_refused_at_once(field: str) -> None:
    """A list or a bare tuple is refused where the problem is made, or else works throughout."""
    try:
        problem = LISTS[field]()
    except ProblemError as error:
        assert field in str(error)
        return
    assert greedy(problem).plan is not None


def test_replace_checks_again() -> None:
    """A variant made by replace is checked like a new problem, also on cross-field rules."""
    problem = tiny()
    with pytest.raises(ProblemError, match="heights"):
        problem.height_map.replace(heights=np.zeros(2))
    with pytest.raises(ProblemError, match="focal"):
        problem.robots[0].camera.replace(focal=-1.0)
    with pytest.raises(ProblemError, match=r"robots\[0\]\.start"):
        problem.replace(height_map=HeightMap(heights=np.full((4, 3), WALL)))
    with pytest.raises(ProblemError, match=r"robots\[1\]\.start\.x"):
        problem.replace(height_map=HeightMap(heights=np.zeros((3, 3))))
    with pytest.raises(TypeError):
        problem.replace(horizons=3)


def test_replace_computes_derived_values_again() -> None:
    """Derived values of a variant come from its own fields, not from the original's memory."""
    problem = tiny()
    assert (len(problem.face_weights), problem.layers) == (5, (5.0,))
    other = problem.replace(actors=(*problem.actors, standing(1, 1, 0, 0)))
    assert len(other.face_weights) == 10
    assert other.face_owner.tolist() == [0] * 5 + [1] * 5
    higher = problem.robots[1].replace(motion=Motion(layers=(7.0,), headings=4))
    assert problem.replace(robots=(problem.robots[0], higher)).layers == (5.0, 7.0)
    actor = problem.actors[0]
    assert actor.face_weights.tolist() == [1.0] * 5
    assert actor.replace(weights=(2.0,) * 5).face_weights.tolist() == [2.0] * 5


def test_the_original_is_untouched_by_replace() -> None:
    """A variant shares nothing that could change the original."""
    problem = tiny()
    before = msgspec.json.encode(problem, enc_hook=lambda array: array.tolist())
    problem.replace(horizon=1, name="other", rules=NO_RULES)
    assert msgspec.json.encode(problem, enc_hook=lambda array: array.tolist()) == before


@pytest.mark.parametrize(
    ("thing", "field"),
    [
        (tiny(), "horizon"),
        (tiny().height_map, "resolution"),
        (tiny().robots[0], "start"),
        (tiny().robots[0].motion, "radius"),
        (tiny().robots[0].camera, "focal"),
        (tiny().actors[0], "poses"),
        (tiny().actors[0].shape, "height"),
        (tiny().rules, "swap"),
        (tiny().objective, "count_start"),
        (tiny().robots[0].start, "x"),
    ],
)
def test_data_is_frozen(thing: object, field: str) -> None:
    """No field of a problem can be set after it is made."""
    with pytest.raises(AttributeError):
        setattr(thing, field, 3)


def arrays_of(problem: Problem) -> dict[str, np.ndarray[Any, Any]]:
    """All arrays that a problem hands out."""
    return {
        "heights": problem.height_map.heights,
        "poses": problem.actors[0].poses,
        "Actor.face_weights": problem.actors[0].face_weights,
        "weighted": problem.actors[0].replace(weights=(1.0,) * 5).face_weights,
        "Problem.face_weights": problem.face_weights,
        "Problem.face_owner": problem.face_owner,
    }


@pytest.mark.parametrize("name", arrays_of(tiny()))
def test_arrays_are_read_only(name: str) -> None:
    """Nobody can change a number inside a problem, not even in an array derived from it."""
    array = arrays_of(tiny())[name]
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1


def test_arrays_are_copies() -> None:
    """Changing the array that a problem was made from does not change the problem."""
    heights, poses = np.zeros((2, 2)), np.zeros((2, 4))
    height_map, actor = HeightMap(heights=heights), Actor(poses=poses)
    heights[:], poses[:] = 7.0, 7.0
    assert height_map.heights.max() == 0.0
    assert actor.poses.max() == 0.0


@pytest.mark.parametrize(
    "duplicate", [copy.copy, copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p))]
)
def test_copies_are_as_immutable_as_the_original(duplicate: Callable[[Problem], Problem]) -> None:
    """A copied or pickled problem (as sent to another process) is equal and still read-only."""
    problem = duplicate(tiny())
    assert problem.replace(name="tiny").height_map.heights.tobytes() == (
        tiny().height_map.heights.tobytes()
    )
    assert problem.robots == tiny().robots
    assert not problem.height_map.heights.flags.writeable
    assert not problem.actors[0].poses.flags.writeable


@examples(15)
@given(problems())
def test_states_and_cells(problem: Problem) -> None:
    """A robot's cell keeps its place, and its layer index stands for the same flight height."""
    for i, robot in enumerate(problem.robots):
        for start in problem.starts[i]:
            cell = problem.cell(i, start)
            assert (cell.x, cell.y) == (start.x, start.y)
            assert problem.layers[cell.layer] == robot.motion.layers[start.layer]
    assert list(problem.layers) == sorted(set(problem.layers))


@examples(100)
@given(
    st.tuples(*[st.integers(0, 9)] * 2),
    st.sampled_from([0.1, 0.3, 1.0, 4.0, 7.7]),
    st.tuples(*[st.floats(-1e6, 1e6)] * 2),
)
def test_centre_lies_in_its_cell(
    cell: tuple[int, int], resolution: float, origin: tuple[float, float]
) -> None:
    """The world point in the middle of a cell is found in that cell."""
    height_map = HeightMap(heights=np.zeros((10, 10)), resolution=resolution, origin=origin)
    assert height_map.cell_of(*height_map.centre(*cell)) == cell


def test_a_world_point_left_of_the_origin_is_outside() -> None:
    """Cells are found by rounding down, not toward zero."""
    assert HeightMap(heights=BOX).cell_of(-0.5, 1.5) == (-1, 1)


def test_blocked_is_at_or_above_the_flight_height_less_clearance() -> None:
    """A cell is blocked where H >= flight height - clearance, and only there."""
    heights = np.array([[0.0, 2.999], [3.0, 4.0]])
    problem = Problem(
        name="",
        height_map=HeightMap(heights=heights),
        robots=(Robot(start=State(0, 0)),),
        actors=(),
        horizon=1,
    )
    motion = Motion(layers=(3.0, 5.0), clearance=0.0)
    blocked = [[problem.blocked(x, y, motion, 0) for y in range(2)] for x in range(2)]
    assert blocked == [[False, False], [True, True]]
    motion = motion.replace(clearance=2.0)
    blocked = [[problem.blocked(x, y, motion, 1) for y in range(2)] for x in range(2)]
    assert blocked == [[False, False], [True, True]]


def test_robots_in_one_column_but_different_layers_may_start() -> None:
    """Layers count: robots above one another do not share a cell."""
    motion = Motion(layers=(5.0, 9.0), headings=4)
    robots = tuple(Robot(start=State(0, 0, layer), motion=motion) for layer in (0, 1))
    assert len(tiny().replace(robots=robots).robots) == 2
    with pytest.raises(ProblemError, match=r"robots\[1\]\.start"):
        tiny().replace(robots=robots, rules=CollisionRules(separation=4.5))


def test_robots_may_share_a_start_where_no_rule_forbids_it() -> None:
    """Without a vertex rule two robots may start in one cell."""
    robot = tiny().robots[0]
    assert len(tiny().replace(robots=(robot, robot), rules=NO_RULES).robots) == 2
    with pytest.raises(ProblemError):
        tiny().replace(robots=(robot, robot), rules=VERTEX_ONLY)


def test_separation_is_strict() -> None:
    """Two robots exactly as far apart as the separation do not conflict."""
    problem = tiny().replace(rules=CollisionRules(separation=4.0))
    assert not problem.too_close(Cell(0, 0), Cell(1, 0))
    assert problem.too_close(Cell(0, 0), Cell(0, 0))
    wider = tiny().replace(rules=CollisionRules(separation=4.00001))
    assert wider.too_close(Cell(0, 0), Cell(1, 0))
    assert not wider.too_close(Cell(0, 0), Cell(1, 1))


def test_rules_say_what_they_are() -> None:
    """The printed form of the rules names each rule that is on."""
    assert str(NO_RULES) == "none"
    assert str(VERTEX_ONLY) == "vertex"
    assert str(CollisionRules()) == "vertex+swap"
    assert str(CollisionRules(separation=2.5)) == "separation 2.5 m"
    assert str(CollisionRules(separation=2.5, vertical=4)) == "separation 2.5 m, or 4 m in height"
    assert NO_RULES.none
    assert not VERTEX_ONLY.none


def _normal(face: FloatArray) -> FloatArray:
    return np.cross(face[1] - face[0], face[2] - face[0])


@pytest.mark.parametrize(
    "shape",
    [Cuboid(), Cuboid(length=3.0, width=0.5), Prism(), Prism(sides=3), Prism(sides=64),
     TriangulatedCuboid()],
)  # fmt: skip
def test_faces_close_the_shape(shape: Shape) -> None:
    """Faces point outward, are planar, and with the bottom close the solid (area vectors)."""
    faces = shape.faces()
    middle = np.array([0.0, 0.0, shape.height / 2])
    total = np.zeros(3)
    for face in faces:
        normal = _normal(face)
        assert normal @ (face[0] - middle) > 0
        assert np.abs((face - face[0]) @ normal).max() < 1e-12
        moved = face - face[0]
        total += np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0) / 2
    assert np.abs(total[:2]).max() < 1e-12
    assert total[2] > 0  # all that is missing is the bottom


def test_face_order() -> None:
    """Cuboid faces come as front, left, back, right, top; triangles two by two in that order."""
    expected = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1]]
    normals = [np.sign(_normal(face).round(9)).tolist() for face in Cuboid().faces()]
    assert normals == expected
    triangles = [np.sign(_normal(f).round(9)).tolist() for f in TriangulatedCuboid().faces()]
    assert triangles == [normal for normal in expected for _ in range(2)]
    assert np.sign(_normal(Prism().faces()[0]).round(9)).tolist() == [1, 0, 0]


def test_triangles_are_halves_of_the_cuboid_faces() -> None:
    """Every two triangles of a triangulated cuboid together have the area of its face."""
    sizes = {"length": 1.5, "width": 0.7, "height": 2.0}
    quads, triangles = Cuboid(**sizes).faces(), TriangulatedCuboid(**sizes).faces()
    for quad, first, second in zip(quads, triangles[::2], triangles[1::2], strict=True):
        whole = np.linalg.norm(np.cross(quad[1] - quad[0], quad[3] - quad[0]))
        for triangle in (first, second):
            assert np.linalg.norm(_normal(triangle)) == pytest.approx(whole, rel=1e-12)
        corners = {tuple(p) for p in np.concatenate([first, second]).tolist()}
        assert corners == {tuple(p) for p in quad.tolist()}


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: tiny().replace(rules="none"), "rules: must be a CollisionRules object"),
        (lambda: tiny().replace(height_map=np.zeros((4, 4))), "height_map: must be a HeightMap"),
        (lambda: tiny().replace(robots=tiny().robots[0]), "robots: must be a sequence of Robot"),
        (lambda: tiny().replace(actors=[np.zeros((3, 4))]), "actors: must be a sequence of Actor"),
        (lambda: CollisionRules(vertex="no"), "vertex: must be true or false, not 'no'"),
        (lambda: Motion(layers=5.0), "layers: must be a sequence of numbers, not 5.0"),
        (lambda: GoalArea(cells=5), "cells: must be a sequence of sequences of 2 numbers, not 5"),
        (lambda: Robot(start=(1, 1)), "start: must be a State object"),
    ],
)
def test_a_field_of_another_type_is_refused(make: Callable[[], object], words: str) -> None:
    """The message names the field and the type that it has."""
    with pytest.raises(ProblemError) as error:
        make()
    assert str(error.value).startswith(words)


def test_arrays_become_plain() -> None:
    """What the caller does to its array later changes no problem."""
    origin = np.array([0.0, 1.0])
    height_map = HeightMap(heights=np.zeros((2, 2)), origin=origin)
    origin[0] = 9.0
    assert height_map.origin == (0.0, 1.0)
    assert Motion(layers=np.array([3, 5])).layers == (3, 5)


def test_whole_numbers_are_floats_where_floats_are_meant() -> None:
    """As in a problem that was read from a file; planners add rewards up in place."""
    objective = Objective(stationarity=1, keep_cell=2, views=Views(weight=(3, 4)))
    assert type(objective.stationarity) is type(objective.keep_cell) is float
    assert objective.views is not None and isinstance(objective.views.weight, tuple)
    assert all(type(weight) is float for weight in objective.views.weight)
    problem = tiny().replace(objective=Objective(stationarity=1, keep_cell=1.5))
    assert PLANNERS["cocap"](problem, never).plan is not None
