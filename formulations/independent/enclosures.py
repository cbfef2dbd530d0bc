"""Enclosures: bounds on coverage by interval arithmetic (Arb, through python-flint), from a scene's
JSON alone.

The pixels of a face are the area of the image of its visible part. A part is visible if no body's
shadow contains it, and all bodies here are upright prisms above convex ground plans: columns of the
map, people, and meshes of that kind. Two sets of points of a face are computed: one that is
certainly visible, and one that contains every point that may be visible; every decision left open
by rounding or by the margins of coverage is taken such that this remains true. If the program is
correct, its pixels lie between those of the two sets. No decision is guessed: an open one widens
the enclosure.

Points of a triangle are represented by weights of its corners, in fractions. A plane cuts the
triangle where an affine function is 0, whose values at the corners are known up to enclosures: the
lower ends define a function that is nowhere above the true one, the upper ends one that is nowhere
below it.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise, product
from typing import Any, NamedTuple

from flint import arb, ctx, fmpq

from cocap_opt.formulations.independent.scene_facts import Point, Prism, UnknownError

Interval = tuple[float, float]  # lower and upper end
Weights = tuple[fmpq, fmpq, fmpq]  # weights of the corners of a triangle, which define a point
Vector = tuple[arb, arb, arb]  # in m, or of unit length
State = tuple[int, int, int, int, int]  # x, y, layer, heading, tilt

_PRECISION = 96  # bits
_ROUNDED = 1e-12  # m, rounding of the program's coordinates near the origin
_UNITS = 8 * 2.0**-52  # the same, relative to the largest coordinate
# The margins of coverage (m): shadows are wider by this much; cuts that are less deep are ignored;
# a face that lies behind a plane by no more than this lies in the plane, and an eye in front of a
# face by no more than this does not see it.
_OVERLAP, _GRAZED, _FLUSH, _IN_ITS_PLANE = 1e-11, 1e-10, 1e-6, 1e-9
_EDGE_OF_CONE = 1e-9  # rad, by which a person may be outside a cone
_SHARE = 1e-9  # tolerance for the visible share at which a person counts
_CLEAR = 1e-6  # m, margin of quick tests in doubles
_SCALE = 64  # bits after the binary point of the ends of affine functions
_MOST_OPEN = 3  # planes for which it is open whether they face an eye
_NOTHING: Interval = (0.0, 0.0)
_PARTS = {  # how a side of a box is divided into two triangles
    0: ((0, 1, 2), (2, 3, 0)), 1: ((1, 2, 3), (3, 0, 1)),
}  # fmt: skip
_CUTS = (0, 1, 1, 0, 1)  # diagonals of the four sides and of the top


class Columns(NamedTuple):
    """The enclosures of everything that a state sees at a step; missing entries are certainly 0.

    Attributes
    ----------
    faces : px/m2 of each face
    people : drones, 0 or 1, of each person; empty if people are not counted
    """

    faces: dict[int, Interval]
    people: dict[int, Interval]


class _Body(NamedTuple):
    """An upright prism.

    Attributes
    ----------
    normals, offsets : its planes n . p <= o, with unit vectors n and offsets o in m
    pairs : pairs of planes that share an edge
    plan : corners x, y of the ground plan in m, rounded
    borders : number of planes, at the beginning of the list, that do not depend on how columns are
        merged
    """

    normals: list[Vector]
    offsets: list[arb]
    pairs: list[tuple[int, int]]
    plan: list[tuple[float, float]]
    borders: int

    @classmethod
    def above(cls, plan: Sequence[tuple[arb, arb]], low: arb | None, high: arb) -> "_Body":
        """Returns the prism above a convex plan, counter-clockwise, between two altitudes."""
        zero, unit = arb(0), arb(1)
        normals, offsets = [(zero, zero, unit)], [high]
        if low is not None:
            normals.append((zero, zero, -unit))
            offsets.append(-low)
        first, n = len(normals), len(plan)
        pairs = [(level, first + k) for level in range(first) for k in range(n)]
        for k, (x, y) in enumerate(plan):
            u, v = plan[(k + 1) % n]
            across = (v - y, x - u)
            length = (across[0] * across[0] + across[1] * across[1]).sqrt()
            normals.append((across[0] / length, across[1] / length, zero))
            offsets.append((across[0] * x + across[1] * y) / length)
            pairs.append((first + k, first + (k + 1) % n))
        # the side of a column may be only a part of a plane
        borders = 1 if low is None else len(normals)
        corners = [(float(x), float(y)) for x, y in plan]
        return cls(normals, offsets, pairs, corners, borders)


class _Half(NamedTuple):
    """A half-space of a shadow, with the points p for which normal . (p - eye) + more <= 0.

    Attributes
    ----------
    is_plane : True if it is a plane of the body, which hides nothing of a face in that plane
    is_border : True if the plane does not depend on how columns are merged
    """

    normal: Vector
    more: arb
    is_plane: bool = False
    is_border: bool = False


class _Shadow(NamedTuple):
    """The shadow that a body casts from an eye.

    Attributes
    ----------
    wide : shadows that together contain all points that may be hidden, each as its half-spaces
    narrow : the half-spaces of a shadow that contains only points that are certainly hidden; None:
        no such shadow
    plan : ground plan of the body
    """

    wide: list[list[_Half]]
    narrow: list[_Half] | None
    plan: list[tuple[float, float]]

    @classmethod
    def of(cls, body: _Body, eye: Vector, rounded: arb) -> "_Shadow":
        """Returns the shadow of a body, with planes and eye known up to rounding."""
        away = [
            _dot(normal, eye) - offset + rounded
            for normal, offset in zip(body.normals, body.offsets, strict=True)
        ]
        is_open = [k for k, d in enumerate(away) if not d > 0 and not d < 0]
        sure = {k: bool(d > 0) for k, d in enumerate(away)}
        if len(is_open) > _MOST_OPEN:
            return cls([[]], None, body.plan)
        wide, narrow = [], list[_Half]()
        is_known = True
        for chosen in product((True, False), repeat=len(is_open)):
            halves, whole = _halves(body, away, sure | dict(zip(is_open, chosen, strict=True)))
            wide.append(halves)
            narrow += halves
            is_known &= whole
        return cls(wide, narrow if is_known else None, body.plan)


def _halves(body: _Body, away: list[arb], turned: dict[int, bool]) -> tuple[list[_Half], bool]:
    """Returns the half-spaces of a shadow, and False if one is missing."""
    halves = [
        _Half(body.normals[k], away[k], True, k < body.borders)
        for k, is_turned in turned.items() if is_turned
    ]  # fmt: skip
    whole = True
    for a, b in body.pairs:
        if turned[a] == turned[b]:
            continue
        da, db = abs(away[a]), abs(away[b])
        normal = _sum(_times(db, body.normals[a]), _times(da, body.normals[b]))
        length = _dot(normal, normal).sqrt()
        across = _times(1 / length, normal)
        if all(part.is_finite() for part in across):
            halves.append(_Half(across, arb(0)))
        else:
            whole = False
    return halves, whole


class _Piece(NamedTuple):
    """A convex part of a triangle of a face."""

    corners: tuple[int, int, int]  # corners of the face
    points: list[Weights]


class _Face(NamedTuple):
    """A face of a person.

    Attributes
    ----------
    corners : corners, in m
    normal : unit vector, outward
    area : m2
    """

    corners: list[Vector]
    normal: Vector
    area: arb

    @property
    def triangles(self) -> list[tuple[int, int, int]]:
        """The corner numbers of the triangles that make up the face."""
        return [(0, k, k + 1) for k in range(1, len(self.corners) - 1)]


class _SeenFrom(NamedTuple):
    """A person relative to an eye.

    Attributes
    ----------
    faces, rounded : corners of each face in m, as enclosures and as doubles
    middle, radius : sphere that contains the corners, in doubles
    """

    faces: list[list[Vector]]
    rounded: list[list[Point]]
    middle: Point
    radius: float


class Enclosures:
    """Enclosures of what drones see.

    Parameters
    ----------
    problem : the content of a scene's JSON file

    Raises
    ------
    UnknownError
        If the scene has meshes that are not upright prisms above convex plans.
    """

    def __init__(self, problem: dict[str, Any]) -> None:
        with ctx.workprec(_PRECISION):
            self._problem, self._map = problem, problem["height_map"]
            self._fixed = [*_columns(self._map), *map(_solid, problem["meshes"])]
            largest = max(
                *(abs(x) for body in self._fixed for point in body.plan for x in point),
                *(abs(x) for actor in problem["actors"] for pose in actor["poses"] for x in pose),
                *(abs(z) for column in self._map["heights"] for z in column),
            )
            self._rounded = _ball(_ROUNDED + _UNITS * largest)
            first, self._of_actor = 0, []
            for actor in problem["actors"]:
                count = len(_plain_faces(actor["shape"]))
                self._of_actor.append(range(first, first + count))
                first += count
            views = problem["objective"]["views"]
            self._at_least = None if views is None else views["at_least"]
        self.person = lru_cache(1024)(self._person)
        self._lenses: dict[tuple[str, int, int, int], _Lens] = {}
        self._seen_from = lru_cache(4096)(self._relative_faces)
        self._fixed_shadows = lru_cache(64)(self._shadows)
        self._visible = lru_cache(4096)(self._visible_parts)

    def seen(self, robot: dict[str, Any], t: int, state: State) -> Columns:
        """Returns the enclosures of everything that a drone sees in a state at a step.

        Parameters
        ----------
        robot : the drone's entry in the scene's JSON
        """
        with ctx.workprec(_PRECISION):
            eye = self._eye(robot, state)
            camera = robot["camera"]
            if camera["type"] == "cone":
                return self._in_cone(robot, t, eye, state)
            if camera["type"] != "pinhole":
                raise UnknownError(f"cameras of the type {camera['type']}")
            key = (repr(camera), robot["motion"]["headings"], state[3], state[4])
            if key not in self._lenses:
                self._lenses[key] = _Lens.of(camera, *key[1:])
            lens = self._lenses[key]
            faces, people = dict[int, Interval](), dict[int, Interval]()
            for j, numbers in enumerate(self._of_actor):
                found, share = self._of_person(lens, t, eye, j)
                faces |= {numbers[f]: amount for f, amount in found.items()}
                if share is not None and share != _NOTHING:
                    people[j] = share
            return Columns(faces, people)

    def _eye(self, robot: dict[str, Any], state: State) -> Point:
        """Returns the position of a drone in m, in doubles."""
        (x, y, layer, *_), edge, origin = state, self._map["resolution"], self._map["origin"]
        datum, lift = ((self._map[name] or {}) for name in ("datum", "lift"))
        zero = (datum[x][y] if datum else 0.0) + (lift[x][y] if lift else 0.0)
        height = robot["motion"]["layers"][layer] + zero
        return origin[0] + (x + 0.5) * edge, origin[1] + (y + 0.5) * edge, height

    # -- people ------------------------------------------------------------------------------

    def _person(self, j: int, t: int) -> tuple[list[_Face], _Body]:
        """Returns the faces of a person at a step, and the body."""
        actor = self._problem["actors"][j]
        x, y, z, yaw = map(arb, actor["poses"][t])
        sine, cosine = yaw.sin_cos()

        def placed(point: Vector) -> Vector:
            u, v, w = point
            return x + u * cosine - v * sine, y + u * sine + v * cosine, z + w

        faces = []
        for corners in _plain_faces(actor["shape"]):
            there = [placed(corner) for corner in corners]
            doubled = _cross(_minus(there[1], there[0]), _minus(there[2], there[0]))
            length = _dot(doubled, doubled).sqrt()
            area = arb(0)
            for k in range(1, len(corners) - 1):
                part = _cross(_minus(there[k], there[0]), _minus(there[k + 1], there[0]))
                area += _dot(part, part).sqrt() / 2
            faces.append(_Face(there, _times(1 / length, doubled), area))
        plan = [placed((u, v, arb(0)))[:2] for u, v in _plan(actor["shape"])]
        return faces, _Body.above(plan, z, z + arb(actor["shape"]["height"]))

    def _of_person(
        self, lens: "_Lens", t: int, eye: Point, j: int
    ) -> tuple[dict[int, Interval], Interval | None]:
        """Returns the pixels of a person's faces, and whether the person counts as seen; None:
        nobody is counted.
        """
        faces, _ = self.person(j, t)
        found = dict[int, Interval]()
        angles = [0.0, 0.0]
        relative, rounded, middle, radius = self._seen_from(j, t, eye)
        if lens.may_see([middle], radius):
            visible = self._visible(j, t, eye)
            for f, (face, corners) in enumerate(zip(faces, relative, strict=True)):
                parts = visible[f]
                if parts is None or not lens.may_see(rounded[f]):
                    continue
                inside = lens.inside(corners)
                pixels = self._measured(parts, inside, lens.area, lens.image)
                if pixels[1] > 0:
                    found[f] = _low(pixels[0] / face.area), _high(pixels[1] / face.area)
                if self._at_least is not None:
                    ends = self._measured(parts, inside, lens.angle, 2 * arb.pi())
                    angles[0] += _low(ends[0])
                    angles[1] += _high(ends[1])
        if self._at_least is None:
            return found, None
        return found, self._counts(self._at_least, angles, faces, relative)

    def _measured(
        self, visible: "_Visible", inside: "_Inside", measure: Any, most: arb
    ) -> tuple[arb, arb]:
        """Returns the smallest and the largest measure of the visible part of a face in the
        image.
        """
        least = largest = arb(0)
        sure = visible.sure if visible.is_sure else ()
        for piece in sure:
            points = inside.cut(piece, sure=True)
            if len(points) > 2 and (size := measure(inside, piece, points)) is not None:
                least += size.abs_lower()
        for piece in visible.possible:
            points = inside.cut(piece, sure=False)
            if len(points) > 2:
                size = measure(inside, piece, points)
                if size is None:
                    return least, most
                largest += size.abs_upper()
        return least, largest if largest < most else most

    def _counts(
        self, at_least: float, angles: list[float], faces: list[_Face], relative: list[list[Vector]]
    ) -> Interval:
        """Returns an enclosure of 1 if a person counts as seen, otherwise of 0."""
        if angles[1] == 0:
            return _NOTHING
        whole = [0.0, 0.0]
        for face, corners in zip(faces, relative, strict=True):
            ahead = -_dot(corners[0], face.normal) - arb(_IN_ITS_PLANE)
            if ahead < 0:
                continue
            size = arb(0)
            for triangle in face.triangles:
                part = _solid_angle(*(corners[k] for k in triangle))
                size += part
            whole[1] += _high(abs(size).upper())
            if ahead > 0:
                whole[0] += _low(abs(size).lower())
        least = angles[0] / whole[1] if whole[1] > 0 else 0.0
        largest = angles[1] / whole[0] if whole[0] > 0 else math.inf
        needed = at_least - _SHARE
        return float(least >= needed * (1 + 1e-12)), float(largest >= needed * (1 - 1e-12))

    def _relative_faces(self, j: int, t: int, eye: Point) -> "_SeenFrom":
        """Returns a person's faces relative to an eye, and a sphere around them."""
        relative = [self._relative(face, eye) for face in self.person(j, t)[0]]
        rounded = [[_rounded(corner) for corner in corners] for corners in relative]
        points = [corner for corners in rounded for corner in corners]
        x, y, z = (sum(p[k] for p in points) / len(points) for k in range(3))
        radius = max(math.dist((x, y, z), point) for point in points)
        return _SeenFrom(relative, rounded, (x, y, z), radius + _CLEAR)

    def _relative(self, face: _Face, eye: Point) -> list[Vector]:
        """Returns the corners of a face relative to an eye, up to rounding."""
        x, y, z = map(arb, eye)
        off = self._rounded
        return [(u - x + off, v - y + off, w - z + off) for u, v, w in face.corners]

    # -- what hides people -------------------------------------------------------------------------

    def _shadows(self, eye: Point) -> dict[int, _Shadow]:
        """Returns a cache for the shadows that fixed bodies cast from an eye."""
        return {}

    def _visible_parts(self, j: int, t: int, eye: Point) -> "list[_Visible | None]":
        """Returns the visible parts of each face of a person; None: certainly not visible."""
        faces, _ = self.person(j, t)
        relative = self._seen_from(j, t, eye).faces
        hull = _Hull.of(eye, [corner for corners in relative for corner in corners])
        at = arb(eye[0]), arb(eye[1]), arb(eye[2])
        shadows, kept = [], self._fixed_shadows(eye)
        for number, body in enumerate(self._fixed):
            if hull.meets(body.plan):
                if number not in kept:
                    kept[number] = _Shadow.of(body, at, self._rounded)
                shadows.append(kept[number])
        actors = self._problem["actors"]
        for other in range(len(actors)):
            if other != j and actors[other]["take"] == actors[j]["take"]:
                _, body = self.person(other, t)
                if hull.meets(body.plan):
                    shadows.append(_Shadow.of(body, at, self._rounded))
        return [
            _Visible.of(face, corners, shadows)
            for face, corners in zip(faces, relative, strict=True)
        ]

    # -- cones -------------------------------------------------------------------------------

    def _in_cone(self, robot: dict[str, Any], t: int, eye: Point, state: State) -> Columns:
        """Returns the enclosures for a cone, which has no image and sees through everything."""
        sine, cosine = arb.sin_cos_pi_fmpq(fmpq(2 * state[3], robot["motion"]["headings"]))
        half, off = arb(robot["camera"]["opening"]) / 2 + arb(_EDGE_OF_CONE), self._rounded
        x, y, z = (arb(value) - off for value in eye)
        found, people = dict[int, Interval](), dict[int, Interval]()
        for j, numbers in enumerate(self._of_actor):
            u, v, ground, _ = map(arb, self._problem["actors"][j]["poses"][t])
            ahead, aside = (
                (u - x) * cosine + (v - y) * sine, (v - y) * cosine - (u - x) * sine
            )  # fmt: skip
            beyond = abs(arb.atan2(aside, ahead)) - half
            if beyond > 0:
                continue
            if self._at_least is not None:
                people[j] = (float(beyond < 0), 1.0)
            for number, face in zip(numbers, self.person(j, t)[0], strict=True):
                n = len(face.corners)
                middle = [sum((c[k] for c in face.corners), arb(0)) / n for k in (0, 1)]
                way = middle[0] - x, middle[1] - y, ground - z
                turned = -_dot(way, face.normal)
                square = _dot(way, way)
                if turned < 0 or square == 0:
                    continue
                law = abs(way[0] * cosine + way[1] * sine) * turned / (square * square)
                if law.is_finite():
                    least = _low(law.lower()) if beyond < 0 and turned > 0 else 0.0
                    found[number] = max(least, 0.0), _high(law.upper())
                else:
                    found[number] = 0.0, math.inf
        return Columns(found, people)


