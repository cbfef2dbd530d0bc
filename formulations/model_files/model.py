"""A scene as an integer program, with named variables and rows from which a plan can be read.

    x_d0_t3_x4_y5_l0_h2_p1      drones like drone 0 in this state at step 3: cell (4, 5), flight
                                height 0, heading 2, gimbal tilt 1
    y_d0_t3_x4_y5_l0_h2_p1_to_x5_y5_l0_h3_p1    of these, those that go on to this state
    x_d0_s1, y_d0_s1_to_x4_..   drones that choose their start among set 1, and what they choose
    z_a1_f2_t3, s_.., u_..      face 2 of person 1 at step 3: its pixels, the sum of roots of single
                                views, and the root that counts; without t where pixels add up over
                                time; without f the drones that see a person, where they count

Drones with the same motion, camera and goal form one flow, which is named after the first of them:
J does not change if they exchange their paths, and the program does not grow with their number.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.integer_programs.program import LinearProgram, Program
from cocap_opt.formulations.model_files.endings import ROOT_ERROR
from cocap_opt.formulations.model_files.tangents import Tangents
from cocap_opt.formulations.relaxations.collision_rows import ConflictRows
from cocap_opt.formulations.relaxations.flow import Flow, Roots
from cocap_opt.model import Model
from cocap_opt.model.coverage_tables import tell_nobody
from cocap_opt.problem import COVERAGE_VERSION, Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.text import printable
from cocap_opt.vision.coverage import Progress

_LINE = 100  # characters per line of a comment


@dataclass(frozen=True, eq=False)
class ModelFile:
    """An integer program of a scene, which can be written in several formats.

    Attributes
    ----------
    program : the integer program, with all tangents; it has none if cones represent the roots
    error : the largest relative error of a root; 0 with cones
    has_tangents : False if cones represent the roots
    """

    program: Program
    error: float
    has_tangents: bool

    @classmethod
    def with_tangents(
        cls, model: Model, error: float = ROOT_ERROR, progress: Progress = tell_nobody
    ) -> "ModelFile":
        """Returns a linear program with roots within a relative error, for all views that drones
        can have.

        Raises
        ------
        UnsupportedError
            If the scene is too large for a flow, needs too many tangents, or has no plan.
        """
        flow, roots, conflicts = _parts(model, progress)
        tangents = Tangents.of(flow, roots, error)
        return cls(Program(flow, roots, conflicts, tangents=tangents[:2]), tangents.error, True)

    @classmethod
    def with_cones(cls, model: Model, progress: Progress = tell_nobody) -> "ModelFile":
        """Returns a program in which u^2 <= z represents the roots.

        Raises
        ------
        UnsupportedError
            If the scene is too large for a flow, or has no plan.
        """
        nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
        return cls(Program(*_parts(model, progress), tangents=nothing), 0.0, False)

    @cached_property
    def linear(self) -> LinearProgram:
        """The rows and bounds, with J in px^0.5/m as the objective."""
        found = LinearProgram.of(self.program)
        return found._replace(gain=found.gain * self.program.unit)

    @property
    def problem(self) -> Problem:
        """The problem from which the program is made."""
        return self.program.flow.model.problem

    @property
    def n_tangents(self) -> int:
        """Number of tangents of all roots together."""
        return len(self.program.tangents[0])

    @property
    def cones(self) -> Iterator[tuple[int, int]]:
        """Yields the numbers of the variables u and z of each root, with u^2 <= z."""
        roots, first = self.program.roots, self.linear.first_pixels
        for k in range(roots.returns.n_roots):
            yield first + 2 * len(roots.used) + k, first + k

    @cached_property
    def variables(self) -> list[str]:
        """The names of all variables, in order."""
        flow, sums = self.program.flow, self._view_sums
        return [
            *(f"x_{name}" for name in node_names(flow)),
            *edge_names(flow),
            *(f"{letter}_{name}" for letter in "zsu" for name in sums),
        ]

    @cached_property
    def rows(self) -> list[str]:
        """The names of all rows, in order."""
        program, sums = self.program, self._view_sums
        flow, conflicts = program.flow, program.conflicts
        nodes = np.array(node_names(flow), dtype=object)
        before = flow.steps < flow.model.problem.horizon
        at = program.tangents[0].tolist()
        return [
            *(f"enter_{name}" for name in nodes[flow.is_entered]),
            *(f"leave_{name}" for name in nodes[before]),
            *(f"{what}_{name}" for what in ("pixels", "roots", "single") for name in sums),
            *(f"tangent{k}_{sums[z]}" for k, z in enumerate(at)),
            *(f"cells{k}" for k in range(conflicts.at_nodes.shape[0])),
            *(f"moves{k}" for k in range(conflicts.crossing.shape[0])),
        ]

    @cached_property
    def _view_sums(self) -> list[str]:
        """Names of the view sums that are used: of a person's face at a step, or of a person."""
        problem = self.problem
        owner, n_roots = problem.face_owner, problem.returns.n_roots
        first = np.searchsorted(owner, owner)  # the first face of the same person
        n_faces, people, found = len(owner), problem.count_weights.shape[1], list[str]()
        for number in self.program.roots.used.tolist():
            if number >= n_roots:
                t, person = divmod(number - n_roots, people)
                found.append(f"a{person}_t{t}")
                continue
            t, face = divmod(number, n_faces)
            step = "" if problem.objective.over_time else f"_t{t}"
            found.append(f"a{owner[face]}_f{face - first[face]}{step}")
        return found

    def header(self, *lines: str) -> Iterator[str]:
        """Yields the lines of a comment for readers of the file.

        Parameters
        ----------
        lines : remarks on the format, e.g. what is maximised
        """
        problem = self.problem
        # Not all readers accept other characters, even in a comment.
        yield f"cocap-opt: {printable(problem.name).encode('ascii', 'backslashreplace').decode()}"
        yield f"digest of the scene {problem_digest(problem)}, coverage {COVERAGE_VERSION}"
        yield from lines
        yield (
            "x, y: numbers of drones; z, s, u: pixels and roots of a face, relative to its best "
            "view"
        )
        for robot_class in self.program.flow.model.classes:
            drones = " ".join(map(str, sorted(robot_class.robots)))
            yield from _folded(f"d{min(robot_class.robots)}: drones {drones}")

    @property
    def told_tangents(self) -> str:
        """Describes the number of tangents and their error."""
        n = self.n_tangents
        if self.error == 0:
            return (
                f"{n:,} tangents replace the roots; they are exact for all views that drones can "
                "have"
            )
        return (
            f"{n:,} tangents replace the roots: the objective of a plan exceeds its J, by at most "
            f"{self.error:.2g} of it"
        )


