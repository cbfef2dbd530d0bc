"""Imports go one way, as the design says. Read from the source; holds for files added later."""

import re
import sys
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest
from pages import pages
from sources import (
    CORE,
    ROOT,
    imports,
    imports_to_run,
    loaded_with,
    package_of,
    reached,
    room_of,
    sources,
)

# What each package may import of the project besides itself.
ALLOWED = {
    "core": set[str](),
    "scenarios": {"core"},
    "formulations": {"core"},
    "run": {"core", "scenarios", "formulations"},
    "experiments": {"core", "scenarios", "formulations", "run"},
    "front": {"core", "scenarios", "formulations", "run", "experiments"},
    "lab": {"core", "scenarios", "formulations", "run", "experiments"},
}
# Rooms from the lowest floor up: none uses a later one. Every
# module is in one of them (a folder stands for all that it holds).
ORDER = {
    "core": (
        "text", "letters", "data", "arithmetic", "memory", "stop", "returns", "world", "problem",
        "result", "files", "compiling",
        "graph", "plausibility", "vision", "referee", "flight", "footage", "model", "timing",
        "objective",
        "coordination", "mixtures", "method", "planners",
    ),
    "formulations": (
        "certificates", "independent", "explanation", "second_opinion", "result", "simple_bounds",
        "brute_force", "solvers",
        "relaxations", "column_generation", "integer_programs", "model_files",
    ),
    "scenarios": (
        "kinds", "text", "tables", "variants", "hardware", "walking", "spread", "site", "earth",
        "maps", "meshes", "tracks", "formats", "recipe", "built_in",
    ),
    "run": ("console", "output", "run", "pictures", "missions", "player"),
    "experiments": ("tables", "sweeps", "report", "library"),
    "front": ("api", "cli"),
    "lab": ("results", "benchmark", "studies", "manual"),
}  # fmt: skip
# Likewise, of the rooms within a room.
INNER_ORDER = {
    "column_generation": (
        "parameters", "master", "primal", "search", "step_envelopes", "tree", "branch_and_price",
    ),
}  # fmt: skip
CERTIFICATES = f"{CORE}.formulations.certificates"
SOLVERS = {"cvxpy", "clarabel", "highspy", "ortools", "pyscipopt"}


def within(names: frozenset[str], package: str) -> set[str]:
    """Those of the names that are the package or in it."""
    return {name for name in names if name == package or name.startswith(f"{package}.")}


def is_front(path: Path) -> bool:
    """True if a file is the front of a room that says what others may use."""
    return path.name == "__init__.py" and "__all__ = [" in path.read_text("utf-8")


def of_package(package: str) -> list[str]:
    """Modules of a package."""
    return [module for module in sources() if package_of(module) == package]


def test_the_sources_are_found() -> None:
    """These tests look at the real files: every package is there, and imports are seen."""
    assert {package_of(name) for name in sources()} == set(ALLOWED)
    assert "cocap_opt.problem" in imports("cocap_opt.graph.motion")
    assert "networkx" in imports("cocap_opt.graph.networks")
    assert "cocap_opt.problem.problem" in reached("cocap_opt.planners.greedy")


def test_packages_import_one_way() -> None:
    """What runs planners is above them, experiments above that, and what people call above both."""
    broken = [
        (module, name)
        for module in sources()
        for name in sorted(imports(module))
        if name.startswith(CORE)
        and package_of(name) not in ALLOWED[package_of(module)] | {package_of(module)}
        and module != CORE
    ]
    assert broken == []


def test_every_module_has_its_place_in_the_order() -> None:
    """Nothing stands outside of the rooms whose order is tested."""
    rooms = {package: {room_of(m) for m in of_package(package)} - {""} for package in ORDER}
    assert rooms == {package: set(order) for package, order in ORDER.items()}


def test_rooms_are_in_order() -> None:
    """No room of a package uses one that comes later in its order: imports never run back up.

    Since no direct import does, none does through others.
    """
    broken = []
    for module in sources():
        package = package_of(module)
        if room_of(module):
            order = ORDER[package]
            own = order.index(room_of(module))
            broken += [
                f"{module} -> {name}"
                for name in sorted(imports(module))
                if name in sources()
                and package_of(name) == package
                and room_of(name)
                and order.index(room_of(name)) > own
            ]
    assert broken == []


