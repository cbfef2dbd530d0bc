"""Staged certificates: bounds of multipliers, lowered by searches. The upper storey of the checker.

For staged files, the searches have to be trusted, too. After the lower storey
(`cocap_opt.formulations.certificates`), a sceptic should read, in this order:

1. `narrowing`: closes states that no better plan visits, and bounds the joint worth of all faces
   of a step.
2. `conflicts`, `joint_states`, `relaxation`, `search`: the search for the most profitable joint
   state of a step.
3. `move_searches`, `reached`, `other_steps`, `team_moves`, `joint_paths`, `middle_paths`: the
   final exploration of the remaining joint paths of all robots, from the start or from a step in
   the middle.
4. `tails`: what plans lose at their latest steps, from joint states of ever earlier steps on.
5. `profitable_moves`: the search for the most profitable move of the team between two steps.
6. `stages`: the effect of a file's stages, in order, and the checks of its numbers.
7. `search_kernel` (with `relaxation_kernel`, `kernel_arrays`) is a faster version of the searches
   of `search` and `move_searches`; tests compare their results. `compiled_search` compiles it with
   numba. Plain verification needs neither.
"""

from cocap_opt.formulations.certificates.staged.joint_paths import best_plan, may_be_used
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.middle_paths import (
    best_plan_from,
    may_begin_later,
)
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.search import NotEndedError, most_profitable
from cocap_opt.formulations.certificates.staged.stages import price_staged
from cocap_opt.formulations.certificates.staged.tails import Tails, first_tail

__all__ = [
    "JointStates",
    "Narrowing",
    "NotEndedError",
    "Tails",
    "best_plan",
    "best_plan_from",
    "first_tail",
    "may_be_used",
    "may_begin_later",
    "most_profitable",
    "price_staged",
]
