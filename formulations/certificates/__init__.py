"""Certificates: the numbers that prove a bound, and all that must be trusted to believe one.

A certificate is a set of non-negative numbers. Whoever has them and the scene can recompute a
bound that no plan's J exceeds; it does not matter which solver found them, nor how badly it
converged. The room has two storeys, and neither imports a solver.

The lower storey, about 1,000 lines of code, checks plain certificates and proofs. It searches
nothing and has no compiled code. A sceptic reads, in this order:

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
6. `checking`: the file's digest belongs to the scene, and it claims no more than it proves.

The upper storey, the folder `staged`, checks staged certificates by searches, in about 900 lines
and 340 more that are compiled. It is loaded only where one of these is checked or made. `checking`
opens it, in one place.

Below both, the trusted core, about 5,000 lines: `cocap_opt.problem`, `world` and `graph` without
`value_iteration` (which moves there are), `vision` (what a view sees), `model` (which drones share
a graph, and what its places and states are), `objective` (weights and J), `data` (array types and
checks of fields), `arithmetic` (of floats) and `files.documents` (the digest that ties a file to
its scene). Besides these, importing it loads what no number depends on: `stop`, `text`, `memory`,
`files.atomic_write`, `files.code`, and `method` (the records of methods, which import none).
"""

from cocap_opt.formulations.certificates.checking import priced, verify
from cocap_opt.formulations.certificates.format import (
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
    Staged,
    UnfinishedError,
)
from cocap_opt.formulations.certificates.pricing import Pricing

__all__ = [
    "Branch",
    "Certificate",
    "CertificateError",
    "CertificateFile",
    "ClassCurve",
    "Decision",
    "EnvelopeCut",
    "Leaf",
    "Multipliers",
    "Pricing",
    "ProofFile",
    "ReferencePixels",
    "Row",
    "Staged",
    "UnfinishedError",
    "priced",
    "verify",
]
