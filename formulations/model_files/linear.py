"""MPS and LP files of linear programs, by HiGHS' writer, below a comment on what they hold."""

import shutil
import tempfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from scipy import sparse

from cocap_opt.formulations.model_files.model import ModelFile

_COMMENTS = {".mps": "* ", ".lp": "\\ "}  # how a line of a comment begins
ENDINGS = tuple(_COMMENTS)


def write_linear(file: BinaryIO, model_file: ModelFile, ending: str) -> None:
    """Writes a linear program, one with tangents, into a file.

    Parameters
    ----------
    ending : of its name, one of ENDINGS

    Raises
    ------
    OSError
        If HiGHS cannot write it.
    """
    import highspy  # which only solvers need

    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.passModel(_translated(model_file))
    for line in model_file.header(model_file.told_tangents):
        file.write(f"{_COMMENTS[ending]}{line}\n".encode())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"program{ending}")
        if solver.writeModel(str(path)) == highspy.HighsStatus.kError:
            raise OSError(f"HiGHS cannot write {ending}")
        with path.open("rb") as written:
            shutil.copyfileobj(written, file)


def _translated(model_file: ModelFile) -> Any:
    """Returns a program as HiGHS has it."""
    import highspy

    linear = model_file.linear
    rows = sparse.csr_array(linear.rows)
    found = highspy.HighsLp()
    found.num_row_, found.num_col_ = rows.shape
    found.sense_ = highspy.ObjSense.kMaximize
    found.col_cost_, found.col_lower_, found.col_upper_ = linear.gain, linear.low, linear.high
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