class _Visible(NamedTuple):
    """The parts of a face that are visible from an eye.

    Attributes
    ----------
    sure, possible : parts that are certainly visible, and parts that together contain everything
        that may be visible
    is_sure : True if the face is certainly turned to the eye
    """

    sure: list[_Piece]
    possible: list[_Piece]
    is_sure: bool

    @classmethod
    def of(cls, face: _Face, corners: list[Vector], shadows: list[_Shadow]) -> "_Visible | None":
        """Returns the visible parts of a face; None: certainly not visible.

        Parameters
        ----------
        corners : relative to the eye
        """
        ahead = -_dot(corners[0], face.normal) - arb(_IN_ITS_PLANE)
        if ahead < 0:
            return None
        whole = [_Piece(triangle, [*_CORNERS]) for triangle in face.triangles]
        sure, possible = whole, whole
        for shadow in shadows:
            for halves in shadow.wide:
                ends = _lower_ends(halves, corners)
                if ends is not None:
                    sure = [rest for piece in sure for rest in _outside(piece, ends)]
            if shadow.narrow is not None:
                ends = _upper_ends(shadow.narrow, corners)
                if ends is not None:
                    possible = [rest for piece in possible for rest in _outside(piece, ends)]
            if not possible:
                return None
        return cls(sure, possible, bool(ahead > 0))


