"""Mesh files: each is read whole, whatever its variant, or refused with the true reason."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb import glb
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem
from cocap_opt.scenarios.meshes import MeshTable
from cocap_opt.scenarios.recipe import read
from cocap_opt.world.workspace import Mesh

Faces = list[list[int]]

BOX = [(x, y, z) for z in (0, 8) for x, y in ((5, 5), (10, 5), (10, 10), (5, 10))]
SIDES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
TRIANGLES = [[side[k] for k in ks] for side in SIDES for ks in ((0, 1, 2), (0, 2, 3))]
STRIP = [2, 3, 6, 7, 4, 3, 0, 2, 1, 6, 5, 4]  # and 1, 0 close it


def saved(folder: Path, name: str, content: str | bytes) -> Path:
    """A new file."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def shape(path: Path, **fields: Any) -> Mesh:
    """The mesh of a file as a recipe has it, but z upwards."""
    return MeshTable(file=path.name, up="z", **fields).mesh(path.parent)


def volume(mesh: Mesh) -> float:
    """The volume that a surface encloses (m3), negative if it is inside out."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)


def is_box(mesh: Mesh) -> bool:
    """Whether a mesh is the box of 5 x 5 x 8 m."""
    low, high = mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()
    return (
        (low, high) == ([5, 5, 0], [10, 10, 8])
        and (len(mesh.surface), mesh.is_solid) == (12, True)
        and volume(mesh) == pytest.approx(200)
    )


def rows(values: Sequence[Sequence[float]], first: str = "", last: str = "") -> str:
    """One row each, with words before and behind it."""
    return "".join(f"{first}{' '.join(map(str, row))}{last}\n" for row in values)


# -- OBJ ----------------------------------------------------------------------------------

OBJ = rows(BOX, "v ") + rows([[corner + 1 for corner in side] for side in SIDES], "f ")


def backwards(vertices: Sequence[Sequence[float]], faces: Faces, name: str = "a") -> str:
    """An object of OBJ whose faces count vertices back from the last."""
    counted = [[corner - len(vertices) for corner in face] for face in faces]
    return f"o {name}\n" + rows(vertices, "v ") + rows(counted, "f ")


@pytest.mark.parametrize(
    "text",
    [
        OBJ,
        backwards(BOX, SIDES),
        "\n".join("  \t" + line for line in OBJ.splitlines()),
        OBJ.replace("\n", "\r\n"),
        OBJ.replace("\n", "\r"),
        OBJ.replace("f 1 4 3 2", "f 1 4 \\\n  3\\\n 2"),
        OBJ.replace("f ", "g wall # one\ns off\nusemtl brick\nf "),
        OBJ.replace("\nv", " 0.5 0.25 1\nv"),
        OBJ.replace("\nv", " 1.0\nv"),
        "vt 0 0\nvn 0 0 1\n" + OBJ.replace(" 1 4 3 2", " 1/1 4/1 3/1 2/1"),
        "vt 0 0\nvn 0 0 1\n" + OBJ.replace(" 1 4 3 2", " 1//1 4//1 3//1 2//1"),
        "vt 0 0\nvn 0 0 1\n" + OBJ.replace(" 1 4 3 2", " 1/1/1 4/-1/-1 3/1/1 2/1/1"),
        OBJ + "f 1 1 2\n",
        OBJ + "f 2 2 2 2\n",
        OBJ.replace("f 1 4 3 2", "f 1 4 4 3 2 2 1"),
        OBJ + "v 5.0000000001 5 0\nf 1 9 2\n",
        OBJ + "f 1 4 3 2\n",
        OBJ + "v 7 5 0\nf 1 2 9\n",
        OBJ + "v 7 7 7\np 9\nl 1 2 9\n",
        "\N{BYTE ORDER MARK}" + OBJ,
    ],
)  # fmt: skip
def test_an_obj_is_the_same_box_however_it_is_written(tmp_path: Path, text: str) -> None:
    """Numbers from the end, indents, continued lines, colours, repeated points: one solid."""
    assert is_box(shape(saved(tmp_path, "a.obj", text)))


def test_a_box_drawn_from_both_sides_is_solid(tmp_path: Path) -> None:
    """Some programs write each face twice, once for each way it looks."""
    both = OBJ + rows([[corner + 1 for corner in side[::-1]] for side in SIDES], "f ")
    mesh = shape(saved(tmp_path, "a.obj", both))
    assert mesh.is_solid
    assert len(mesh.surface) == 12
    assert abs(volume(mesh)) == pytest.approx(200)


def test_lines_and_points_are_left_out_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """They are no surfaces; a file of nothing else is refused."""
    shape(saved(tmp_path, "a.obj", OBJ + "p 1 2\nl 1 2\nl 3 4\n"))
    assert "1 points, 2 lines are not surfaces and are left out" in caplog.text
    with pytest.raises(ProblemError, match="must contain at least one triangle"):
        shape(saved(tmp_path, "b.obj", rows(BOX, "v ") + "l 1 2 3\n"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (OBJ + "f 0 1 2\n", r"line 15: vertices are numbered from 1, but a corner is 0"),
        (OBJ + "f 1 2 9\n", r"faces: must name vertices 0\.\.7, not 8"),
        (OBJ + "f 1 2 -9\n", r"line 15: corner -9 counts back beyond the 8 vertices"),
        (OBJ + f"f 1 2 {10**30}\n", r"line 15: a corner must be written like 3"),
        (OBJ + "f 1 2\n", r"line 15: a face must have at least 3 corners"),
        (OBJ + "f 1 2 x\n", r"line 15: a corner must be written like 3, 3/1"),
        (OBJ + "f 1 2 3.0\n", r"line 15: a corner must be written like 3, 3/1"),
        (OBJ + "cstype bezier\ndeg 3 3\nsurf 0 1 0 1 1 2 3 4\nend\n", r"cstype belongs to a curve"),
        (OBJ + "curv 0 1 1 2 3\n", r"line 15: curv belongs to a curve or a free-form surface"),
        (OBJ + "call other.obj\n", r"line 15: must be a statement of OBJ, not 'call'"),
        (OBJ + "v 1,5 2 3\n", r"line 15: must be numbers with a decimal point"),
        (OBJ + "v 1 2 3 0.5\n", r"line 15: the weight of a vertex must be 1, not 0\.5"),
        (OBJ + "f 1 2 \\", r"line 15: must continue after its backslash"),
        (OBJ + "v 0 0 9\nf 5 6 8 7\n", r"faces\[6\]: must not cross itself"),
    ],
)
def test_an_obj_that_cannot_be_read_whole_is_refused(tmp_path: Path, text: str, words: str) -> None:
    """The line and the reason are named; nothing is left out in silence."""
    with pytest.raises(ProblemError, match=words):
        shape(saved(tmp_path, "a.obj", text))


def test_obj_in_utf_16_is_refused(tmp_path: Path) -> None:
    """Its zeros are no letters."""
    with pytest.raises(ProblemError, match="not binary or UTF-16"):
        shape(saved(tmp_path, "a.obj", OBJ.encode("utf-16")))


FILM = """\
steps = 6
step = 1
map = { size = [40, 40] }
[[mesh]]
file = "two.obj"
[[walk]]
points = [[3.5, 4], [3.5, 11]]
[[drones]]
starts = [{ x = 14.5, y = 7.5, height = 4, heading = 180 }]
camera = "dji-mavic-pro"
tilts = [20]
motion = { layers = [4] }
"""


@pytest.mark.slow
def test_a_plan_is_the_same_with_numbers_from_the_end(tmp_path: Path) -> None:
    """Two houses, each before its faces, hide the person from the same views."""
    other = [(x + 20, y, z / 2) for x, y, z in BOX]
    ahead = [[corner + 1 for corner in side] for side in SIDES]
    texts = [
        backwards(BOX, SIDES) + backwards(other, SIDES, "b"),
        rows(BOX + other, "v ")
        + rows(ahead + [[corner + 8 for corner in side] for side in ahead], "f "),
    ]

    def scene(text: str) -> Problem:
        saved(tmp_path, "two.obj", text)
        return read(saved(tmp_path, "film.toml", FILM))

    first, second = map(scene, texts)
    np.testing.assert_array_equal(first.meshes[0].corners, second.meshes[0].corners)
    rewards = [PLANNERS["cocap"](problem).value for problem in (first, second)]
    assert rewards[0] == rewards[1]
    assert rewards[0] < PLANNERS["cocap"](first.replace(meshes=())).value


@pytest.mark.parametrize(
    "more", ["f 1 1 2\n", "f 1 2 3\n", "f 2 3 4\n", "v 30 30 0\nv 35 30 0\nv 30 35 0\nf 9 10 11\n"]
)
def test_a_drone_does_not_start_in_a_house(tmp_path: Path, more: str) -> None:
    """Neither two equal corners nor a second face in the floor nor a lawn make it hollow."""
    saved(tmp_path, "two.obj", OBJ + more)
    inside = FILM.replace("x = 14.5", "x = 7.5")
    with pytest.raises(ProblemError, match=r"cell \(7, 7\) is blocked"):
        read(saved(tmp_path, "inside.toml", inside))


# -- solids -------------------------------------------------------------------------------


def test_what_makes_no_solid_hollow() -> None:
    """Unmerged corners, repeats, and corners 1e-9 m apart; a hole still does."""
    corners = np.array(BOX, dtype=float)[np.array(TRIANGLES)]
    soup = Mesh(vertices=corners.reshape(-1, 3), triangles=np.arange(36).reshape(-1, 3))
    assert soup.is_solid
    shaken = soup.vertices + 1e-9 * np.arange(108).reshape(-1, 3) / 108
    assert soup.replace(vertices=shaken).is_solid
    assert soup.replace(triangles=np.concatenate([soup.triangles] * 2)).is_solid
    open_box = soup.replace(triangles=soup.triangles[1:])
    assert not open_box.is_solid
    assert not open_box.replace(triangles=np.concatenate([open_box.triangles] * 2)).is_solid


def test_a_solid_whose_faces_look_different_ways_is_solid() -> None:
    """If each edge has two faces, those that look another way than most are turned."""
    mesh = Mesh(vertices=np.array(BOX, dtype=float), triangles=np.array(TRIANGLES))
    other = Mesh.box((20, 0, 0), (21, 1, 1))
    mixed = mesh.triangles.copy()
    mixed[[0, 7]] = mixed[[0, 7], ::-1]
    both = Mesh.joined([mesh.replace(triangles=mixed), other])
    assert both.is_solid
    assert volume(both) == pytest.approx(201)
    assert not both.replace(triangles=both.triangles[1:]).is_solid
    strip = [[k, (k + 1) % 5, (k + 2) % 5] for k in range(5)]  # with one side and an edge
    assert not Mesh(vertices=mesh.vertices[:5], triangles=np.array(strip)).is_solid


def test_a_house_is_solid_beside_what_is_open() -> None:
    """A plane in the same file makes no house hollow; together they are all that was there."""
    house = Mesh.box((0, 0, 0), (2, 2, 2))
    plane = Mesh.box((9, 9, 9), (12, 12, 10))
    plane = plane.replace(triangles=plane.triangles[:2])
    mesh = Mesh.joined([house, plane])
    assert not mesh.is_solid
    solid, rest = mesh.parts
    assert (solid.is_solid, rest.is_solid) == (True, False)
    assert volume(solid) == pytest.approx(8)
    assert (len(solid.surface), len(rest.surface)) == (12, 2)
    assert house.parts == (house,)
    assert plane.parts == (plane,)


def test_two_rooms_with_a_wall_between_them_are_solid() -> None:
    """The wall is in both, once for each way it looks, and belongs to each."""
    rooms = [Mesh.box((0, 0, 0), (2, 2, 2)), Mesh.box((2, 0, 0), (4, 2, 2))]
    mesh = Mesh.joined(rooms)
    assert mesh.is_solid
    assert len(mesh.surface) == 24
    assert volume(mesh) == pytest.approx(16)
    assert len(Mesh.joined([*rooms, rooms[0]]).surface) == 24


# -- OFF ----------------------------------------------------------------------------------

OFF = "OFF\n8 6 12\n" + rows(BOX) + rows([[len(side), *side] for side in SIDES])


@pytest.mark.parametrize(
    "text",
    [
        OFF,
        OFF.replace("OFF\n", "OFF "),
        OFF.replace("12", "0"),
        OFF.replace("OFF\n8", "# of a town\n\nOFF # text\n# more\n8").replace(" 12", " 12 # edges"),
        "OFF\n8 6 0\n" + rows(BOX) + rows([[4, *side] for side in SIDES], "", " 255 0 0"),
        "COFF\n8 6 0\n" + rows(BOX, "", " 1 0 0 1") + rows([[4, *side] for side in SIDES]),
        "NOFF\n8 6 0\n" + rows(BOX, "", " 0 0 1") + rows([[4, *side] for side in SIDES]),
        "CNOFF\n8 6 0\n" + rows(BOX, "", " 0 0 1 1 0 0 1") + rows([[4, *side] for side in SIDES]),
        "OFF\n8 12 0\n" + rows(BOX) + rows([[3, *side] for side in TRIANGLES]),
        "OFF\n8 8 0\n" + rows(BOX) + rows([[4, *side] for side in SIDES]) + "2 0 1\n1 3\n",
    ],
)  # fmt: skip
def test_an_off_is_the_same_box_however_it_is_written(tmp_path: Path, text: str) -> None:
    """Colours, normals, comments, and a header on one line."""
    assert is_box(shape(saved(tmp_path, "a.off", text)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (OFF.replace("8 6", "8 7"), r"8 vertices and 7 faces, as it declares, not 14 rows"),
        (OFF.replace("8 6", "-2 16"), r"-2 vertices and 16 faces, as it declares, not 14 rows"),
        ("OFF", r"line 1: must be the numbers of vertices, faces and edges"),
        ("<html>", r"is HTML"),
        ("OFFAL 8", r"must begin with OFF"),
        (OFF.replace("8 6", "8 5"), r"8 vertices and 5 faces, as it declares, not 14 rows"),
        (OFF.replace("4 3 0 4 7", "4 3 0 4"), r"line 16: must have 4 corners, not 3"),
        (OFF.replace("4 3 0 4 7", "4 3 0 4 8"), r"must name vertices 0\.\.7, not 8"),
        (OFF.replace("4 3 0 4 7", "4 3 0 4 1e300"), r"must name vertices by numbers below 2\^63"),
        (OFF.replace("OFF\n", "4OFF\n"), r"must have three dimensions"),
        (OFF.replace("OFF\n", "OFF BINARY\n\0"), r"must be OFF as text, not binary"),
        (OFF.replace("5 5 0", "5 5"), r"line 3: a vertex must be x, y, z"),
        ("", r"is empty"),
    ],
)
def test_an_off_that_cannot_be_read_whole_is_refused(tmp_path: Path, text: str, words: str) -> None:
    """The rows are compared with those that it declares."""
    with pytest.raises(ProblemError, match=words):
        shape(saved(tmp_path, "a.off", text))


# -- polygons -----------------------------------------------------------------------------


@st.composite
def prisms(draw: st.DrawFn) -> tuple[list[tuple[float, float, float]], Faces]:
    """A prism over a star-shaped polygon, mostly concave, in numbers that single precision has."""
    radii = draw(st.lists(st.integers(1, 9), min_size=3, max_size=9))
    n = len(radii)
    ring = [
        (
            round(16 * r * np.cos(2 * np.pi * k / n)) / 16,
            round(16 * r * np.sin(2 * np.pi * k / n)) / 16,
        )
        for k, r in enumerate(radii)
    ]
    height = draw(st.integers(1, 20))
    vertices = [(x, y, z) for z in (0, height) for x, y in ring]
    sides = [[k, (k + 1) % n, (k + 1) % n + n, k + n] for k in range(n)]
    return vertices, [list(range(n))[::-1], list(range(n, 2 * n)), *sides]


def area(ring: FloatArray) -> float:
    """The area of a polygon [n, 2], by the shoelace formula."""
    x, y = ring.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def as_triangles(vertices: Sequence[Sequence[float]], triangles: Any) -> list[Any]:
    """Triangles by their corners, each beginning with its least, in order."""
    found = []
    for triangle in np.asarray(vertices, dtype=float)[np.asarray(triangles)].tolist():
        k = triangle.index(min(triangle))
        found.append(triangle[k:] + triangle[:k])
    return sorted(found)


def ply(
    kind: str, vertices: Any, faces: Faces, length: str = "uchar", number: str = "int"
) -> bytes:
    """A PLY file with a property and an element that no reader knows."""
    head = (
        f"ply\nformat {kind} 1.0\ncomment made by a test\nelement camera 1\nproperty float zoom\n"
        f"element vertex {len(vertices)}\nproperty uchar red\nproperty double x\nproperty float y\n"
        f"property float z\nelement face {len(faces)}\nproperty list uchar float texcoord\n"
        f"property list {length} {number} vertex_indices\nproperty short flags\nend_header\n"
    )
    codes = {"uchar": "B", "char": "b", "ushort": "H", "short": "h", "int": "i", "uint": "I"}
    if kind == "ascii":
        body = "1.5\n" + rows(vertices, "7 ") + rows([[0, len(f), *f, 3] for f in faces])
        return (head + body).encode()
    order = "<" if "little" in kind else ">"
    body_bytes = struct.pack(order + "f", 1.5)
    for x, y, z in vertices:
        body_bytes += struct.pack(order + "Bdff", 7, x, y, z)
    for k, face in enumerate(faces):
        body_bytes += struct.pack(order + "B" + "f" * (k % 2), k % 2, *[0.5] * (k % 2))
        body_bytes += struct.pack(order + codes[length], len(face))
        body_bytes += struct.pack(f"{order}{len(face)}{codes[number]}h", *face, 3)
    return head.encode() + body_bytes


def stl_text(triangles: FloatArray) -> str:
    """STL as text, in two solids."""
    facets = [
        "facet normal 0 0 0\n outer loop\n" + rows(triangle.tolist(), "  vertex ")
        + " endloop\nendfacet\n"
        for triangle in triangles
    ]  # fmt: skip
    half = len(facets) // 2
    parts = [f"solid house {k}\n{''.join(part)}endsolid house {k}\n"
             for k, part in enumerate((facets[:half], facets[half:]))]  # fmt: skip
    return "".join(parts)


def stl(triangles: FloatArray, head: bytes = b"") -> bytes:
    """Binary STL."""
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *triangle.ravel().tolist(), 0) for triangle in triangles
    )
    return head.ljust(80, b" ") + struct.pack("<I", len(triangles)) + body


@pytest.mark.slow
@examples(20)
@given(prisms())
def test_a_prism_is_the_same_solid_from_every_format(
    tmp_path_factory: pytest.TempPathFactory, prism: tuple[list[tuple[float, float, float]], Faces]
) -> None:
    """Polygons of any form are cut into triangles that fill them; formats agree on each one."""
    vertices, faces = prism
    folder = tmp_path_factory.mktemp("prism")
    n = len(vertices) // 2
    expected = area(np.array(vertices)[:n, :2]) * vertices[-1][2]
    off = f"OFF\n{2 * n} {len(faces)} 0\n" + rows(vertices) + rows([[len(f), *f] for f in faces])
    mesh = shape(saved(folder, "a.off", off))
    assert mesh.is_solid
    assert volume(mesh) == pytest.approx(expected)
    found = as_triangles(mesh.vertices, mesh.triangles)
    assert len(found) == 2 * (n - 2) + 2 * n
    files = [
        ("a.obj", backwards(vertices, faces).encode()),
        ("b.ply", ply("ascii", vertices, faces)),
        ("c.ply", ply("binary_little_endian", vertices, faces, "uint", "ushort")),
        ("d.ply", ply("binary_big_endian", vertices, faces, "short", "uchar")),
        ("e.stl", stl_text(mesh.corners).encode()),
        ("f.stl", stl(mesh.corners, b"solid but binary")),
        ("g.glb", glb(vertices, mesh_triangles(mesh, vertices))),
        ("h.glb", glb(vertices, mesh_triangles(mesh, vertices), variant="interleaved")),
        ("i.glb", glb(vertices, mesh_triangles(mesh, vertices), variant="not indexed")),
        ("j.glb", glb(vertices, mesh_triangles(mesh, vertices), variant="sparse")),
    ]
    for name, content in files:
        other = shape(saved(folder, name, content))
        assert as_triangles(other.vertices, other.triangles) == found, name


def mesh_triangles(mesh: Mesh, vertices: Any) -> Faces:
    """The triangles of a mesh by the numbers that vertices have elsewhere."""
    number = {tuple(map(float, vertex)): k for k, vertex in enumerate(vertices)}
    return [[number[tuple(corner)] for corner in triangle] for triangle in mesh.corners.tolist()]


def test_a_face_with_a_hole_that_a_bridge_joins_is_cut(tmp_path: Path) -> None:
    """Modellers write a wall with a window as one ring that passes the bridge both ways."""
    ring = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0), (3, 3), (3, 6), (6, 6), (6, 3), (3, 3)]
    text = rows([(*point, 2) for point in ring], "v ") + "f 1 2 3 4 5 6 7 8 9 10\n"
    mesh = shape(saved(tmp_path, "a.obj", text))
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(81 - 9)


# -- PLY ----------------------------------------------------------------------------------


def test_strips_of_ply_are_read_with_its_faces(tmp_path: Path) -> None:
    """Both are in one file, and a strip may end and begin again."""
    head = (
        "ply\nformat ascii 1.0\nelement vertex 8\n"
        + rows([["property float", axis] for axis in "xyz"])  # type: ignore[list-item]
        + "element face 1\nproperty list uchar int vertex_index\n"
        + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    )
    strips = [*STRIP, -1, 5, 4, 1]
    text = head + rows(BOX) + "3 1 4 0\n" + f"{len(strips)} {' '.join(map(str, strips))}\n"
    assert is_box(shape(saved(tmp_path, "a.ply", text)))
    for odd, words in (("1" + "0" * 30, "numbers below 2"), ("8", "vertices 0..7, not 8")):
        with pytest.raises(ProblemError, match=words):
            shape(saved(tmp_path, "b.ply", text.replace(" -1 5 ", f" -1 {odd} ")))


def test_elements_of_ply_that_are_left_out_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Edges are drawn lines; cameras and materials need no word."""
    text = ply("ascii", BOX, SIDES).decode()
    more = text.replace("end_header", "element edge 1\nproperty int vertex1\nend_header") + "0\n"
    assert is_box(shape(saved(tmp_path, "a.ply", more)))
    assert caplog.messages == [f"{tmp_path / 'a.ply'}: element edge is left out"]


