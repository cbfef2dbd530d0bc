"""Compiled views of a pinhole camera, one eye after the other. Imported only if numba is installed.

The formulas and their order are those of `views`, `visibility`, `candidates`, `shadows` and
`projection`, which process many eyes at once with NumPy, and with which tests compare this module.
Arrays of one eye and one person are small and stay in the processor's cache, and nothing is
computed for a person known to be hidden; therefore it is ten times as fast.
"""

import math
from functools import partial
from typing import NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from cocap_opt.compiling import compiled
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.candidates import (
    BINS,
    GRAIN,
    MARGIN,
    NEAREST,
    ROUNDING,
    SECTORS,
    SHARES,
)  # fmt: skip
from cocap_opt.vision.shadows import FLUSH, GRAZED, OVERLAP
from cocap_opt.vision.visibility import IN_ITS_PLANE, LEAST

_Number = TypeVar("_Number", np.int64, np.float64)

_SHADOWS = 512  # largest number of shadows on a part of one person from one eye
_PIECES = 4_096  # largest number of pieces of one face
_CUTS = 40  # largest number of vertices of a piece in addition to those of its face
_FLAT = 1 / 64  # tangents for which a short series is exact
_HIDDEN, _TOO_MANY = -1, -2  # codes in place of a number of shadows or pieces
_BESIDE, _INSIDE, _IN_PART = range(3)  # position of points relative to a shadow


Eye = tuple[float, float, float]  # m


class Lens(NamedTuple):
    """A camera and the orientations that it can have."""

    axes: FloatArray  # [O, 3, 3] right, up and forward
    slopes: FloatArray  # [2] half the image's width and height, over the focal length
    focal: float  # px
    image: float  # px, its area


class Solids(NamedTuple):
    """Convex bodies, like `Bodies`, with their numbers of planes and edges."""

    normals: FloatArray  # [B, P, 3]
    offsets: FloatArray  # [B, P] m
    edges: IntArray  # [B, N, 2] planes on both sides
    planes: IntArray  # [B] number of planes
    pairs: IntArray  # [B] number of edges
    low: FloatArray  # [B, 2] m
    high: FloatArray  # [B, 3] m
    endless: BoolArray  # [B]


class People(NamedTuple):
    """The persons at one step, with their faces."""

    middles: FloatArray  # [A, 3] m
    reaches: FloatArray  # [A] m
    corners: FloatArray  # [A, C, 3] m
    n_corners: IntArray  # [A] number of corners; the last is repeated
    first_face: IntArray  # [A + 1]
    polygons: FloatArray  # [F, V, 3] m
    n_vertices: IntArray  # [F] number of vertices; the last is repeated
    normals: FloatArray  # [F, 3]
    areas: FloatArray  # [F] m2
    solids: Solids  # A bodies
    take_of: IntArray  # [A] only people of the same take hide each other


class Before(NamedTuple):
    """The fixed bodies that may hide each person, like `Candidates`."""

    solids: Solids
    keys: FloatArray  # keys of all entries, increasing
    bodies: IntArray  # body of each entry
    nearest: FloatArray  # m, of each entry
    starts: IntArray  # [G SECTORS + 1] first entry of each target's sectors
    around: FloatArray  # [G, 2] m, of cylinders around the targets
    radii: FloatArray  # [G] m
    feet: FloatArray  # [G] m
    # [G] m, slightly more than the radii: bodies nearer than this surround a target
    around_it: FloatArray
    middles: FloatArray  # [B, 2] m, of the bodies along x and y
    halves: FloatArray  # [B, 2] m
    first: int  # number of the first person's target


class Skyline(NamedTuple):
    """The skyline in front of a person, and the bodies examined to raise it."""

    bins: FloatArray  # [BINS + 1]
    heights: FloatArray  # [BINS]
    listed: IntArray  # [B] bodies
    edges: FloatArray  # [B, 3] their left and right ends and peaks; nan for bodies without these


class Shadows(NamedTuple):
    """Shadows on parts of a person, as half-spaces."""

    normals: FloatArray  # [_SHADOWS, K, 3]
    offsets: FloatArray  # [_SHADOWS, K] m
    depths: FloatArray  # [_SHADOWS, K] m
    sizes: IntArray  # [_SHADOWS] number of half-spaces of each
    distances: FloatArray  # [P] m, of the eye from a body's planes