_CORNERS: tuple[Weights, ...] = tuple(
    (fmpq(int(k == 0)), fmpq(int(k == 1)), fmpq(int(k == 2))) for k in range(3)
)


def _lower_ends(halves: list[_Half], corners: list[Vector]) -> list[list[int]] | None:
    """Returns lower bounds on the excess of corners over half-spaces, in units of 2^-64 m.

    None: the face lies in a plane of the body, which certainly hides nothing of it.
    """
    found = []
    for half in halves:
        excess = _excess(half, corners)
        if half.is_border and all(value > -arb(_FLUSH) for value in excess):
            return None
        found.append([_floor(value) for value in excess])
    return found


def _upper_ends(halves: list[_Half], corners: list[Vector]) -> list[list[int]] | None:
    """Returns upper bounds on the excess of corners over half-spaces, with the smallest cut added.

    None: the face may lie in a plane of the body.
    """
    found = []
    for half in halves:
        excess = _excess(half, corners)
        if half.is_plane and not any(value < -arb(_FLUSH) for value in excess):
            return None
        found.append([-_floor(-value - arb(_GRAZED)) for value in excess])
    return found


def _excess(half: _Half, corners: list[Vector]) -> list[arb]:
    more = half.more - arb(_OVERLAP)
    return [_dot(half.normal, corner) + more for corner in corners]