def node_names(flow: Flow) -> list[str]:
    """Returns the name of each node of a flow [N]: its drones, step and state."""
    found = list[str]()
    for number, robot_class in enumerate(flow.model.classes):
        of_class = flow.owner == number
        drones, graph = f"d{min(robot_class.robots)}", robot_class.graph
        orientations, places = np.divmod(flow.states[of_class], graph.n_places)
        sources = flow.is_source[of_class].tolist()
        layers, xs, ys = graph.coordinates(np.where(sources, 0, places))
        headings, pitches = np.divmod(orientations, graph.shape[1])
        columns = (flow.steps[of_class], xs, ys, layers, headings, pitches, flow.states[of_class])
        rows = zip(sources, *(column.tolist() for column in columns), strict=True)
        found += [
            f"{drones}_s{state}" if source else f"{drones}_t{t}_x{x}_y{y}_l{layer}_h{h}_p{p}"
            for source, t, x, y, layer, h, p, state in rows
        ]
    return found


def edge_names(flow: Flow) -> list[str]:
    """Returns the name of each edge's variable [E]: its tail node, and the state of its head."""
    nodes = node_names(flow)
    places = [name.split("_", 2)[-1] for name in nodes]  # without drones and step
    ends = zip(flow.tails.tolist(), flow.heads.tolist(), strict=True)
    return [f"y_{nodes[tail]}_to_{places[head]}" for tail, head in ends]


def _parts(model: Model, progress: Progress) -> tuple[Flow, Roots, ConflictRows]:
    """Returns the parts of a program; raises UnsupportedError if a drone has no path.

    Coverage is computed last, after everything that may be too large.
    """
    flow = Flow.of(model)
    if not flow.serves_all:
        raise UnsupportedError("a drone has no path, so there is no plan and no program")
    model.prepare_all(progress=progress)
    return flow, Roots.of(flow), ConflictRows.of(flow)


def _folded(text: str) -> Iterator[str]:
    """Yields the lines of a comment that contain a text."""
    line = ""
    for word in text.split(" "):
        if len(line) + len(word) > _LINE:
            yield line.rstrip()
            line = "  "
        line += f"{word} "
    yield line.rstrip()