class Pieces(NamedTuple):
    """A face, and its pieces outside the shadows processed so far."""

    face: FloatArray  # [V, 3] m, relative to the eye
    points: FloatArray  # [2, _PIECES, W, 3] m, before and after processing a shadow
    sizes: IntArray  # [2, _PIECES] number of vertices of each
    angles: FloatArray  # [_PIECES + 1] sr, of the face, and of the remaining pieces
    inner: FloatArray  # [2, W, 3] m, part of a piece inside a shadow
    excess: FloatArray  # [W] m, excess of its vertices
    cuts: BoolArray  # [K] half-spaces that do not contain the whole piece


class Image(NamedTuple):
    """A piece in the camera's axes."""

    points: FloatArray  # [2, W + 5, 3] m, before and after clipping
    beyond: FloatArray  # [W + 5] m, distance from a side of the image


class Memory(NamedTuple):
    """Working memory for one eye with at most L views."""

    views: IntArray  # [L] views that may have the person in the image
    is_whole: BoolArray  # [L] True for views that have the whole person
    corners: FloatArray  # [C, 3] m, of the person, relative to the eye
    skyline: Skyline
    shadows: Shadows
    pieces: Pieces
    image: Image
    seen: FloatArray  # [L, F] px
    visible: FloatArray  # [L, A] sr
    unhidden: FloatArray  # [A] sr


class Total(NamedTuple):
    """The number of finished eyes, and of the faces and people that they see."""

    eyes: int
    faces: int
    people: int


class Found(NamedTuple):
    """The faces that views see, view by view, and the people, if requested."""

    counts: IntArray  # [n] number of faces that each view sees
    faces: IntArray  # numbers of all of them, increasing for each view
    pixels: FloatArray  # px/m2
    n_people: IntArray  # [n] number of people that each view sees; [0] if not requested
    people: IntArray  # numbers of all of them, increasing for each view
    visible: FloatArray  # sr
    unhidden: FloatArray  # sr, without obstructions and image edges

    @classmethod
    def empty(cls, views: int, faces: int, people: int) -> Self:
        """Returns arrays for the given numbers of entries; without people, none are requested."""
        whole = np.int64
        return cls(
            np.zeros(views, whole), np.empty(faces, whole), np.empty(faces),
            np.zeros(views if people else 0, whole), np.empty(people, whole), np.empty(people),
            np.empty(people),
        )  # fmt: skip

    def has_room(self, views: int, faces: int, people: int) -> bool:
        """Returns True if `empty` with these numbers would give no more room."""
        given = self.counts, self.n_people, self.faces, self.people
        needed = views, views if people else 0, faces, people
        return all(len(column) >= number for column, number in zip(given, needed, strict=True))

    def doubled(self) -> Self:
        """Returns the same entries with twice the room."""
        return self._replace(
            faces=_doubled(self.faces), pixels=_doubled(self.pixels),
            people=_doubled(self.people), visible=_doubled(self.visible),
            unhidden=_doubled(self.unhidden),
        )  # fmt: skip


def _doubled(column: NDArray[_Number]) -> NDArray[_Number]:
    return np.concatenate([column, np.empty_like(column)])


# Nothing is allocated here, so references need not be counted, which took half of the time.
_compiled = partial(compiled, nogil=True, error_model="numpy", _nrt=False)
# Inlined into the callers: calls that pass all arrays take longer than the work in them.
_inlined = partial(_compiled, kept=False, forceinline=True)


def memory_for(people: People, before: Before, most: int) -> Memory:
    """Returns memory for `cover`, for one step.

    Parameters
    ----------
    most : largest number of views of one eye
    """
    bodies = people.solids, before.solids
    planes = max(part.normals.shape[1] for part in bodies)
    size = max(part.normals.shape[1] + part.edges.shape[1] for part in bodies)
    whole, n_fixed = np.int64, len(before.solids.low)
    vertices = people.polygons.shape[1]
    width = vertices + _CUTS
    return Memory(
        np.empty(most, whole),
        np.empty(most, np.bool_),
        np.empty((people.corners.shape[1], 3)),
        Skyline(
            np.empty(BINS + 1), np.empty(BINS), np.empty(n_fixed, whole), np.empty((n_fixed, 3))
        ),
        Shadows(
            np.empty((_SHADOWS, size, 3)), np.empty((_SHADOWS, size)), np.empty((_SHADOWS, size)),
            np.empty(_SHADOWS, whole), np.empty(planes),
        ),
        Pieces(
            np.empty((vertices, 3)), np.empty((2, _PIECES, width, 3)),
            np.empty((2, _PIECES), whole), np.empty(_PIECES + 1), np.empty((2, width, 3)),
            np.empty(width), np.empty(size, np.bool_),
        ),
        Image(np.empty((2, width + 5, 3)), np.empty(width + 5)),
        np.zeros((most, len(people.areas))), np.zeros((most, len(people.reaches))),
        np.zeros(len(people.reaches)),
    )  # fmt: skip