def _outside(piece: _Piece, ends: list[list[int]]) -> list[_Piece]:
    """Returns the parts of a piece that are outside a shadow.

    Parameters
    ----------
    ends : for each half-space, the excess of each corner of the face over it
    """
    values = [[end[k] for k in piece.corners] for end in ends]
    if any(min(value) > 0 for value in values):
        return [piece]
    rest, outer = piece.points, list[_Piece]()
    for value in values:
        if max(value) <= 0:
            continue
        excess = [_at(point, value) for point in rest]
        if max(excess) <= 0:
            continue
        if min(excess) >= 0:
            return [piece]  # nothing remains in the shadow
        outer.append(_Piece(piece.corners, _cut(rest, excess)))
        rest = _cut(rest, [-x for x in excess])
    return outer


def _at(point: Weights, values: Sequence[int]) -> fmpq:
    """Returns the value of an affine function at a point, given its values at the corners."""
    found: fmpq = point[0] * values[0] + point[1] * values[1] + point[2] * values[2]
    return found


def _cut(points: list[Weights], values: list[fmpq]) -> list[Weights]:
    """Returns the part of a convex polygon in which an affine function is at least 0."""
    found = list[Weights]()
    for k, (point, value) in enumerate(zip(points, values, strict=True)):
        before, last = points[k - 1], values[k - 1]
        if (value > 0 and last < 0) or (value < 0 and last > 0):
            share = last / (last - value)
            u, v, w = (a + share * (b - a) for a, b in zip(before, point, strict=True))
            found.append((u, v, w))
        if value >= 0:
            found.append(point)
    return found


