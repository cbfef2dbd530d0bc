"""Staged certificates: bounds of multipliers, lowered by searches. The upper storey of the checker.

Where a file is staged, its searches have to be trusted as well. A sceptic reads, after the lower
storey (`cocap_opt.formulations.certificates`), in this order:

1. `narrowing`: closes states that no better plan visits, and bounds what all faces of a step are
   worth together.
2. `joint_states`, `relaxation`, `search`: the search for the most profitable joint state of a step.
3. `joint_paths`: at the end the paths of all robots together that are left are explored.
4. `stages`: what a file's stages do, one after the other, and which numbers are refused.
5. `search_kernel` (with `relaxation_kernel`, `kernel_arrays`) repeats the searches of `search` and
   `joint_paths`, faster, and is held to them by tests; `compiled_search` asks numba to compile it.
   Plain verification does without both.
"""

from cocap_opt.formulations.certificates.staged.joint_paths import best_plan, may_be_used
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.search import NotEndedError, most_profitable
from cocap_opt.formulations.certificates.staged.stages import price_staged

__all__ = [
    "JointStates",
    "Narrowing",
    "NotEndedError",
    "best_plan",
    "may_be_used",
    "most_profitable",
    "price_staged",
]