def test_rooms_of_column_generation_are_in_order() -> None:
    """The master knows no plans, plans know no search, and only the tree knows all of these."""
    room = f"{CORE}.formulations.column_generation"
    order = INNER_ORDER["column_generation"]
    inner = within(frozenset(sources()), room) - {room}
    part = {module: module.removeprefix(f"{room}.").split(".")[0] for module in inner}
    assert set(part.values()) == set(order)
    broken = [
        f"{module} -> {name}"
        for module in inner
        for name in sorted(imports(module) & inner)
        if order.index(part[name]) > order.index(part[module])
    ]
    assert broken == []


def test_contributing_tells_the_order() -> None:
    """The order of rooms in CONTRIBUTING is the one that is tested."""
    text = (ROOT.parent / "CONTRIBUTING.md").read_text().split("| you look for")[0]
    words = " ".join(text.replace("->", " ").replace(";", " ").split())
    for order in (*ORDER.values(), *INNER_ORDER.values()):
        assert " ".join(order) in words


def test_no_module_imports_itself_in_a_circle() -> None:
    """Imports have no cycles, packages' fronts (`__init__`) left aside."""
    fronts = {name for name, path in sources().items() if path.name == "__init__.py"}
    inner = set(sources()) - fronts
    order = TopologicalSorter({module: imports(module) & inner for module in inner})
    order.prepare()  # raises CycleError


def test_the_folder_of_stored_results_has_one_spelling() -> None:
    """Its path is in one module; whoever reads stored results imports it from there."""
    spelt = [name for name, path in sources().items() if '/ "stored"' in path.read_text("utf-8")]
    assert spelt == ["cocap_opt.experiments.lab.results"]
    folder = import_module(spelt[0]).STORED
    assert (folder / "paper.csv").is_file()


def test_nothing_imports_the_face() -> None:
    """The face (`import cocap_opt`) is for users; no module of the project goes through it."""
    assert [m for m in sources() if m != CORE and CORE in imports(m)] == []


COLUMNS = "formulations.column_generation"


@pytest.mark.parametrize(
    "room",
    [
        "coordination", "flight", "footage", "graph", "formulations.certificates.staged",
        "formulations.relaxations", COLUMNS, f"{COLUMNS}.master", f"{COLUMNS}.primal",
        f"{COLUMNS}.step_envelopes", f"{COLUMNS}.tree",
    ],
)  # fmt: skip
def test_a_front_names_all_of_its_modules(room: str) -> None:
    """Whoever reads what a room has finds each of its files there."""
    front = sources()[f"{CORE}.{room}"]
    modules = {path.stem for path in front.parent.glob("*.py")} - {"__init__"}
    words = set(re.findall(r"`(\w+)`", front.read_text().split('"""')[1]))
    assert modules <= words


def used_beyond(room: str) -> set[str]:
    """The modules and folders of a room that are named outside of it: imported, or in a string."""
    texts = {name: path.read_text("utf-8") for name, path in sources().items()}
    docs = sorted((ROOT.parent / "docs").glob("*.py"))
    texts["pages"] = "\n".join(path.read_text("utf-8") for path in docs)
    texts["program"] = (ROOT.parent / "pyproject.toml").read_text("utf-8").split("[tool.")[0]
    inside = {name for name in sources() if name == room or name.startswith(f"{room}.")}
    used = {name for module in set(sources()) - inside for name in imports(module)}
    outside = (text for name, text in texts.items() if name not in inside)
    used |= {name for text in outside for name in re.findall(rf"{CORE}(?:\.\w+)+", text)}
    found = (name.removeprefix(f"{room}.").split(".")[0] for name in used)
    return {name for name in found if f"{room}.{name}" in inside}


@pytest.mark.parametrize("room", [name for name, path in sources().items() if is_front(path)])
def test_fronts_list_what_others_use(room: str) -> None:
    """Where `__all__` has modules, it has all that are used outside of the room, and no others."""
    listed = sources()[room].read_text("utf-8").split("__all__ = [")[1].split("]")[0]
    exported = set(re.findall(r'"(\w+)"', listed))
    inner = {name for name in exported if f"{room}.{name}" in sources()}
    if inner:
        assert exported == used_beyond(room)