@_inlined
def _put(points: FloatArray, k: int, x: float, y: float, z: float) -> None:
    """Writes a point. A loop over three coordinates would be vectorised, and slower."""
    points[k, 0] = x
    points[k, 1] = y
    points[k, 2] = z


@_inlined
def _copy(points: FloatArray, n: int, target: FloatArray) -> None:
    """Copies n points."""
    for k in range(n):
        _put(target, k, points[k, 0], points[k, 1], points[k, 2])


# -- which orientations -----------------------------------------------------------------------


@_inlined
def _in_view(
    lens: Lens,
    people: People,
    person: int,
    eye: Eye,
    looks: IntArray,
    memory: Memory,
) -> int:
    """Lists the views of an eye whose image may contain a person; returns their number."""
    n, axes, reach = 0, lens.axes, people.reaches[person]
    x, y = people.middles[person, 0] - eye[0], people.middles[person, 1] - eye[1]
    z = people.middles[person, 2] - eye[2]
    across, up = lens.slopes[0], lens.slopes[1]
    least_u = -reach * math.sqrt(1.0 + across * across)
    least_v = -reach * math.sqrt(1.0 + up * up)
    for view in range(len(looks)):
        k = looks[view]
        depth = x * axes[k, 2, 0] + y * axes[k, 2, 1] + z * axes[k, 2, 2]
        if depth < -reach:
            continue
        u = across * depth - abs(x * axes[k, 0, 0] + y * axes[k, 0, 1] + z * axes[k, 0, 2])
        if not u >= least_u:
            continue
        v = up * depth - abs(x * axes[k, 1, 0] + y * axes[k, 1, 1] + z * axes[k, 1, 2])
        if not v >= least_v:
            continue
        memory.views[n] = view
        memory.is_whole[n] = u >= -least_u and v >= -least_v
        n += 1
    return n


# -- the skyline in front of a person -----------------------------------------------------------


@_inlined
def _entries(before: Before, target: int, eye: Eye) -> tuple[int, int, float, float, float, float]:
    """Returns the span of a target's list, the vector and distance to the eye, and the relevant
    distance.
    """
    x, y = eye[0] - before.around[target, 0], eye[1] - before.around[target, 1]
    away, radius = math.hypot(x, y), before.radii[target]
    up = eye[2] - before.feet[target]
    slope = math.inf if up >= 0 else -math.inf
    if up >= 0 and away > radius:
        slope = up / (away - radius)
    sector = target * SECTORS + math.floor(math.atan2(y, x) * (SECTORS / math.tau)) % SECTORS
    fall = math.floor((0.4 - 0.8 / math.pi * math.atan(slope)) / GRAIN + 0.5) * GRAIN
    key = sector + fall + 4 * GRAIN
    first = last = before.starts[sector]
    end = before.starts[sector + 1]
    while last < end:
        middle = (last + end) // 2
        if before.keys[middle] <= key:
            last = middle + 1
        else:
            end = middle
    return first, last, x, y, away, max(away, before.around_it[target])


@_inlined
def _edge(
    solids: Solids,
    body: int,
    eye: Eye,
    ahead: tuple[float, float],
    nearest: float,
) -> tuple[float, float, float, float, float, float]:
    """Returns the upper edge of a body: its ends, its peak, the position of the peak, and both
    slopes.

    The peak is nan for a body that the skyline does not consider.
    """
    ax, ay = ahead
    left, right, peak, at = math.inf, -math.inf, -math.inf, math.inf
    at_left = at_right = 0.0
    top = solids.high[body, 2] - eye[2]
    least, most = math.inf, -math.inf
    for i in range(4):
        x = (solids.high[body, 0] if i >= 2 else solids.low[body, 0]) - eye[0]
        y = (solids.high[body, 1] if i % 2 else solids.low[body, 1]) - eye[1]
        distance = x * ax + y * ay
        least, most = min(least, distance), max(most, distance)
        u, s = (y * ax - x * ay) / distance, top / distance
        if u < left:
            left, at_left = u, s
        if s > peak:
            at, peak = u, s
        if u > right:
            right, at_right = u, s
    if not (solids.endless[body] and least > NEAREST and most < nearest):
        return 0.0, 0.0, math.nan, 0.0, 0.0, 0.0
    rise = (peak - at_left) / (at - left) if at - left > 0 else 0.0
    fall = (peak - at_right) / (right - at) if right - at > 0 else 0.0
    return left, right, peak, at, rise, fall