def test_ply_of_equal_faces_is_read_like_any_other(tmp_path: Path) -> None:
    """Rows of one length are read at once, others one after the other."""
    for order in ("little", "big"):
        kind = f"binary_{order}_endian"
        content = ply(kind, BOX, TRIANGLES)
        assert is_box(shape(saved(tmp_path, "a.ply", content)))
        cut = saved(tmp_path, "b.ply", content[:-3])
        with pytest.raises(ProblemError, match="ends within its 12 rows of the element face"):
            shape(cut)
        longer = saved(tmp_path, "c.ply", content + b"\0\0")
        with pytest.raises(ProblemError, match=r"must end after the rows .*, not 2 bytes later"):
            shape(longer)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_coordinates_of_ply_are_no_lists(tmp_path: Path, kind: str) -> None:
    """A list for x would give a vertex several places, or none."""
    head = (
        f"ply\nformat {kind} 1.0\nelement vertex 3\nproperty list uchar float x\n"
        "property float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    rows = [(1, 0.0, 0.0, 0.0), (1, 1.0, 0.0, 0.0), (1, 0.0, 1.0, 0.0)]
    text = "".join(f"{n} {x} {y} {z}\n" for n, x, y, z in rows) + "3 0 1 2\n"
    binary = b"".join(struct.pack("<B3f", *row) for row in rows) + struct.pack("<B3i", 3, 0, 1, 2)
    content = head + (text.encode() if kind == "ascii" else binary)
    with pytest.raises(ProblemError, match=r"x, y, z, each of them one number, not x \(list\), y"):
        shape(saved(tmp_path, "a.ply", content))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("element face", "element range_grid", r"element range_grid: lists corners"),
        ("vertex_indices", "corners", r"element face: must have one list vertex_indices"),
        ("property double x", "property double a", r"element vertex: must have x, y, z"),
        ("ascii 1.0", "ascii 2.0", r"line 2: must be a line of PLY's header"),
        ("short flags", "quad flags", r"must be a line of PLY's header"),
        ("list uchar int", "list uchar float", r"vertex_indices must be whole numbers"),
        ("0 4 0 3 2 1 3", "0 4 0 3 2 1.5 3", r"face\[0\]: vertex_indices must be whole numbers"),
        ("0 4 0 3 2 1 3", "0 4 0 3 2 1", r"face\[0\]: must have 7 numbers, not 6"),
        ("0 4 0 3 2 1 3", "0 4 0 3 2 1 3 3", r"face\[0\]: must have 7 numbers, not 8"),
        ("end_header\n", "end_header\n1\n", r"must have 15 rows, as its header says, but has 16"),
        ("end_header\n", "", r"must begin with `ply`"),
        ("property uchar red", "property uchar x", r"vertex: must have properties of different"),
    ],
)
def test_a_ply_that_cannot_be_read_whole_is_refused(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    """Rows, numbers and lists are those that its header declares."""
    content = ply("ascii", BOX, SIDES).decode()
    assert is_box(shape(saved(tmp_path, "a.ply", content)))
    with pytest.raises(ProblemError, match=words):
        shape(saved(tmp_path, "b.ply", content.replace(old, new)))


# -- STL ----------------------------------------------------------------------------------

CORNERS = np.array(BOX, dtype=float)[np.array(TRIANGLES)]


@pytest.mark.parametrize(
    "content",
    [
        stl(CORNERS), stl(CORNERS, b"solid"), stl_text(CORNERS).encode(),
        stl_text(CORNERS).upper().encode(), stl_text(CORNERS).replace("\n", "\r\n").encode(),
        stl_text(CORNERS).replace("\n  vertex", " vertex").replace("\n outer", " outer").encode(),
        b"\n\n" + stl_text(CORNERS).replace("house", "vertex endsolid facet").encode(),
    ],
)  # fmt: skip
def test_an_stl_is_the_same_box_however_it_is_written(tmp_path: Path, content: bytes) -> None:
    """Text and binary, which may begin with the word solid, and several solids."""
    assert is_box(shape(saved(tmp_path, "a.stl", content)))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (stl(CORNERS)[:-50], r"must have 684 bytes, as it declares 12 triangles, but has 634"),
        (stl(CORNERS) + b"x", r"must have 684 bytes"),
        (stl_text(CORNERS)[:-17].encode(), r"ends before its `endsolid`"),
        (stl_text(CORNERS).replace("vertex", "point", 1).encode(), r"line 4: must be a statement"),
        (stl_text(CORNERS).replace(" endloop\n", "", 1).encode(), r"must continue with vertex or "),
        (stl_text(CORNERS).replace("5 5 0", "5 5 z", 1).replace("5.0 5.0 0.0", "5 5 z", 1).encode(),
         r"line \d+: must be numbers"),
        (b"solid", r"ends before its `endsolid`"),
        (b"x" * 20, r"must be STL, which begins with `solid`"),
    ],
)  # fmt: skip
def test_an_stl_that_cannot_be_read_whole_is_refused(
    tmp_path: Path, content: bytes, words: str
) -> None:
    """The bytes of binary files are counted, the statements of text are in their order."""
    with pytest.raises(ProblemError, match=words):
        shape(saved(tmp_path, "a.stl", content))


