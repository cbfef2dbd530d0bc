"""Writes MPS and LP files of linear programs with HiGHS, after a comment that describes them.

The files are written for a wide range of solvers. Not all read the line for the direction in MPS
(CBC does not), so MPS files minimise -J, which is the default direction. In LP files, lines are
short (CPLEX accepts 560 characters), and sections of variables that would be empty are left out.
"""

import tempfile
import textwrap
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from cocap_opt.formulations.model_files.endings import LP, MPS
from cocap_opt.formulations.model_files.model import ModelFile

_COMMENTS = {MPS: "* ", LP: "\\ "}  # prefix of a comment line
_GOALS = {MPS: "minimise -J (px^0.5/m)", LP: "maximise J (px^0.5/m)"}
_LONGEST = 250  # characters per line


def write_linear(file: BinaryIO, model_file: ModelFile, ending: str) -> None:
    """Writes a linear program with tangents to a file.

    Parameters
    ----------
    ending : ending of the file's name, one of LINEAR

    Raises
    ------
    OSError
        If HiGHS cannot write the file.
    """
    import highspy  # only solvers need this library

    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.passModel(_translated(model_file, minimised=ending == MPS))
    for line in model_file.header(_GOALS[ending], model_file.told_tangents):
        file.write(f"{_COMMENTS[ending]}{line}\n".encode())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"program{ending}")
        if solver.writeModel(str(path)) == highspy.HighsStatus.kError:
            raise OSError(f"HiGHS cannot write {ending}")
        with path.open(encoding="ascii") as written:
            lines = (line.rstrip("\n") for line in written)
            for line in chain.from_iterable(map(_folded, lines)) if ending == LP else lines:
                file.write(f"{line}\n".encode())


def _folded(line: str) -> Iterable[str]:
    """Returns a line of LP as lines that are not too long; an empty section gives none."""
    if line == "semi":
        return ()
    if len(line) <= _LONGEST:
        return (line,)
    return textwrap.wrap(line, _LONGEST, break_long_words=False, break_on_hyphens=False)


def _translated(model_file: ModelFile, minimised: bool) -> Any:
    """Returns a program as a HiGHS model, with J to be maximised or -J to be minimised."""
    import highspy
    from scipy import sparse

    linear = model_file.linear
    rows = sparse.csr_array(linear.rows)
    found = highspy.HighsLp()
    found.model_name_ = "cocap-opt"  # some readers require a name
    found.num_row_, found.num_col_ = rows.shape
    found.sense_ = highspy.ObjSense.kMinimize if minimised else highspy.ObjSense.kMaximize
    found.col_cost_ = -linear.gain if minimised else linear.gain
    found.col_lower_, found.col_upper_ = linear.low, linear.high
    found.row_lower_, found.row_upper_ = linear.row_low, linear.row_high
    found.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    found.a_matrix_.start_, found.a_matrix_.index_ = rows.indptr, rows.indices
    found.a_matrix_.value_ = rows.data
    kinds = highspy.HighsVarType
    found.integrality_ = [
        kinds.kInteger if whole else kinds.kContinuous for whole in np.asarray(linear.integral)
    ]
    found.col_names_, found.row_names_ = model_file.variables, model_file.rows
    return found