def test_the_referee_is_independent() -> None:
    """The referee uses no planner, no reward code, no compiled model and no cache."""
    used = reached("cocap_opt.referee")
    for part in ("planners", "objective", "model", "coordination", "vision.cache", "result"):
        assert not within(used, f"{CORE}.{part}")


def test_judges_compute_rewards_for_moves_themselves() -> None:
    """Referee and certificates do not take them from what planners and pricing use."""
    certificates = within(frozenset(sources()), CERTIFICATES)
    judges = ["cocap_opt.referee", *certificates]
    assert [m for m in judges if "cocap_opt.graph.move_rewards" in imports(m)] == []


def test_planners_and_formulations_are_strangers() -> None:
    """A bound cannot depend on the plan it bounds: neither side uses the other, at any depth."""
    for module in within(frozenset(sources()), f"{CORE}.planners"):
        assert not within(reached(module), f"{CORE}.formulations"), module
    for module in of_package("formulations"):
        for other in ("planners", "scenarios", "experiments", "run", "api", "cli"):
            assert not within(reached(module), f"{CORE}.{other}"), module


def test_scenes_use_no_planner() -> None:
    """A scene is made without planning it."""
    for module in of_package("scenarios"):
        assert not within(reached(module), f"{CORE}.planners"), module


def test_scenes_are_the_same_on_every_processor() -> None:
    """NumPy's trigonometry, which differs in the last bit between processors, makes no scene."""
    angles = re.compile(r"np\.(sin|cos|tan|arc\w+)\b")
    for module, path in sources().items():
        if package_of(module) == "scenarios" or room_of(module) == "problem":
            assert not angles.search(path.read_text()), module


def test_the_core_and_the_certificates_call_no_solver() -> None:
    """Planners, referee and the checker of certificates run without an optimisation package."""
    for module in sources():
        trusted = within(frozenset([module]), CERTIFICATES)
        if package_of(module) in ("core", "scenarios") or trusted:
            assert not {name.split(".")[0] for name in imports(module)} & SOLVERS, module


def test_certificates_use_the_core_without_what_plans_and_nothing_else() -> None:
    """What must be trusted is one room: it uses the core and no other room of its package."""
    for module in within(frozenset(sources()), CERTIFICATES):
        used = [n for n in imports(module) if package_of(n) == "formulations"]
        assert all(room_of(n) == "certificates" for n in used if n.startswith(CORE)), module
        for searching in ("graph.value_iteration", "coordination", "planners", "referee"):
            assert not within(reached(module), f"{CORE}.{searching}"), module
        assert f"{CORE}.formulations.result" not in reached(module), module


def test_plain_certificates_are_checked_without_any_search() -> None:
    """The checker's lower storey stands alone: one function, for staged files, opens the upper one.

    No other module of it names the upper one, nor numba, and importing it loads neither, though
    `compiling.functions` loads numba where something is compiled.
    """
    upper = within(frozenset(sources()), f"{CERTIFICATES}.staged")
    lower = within(frozenset(sources()), CERTIFICATES) - upper
    assert {"stages", "search_kernel"} <= {name.rpartition(".")[2] for name in upper}
    assert {module for module in lower if imports(module) & upper} == {f"{CERTIFICATES}.checking"}
    for module in lower:
        assert not loaded_with(module) & upper, module
        others = {module, *loaded_with(module)} & set(sources()) - upper - {
            f"{CORE}.compiling.functions"
        }
        used = {name for other in others for name in imports(other)}
        assert not within(frozenset(used), "numba"), module


def test_checking_uses_nothing_of_what_bounds_coverage() -> None:
    """Upper bounds on what is seen are for planners and for early bounds; nobody else uses them."""
    used = {CERTIFICATES, *reached(CERTIFICATES)}
    for part in ("unhidden", "ceilings"):
        assert f"{CORE}.vision.{part}" in sources()
        assert f"{CORE}.vision.{part}" not in used