class _Lens(NamedTuple):
    """A pinhole camera in a given direction.

    Attributes
    ----------
    axes : right, up and forward unit vectors
    slopes : slopes of the image's sides, horizontal and vertical
    focal, image : focal length in px, and area of the whole image in px^2
    walls : inward normals of the planes through the image's sides, in doubles
    """

    axes: tuple[Vector, Vector, Vector]
    slopes: tuple[arb, arb]
    focal: arb
    image: arb
    walls: list[Point]

    @classmethod
    def of(cls, camera: dict[str, Any], headings: int, heading: int, tilt: int) -> "_Lens":
        """Returns a camera in an orientation."""
        s, c = arb.sin_cos_pi_fmpq(fmpq(2 * heading, headings))
        st, ct = arb(camera["tilts"][tilt]).sin_cos()
        axes = (s, -c, arb(0)), (c * st, s * st, ct), (c * ct, s * ct, -st)
        width, height, focal = (arb(camera[name]) for name in ("width", "height", "focal"))
        slopes = width / focal / 2, height / focal / 2
        walls = [
            _rounded(_sum(_times(slope, axes[2]), _times(arb(sign), axis)))
            for axis, slope in zip(axes, slopes, strict=False) for sign in (-1, 1)
        ]  # fmt: skip
        return cls(axes, slopes, focal, width * height, walls)

    def sides(self, point: Vector) -> list[arb]:
        """Returns the distances, up to scale, of a point in camera coordinates from the image's
        sides.
        """
        u, v, depth = point
        across, upright = self.slopes[0] * depth, self.slopes[1] * depth
        return [across - u, across + u, upright - v, upright + v]

    def may_see(self, points: list[Point], radius: float = 0.0) -> bool:
        """Returns False if spheres around points are clearly outside the image.

        Parameters
        ----------
        points : relative to the eye (m)
        """
        for u, v, w in self.walls:
            far = math.sqrt(u * u + v * v + w * w)
            if all(
                u * x + v * y + w * z + far * (radius + _CLEAR * (1 + abs(x) + abs(y) + abs(z))) < 0
                for x, y, z in points
            ):
                return False
        return True

    def inside(self, corners: list[Vector]) -> "_Inside":
        """Returns a face, given relative to the eye, in camera coordinates."""
        right, up, ahead = self.axes
        points = [
            (_dot(corner, right), _dot(corner, up), _dot(corner, ahead)) for corner in corners
        ]
        sides = [*zip(*(self.sides(point) for point in points), strict=True)]
        return _Inside(
            points,
            [[_floor(x) for x in side] for side in sides],
            [[-_floor(-x) for x in side] for side in sides],
        )

    def area(self, inside: "_Inside", piece: _Piece, points: list[Weights]) -> arb | None:
        """Returns the area (px) of the image of a part of a face; None: no bound is found."""
        image = []
        for u, v, depth in inside.placed(piece, points):
            if not depth > 0:
                return None
            scale = self.focal / depth
            image.append((u * scale, v * scale))
        (x, y), doubled = image[0], arb(0)
        off = [(u - x, v - y) for u, v in image[1:]]
        for (a, b), (c, d) in pairwise(off):
            doubled += a * d - b * c
        return doubled / 2

    def angle(self, inside: "_Inside", piece: _Piece, points: list[Weights]) -> arb | None:
        """Returns the solid angle (sr) of a part of a face; None: no bound is found."""
        first, *others = inside.placed(piece, points)
        found = arb(0)
        for second, third in pairwise(others):
            found += _solid_angle(first, second, third)
        return found if found.is_finite() else None