def with_comment(name: str, comment: str) -> str | bytes:
    """The box in a format, with a comment where its header may have one."""
    corners = rows(BOX)
    faces = rows([[4, *side] for side in SIDES])
    head = f"element vertex 8\n{XYZ}element face 6\nproperty list uchar int vertex_indices\n"
    triangles = b"".join(
        struct.pack("<12fH", *[0] * 3, *(v for k in three for v in BOX[k]), 0)
        for three in TRIANGLES
    )
    return {
        "a.obj": f"# {comment}\n" + rows(BOX, "v ") + rows(np.array(SIDES) + 1, "f "),
        "b.obj": rows(BOX, "v ") + rows(np.array(SIDES) + 1, "f ", f" # {comment}"),
        "a.off": f"OFF # {comment}\n8 6 0\n{corners}{faces}",
        "a.ply": f"ply\nformat ascii 1.0\ncomment {comment}\n{head}end_header\n{corners}{faces}",
        "a.stl": comment.encode().ljust(80) + struct.pack("<I", 12) + triangles,
    }[name]


XYZ = "".join(f"property float {axis}\n" for axis in "xyz")
COMMENTED = ["a.obj", "b.obj", "a.off", "a.ply", "a.stl"]


@pytest.mark.parametrize("name", COMMENTED)
@pytest.mark.parametrize(
    ("comment", "metre"),
    [("File units = millimeters", 1000), ("unit: ft", 1 / 0.3048), ("UNITS=m", 1),
     ("units: US survey feet", 3937 / 1200), ("units: 12", 1), ("units are cm, z up", 100),
     ("made in 3 units", 1), ("unity = cm", 1), ("unit mm", 1000),
     ("Coordinates are in feet", 1 / 0.3048), ("Length unit [ft]", 1 / 0.3048),
     ("Unit: 1 unit = 1 foot", 1 / 0.3048), ("1 ft = 1 unit", 1 / 0.3048),
     ("unit system: imperial (feet)", 1 / 0.3048), ("object exported in millimeters", 1000),
     ("vertices in US survey feet", 3937 / 1200), ("exported in 2024 with 8 vertices", 1),
     ("made in Finland, 12 m", 1)],
)  # fmt: skip
def test_the_unit_that_a_comment_states_counts(
    tmp_path: Path, name: str, comment: str, metre: float
) -> None:
    """As in OBJ by SketchUp; the recipe may say the same, but nothing else."""
    path = saved(tmp_path, name, with_comment(name, comment))
    assert np.ptp(shape(path).vertices) == pytest.approx(10 / metre)
    if metre in (100, 1000):
        unit = {100: "cm", 1000: "mm"}[metre]
        assert np.ptp(shape(path, unit=unit).vertices) == pytest.approx(10 / metre)
        with pytest.raises(ProblemError, match=f"unit: must be '{unit}' or left out, as a comment"):
            shape(path, unit="m")