@_inlined
def _raise(skyline: Skyline, edge: tuple[float, float, float, float, float, float]) -> bool:
    """Raises the skyline to an edge; returns True if that raises it anywhere."""
    left, right, peak, at, rise, fall = edge
    bins, heights, changed, before = skyline.bins, skyline.heights, False, 0.0
    if not (left <= bins[BINS] and right >= bins[0]):
        return False
    for k in range(BINS + 1):
        off = bins[k] - at
        height = peak - (-rise if off < 0 else fall) * off - MARGIN
        spans = k > 0 and left <= bins[k - 1] and bins[k] <= right
        if spans and min(before, height) > heights[k - 1]:
            heights[k - 1] = min(before, height)
            changed = True
        before = height
    return changed


@_inlined
def _lowest(values: FloatArray) -> float:
    least = math.inf
    for value in values:
        least = min(least, value)
    return least


@_inlined
def _stands_out(skyline: Skyline, k: int, low: float) -> bool:
    """Returns True for a body that may exceed the skyline, or that it does not consider."""
    left, right, peak = skyline.edges[k, 0], skyline.edges[k, 1], skyline.edges[k, 2]
    if math.isnan(peak):
        return True
    bins, heights = skyline.bins, skyline.heights
    for i in range(BINS):
        meets = left <= bins[i + 1] + MARGIN and right >= bins[i] - MARGIN
        if meets and peak >= max(heights[i], low - MARGIN):
            return True
    return False


# -- shadows ----------------------------------------------------------------------------------


@_inlined
def _add_shadow(solids: Solids, body: int, eye: Eye, shadows: Shadows, row: int) -> None:
    """Writes the half-spaces of a body's shadow."""
    x, y, z = eye
    normals, offsets, depths = shadows.normals[row], shadows.offsets[row], shadows.depths[row]
    planes, distances, n = solids.normals[body], shadows.distances, 0
    for k in range(solids.planes[body]):
        a, b, c = planes[k, 0], planes[k, 1], planes[k, 2]
        distance = a * x + b * y + c * z - solids.offsets[body, k]
        distances[k] = distance
        if distance >= 0:
            _put(normals, n, a, b, c)
            offsets[n], depths[n] = -distance + OVERLAP, FLUSH
            n += 1
    for k in range(solids.pairs[body]):
        i, j = solids.edges[body, k, 0], solids.edges[body, k, 1]
        if (distances[i] >= 0) == (distances[j] >= 0):
            continue
        p, q = abs(distances[j]), abs(distances[i])
        a = p * planes[i, 0] + q * planes[j, 0]
        b = p * planes[i, 1] + q * planes[j, 1]
        c = p * planes[i, 2] + q * planes[j, 2]
        length = math.sqrt(a * a + b * b + c * c)
        if length > 0:
            _put(normals, n, a / length, b / length, c / length)
            offsets[n], depths[n] = OVERLAP, GRAZED
            n += 1
    shadows.sizes[row] = n


@_inlined
def _outside(shadows: Shadows, row: int, k: int, x: float, y: float, z: float) -> float:
    """Returns the distance (m) of a point from a half-space of a shadow, positive outside."""
    normals = shadows.normals
    along: float = x * normals[row, k, 0] + y * normals[row, k, 1] + z * normals[row, k, 2]
    return along - float(shadows.offsets[row, k])


@_inlined
def _side(shadows: Shadows, row: int, points: FloatArray, n: int) -> int:
    """Returns the position of the hull of n points relative to a shadow."""
    inside = True
    for k in range(shadows.sizes[row]):
        beside, depth = True, -shadows.depths[row, k]
        for i in range(n):
            if _outside(shadows, row, k, points[i, 0], points[i, 1], points[i, 2]) > depth:
                inside = False
            else:
                beside = False
        if beside:
            return _BESIDE
    return _INSIDE if inside else _IN_PART