class _Inside(NamedTuple):
    """A face in camera coordinates.

    Attributes
    ----------
    corners : coordinates right, up and forward, in m
    lower, upper : bounds on the corners' distances from each side of the image, in units of 2^-64 m
    """

    corners: list[Vector]
    lower: list[list[int]]
    upper: list[list[int]]

    def cut(self, piece: _Piece, sure: bool) -> list[Weights]:
        """Returns the part of a piece that is certainly, or possibly, in the image."""
        points = piece.points
        for side in self.lower if sure else self.upper:
            values = [side[k] for k in piece.corners]
            if min(values) >= 0:
                continue
            points = _cut(points, [_at(point, values) for point in points])
            if len(points) < 3:
                return []
        return points

    def placed(self, piece: _Piece, points: list[Weights]) -> Iterator[Vector]:
        """Yields points of a piece as coordinates right, up and forward, in m."""
        a, b, c = (self.corners[k] for k in piece.corners)
        for point in points:
            x, y, z = map(arb, point)
            u, v, w = (x * p + y * q + z * r for p, q, r in zip(a, b, c, strict=True))
            yield u, v, w


class _Hull(NamedTuple):
    """The hull of an eye and a person, seen from above, in doubles."""

    points: list[tuple[float, float]]
    low: tuple[float, float]
    high: tuple[float, float]
    axes: list[tuple[float, float]]

    @classmethod
    def of(cls, eye: Point, corners: list[Vector]) -> "_Hull":
        """Returns the hull of an eye and of corners relative to it."""
        points = [eye[:2], *{(eye[0] + float(u), eye[1] + float(v)) for u, v, _ in corners}]
        hull = _convex(points)
        across, along = zip(*points, strict=True)
        return cls(hull, (min(across), min(along)), (max(across), max(along)), _across(hull))

    def meets(self, plan: list[tuple[float, float]]) -> bool:
        """Returns False if a convex plan is clearly outside the hull."""
        for k in (0, 1):
            if min(p[k] for p in plan) > self.high[k] + _CLEAR:
                return False
            if max(p[k] for p in plan) < self.low[k] - _CLEAR:
                return False
        for u, v in (*self.axes, *_across(plan)):
            ours = [u * x + v * y for x, y in self.points]
            theirs = [u * x + v * y for x, y in plan]
            if min(ours) > max(theirs) + _CLEAR or min(theirs) > max(ours) + _CLEAR:
                return False
        return True


