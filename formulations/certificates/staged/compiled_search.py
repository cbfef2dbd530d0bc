"""The searches of joint states, compiled by numba where that is installed.

They do what the plain search (`search`) does, about twenty times as fast, and can be
interrupted; the tests hold it to the plain one. Without numba (extra `fast`) the plain one runs.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.stop import Stop

if TYPE_CHECKING:
    from cocap_opt.formulations.certificates.staged.search_kernel import Inputs, Memory

_KERNEL = "cocap_opt.formulations.certificates.staged.search_kernel"
_COMPILING = 5.0  # seconds that the first compiled search of a machine may take


@cache
def is_there() -> bool:
    """Returns True if numba is installed."""
    return find_spec("numba") is not None


def is_loaded() -> bool:
    """Returns True if the compiled search has been used, so that it is loaded."""
    return _KERNEL in sys.modules


def may_take_over(stop: Stop) -> bool:
    """Returns True if numba is installed, and a limit of time leaves enough to compile."""
    return is_there() and stop.seconds_left > _COMPILING


def is_fast(stop: Stop) -> bool:
    """Returns True if searches are compiled, or will be once they are long."""
    return is_loaded() or may_take_over(stop)


@dataclass(eq=False)
class CompiledSearch:
    """A search that has been begun.

    Attributes
    ----------
    data : the arrays that it reads
    memory : the arrays that it writes
    best : largest profit found, at first the least one wanted
    floor : least worth, less charges, of a joint state that counts
    """

    data: Inputs
    memory: Memory
    best: float
    floor: float

    @classmethod
    def of(cls, joint: JointStates, least: float, most_found: int = 0) -> CompiledSearch:
        """Returns a search at its beginning.

        Parameters
        ----------
        least : profits up to here do not matter
        most_found : if not 0, the search is for `follow`, which collects up to so many in a call
        """
        from cocap_opt.formulations.certificates.staged.search_kernel import Inputs

        bounds, classes = joint.bounds, np.repeat(np.arange(len(joint.sizes)), joint.sizes)
        data = Inputs(
            *joint.sparse,
            joint.weights,
            joint.price,
            joint.charge,
            joint.class_of,
            classes,
            counts=np.array([
                np.bincount(classes[d:], minlength=len(joint.sizes))
                for d in range(len(classes) + 1)
            ]),
            conflict=joint.conflict,
            raised=np.array([bound.raised for bound in bounds]).reshape(
                len(bounds), len(joint.class_of)
            ),
            is_limit=np.arange(len(bounds)) >= len(joint.ceilings),
        )  # fmt: skip
        profits = np.array([bound.profit for bound in bounds])
        return cls(data, _beginning(data, profits, most_found), least, joint.floor - joint.margin)

    @property
    def positions(self) -> tuple[int, ...]:
        """Positions of the states of the joint state that has it; none if none has more."""
        found = self.memory.chosen[1]
        return tuple(found.tolist()) if found[0] >= 0 else ()

    def advance(self, nodes: int) -> bool:
        """Goes on for so many nodes; returns True once all is done."""
        from cocap_opt.formulations.certificates.staged.search_kernel import IS_DONE, advance

        self.best = float(advance(self.data, self.memory, self.best, self.floor, nodes))
        return bool(self.memory.progress[IS_DONE])

    def follow(
        self,
        choices: tuple[IntArray, IntArray, IntArray],
        floors: FloatArray,
        tails: tuple[int, int],
        nodes: int,
    ) -> tuple[int, IntArray, IntArray]:
        """Collects the joint states that follow each of some; goes on where it was interrupted.

        Parameters
        ----------
        choices : first entry of each list of states [K+1], positions of the states of all lists,
            and the number of each robot's list [L, R]
        floors : [L] of each joint state before: least worth, less charges, of one that follows,
            rounding included
        tails : number of the first joint state before, and after the last
        nodes : after which it is interrupted, or after as many as may be collected

        Returns
        -------
        The number of the first joint state that is not done, and of those that were collected the
        numbers of the ones that they follow [M] and the positions of their states [M, R].
        """
        from cocap_opt.formulations.certificates.staged import search_kernel as kernel

        nodes = min(nodes, len(self.memory.collected))  # each collects one joint state at most
        arrays = kernel.MoveLists(*choices, floors)
        found = np.zeros(len(self.memory.collected), dtype=np.int64)
        tail = int(kernel.follow(self.data, self.memory, arrays, *tails, nodes, found))
        n = self._n_found
        return tail, found[:n], self.memory.collected[:n].copy()

    @property
    def nodes(self) -> int:
        """Number of nodes of the tree so far, or of the last call of `follow`."""
        from cocap_opt.formulations.certificates.staged.search_kernel import NODES

        return int(self.memory.progress[NODES])

    @property
    def _n_found(self) -> int:
        from cocap_opt.formulations.certificates.staged.search_kernel import FOUND

        return int(self.memory.progress[FOUND])


def _beginning(data: Inputs, profits: FloatArray, most_found: int) -> Memory:
    """Returns the memory of a search whose root is its next node, or that `follow` begins."""
    from cocap_opt.formulations.certificates.staged.search_kernel import Memory

    depths, n_classes = data.counts.shape
    robots, n, n_faces = depths - 1, len(data.class_of), len(data.weights)
    return Memory(
        progress=np.array([-1 if most_found else 0, 1, 0, 0, 0]),
        states=np.tile(np.arange(n), (depths, 1)),
        numbers=np.tile([n, 0], (depths, 1)),
        child=np.zeros(depths, dtype=np.int64),
        values=np.zeros((3, depths, n)),
        seen=np.zeros((2, depths, n_faces)),
        profits=np.zeros((2, depths)),
        below=np.tile(profits, (depths, 1)),
        largest=np.zeros((2, n_classes)),
        chosen=np.full((2, robots), -1),
        collected=np.zeros((most_found, robots), dtype=np.int64),
    )