@_inlined
def _cast(
    solids: Solids,
    body: int,
    eye: Eye,
    shadows: Shadows,
    n: int,
    corners: FloatArray,
    n_corners: int,
) -> int:
    """Casts the shadow of a body; returns the number of shadows on parts of the person so far."""
    if n >= _SHADOWS:
        return _TOO_MANY
    _add_shadow(solids, body, eye, shadows, n)
    side = _side(shadows, n, corners, n_corners)
    if side == _INSIDE:
        return _HIDDEN
    return n + 1 if side == _IN_PART else n


@_inlined
def _shadows_of_fixed(before: Before, people: People, person: int, eye: Eye, memory: Memory) -> int:
    """Returns the number of shadows of fixed bodies on parts of a person."""
    corners, n_corners, padded = memory.corners, people.n_corners[person], len(memory.corners)
    ax = ay = 0.0
    for k in range(padded):
        x, y = people.corners[person, k, 0] - eye[0], people.corners[person, k, 1] - eye[1]
        _put(corners, k, x, y, people.corners[person, k, 2] - eye[2])
        ax += x
        ay += y
    ax, ay = ax / padded, ay / padded
    length = math.hypot(ax, ay)
    if length > 0:
        ax, ay = ax / length, ay / length
    nearest = left = low = math.inf
    right = high = -math.inf
    for k in range(n_corners):
        distance = corners[k, 0] * ax + corners[k, 1] * ay
        nearest = min(nearest, distance)
        distance = max(distance, NEAREST)
        u, s = (corners[k, 1] * ax - corners[k, 0] * ay) / distance, corners[k, 2] / distance
        left, right = min(left, u), max(right, u)
        low, high = min(low, s), max(high, s)
    skyline, solids, shadows = memory.skyline, before.solids, memory.shadows
    for k in range(BINS + 1):
        skyline.bins[k] = left + (right - left) * SHARES[k]
    for k in range(BINS):
        skyline.heights[k] = -math.inf
    target, n = before.first + person, 0
    first, last, way_x, way_y, away, reach = _entries(before, target, eye)
    least = min(eye[2], before.feet[target])
    for entry in range(first, last):
        body = before.bodies[entry]
        if not (before.nearest[entry] < reach and solids.high[body, 2] > least):
            continue
        edge = _edge(solids, body, eye, (ax, ay), nearest)
        skyline.listed[n] = body
        _put(skyline.edges, n, edge[0], edge[1], edge[2])
        n += 1
        is_edge = not math.isnan(edge[2])
        if is_edge and _raise(skyline, edge) and _lowest(skyline.heights) > high:
            return _HIDDEN
    across_x, across_y = -way_y / away, way_x / away
    found: int = 0
    radius, x, y = before.radii[target], before.around[target, 0], before.around[target, 1]
    for k in range(n):
        if not _stands_out(skyline, k, low):
            continue
        body = skyline.listed[k]
        off_x, off_y = before.middles[body, 0] - x, before.middles[body, 1] - y
        aside = abs(across_x * off_x + across_y * off_y)
        width = abs(across_x) * before.halves[body, 0] + abs(across_y) * before.halves[body, 1]
        if aside > (width + radius) * (1 + ROUNDING):
            continue
        found = _cast(solids, body, eye, shadows, found, corners, n_corners)
        if found < 0:
            return found
    return found


@_inlined
def _shadows_of_people(people: People, person: int, eye: Eye, memory: Memory, found: int) -> int:
    """Adds the shadows of people of the same take who are, or almost are, between a person and the
    eye.
    """
    middles, reaches = people.middles, people.reaches
    x, y, z = middles[person, 0] - eye[0], middles[person, 1] - eye[1], middles[person, 2] - eye[2]
    square = max(x * x + y * y + z * z, LEAST)
    for other in range(len(reaches)):
        if other == person or people.take_of[other] != people.take_of[person]:
            continue
        a, b, c = middles[other, 0] - eye[0], middles[other, 1] - eye[1], middles[other, 2] - eye[2]
        along = min(max((a * x + b * y + c * z) / square, 0.0), 1.0)
        a, b, c = a - along * x, b - along * y, c - along * z
        if a * a + b * b + c * c > (reaches[person] + reaches[other]) ** 2:
            continue
        found = _cast(
            people.solids, other, eye, memory.shadows, found, memory.corners,
            people.n_corners[person],
        )  # fmt: skip
        if found < 0:
            return found
    return found


# -- pieces of faces --------------------------------------------------------------------------