def _across(plan: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Returns unit vectors perpendicular to the edges of a plan."""
    found = []
    for k, (x, y) in enumerate(plan):
        u, v = plan[k - 1]
        length = math.hypot(x - u, y - v)
        if length > 0:
            found.append(((y - v) / length, (u - x) / length))
    return found


def _convex(points: Iterable[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    """Returns the corners of the convex hull of points, counter-clockwise (Andrew, 1979)."""
    ordered = sorted({*points})

    def half(walk: Iterable[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
        found = list[tuple[Any, Any]]()
        for x, y in walk:
            while len(found) > 1:
                (a, b), (c, d) = found[-2:]
                if (c - a) * (y - b) - (d - b) * (x - a) > 0:
                    break
                found.pop()
            found.append((x, y))
        return found[:-1]

    if len(ordered) < 3:
        return ordered
    return half(ordered) + half(reversed(ordered))


def _columns(height_map: dict[str, Any]) -> Iterator[_Body]:
    """Yields the columns of a map, merging columns of equal height that form a rectangle."""
    heights, (ox, oy) = height_map["heights"], map(arb, height_map["origin"])
    edge, (width, depth) = arb(height_map["resolution"]), (len(heights), len(heights[0]))
    lowest = min(map(min, heights))
    rectangles = [(0, 0, width, depth, lowest)]
    done = [[z == lowest for z in column] for column in heights]
    for y, x in product(range(depth), range(width)):
        if done[x][y]:
            continue
        z, last, top = heights[x][y], x, y
        while last < width and not done[last][y] and heights[last][y] == z:
            last += 1
        while top < depth and all(
            not done[k][top] and heights[k][top] == z for k in range(x, last)
        ):
            top += 1
        for k in range(x, last):
            done[k][y:top] = [True] * (top - y)
        rectangles.append((x, y, last, top, z))
    for x, y, last, top, z in rectangles:
        (a, c), (b, d) = ((ox + edge * k for k in (x, last)), (oy + edge * k for k in (y, top)))
        yield _Body.above([(a, b), (c, b), (c, d), (a, d)], None, arb(z))


def _solid(mesh: dict[str, Any]) -> _Body:
    """Returns a mesh as a body, if the mesh is an upright prism above a convex plan."""
    prism = Prism.of(mesh, "meshes")
    area = sum(abs(_area(triangle)) for triangle in prism.triangles)
    hull = _convex(point for triangle in prism.triangles for point in triangle)
    whole = sum(
        (_area([hull[0], hull[k], hull[k + 1]]) for k in range(1, len(hull) - 1)), Fraction(0)
    )
    if whole != area:
        raise UnknownError("meshes with ground plans that are not convex")
    plan = [(arb(fmpq(*x.as_integer_ratio())), arb(fmpq(*y.as_integer_ratio()))) for x, y in hull]
    return _Body.above(plan, arb(prism.low), arb(prism.high))


def _area(plan: Sequence[tuple[Any, Any]]) -> Any:
    (ax, ay), (bx, by), (cx, cy) = plan
    return ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2


def _plan(shape: dict[str, Any]) -> list[tuple[arb, arb]]:
    """Returns the ground plan of a person around the foot point, facing along x."""
    if shape["type"] == "prism":
        n = shape["sides"]
        corner = arb(shape["apothem"]) / arb.cos_pi_fmpq(fmpq(1, n))
        turns = [arb.sin_cos_pi_fmpq(fmpq(2 * k - 1, n)) for k in range(n)]
        return [(corner * cosine, corner * sine) for sine, cosine in turns]
    x, y = arb(shape["length"]) / 2, arb(shape["width"]) / 2
    return [(x, -y), (x, y), (-x, y), (-x, -y)]


def _plain_faces(shape: dict[str, Any]) -> list[list[Vector]]:
    """Returns the corners of a person's faces, sides and top, counter-clockwise from outside."""
    plan, height, ground = _plan(shape), arb(shape["height"]), arb(0)
    ends = [*zip(plan, [*plan[1:], plan[0]], strict=True)]
    quads = [[(*a, ground), (*b, ground), (*b, height), (*a, height)] for a, b in ends]
    top = [(*corner, height) for corner in plan]
    if shape["type"] != "triangulated-cuboid":
        return [*quads, top]
    return [
        [quad[k] for k in part]
        for quad, cut in zip([*quads, top], _CUTS, strict=True) for part in _PARTS[cut]
    ]  # fmt: skip


def _solid_angle(a: Sequence[arb], b: Sequence[arb], c: Sequence[arb]) -> arb:
    """Returns the signed solid angle of a triangle, seen from the origin (Van Oosterom)."""
    la, lb, lc = (_dot(x, x).sqrt() for x in (a, b, c))
    over = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
    return 2 * arb.atan2(_dot(a, _cross(b, c)), over)


def _ball(radius: float) -> arb:
    """Returns an enclosure of all numbers with at most this absolute value."""
    return arb(0, radius)


def _floor(value: arb) -> int:
    """Returns a whole number of units of 2^-64 that is certainly not above a value."""
    digits, exponent = value.lower().man_exp()
    shift = int(exponent) + _SCALE
    return int(digits) << shift if shift >= 0 else int(digits) >> -shift


def _low(value: arb) -> float:
    return math.nextafter(float(value.lower()), -math.inf) if value != 0 else 0.0


def _high(value: arb) -> float:
    return math.nextafter(float(value.upper()), math.inf)


def _rounded(a: Vector) -> Point:
    return float(a[0]), float(a[1]), float(a[2])


def _dot(a: Sequence[arb], b: Sequence[arb]) -> arb:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _times(factor: arb, a: Sequence[arb]) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def _sum(a: Sequence[arb], b: Sequence[arb]) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _minus(a: Sequence[arb], b: Sequence[arb]) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Sequence[arb], b: Sequence[arb]) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    )  # fmt: skip
