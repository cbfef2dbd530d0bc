"""Certificates: the numbers that prove a bound, and all code that must be trusted to believe it.

A certificate is a set of non-negative numbers. Anyone who has them and the scene can recompute a
bound that no plan's J exceeds, regardless of which solver found the numbers and how well it
converged. This package has two storeys, and neither imports a solver.

The lower storey, about 1,150 lines of code, checks plain certificates and proofs. It contains no
search and no compiled code. A sceptic should read, in this order:

1. `pricing`: three inequalities in its docstring bound J by a constant and one best path per robot,
   for any non-negative numbers. `Pricing.of` adds these up, and adds a bound on its own rounding
   errors. The leaves of a tree of decisions cover all plans, so the largest of their bounds holds
   for all plans: `Pricing.of_proof`.
2. `sweep`: the best path, by value iteration that shares no code with planners. A value that is too
   small would give a false bound, so the code is written to be read.
3. `resources`: the rows that every plan obeys. `why_shared` rejects all other rows, which two
   robots may break.
4. `envelope`: a cut's constant is the largest excess at finitely many corners, and convexity proves
   that the excess is no larger between and beyond them. The functions themselves are arbitrary.
5. `state_cuts`: the same for functions of the state in which a robot is, where no two robots may be
   in one cell.
6. `format`: the conditions under which nodes form a tree and the cuts of a file have a constant.
7. `checking`: checks that the file's digest matches the scene, and that the file claims no more
   than it proves.

The upper storey, the folder `staged`, checks staged certificates by searches, in about 1,670 lines,
and 660 more of compiled code. It is loaded only when a staged certificate is checked or made;
`checking` loads it, in one place.

Below both, the trusted core, about 6,800 lines:

- `problem`: `actor`, `airspace`, `camera`, `checks`, `goals`, `homes`, `motion`, `objective`,
  `plan`, `problem`, `refusals`, `robot`, `rules`, `scene`, `shapes`, `starts`, `takes`; the scene,
  and which conflicts it forbids.
- `world`: `columns`, `triangles`, `workspace`; what is solid.
- `graph`: `charges`, `motion`, `move_rewards`, `timegraph`; which moves exist.
- `vision`: `bodies`, `candidates`, `coverage`, `faces`, `projection`, `seen`, `shadows`,
  `sights`, `viewpoints`, `views`, `visibility`; what a view sees.
- `model`: `coverage_tables`, `model`, `path_cells`, `places`; who shares a graph, and its states.
- `files`: `documents`, `strict_json`; reading files, and the digest that ties one to its scene.
- `objective`, `returns`, `arithmetic`, `data`; weights and J, concave returns, sums of floats, and
  checks of fields.

Importing this package also loads the following modules, on which no number depends:

- `problem`: `land_cover`, `open_areas`, `placement`; the map that pictures show, the places
  proposed for rejected starts, and a first choice of starts, if drones have one.
- `model`: `coverage_estimate`; an estimate of the time that coverage takes.
- `files`: `atomic_write`, `messages`, `users_folder`; how and where files are written, and the
  wording of errors.
- `formulations`, `method`; names of methods, none of which is imported.
- `memory`, `stop`, `text`; rejection of problems that are too large, limits, and wording.
- `compiling`: `functions`, `kernel`, `marks`; decides when compiled code computes coverage: never
  in a model that checks.

Modules that it may import later, when needed:

- `vision.surfaces`; rays, if a scene has meshes that are not convex: trusted for these scenes.
- `problem.pictures`, `problem.map_frame`, `problem.start_ground`, `problem.whole_names`,
  `problem.cut_zones`, `problem.apart_numbers`, `problem.labels`; for
  `Problem.plot`. `verify` draws nothing.
- `vision.cache`, `files.code`, `files.known_digests`; the cache of coverage. `verify` makes a model
  without it.
- `compiling.apart`; compiling in another process.
- `vision.compiled_sight`, `vision.view_kernel`; coverage by compiled code. `verify` makes a model
  without it.

Libraries that must be trusted, too:

- lower storey: `numpy`, `msgspec`, which decodes files, `psutil`, which measures free memory,
  `scipy`, if a scene has meshes, `embreex`, if these are not convex, and `matplotlib` and
  `shapely`, if something is drawn. `numba` is never loaded here.
- upper storey: these, and numba if it is installed and not switched off.
"""

from cocap_opt.formulations.certificates.checking import priced, verify
from cocap_opt.formulations.certificates.format import (
    Branch,
    Certificate,
    CertificateError,
    CertificateFile,
    ClassCurve,
    ClassPayments,
    Decision,
    EnvelopeCut,
    Leaf,
    Multipliers,
    ProofFile,
    ReferencePixels,
    Row,
    Staged,
    StateCut,
    UnfinishedError,
)
from cocap_opt.formulations.certificates.pricing import Pricing

__all__ = [
    "Branch",
    "Certificate",
    "CertificateError",
    "CertificateFile",
    "ClassCurve",
    "ClassPayments",
    "Decision",
    "EnvelopeCut",
    "Leaf",
    "Multipliers",
    "Pricing",
    "ProofFile",
    "ReferencePixels",
    "Row",
    "Staged",
    "StateCut",
    "UnfinishedError",
    "priced",
    "verify",
]
