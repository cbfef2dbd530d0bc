"""Faces and people seen by views: by pixels and by solid angles."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from cocap_opt.arithmetic import entries_of
from cocap_opt.data import BoolArray, FloatArray, IntArray

_SHARE_ROUNDING = 1e-9  # tolerance for a share: that of a whole person is 1


class SeenFaces(NamedTuple):
    """The faces that views see."""

    counts: IntArray  # [n] number of faces that each view sees
    faces: IntArray  # [nnz] view by view, increasing for each
    pixels: FloatArray  # [nnz] px/m2, > 0

    @property
    def rows(self) -> IntArray:
        """Numbers of the views [nnz], increasing, one for each face that is seen."""
        return _rows(self.counts)


class SeenPeople(NamedTuple):
    """The people that views see, in whole or in part, by solid angles."""

    counts: IntArray  # [n] number of people that each view sees
    people: IntArray  # [nnz] view by view, increasing for each
    visible: FloatArray  # [nnz] sr, > 0, of the part that is visible in the image
    unhidden: FloatArray  # [nnz] sr, without obstructions and image edges

    @property
    def rows(self) -> IntArray:
        """Numbers of the views [nnz], increasing, one for each person who is seen."""
        return _rows(self.counts)

    @property
    def shares(self) -> FloatArray:
        """Visible shares [nnz] of the unobstructed solid angles, 0 to 1."""
        return np.minimum(self.visible / self.unhidden, 1.0)


class Seen(NamedTuple):
    """The faces that views see, and the people, if requested."""

    faces: SeenFaces
    people: SeenPeople

    @classmethod
    def nothing(cls, n: int) -> Self:
        """Returns that n views see nothing."""
        counts, none = np.zeros(n, dtype=np.int64), np.zeros(0, dtype=np.int64)
        pixels = angles = np.zeros(0)
        return cls(SeenFaces(counts, none, pixels), SeenPeople(counts, none, angles, angles))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Returns everything that the views of several parts see, part by part."""
        faces, people = zip(*parts, strict=True)
        return cls(SeenFaces(*_joined(faces)), SeenPeople(*_joined(people)))

    def take(self, order: IntArray) -> Self:
        """Returns the faces and people of the views order[0], order[1], .. only."""
        return type(self)(
            SeenFaces(*_taken(order, *self.faces)), SeenPeople(*_taken(order, *self.people))
        )


class SeenColumns(NamedTuple):
    """The faces that views see, and the people, if these are counted.

    Columns are numbered as in `Problem.step_view_sums`: faces, then people.
    """

    counts: IntArray  # [n] number of columns that each view sees
    columns: IntArray  # [nnz] view by view, increasing for each
    amounts: FloatArray  # [nnz] px/m2 of a face, > 0; 1 for a person who is seen well enough

    @property
    def rows(self) -> IntArray:
        """Numbers of the views [nnz], increasing, one for each column that is seen."""
        return _rows(self.counts)

    @classmethod
    def nothing(cls, n: int) -> Self:
        """Returns that n views see nothing."""
        return cls(np.zeros(n, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))

    @classmethod
    def of(cls, seen: Seen, n_faces: int, at_least: float) -> Self:
        """Returns the seen faces, and the people of whom a sufficient share is visible.

        Parameters
        ----------
        at_least : required share of a person's unobstructed solid angle
        """
        people = seen.people
        kept = np.flatnonzero(are_seen(people.shares, at_least))
        return cls.merged(seen.faces, people.rows[kept], people.people[kept], n_faces)

    @classmethod
    def merged(cls, faces: SeenFaces, rows: IntArray, people: IntArray, n_faces: int) -> Self:
        """Returns the faces that views see, each view's faces followed by its counted people.

        Parameters
        ----------
        rows, people : numbers of views, increasing, and of people, increasing for each view
        """
        total = len(faces.faces) + len(people)
        columns, amounts = np.empty(total, dtype=np.int64), np.ones(total)
        is_face = np.ones(total, dtype=bool)
        at_people = np.cumsum(faces.counts)[rows] + np.arange(len(rows))
        is_face[at_people] = False
        columns[at_people], columns[is_face] = people + n_faces, faces.faces
        amounts[is_face] = faces.pixels
        return cls(faces.counts + np.bincount(rows, minlength=len(faces.counts)), columns, amounts)


def are_seen(shares: FloatArray, at_least: float) -> BoolArray:
    """Returns True for shares that are large enough for the person to count."""
    return np.asarray(shares >= at_least - _SHARE_ROUNDING)


def _taken(order: IntArray, counts: IntArray, *columns: NDArray[Any]) -> list[NDArray[Any]]:
    """Returns the counts and the columns of views order[0], order[1], ..

    Parameters
    ----------
    order : [m] numbers of the views
    counts : [n] number of entries of each view
    columns : columns of the entries [nnz], view by view
    """
    entries = entries_of(order, counts)
    return [counts[order], *(column[entries] for column in columns)]


def _joined(parts: Sequence[SeenFaces | SeenPeople]) -> list[NDArray[Any]]:
    if len(parts) == 1:
        return list(parts[0])
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _rows(counts: IntArray) -> IntArray:
    return np.repeat(np.arange(len(counts)), counts)