def test_files_that_are_named_exist() -> None:
    """Links, and names in backquotes that begin with a folder of this repository, lead somewhere.

    `file::name` and `folder -> other` name what stands before.
    """
    root = Path(__file__).parents[1]
    folders = "|".join(("cocap_opt", "formulations", "scenarios", "experiments", "tests", "docs"))
    found = 0
    for page in (root / "README.md", root / "CONTRIBUTING.md", *pages()):
        text = page.read_text(encoding="utf-8")
        linked = re.findall(r"\]\(([^)#:\s]+)\)", text)
        named = re.findall(rf"`((?:{folders})/[\w./-]*)", text)
        files = [page.parent / name for name in linked] + [root / name for name in named]
        assert [file for file in files if not file.exists()] == [], page
        found += len(named)
    assert found > 10


def test_nothing_imports_the_tests() -> None:
    """The package works without its tests."""
    helpers = {path.stem for path in Path(__file__).parent.rglob("*.py")}
    for module in sources():
        used = {name.split(".")[0] for name in imports(module)}
        assert not used & {*helpers, "pytest", "hypothesis"}, module


def items(text: str) -> list[str]:
    """The items of the first list in a text, each on one line."""
    listed = re.search(r"(?:^- .*\n(?:  .*\n)*)+", text, re.MULTILINE)
    assert listed
    return [re.sub(r"\s+", " ", item) for item in re.split(r"^- ", listed[0], flags=re.M)[1:]]


def modules_named(text: str) -> set[str]:
    """The modules that a list names: `room`: its modules; or modules; words follow."""
    found = set[str]()
    for item in items(text):
        head = item.split(";")[0]
        names = re.findall(r"`([\w.]+)`", head)
        found |= {names[0], *(f"{names[0]}.{name}" for name in names[1:])} if ":" in head else {
            *names
        }  # fmt: skip
    return {f"{CORE}.{name}" for name in found}


def libraries_named(text: str) -> list[set[str]]:
    """The libraries that each item of a list names."""
    return [{*re.findall(r"`(\w+)`", item)} for item in items(text)]


def libraries(modules: set[str]) -> set[str]:
    """What modules import, anywhere in them, that is neither Python's nor of this project."""
    used = {name.split(".")[0] for module in modules for name in imports_to_run(module)}
    return used - {CORE, *sys.stdlib_module_names}


def test_all_that_must_be_trusted_is_named() -> None:
    """The certificates' fronts name each module and each library of both storeys; no others.

    What importing loads is told apart from what is imported only where it is needed.
    """
    upper = within(frozenset(sources()), f"{CERTIFICATES}.staged")
    proved = {f"{CERTIFICATES}.coq.lower"}  # a script whose files a proved checker takes or refuses
    lower = within(frozenset(sources()), CERTIFICATES) - upper - proved
    loaded, all_ = loaded_with(CERTIFICATES) - lower, reached(CERTIFICATES) - lower - upper
    assert not all_ & proved
    told = sources()[CERTIFICATES].read_text().split('"""')[1]
    _, core, harmless, later, foreign = re.split(
        r"Below both, |Importing this|Modules that it may|Libraries that must", told
    )
    named = modules_named(core) | modules_named(harmless)
    rooms = {name for name in named if sources()[name].name == "__init__.py"}
    assert modules_named(core) & modules_named(harmless) <= rooms
    assert named == loaded
    assert modules_named(later) == all_ - loaded
    assert loaded_with(f"{CERTIFICATES}.staged") <= loaded | lower | upper
    for front, room in ((CERTIFICATES, lower), (f"{CERTIFICATES}.staged", upper)):
        words = sources()[front].read_text().split('"""')[1]
        modules = {name.rpartition(".")[2] for name in room - {front}}
        assert {name for name in modules if f"`{name}`" not in words} == set()
    page = ROOT.parent / "docs" / "how-to" / "certificates-checked.md"
    for text in (foreign, page.read_text(encoding="utf-8").split("## What must be trusted")[1]):
        of_lower, of_upper = libraries_named(text)
        assert of_lower == libraries(all_ | lower)
        assert of_lower | of_upper == libraries(all_ | lower | upper)
        assert not of_lower & of_upper