@_inlined
def _clipped(
    points: FloatArray, n: int, inside: FloatArray, sign: float, target: FloatArray
) -> int:
    """Writes the part of a polygon where sign * inside >= 0; returns its number of vertices."""
    size = 0
    for k in range(n):
        ahead = k + 1 if k + 1 < n else 0
        here, there = sign * inside[k], sign * inside[ahead]
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        if here >= 0 and size <= n:
            _put(target, size, x, y, z)
            size += 1
        if (here >= 0) != (there >= 0) and size <= n:
            share = here / (here - there)
            a, b, c = points[ahead, 0] - x, points[ahead, 1] - y, points[ahead, 2] - z
            _put(target, size, x + share * a, y + share * b, z + share * c)
            size += 1
    return size


@_inlined
def _is_beside(shadows: Shadows, row: int, pieces: Pieces, piece: FloatArray, n: int) -> bool:
    """Returns True if a piece is completely outside a shadow, and records the half-spaces that cut
    it.

    A thin piece is only slightly behind a plane; only a whole face for which this is true lies in
    it.
    """
    beside, is_thin = False, True
    for k in range(shadows.sizes[row]):
        deepest, reaches_out = math.inf, False
        for i in range(n):
            excess = _outside(shadows, row, k, piece[i, 0], piece[i, 1], piece[i, 2])
            deepest = min(deepest, excess)
            reaches_out |= excess > 0
        pieces.cuts[k] = reaches_out
        beside |= deepest > -shadows.depths[row, k]
        is_thin &= deepest <= -GRAZED
    if beside and is_thin:
        beside = _side(shadows, row, pieces.face, len(pieces.face)) == _BESIDE
    return beside


@_inlined
def _cut(
    shadows: Shadows, row: int, pieces: Pieces, piece: FloatArray, n: int, found: int, target: int
) -> int:
    """Writes the parts of a piece outside a shadow; returns the number of pieces so far."""
    inner, excess, here = pieces.inner, pieces.excess, 0
    _copy(piece, n, inner[0])
    for k in range(shadows.sizes[row]):
        if not pieces.cuts[k]:
            continue
        points, reaches_out, reaches_in = inner[here], False, False
        for i in range(n):
            excess[i] = _outside(shadows, row, k, points[i, 0], points[i, 1], points[i, 2])
            reaches_out |= excess[i] > 0
            reaches_in |= excess[i] < 0
        if not reaches_out:
            continue
        if n + 1 >= len(excess) or found + 1 >= _PIECES:
            return _TOO_MANY
        pieces.sizes[target, found] = _clipped(points, n, excess, 1.0, pieces.points[target, found])
        found += 1
        if not reaches_in:
            break
        n = _clipped(points, n, excess, -1.0, inner[1 - here])
        here = 1 - here
    return found


@_inlined
def _cut_by_all(shadows: Shadows, found: int, pieces: Pieces, vertices: int) -> tuple[int, int]:
    """Cuts a face by all shadows; returns the half of the memory with its pieces, and their
    number.
    """
    here, n = 0, 1
    pieces.sizes[0, 0] = vertices
    _copy(pieces.face, vertices, pieces.points[0, 0])
    for row in range(found):
        there, m = 1 - here, 0
        for k in range(n):
            piece, size = pieces.points[here, k], pieces.sizes[here, k]
            if _is_beside(shadows, row, pieces, piece, size):
                pieces.sizes[there, m] = size
                _copy(piece, size, pieces.points[there, m])
                m += 1
            else:
                m = _cut(shadows, row, pieces, piece, size, m, there)
            if m < 0 or m + 1 >= _PIECES:
                return here, _TOO_MANY
        here, n = there, m
        if n == 0:
            break
    return here, n


# -- images -----------------------------------------------------------------------------------


