"""Certificates: the numbers that prove a bound, and all that must be trusted to believe one.

A certificate is a set of non-negative numbers. Whoever has them and the scene can recompute a
bound that no plan's J exceeds; it does not matter which solver found them, nor how badly it
converged. This room imports no solver and nothing that searches. A sceptic reads, in this
order:

1. `pricing`: three inequalities in its docstring bound J by a constant and one best path
   per robot, for any non-negative numbers. `Pricing.of` adds these up, and a bound on its own
   rounding errors. The leaves of a tree of decisions cover all plans, so that the largest of
   their bounds holds for all: `Pricing.of_proof`.
2. `sweep`: the best path, by value iteration that shares no code with planners. Too
   small a value here would be a false bound, so it is written to be read.
3. `resources`: which rows every plan obeys. `why_shared` refuses all others, as two
   robots may break them.
4. `envelope`: a cut's constant is the largest excess at finitely many
   corners, and convexity proves that it is no larger between and beyond them. The functions
   themselves may be any.
5. `format`: which nodes are a tree, and which cuts of a file have a constant.
6. `narrowing`, `joint_states`, `staged`: certificates in stages, which close states that no better
   plan visits and bound what all faces of a step are worth together. `following`, `joint_paths`:
   at the end the paths of all robots together that are left are tried. `compiled_search` repeats
   the searches of `joint_states` and `following`, faster, and is held to them by tests;
   `search_kernel` has its steps.
7. `checking`: the file's digest belongs to the scene, and it claims no more than it proves.

Below it, the trusted core: `cocap_opt.problem`, `world` and `graph` without `value_iteration`
(which moves there are), `vision` (what a view sees), `model` (which drones share a graph, and what
its places and states are), `objective` (weights and J), `data` (array types and checks of fields),
`sums` (of floats) and `files.documents` (the digest that ties a file to its scene). Besides these,
importing it loads what no number depends on: `stop`, `text`, `memory`, `drawing`,
`files.atomic_write`, `files.code`.
"""

from cocap_opt.formulations.certificates.checking import certify, verify
from cocap_opt.formulations.certificates.envelope import Curve, Cut
from cocap_opt.formulations.certificates.format import (
    OPTIMISTIC,
    Branch,
    Certificate,
    CertificateError,
    CertificateFile,
    ClassCurve,
    Decision,
    EnvelopeCut,
    Leaf,
    Multipliers,
    ProofFile,
    ReferencePixels,
    Row,
    Stage,
    Staged,
    StepConstant,
    StepPayments,
    UnfinishedError,
)
from cocap_opt.formulations.certificates.joint_paths import best_plan, may_be_used
from cocap_opt.formulations.certificates.joint_states import JointStates, NotEndedError, Wanted
from cocap_opt.formulations.certificates.narrowing import Narrowing
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.formulations.certificates.resources import (
    MOST_MOVES,
    Cells,
    Move,
    Moves,
    PathCells,
    Resource,
    Swap,
    Visit,
    charges_of,
)

__all__ = [
    "MOST_MOVES",
    "OPTIMISTIC",
    "Branch",
    "Cells",
    "Certificate",
    "CertificateError",
    "CertificateFile",
    "ClassCurve",
    "Curve",
    "Cut",
    "Decision",
    "EnvelopeCut",
    "JointStates",
    "Leaf",
    "Move",
    "Moves",
    "Multipliers",
    "Narrowing",
    "NotEndedError",
    "PathCells",
    "Pricing",
    "ProofFile",
    "ReferencePixels",
    "Resource",
    "Row",
    "Stage",
    "Staged",
    "StepConstant",
    "StepPayments",
    "Swap",
    "UnfinishedError",
    "Visit",
    "Wanted",
    "best_plan",
    "certify",
    "charges_of",
    "may_be_used",
    "verify",
]