@pytest.mark.parametrize("name", COMMENTED)
@pytest.mark.parametrize("comment", ["File units = inches", "unit: yd", "UNITS = km"])
def test_a_unit_that_no_recipe_has_is_refused(tmp_path: Path, name: str, comment: str) -> None:
    """Whatever the recipe says."""
    path = saved(tmp_path, name, with_comment(name, comment))
    for unit in (None, "m"):
        with pytest.raises(ProblemError, match=f"unit: must be m, .* states '{comment}'"):
            shape(path, unit=unit)


@pytest.mark.parametrize("name", COMMENTED)
@pytest.mark.parametrize(
    "comment", ["1 unit = 10 cm", "1 unit = 0.0254 m", "Units: 0.1 m", "100 units = 1 m",
                "units = 1,5 ft", "Unit-in-meters: 0.3048", "vertices in feet, scale: 12"],
)  # fmt: skip
def test_scales_in_comments_are_refused(tmp_path: Path, name: str, comment: str) -> None:
    """A unit of the file that is some units of length; one of one is the unit itself."""
    path = saved(tmp_path, name, with_comment(name, comment))
    with pytest.raises(ProblemError, match=f"states '{comment}', which is a scale"):
        shape(path)
    for same, metre in (("1 unit = 1 cm", 100), ("texture units: cm", 1)):
        path = saved(tmp_path, name, with_comment(name, same))
        assert np.ptp(shape(path).vertices) == pytest.approx(10 / metre)


def test_comments_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    """One unit for all coordinates."""
    text = str(with_comment("a.obj", "unit: mm")) + "# unit: m\n"
    with pytest.raises(ProblemError, match="unit: must be one, but comments state mm and m"):
        shape(saved(tmp_path, "a.obj", text))
