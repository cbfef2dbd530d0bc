"""The studies, each a command of `cocap-opt study`: what it does, and where its function is.

To add one: a module whose function has the options of the command, and an entry in `STUDIES`. The
module is imported only when its command is called, so that listing the commands is quick.
"""

from typing import NamedTuple

from cyclopts import App


class Study(NamedTuple):
    """A study.

    Attributes
    ----------
    function : its command, as "module:function" below this package
    help : help text of the command, with an example
    """

    function: str
    help: str


STUDIES = {
    "paper": Study("paper.reproduction:paper", """\
Reproduce the paper's experiments over many seeds, and answer its claims with bounds.

It writes a verdict in sentences, reward curves, tables, an ablation, a search for CoCap's largest
gain, the test of giving way, and scaling. Results already in the folder are not recomputed.

Example: cocap-opt study paper --out paper --seeds 0-9
"""),
    "planners": Study("paper.planner_table:planners", """\
Print the table of planners: requirements, guarantees, measured gap and time of each.

Example: cocap-opt study planners --paper paper
"""),
    "quote": Study("quotes:quote", """\
Print a number, a sentence or a table of the stored results, as the documentation quotes it.

Example: cocap-opt study quote planners_in_short
"""),
    "others": Study("others.others:others", """\
Compare published plans of other projects with ours, with certified bounds.

FOLDER contains scenes of Greedy Perspectives (seq.yaml, starts.csv, peer_paths.csv) or of Hughes et
al. (NAME_data.json or scene.json, solutions, ppa_evaluation.csv), in the published folders. All
plans are evaluated by the same code. Results already in the --out folder are not recomputed.

Example: cocap-opt study others greedy_perspectives --limit 30 --out others
"""),
    "growth": Study("growth.growth:growth", """\
Measure how column generation grows with drones, steps and cells.

Example: cocap-opt study growth --seeds 0 --limit 20 --out growth
"""),
    "views": Study("views:views", """\
Compare planned with rendered coverage.

Example: cocap-opt study views --scene corridor --poses 100 --out views
"""),
    "solvers": Study("solvers.table:solvers", """\
Compare bounds and exact methods with generic solvers.

Times are CPU times of one thread.

Example: cocap-opt study solvers --rows corridor cone-program --limit 20
"""),
    "steps": Study("steps:steps", """\
Measure exact methods against the number of steps: time and bound.

HiGHS, SCIP, CP-SAT and nonlinear SCIP each solve the whole instance as one integer program. They
are compared with joint value iteration, brute force and branch-and-price. It takes about a quarter
of an hour. The notebook solvers_compared draws the stored results.

Example: cocap-opt study steps --steps 1-4 --seeds 0 --out steps
"""),
    "audit": Study("audit:audit", """\
Check the exported instances of built-in scenes against the scenes, with independent code.

Coverage is checked by interval arithmetic (the extra `audit`). If a scene has too many reachable
states, only those of a greedy plan, those with most pixels, and as many random ones are checked.
It takes a quarter of an hour.

Example: cocap-opt study audit --scene corridor --out audit
"""),
    "coverage": Study("coverage.coverage:coverage", """\
Measure the cost of coverage on maps of 120 x 120 cells.

Example: cocap-opt study coverage --robots 2 --steps 10
"""),
    "gamma": Study("gamma:gamma", """\
Measure the discount factor of view search: rewards kept and views saved.

Example: cocap-opt study gamma --scene corridor --seeds 0-1
"""),
    "lazy": Study("lazy:lazy", """\
Measure lazy value iteration: views, rewards and time, compared with full coverage.

By default it runs scenes with cheap views and scenes with expensive ones, in a few minutes.

Example: cocap-opt study lazy --scene corridor bridge --seeds 0
"""),
    "starts": Study("starts:starts", """\
Measure the gain from choosing starts: proved optima from given starts and from the best ones.

Example: cocap-opt study starts --scene corridor --seeds 0
"""),
    "tripods": Study("tripods.tripods:tripods", """\
Place fixed cameras on the walls of a room, and compare them with lab-camera-optimizer 1.2.1.

That program runs in its own Python environment: pass its interpreter as --theirs.

Example: cocap-opt study tripods --theirs venv/bin/python --room demo --cameras 2-3
"""),
    "separation": Study("separation.separation:separation", """\
Measure how much J a separation at every moment costs, with certified bounds.

Example: cocap-opt study separation --scene corridor --seeds 0 --metres 1 2 --limit 20
"""),
    "flight": Study("flight.flight:flight", """\
Fly plans in the simulator RotorPy: errors, distances, and J of the filmed views.

It flies smooth and straight flights, in still air and in wind. It needs the extra `flight`, and
takes a quarter of an hour by default; --stored needs neither.

Example: cocap-opt study flight bridge --seeds 0 --wind 0 --out flown
"""),
    "peers": Study("coverage.peers:peers", """\
Compare coverage with the pixels that the program of Greedy Perspectives rendered.

Example: cocap-opt study peers seq.yaml peer_coverage.csv
"""),
    "quality": Study("quality.quality:quality", """\
Compare the predicted accuracy of plans with triangulated walkers, and quality with J.

Joints of walking figures are projected into the planned cameras with noise, and triangulated by
least squares and by a library (the extra `triangulation`). It takes three minutes.

Example: cocap-opt study quality --scene corridor --seeds 0 --out quality
"""),
    "cameras": Study("cameras:cameras", """\
Measure how much J two cameras on each person cost, and how proofs change.

By default it runs the built-in scenes, some of them for two minutes of CPU time.

Example: cocap-opt study cameras --scene corridor --seeds 0 --limit 20 --out cameras
"""),
    "library": Study("library:library", """\
Fill the library: make its instances, and submit a plan and a proof for each one that has none.

For scenes of other projects, --from names a folder with one folder for each family.

Example: cocap-opt study library bottleneck-0 --limit 5
"""),
    "speed": Study("speed:speed", """\
Measure the speed of coverage, planners and the command line.

Example: cocap-opt study speed --out speed
"""),
    "browser": Study("browser.browser:browser", """\
Compare the speed of cocap-check in a browser with the command; needs Chromium and npm.

Example: cocap-opt study browser --scene corridor --out browser
"""),
    "verified": Study("verified:verified", """\
Measure the speed of the checker that is verified in Coq, on bounds of built-in scenes.

Build the program with formulations/certificates/coq/build.sh first. The study takes some minutes.

Example: cocap-opt study verified --program build/cocap-check-verified --scene corridor
"""),
    "memory": Study("memory:memory", """\
Measure the memory used to compute coverage tables, and to plan with them.

Example: cocap-opt study memory --scene field-large --out memory
"""),
    "releases": Study("releases:releases", """\
Make the row of a release for the benchmarks page from stored results.

It replaces the row of the development since the last release; all other rows are kept.

Example: cocap-opt study releases 0.2.0 2026-11-26 --out experiments/lab/stored
"""),
    "frames": Study("frames:frames", """\
Measure how fast the player draws a plan; needs Chromium.

Example: cocap-opt study frames field --planner cocap-lns
"""),
    "place": Study("place:place", """\
Cut the files of the built-in scene delft out of larger ones; needs the extras maps and earth.

SOURCE contains surface.tif, ground.tif and map.geojson; scenarios/places/delft/README.md says where
they come from.

Example: cocap-opt study place delft --out scenarios/places/delft
"""),
    "notebooks": Study("notebooks:notebooks", """\
Run the project's notebooks from start to end and store them with their outputs.

If a cell fails, its notebook is not changed.

Example: cocap-opt study notebooks first_tour
"""),
}  # fmt: skip

app = App(
    name="study",
    help="Re-run the project's benchmarks.",
    help_format="markdown",  # plain text is shown with the line breaks of the source
    version_flags=[],
)
for _name, _study in STUDIES.items():
    app.command(f"{__package__}.{_study.function}", name=_name, help=_study.help)