@_inlined
def _beyond(lens: Lens, point: FloatArray, side: int) -> float:
    """Returns the distance from a side of the image: 0 right, 1 left, 2 upper, 3 lower."""
    half, off = lens.slopes[side // 2] * point[2], point[side // 2]
    distance: float = half + off if side % 2 else half - off
    return distance


@_inlined
def _length(points: FloatArray, k: int) -> float:
    x, y, z = points[k, 0], points[k, 1], points[k, 2]
    return math.sqrt(x * x + y * y + z * z)


@_inlined
def _inner(points: FloatArray, i: int, k: int) -> float:
    product: float = (
        points[i, 0] * points[k, 0] + points[i, 1] * points[k, 1] + points[i, 2] * points[k, 2]
    )
    return product


@_inlined
def _solid_angle(points: FloatArray, n: int) -> float:
    """Returns the solid angle (sr) of a convex polygon, relative to the eye.

    As `projection.solid_angles`.
    """
    x, y, z = points[0, 0], points[0, 1], points[0, 2]
    p, q, r = points[1, 0] - x, points[1, 1] - y, points[1, 2] - z
    a, b, ab, real, imaginary = (
        _length(points, 0),
        _length(points, 1),
        _inner(points, 0, 1),
        1.0,
        0.0,
    )
    for k in range(2, n):
        u, v, w = points[k, 0] - x, points[k, 1] - y, points[k, 2] - z
        c, bc, ca = _length(points, k), _inner(points, k - 1, k), _inner(points, k, 0)
        det = x * (q * w - r * v) + y * (r * u - p * w) + z * (p * v - q * u)
        over = a * b * c + ab * c + bc * a + ca * b
        size = abs(det) + abs(over)
        if size > 0:
            det, over = det / size, over / size
            real, imaginary = real * over - imaginary * det, real * det + imaginary * over
        p, q, r, b, ab = u, v, w, c, ca
    if abs(imaginary) > _FLAT * abs(real) or real < 0:
        return 2 * abs(math.atan2(imaginary, real))
    t = imaginary / real
    square = t * t  # series of the arc tangent, accurate to the last bit but one
    return 2 * abs(t * (1 - square * (1 / 3 - square * (1 / 5 - square / 7))))


@_inlined
def _image_of(
    lens: Lens,
    axes: FloatArray,
    points: FloatArray,
    n: int,
    angle: float,
    is_whole: bool,
    image: Image,
) -> tuple[float, float]:
    """Returns the area (px) of a polygon's image, at most the image's area, and its solid angle.

    Parameters
    ----------
    points : [n, 3] m, relative to the eye
    angle : solid angle of the whole polygon, sr; nan if not requested
    is_whole : True if the whole polygon is known to be in the image
    """
    images, beyond, here = image.points, image.beyond, 0
    for i in range(n):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        _put(
            images[0], i,
            x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2],
            x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2],
            x * axes[2, 0] + y * axes[2, 1] + z * axes[2, 2],
        )  # fmt: skip
    if not is_whole:
        is_cut = False
        for side in range(4):
            reaches_in = False
            for i in range(n):
                distance = _beyond(lens, images[0, i], side)
                reaches_in |= distance > 0
                is_cut |= not distance >= 0
            if not reaches_in:
                return 0.0, 0.0
        for side in range(4 if is_cut else 0):
            reaches_out = False
            for i in range(n):
                beyond[i] = _beyond(lens, images[here, i], side)
                reaches_out |= not beyond[i] >= 0
            if reaches_out:
                n = _clipped(images[here], n, beyond, 1.0, images[1 - here])
                here = 1 - here
                if n < 3:
                    return 0.0, 0.0
        if is_cut and not math.isnan(angle):
            angle = _solid_angle(images[here], n)
    area = first_u = first_v = u = v = 0.0
    for i in range(n):
        depth = images[here, i, 2]
        scale = lens.focal / (depth if depth > 0 else 1.0)
        next_u, next_v = images[here, i, 0] * scale, images[here, i, 1] * scale
        if i == 0:
            first_u, first_v = next_u, next_v
        next_u, next_v = next_u - first_u, next_v - first_v
        if i > 1:
            area += u * next_v - next_u * v
        u, v = next_u, next_v
    area = abs(area) / 2
    return lens.image if area > lens.image else area, angle


@_inlined
def _measure(vertices: int, pieces: Pieces, here: int, n: int, shadows: int) -> None:
    """Measures the solid angles (sr) of a face, first, and of its remaining pieces."""
    angles = pieces.angles
    angles[0] = _solid_angle(pieces.face, vertices)
    for i in range(n):
        if shadows:
            angles[i + 1] = _solid_angle(pieces.points[here, i], pieces.sizes[here, i])
        else:
            angles[i + 1] = angles[0]


