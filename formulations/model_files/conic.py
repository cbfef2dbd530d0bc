"""Writes the Conic Benchmark Format (CBF), version 4: roots as cones, drones as integers.

Each root is a rotated cone, (1/2, z, u) in QR: 2 (1/2) z >= u^2. CBF has no names: a comment lists
the names of the variables in order, and solvers number the variables from 0.

Source: Friberg, CBLIB 2014, Mathematical Programming Computation 8 (2016); the format's
specification at cblib.zib.de.
"""

from collections.abc import Iterator
from itertools import groupby, islice
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.model_files.model import ModelFile

if TYPE_CHECKING:
    from scipy import sparse

VERSION = 4
_CHUNK = 50_000  # lines per chunk


def write_cones(file: BinaryIO, model_file: ModelFile) -> None:
    """Writes a program with cones to a file."""
    lines = _lines(model_file)
    while chunk := list(islice(lines, _CHUNK)):
        file.write("".join(f"{line}\n" for line in chunk).encode())


def _lines(model_file: ModelFile) -> Iterator[str]:
    linear, cones = model_file.linear, list(model_file.cones)
    yield from (
        f"# {line}"
        for line in model_file.header(
            "maximise J (px^0.5/m)",
            "roots are cones, (1/2, z, u) in QR; x and y are integers, or follow from them",
        )
    )
    yield "# variables by number:"
    yield from (f"# {k} {name}" for k, name in enumerate(model_file.variables))
    yield from ("VER", str(VERSION), "", "OBJSENSE", "MAX", "")
    yield from _variables(linear.low)
    whole = np.flatnonzero(linear.integral).tolist()
    yield from ("INT", str(len(whole)), *map(str, whole), "")
    rows, constants, domains = _rows(model_file)
    yield from ("CON", f"{rows.shape[0] + 3 * len(cones)} {len(domains) + len(cones)}")
    yield from (f"{name} {size}" for name, size in domains)
    yield from ("QR 3" for _ in cones)
    yield ""
    paid = np.flatnonzero(linear.gain).tolist()
    yield from ("OBJACOORD", str(len(paid)))
    yield from (f"{k} {_number(linear.gain[k])}" for k in paid)
    yield ""
    entries, first = rows.tocoo(), rows.shape[0]
    yield from ("ACOORD", str(entries.nnz + 2 * len(cones)))
    for row, column, value in zip(
        entries.row.tolist(), entries.col.tolist(), entries.data.tolist(), strict=True
    ):
        yield f"{row} {column} {_number(value)}"
    for k, (u, z) in enumerate(cones):
        yield f"{first + 3 * k + 1} {z} 1"
        yield f"{first + 3 * k + 2} {u} 1"
    yield ""
    given = np.flatnonzero(constants).tolist()
    yield from ("BCOORD", str(len(given) + len(cones)))
    yield from (f"{row} {_number(constants[row])}" for row in given)
    yield from (f"{first + 3 * k} 0.5" for k in range(len(cones)))


def _variables(low: FloatArray) -> Iterator[str]:
    """Yields the domains of variables: each is at least 0 or fixed by a row."""
    assert (low >= 0).all()
    yield from ("VAR", f"{len(low)} 1", f"L+ {len(low)}", "")


def _rows(model_file: ModelFile) -> "tuple[sparse.csr_array, FloatArray, list[tuple[str, int]]]":
    """Returns rows A v + b, including bounds as rows, and their domains: name and number of rows of
    each.
    """
    from scipy import sparse

    linear = model_file.linear
    n = len(linear.low)
    each = sparse.eye_array(n, format="csr")
    fixed = linear.low == linear.high
    above = np.flatnonzero(fixed | (linear.low > 0))
    below = np.flatnonzero(~fixed & np.isfinite(linear.high))
    equal = linear.row_low == linear.row_high
    rows = sparse.csr_array(sparse.vstack([linear.rows, each[above], each[below]]))
    constants = -np.concatenate([linear.row_high, linear.low[above], linear.high[below]])
    kinds = np.concatenate(
        [np.where(equal, "L=", "L-"), np.where(fixed[above], "L=", "L+"), np.full(len(below), "L-")]
    )
    domains = [(str(kind), len(list(same))) for kind, same in groupby(kinds.tolist())]
    return rows, constants, domains


def _number(value: float) -> str:
    """Returns the shortest text that represents a double exactly."""
    return repr(float(value)).removesuffix(".0")
