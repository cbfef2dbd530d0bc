"""A reader of the Conic Benchmark Format that knows nothing of the writer, and two solvers of it.

It takes of the format what linear and (rotated) quadratic cones need, and refuses all else.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

_KNOWN = {"VER", "OBJSENSE", "VAR", "INT", "CON", "OBJACOORD", "OBJBCOORD", "ACOORD", "BCOORD"}
_LINEAR = {"F", "L+", "L-", "L="}


class Cbf(NamedTuple):
    """A program max or min c v + d with A v + b in cones, v in cones, some v whole."""

    maximised: bool
    variables: list[tuple[str, int]]  # cones, and how many variables are in each
    whole: list[int]
    rows: list[tuple[str, int]]
    cost: np.ndarray
    matrix: sparse.csr_array
    constant: np.ndarray
    names: list[str]  # of the comment

    @classmethod
    def read(cls, text: str) -> "Cbf":
        """Reads a file's text."""
        comments = [line[1:].split() for line in text.splitlines() if line.startswith("#")]
        lines = iter(line.split() for line in text.splitlines() if line.strip() and line[0] != "#")
        parts: dict[str, Any] = {}
        for (word,) in lines:
            assert word in _KNOWN and word not in parts
            if word in ("VER", "OBJSENSE"):
                (parts[word],) = next(lines)
                continue
            first, *rest = map(int, next(lines))
            count = rest[0] if rest else first
            parts[word] = (first, [next(lines) for _ in range(count)])
        assert next(iter(parts)) == "VER" and int(parts["VER"]) in (1, 2, 3, 4)
        n, cones = parts["VAR"]
        m, domains = parts["CON"]
        cost, constant = np.zeros(n), np.zeros(m)
        for k, value in parts["OBJACOORD"][1]:
            cost[int(k)] += float(value)
        for k, value in parts["BCOORD"][1]:
            constant[int(k)] += float(value)
        row, column, value = zip(*parts["ACOORD"][1], strict=True)
        at = (np.array(row, dtype=int), np.array(column, dtype=int))
        matrix = sparse.csr_array((np.array(value, dtype=float), at), shape=(m, n))
        variables, rows = ([(name, int(size)) for name, size in part] for part in (cones, domains))
        assert sum(size for _, size in variables) == n and sum(size for _, size in rows) == m
        assert {name for name, _ in variables} <= _LINEAR
        named = [words[1] for words in comments if len(words) == 2 and words[0].isdecimal()]
        assert len(named) == n
        whole = [int(k) for (k,) in parts["INT"][1]]
        return cls(
            parts["OBJSENSE"] == "MAX", variables, whole, rows, cost, matrix, constant, named
        )

    def scip(self) -> tuple[float, dict[str, float]]:
        """Returns SCIP's optimum and solution, by the names in the comment."""
        import pyscipopt

        model = pyscipopt.Model()
        model.hideOutput()
        model.setParam("misc/usesymmetry", 0)
        kinds = [name for name, size in self.variables for _ in range(size)]
        low = {"L+": 0.0, "L=": 0.0, "F": None, "L-": None}
        high = {"L-": 0.0, "L=": 0.0, "F": None, "L+": None}
        whole = set(self.whole)
        v = [
            model.addVar(
                lb=low[kind], ub=high[kind], vtype="I" if k in whole else "C", obj=self.cost[k]
            )
            for k, kind in enumerate(kinds)
        ]
        (model.setMaximize if self.maximised else model.setMinimize)()
        first = 0
        for name, size in self.rows:
            found = [self._expression(v, row) for row in range(first, first + size)]
            first += size
            if name == "QR":
                a, b, *rest = found
                model.addCons(pyscipopt.quicksum(part * part for part in rest) <= 2 * a * b)
                continue
            for part in found:
                if name == "L=":
                    model.addCons(part == 0)
                elif name == "L+":
                    model.addCons(part >= 0)
                else:
                    assert name == "L-"
                    model.addCons(part <= 0)
        model.optimize()
        assert model.getStatus() == "optimal"
        values = {name: model.getVal(v[k]) for k, name in enumerate(self.names)}
        return model.getObjVal(), values

    def _expression(self, v: list[Any], row: int) -> Any:
        import pyscipopt

        at = slice(self.matrix.indptr[row], self.matrix.indptr[row + 1])
        entries = zip(self.matrix.indices[at], self.matrix.data[at], strict=True)
        return pyscipopt.quicksum(a * v[k] for k, a in entries) + self.constant[row]

    def clarabel(self) -> float:
        """Returns Clarabel's optimum of the continuous relaxation."""
        import clarabel

        n = len(self.cost)
        kinds = np.array([name for name, size in self.variables for _ in range(size)])
        rows, constants, cones = [], [], []
        first = 0
        for name, size in self.rows:
            a, b = self.matrix[first : first + size], self.constant[first : first + size]
            first += size
            if name == "L=":
                cones.append(clarabel.ZeroConeT(size))
            elif name in ("L+", "L-"):
                cones.append(clarabel.NonnegativeConeT(size))
                a, b = (a, b) if name == "L+" else (-a, -b)
            else:  # (a + b) / sqrt 2 >= || (a - b) / sqrt 2, rest ||
                turn = np.eye(size)
                turn[:2, :2] = np.array([[1, 1], [1, -1]]) / math.sqrt(2)
                a, b = sparse.csr_array(turn) @ a, turn @ b
                cones.append(clarabel.SecondOrderConeT(size))
            rows.append(-a)
            constants.append(b)
        positive = np.flatnonzero(kinds == "L+")
        rows.append(-sparse.eye_array(n, format="csr")[positive])
        constants.append(np.zeros(len(positive)))
        cones.append(clarabel.NonnegativeConeT(len(positive)))
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        sign = -1.0 if self.maximised else 1.0
        solution = clarabel.DefaultSolver(
            sparse.csc_matrix((n, n)),
            sign * self.cost,
            sparse.csc_matrix(sparse.vstack(rows)),
            np.concatenate(constants),
            cones,
            settings,
        ).solve()
        assert str(solution.status) == "Solved"
        return sign * solution.obj_val
