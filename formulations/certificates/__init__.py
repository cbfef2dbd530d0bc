"""Certificates: the numbers that prove a bound, and all that must be trusted to believe one.

A certificate is a set of non-negative numbers. People who have them and the scene can recompute a
bound that no plan's J exceeds; it does not matter which solver found them, nor how badly it
converged. This package has two storeys, and neither imports a solver.

The lower storey, about 1,000 lines of code, checks plain certificates and proofs. It searches
nothing and has no compiled code. A sceptic should read, in this order:

1. `pricing`: three inequalities in its docstring bound J by a constant and one best path
   per robot, for any non-negative numbers. `Pricing.of` adds these up, and a bound on its own
   rounding errors. The leaves of a tree of decisions cover all plans, so that the largest of
   their bounds holds for all: `Pricing.of_proof`.
2. `sweep`: the best path, by value iteration that shares no code with planners. Too
   small a value here would be a false bound, so it is written to be read.
3. `resources`: the rows that every plan obeys. `why_shared` refuses all others, which two
   robots may break.
4. `envelope`: a cut's constant is the largest excess at finitely many
   corners, and convexity proves that it is no larger between and beyond them. The functions
   themselves may be any.
5. `format`: the conditions for nodes to be a tree, and for cuts of a file to have a constant.
6. `checking`: the file's digest belongs to the scene, and it claims no more than it proves.

The upper storey, the folder `staged`, checks staged certificates by searches, in about 1,200 lines
and 660 more that are compiled. It is loaded only when one of these is checked or made. `checking`
loads it, in one place.

Below both, the trusted core, about 6,800 lines:

- `problem`: `actor`, `airspace`, `camera`, `checks`, `goals`, `homes`, `motion`, `objective`,
  `plan`, `problem`, `refusals`, `robot`, `rules`, `scene`, `shapes`, `starts`, `takes`; the scene,
  and which conflicts it forbids.
- `world`: `columns`, `triangles`, `workspace`; what is solid.
- `graph`: `charges`, `motion`, `move_rewards`, `timegraph`; which moves there are.
- `vision`: `bodies`, `candidates`, `coverage`, `faces`, `projection`, `seen`, `shadows`,
  `sights`, `viewpoints`, `views`, `visibility`; what a view sees.
- `model`: `coverage_tables`, `model`, `path_cells`, `places`; who shares a graph, and its states.
- `files`: `documents`, `strict_json`; reading files, and the digest that ties one to its scene.
- `objective`, `returns`, `arithmetic`, `data`; weights and J, concave returns, sums of floats, and
  checks of fields.

Importing the room loads these as well, on which no number depends:

- `problem`: `land_cover`, `open_areas`, `placement`; the map that pictures show, the places that
  are proposed for refused starts, and a first choice of starts, where drones have one.
- `model`: `coverage_estimate`; what coverage will cost.
- `files`: `atomic_write`, `messages`, `users_folder`; how and where files are written, and errors
  worded.
- `formulations`, `method`; names of methods, none of which is imported.
- `memory`, `stop`, `text`; refusals of what is too large, limits, and words.
- `compiling`: `functions`, `kernel`, `marks`; when compiled code finds coverage: not in a model
  that checks.

What it may import but does not load at once:

- `vision.surfaces`; rays, where a scene has meshes that are not convex: trusted for these scenes.
- `problem.pictures`, `problem.map_frame`, `problem.start_ground`, `problem.whole_names`,
  `problem.cut_zones`, `problem.apart_numbers`, `problem.labels`; for
  `Problem.plot`. `verify` draws nothing.
- `vision.cache`, `files.code`; the cache of coverage. `verify` makes a model without it.
- `compiling.apart`; compiling in another process.
- `vision.compiled_sight`, `vision.view_kernel`; coverage by compiled code. `verify` makes a model
  without it.

Libraries that have to be trusted, too:

- lower storey: `numpy`, `msgspec`, which decodes files, `psutil`, which says how much memory is
  free, `scipy`, where a scene has meshes, `embreex`, where these are not convex, and
  `matplotlib` and `shapely`, where something is drawn. `numba` is never loaded here.
- upper storey: these, and numba where it is installed and wanted.
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