@_inlined
def _look(
    lens: Lens,
    people: People,
    person: int,
    eye: Eye,
    looks: IntArray,
    memory: Memory,
    views: int,
    shadows: int,
    measures: bool,
) -> bool:
    """Adds the listed views' coverage of a person; returns False if there are too many pieces.

    Parameters
    ----------
    measures : True: also measure solid angles
    """
    x, y, z = eye
    polygons, pieces = people.polygons, memory.pieces
    for f in range(people.first_face[person], people.first_face[person + 1]):
        ahead = (
            (x - polygons[f, 0, 0]) * people.normals[f, 0]
            + (y - polygons[f, 0, 1]) * people.normals[f, 1]
            + (z - polygons[f, 0, 2]) * people.normals[f, 2]
        )
        if not ahead > IN_ITS_PLANE:
            continue
        for i in range(polygons.shape[1]):
            _put(
                pieces.face, i, polygons[f, i, 0] - x, polygons[f, i, 1] - y, polygons[f, i, 2] - z
            )
        here, n = _cut_by_all(memory.shadows, shadows, pieces, people.n_vertices[f])
        if n < 0:
            return False
        if measures:
            _measure(people.n_vertices[f], pieces, here, n, shadows)
            memory.unhidden[person] += pieces.angles[0]
        for k in range(views):
            view, area, angle = memory.views[k], 0.0, 0.0
            for i in range(n):
                more = _image_of(
                    lens, lens.axes[looks[view]], pieces.points[here, i], pieces.sizes[here, i],
                    pieces.angles[i + 1] if measures else math.nan, memory.is_whole[k],
                    memory.image,
                )  # fmt: skip
                area, angle = area + more[0], angle + more[1]
            memory.seen[view, f] = lens.image if area > lens.image else area
            if measures:
                memory.visible[view, person] += angle
    return True


@_inlined
def _note_people(memory: Memory, found: Found, first: int, n: int, total: int) -> int:
    """Records the people that n views of an eye see; returns the number recorded so far."""
    for view in range(n):
        start = total
        for person in range(len(memory.unhidden)):
            visible = memory.visible[view, person]
            if visible > 0:
                found.people[total] = person
                found.visible[total] = visible
                found.unhidden[total] = memory.unhidden[person]
                total += 1
            memory.visible[view, person] = 0.0
        found.n_people[first + view] = total - start
    for person in range(len(memory.unhidden)):
        memory.unhidden[person] = 0.0
    return total


@_compiled
def cover(
    lens: Lens,
    people: People,
    before: Before,
    eyes: FloatArray,
    first: IntArray,
    looks: IntArray,
    memory: Memory,
    found: Found,
    done: Total,
) -> Total:
    """Computes the views from eyes at one step, starting at a given eye.

    Parameters
    ----------
    lens : the camera
    people, before : the people at this step, and the fixed bodies that can hide them
    eyes : [E, 3] m
    first : [E + 1] first view of each eye
    looks : [n] orientation of each view
    memory : working memory, made by `memory_for` for people and bodies of these shapes; it can be
        reused unless a person was cut into too many pieces
    found : entries, written from the position that `done` gives; solid angles are measured if its
        `n_people` is not empty
    done : the number of finished eyes, and of the faces and people they see

    Returns
    -------
    done : the updated numbers; fewer than all eyes if there is no room for more entries, and -1 if
        there is no room for the pieces of a person
    """
    n_faces, n_people, measures = memory.seen.shape[1], len(people.reaches), len(found.n_people) > 0
    faces, seen_people = done.faces, done.people
    for e in range(done.eyes, len(eyes)):
        last = first[e + 1]
        n = last - first[e]
        is_full = faces + n * n_faces > len(found.faces)
        if is_full or (measures and seen_people + n * n_people > len(found.people)):
            return Total(e, faces, seen_people)
        eye, of_eye = (eyes[e, 0], eyes[e, 1], eyes[e, 2]), looks[first[e] : last]
        for person in range(n_people):
            views = _in_view(lens, people, person, eye, of_eye, memory)
            if not views:
                continue
            shadows = _shadows_of_fixed(before, people, person, eye, memory)
            if shadows >= 0:
                shadows = _shadows_of_people(people, person, eye, memory, shadows)
            if shadows == _HIDDEN:
                continue
            if shadows < 0:
                return Total(-1, faces, seen_people)
            if not _look(lens, people, person, eye, of_eye, memory, views, shadows, measures):
                return Total(-1, faces, seen_people)
        for view in range(n):
            start = faces
            for f in range(n_faces):
                area = memory.seen[view, f]
                if area > 0:
                    found.faces[faces] = f
                    found.pixels[faces] = area / people.areas[f]
                    faces += 1
                memory.seen[view, f] = 0.0
            found.counts[first[e] + view] = faces - start
        if measures:
            seen_people = _note_people(memory, found, first[e], n, seen_people)
    return Total(len(eyes), faces, seen_people)
