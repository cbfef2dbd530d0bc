"""Reader of recipes: scenes of a map, meshes, people whom others tracked, and drones.

The file is TOML. Files are named relative to its folder; lengths are in metres, angles in
degrees, times in seconds. `EXAMPLE` has every table once. Each other module has the tables of one
kind of part; `lighter` changes a recipe to what costs less to plan.
"""

import logging
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from cocap_opt.data import LARGEST, MOST_STEPS, ProblemError
from cocap_opt.files.messages import in_words
from cocap_opt.problem import Actor, Earth, Problem, Robot
from cocap_opt.scenarios.earth.place import EarthTable, MapProjection, require_likely
from cocap_opt.scenarios.kinds import JSON
from cocap_opt.scenarios.maps.terrain import MapTable, Terrain
from cocap_opt.scenarios.maps.walls import WallsTable
from cocap_opt.scenarios.meshes import MeshTable
from cocap_opt.scenarios.recipe.drones import DronesTable, Surroundings, say_moved
from cocap_opt.scenarios.recipe.objective import ObjectiveTable
from cocap_opt.scenarios.recipe.people import TracksTable, WalkTable
from cocap_opt.scenarios.recipe.rules import AirspaceTable, NoFlyTable, RulesTable
from cocap_opt.scenarios.recipe.strides import Strides
from cocap_opt.scenarios.tables import ABOVE_GROUND, Flight, Table
from cocap_opt.scenarios.text import naming, read_text, rectangle
from cocap_opt.scenarios.tracks.times import Epoch
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

log = logging.getLogger(__name__)

MOST_DIGITS = 4300  # of a whole number, that Python reads
_ROUND = 5.0  # m, to which the corner of a map is rounded that a message proposes

EXAMPLE = """\
name = "example"            # left out: that of the file
steps = 20                  # number of moves
step = 0.5                  # seconds each; left out: 1
flight = "above-ground"     # or "above-sea"; the layers of all drones are heights above it; left
                            # out: above the ground, and more where it is too steep for limits
flown = "smooth"            # drones with limits make moves that smooth flights can have in any
                            # order; "straight": those that are slow enough by themselves
face_samples = 3            # squared: rays to each triangle of what meshes may hide

[map]
file = "houses.tif"         # .tif or .asc; in place of it: size = [60, 40], origin = [0, 0]
unit = "m"                  # "m", "cm", "mm", "ft" or "us-ft" (US survey feet): of the heights in
                            # files; left out: as the file says, else m
heights = "above-ground"    # or "absolute", which needs a ground
ground = "terrain.tif"      # bare terrain; "surface": the map itself is that; left out: flat, 0
resolution = 1.0            # m, cells of the plan; left out: those of the file
window = [10, 10, 70, 50]   # x0, y0, x1, y1 of the part that is used; left out: all
fill = 0.0                  # m, where the file has no data; left out: such files are refused
nodata = -32768             # a value that means no data, besides what the file says
band = 1                    # of the file; left out: the only one
lowest = 0.5                # m above the ground; what is lower is no obstacle

[[mesh]]
file = "bridge.glb"         # .obj, .glb, .gltf, .stl, .ply or .off
unit = "m"                  # "m", "cm", "mm", "ft" or "us-ft"
up = "y"                    # axis that is upwards; left out: y for glTF, z for others
turn = 90                   # counter-clockwise about its origin
at = [35, 20, 0]            # where its origin comes to lie

[[walls]]
file = "geometry.json"      # polygons of the walkable area and of obstacles: JSON, GeoJSON, WKT
unit = "m"                  # "m", "cm", "mm", "ft" or "us-ft"; left out: as the file says; else
                            # degrees in GeoJSON, where [earth] must be known, and m in others
name = "bottleneck"         # which of them
# polygons = "obstacles"    # or "walkable": what those of GeoJSON and WKT are
height = 2.0                # m above base; of GeoJSON's polygons those that have none of their own
border = 0.2                # thickness of walls around the walkable area; left out: none
at = [30, 10]               # added to their points
base = 50.0                 # altitude of their foot; left out: the lowest ground

[[tracks]]
file = "people.txt"         # or a database of JuPedSim, or GPX, where [earth] is known; several
                            # files on one clock: ["ada.gpx", "ben.gpx"]
columns = ["id", "frame", "x", "y", "z"]   # left out: as the file says; in place of x and y:
                            # latitude and longitude, where [earth] is known
unit = "cm"                 # "m", "cm", "mm", "ft" or "us-ft"; left out, as fps: as the file says
fps = 16
# time_unit = "ms"          # "s", "ms", "us" or "ns", of times; left out: as the file says, else s
gap = 1.0                   # s between rows in which people walk straight on; left out: 1, and 10
                            # within a segment of GPX
begin = 37.0                # s of the tracks at step 0; left out: the first from which all are
                            # there at all steps, which a longer gap may make late; dates, and
                            # times since 1970, count from the first of them
ids = [12, 15, 16]          # or: count = 3, the first that are there at all steps
at = [40, 20]               # added to their points
delimiter = " "             # left out: what the first row looks like
still = 0.1                 # m/s; people who are slower keep their heading
shape = { type = "prism", sides = 6, apothem = 0.25 }
views_weight = 0.5          # times the weight of views in [objective]; left out: 1

[[walk]]
points = [[20, 20], [60, 22]]
name = "Ada"                # as people call the person; left out: nobody says it
speed = 1.2
first = 0.5                 # m of the way that are walked before step 0
# heading = 90              # where the person looks all the time, from x to y; left out: ahead
shape = { type = "cuboid", length = 0.4, width = 0.5, height = 1.8 }
views_weight = 2.0          # likewise: Ada is to be seen by two rather than the others

[[drones]]
count = 3                   # in random cells, chosen by the seed, within 15 m of someone; other
                            # steps or people choose others, `starts` keeps them
near = 15
camera = "dji-mavic-pro"
tilts = [10, 40]            # below the horizon; several make a gimbal
airframe = "px4"            # whose limits hold; left out, as each of `limits`: none are checked

[drones.motion]             # what the drones above can do in one step
layers = [4, 6]             # m, flight heights
radius = 1                  # cells along each axis: with cells of 1 m and steps of 0.5 s 2.8 m/s
climb = 1                   # layers, up or down
headings = 8                # in a full turn
turn = 1                    # headings, either way
pitch_turn = 1              # tilts, either way
spacing = 1                 # cells of which moves are multiples
stride = { aside = 2.0, upright = 2.0, space = 3.0 }   # m, the longest moves; left out, as each
                            # bound: as radius, climb and limits have it
clearance = 0.5             # m that are free above and below
corner_cutting = false      # true: a move may cut a wall's corner, only its ends must be free

[drones.limits]             # which bound motion; in place of the airframe's
speed = 8                   # m/s; climb and descent likewise
climb = 5
descent = 4
acceleration = 8            # m/s2; a move from rest to rest within a step wants 5.8 x its length
                            # / step^2: 0.34 m here, so cells of 1 m are divided by 3
yaw_rate = 90               # degrees/s, as the gimbal's
gimbal_rate = 90
endurance = 1200            # s for which the battery lasts

[[drones]]
# A drone starts in the middle of the cell in which x and y are; heading 0 is along x.
starts = [{ x = 30, y = 20, height = 4, heading = 90 }]
# starts = { area = [[20, 10], [40, 10], [40, 30]], heights = [4], headings = [0, 90] }
#                           # with a count: in the area, wherever it is best; "anywhere": on the
#                           # whole map; heights, headings left out: all

[[no_fly]]
polygon = [[40, 10], [50, 10], [50, 20]]   # no drone enters it, not even in part of a cell
bottom = 0.0                # altitudes in m between which it is closed; left out: at all
top = 30.0

[airspace]
ceiling = 30.0              # m, as layers are; left out: there is none
people = 3.0                # m from people, seen from above, at every moment; 0: none
over_people = 5.0           # m above heads from which on drones may fly over; left out: never

[earth]
crs = "EPSG:25830"          # x goes to its east, y to its grid's north; left out: the map's file's
# latitude = 43.263         # of the point x = 0, y = 0 (WGS 84), where no file says the place
# longitude = -2.935
height = 20.0               # m, of z = 0
heights = "above-sea"       # or "above-ellipsoid"; nothing is converted between them

[rules]
vertex = true               # no two drones in one cell; false, and swap: they may share cells
swap = true                 # nor may two exchange cells
separation = 2.0            # m between drones at every moment; left out: 2, and 0 is none
vertical = 0.0              # m in height that suffice as well; 0: only the distance counts

[objective]
pixels = 1.0                # weight of all pixels; 0: they do not count
stationarity = 0.0          # of a drone that stays in its state for a step
keep_cell = 0.0             # or in its cell
keep_heading = 0.0          # or keeps its heading
balanced = 0.0              # or moves by as many cells along x as against y, or not at all
count_start = false         # true: what is seen at step 0 counts too
over_time = false           # true: pixels add up over the steps before the root is taken

[objective.views]           # drones that see a person count, too; left out: they do not
cameras = 2                 # from so many on, more add nothing
# weight = 250.0            # px^0.5/m, of a drone that sees a person at a step; or a list, a number
                            # for each person; left out: half of what a view of the person pays from
                            # where the person fills a third of the image's height; "first": more
                            # than all pixels can pay, so that people are seen before all else
at_least = 0.3              # share that must be visible of all that a person shows in a direction
# share = 0.95              # of all views, `cameras` of each person at each step, that plans should
                            # keep: `plan` gives views more weight until they do; see `front`
"""


class Recipe(Table):
    """The whole file, see `EXAMPLE`."""

    steps: Annotated[int, Meta(ge=1, le=MOST_STEPS)]
    map: MapTable
    drones: Annotated[tuple[DronesTable, ...], Meta(min_length=1)]
    name: str | None = None  # None: as the file
    step: Annotated[float, Meta(gt=0, le=LARGEST)] = 1.0
    flight: Flight | None = None  # None: above the ground, and level where that is too steep
    flown: Literal["smooth", "straight"] = "smooth"
    mesh: tuple[MeshTable, ...] = ()
    walls: tuple[WallsTable, ...] = ()
    tracks: tuple[TracksTable, ...] = ()
    walk: tuple[WalkTable, ...] = ()
    no_fly: tuple[NoFlyTable, ...] = ()
    airspace: AirspaceTable = msgspec.field(default_factory=AirspaceTable)
    rules: RulesTable = msgspec.field(default_factory=RulesTable)
    objective: ObjectiveTable = msgspec.field(default_factory=ObjectiveTable)
    face_samples: int = 3
    earth: EarthTable | None = None


def read(
    path: Path, seed: int = 0, change: Callable[[Recipe], Recipe] = lambda recipe: recipe
) -> Problem:
    """Reads a recipe and all files that it names.

    Parameters
    ----------
    path
        The TOML file.
    seed
        Chooses the starts of drones that have a `count`.
    change
        Makes another recipe of what the file says; nothing is changed if not given.

    Raises
    ------
    ProblemError
        If a file cannot be read, or something is not allowed or does not fit together; one
        line, naming file and field.
    """
    with naming(path):
        recipe = change(decoded(path))
        with naming("map"):
            terrain = recipe.map.terrain(path.parent, recipe.flight or ABOVE_GROUND)
        earth = _earth(recipe, terrain)
        projection = MapProjection(earth, terrain.height_map.centre(0, 0))
        recipe, terrain, stray = _flyable(recipe, terrain)
        solid = tuple(_meshes(recipe, path.parent, terrain, projection))
        people = list(_people(recipe, path.parent, terrain, projection))
        actors = tuple(actor for actor, _ in people)
        with naming("rules"):
            rules = recipe.rules.rules()
        if recipe.earth is not None and earth is not None and terrain.crs is None:
            with naming("earth"):  # walls or tracks off the map say first where it should be
                require_likely(earth, terrain.height_map)
        airspace = recipe.airspace.airspace(recipe.no_fly)
        if airspace.people_aside:
            airspace = airspace.replace(people_stray=stray)
        for k, zone in enumerate(airspace.no_fly):
            with naming(f"no_fly[{k}]"), naming("polygon"):
                _require_on_map([zone], terrain.height_map, "it has coordinates of the map")
        workspace = Workspace(terrain.height_map, solid, airspace.no_fly, airspace.ceiling)
        around = Surroundings(workspace, actors, recipe.steps, rules, airspace)
        team = _team(recipe, around, np.random.default_rng(seed))
        with naming("objective"):
            factors = [factor for _, factor in people]
            objective = recipe.objective.objective(actors, factors, team, recipe.steps)
        return _problem(
            recipe,
            name=recipe.name or path.stem,
            height_map=terrain.height_map,
            meshes=solid,
            robots=tuple(team),
            actors=actors,
            horizon=recipe.steps,
            rules=rules,
            airspace=airspace,
            objective=objective,
            face_samples=recipe.face_samples,
            step=recipe.step,
            earth=earth,
        )


def without_limits(recipe: Recipe) -> Recipe:
    """Returns a recipe of whose drones nobody knows how fast they can be."""
    tables = tuple(table.without_limits() for table in recipe.drones)
    return msgspec.structs.replace(recipe, drones=tables)


def _flyable(recipe: Recipe, terrain: Terrain) -> tuple[Recipe, Terrain, float]:
    """Returns a recipe whose drones can fly all of their moves smoothly, in any order.

    Returns
    -------
    recipe, terrain : with other motions, cells and flight heights, where limits ask for that
    stray : share of a move by which drones may then stray from their even pace
    """
    for k, given in enumerate(recipe.drones):
        with naming(f"drones[{k}]"):
            given.require_likely(terrain.height_map.resolution, recipe.step)
    limited = any(table.known_limits is not None for table in recipe.drones)
    if recipe.flown == "straight" or not limited:
        return recipe, terrain, 0.0
    ceiling, follows = recipe.airspace.ceiling, recipe.flight is not None
    strides = Strides.of(recipe.drones, terrain, recipe.step, follows, ceiling)
    strides.say()
    changed = msgspec.structs.replace(recipe, drones=strides.tables)
    return changed, strides.terrain, strides.law.stray


def _team(recipe: Recipe, around: Surroundings, rng: np.random.Generator) -> list[Robot]:
    """Returns the drones of all tables, each of which keeps away from those before."""
    team: list[Robot] = []
    for k, given in enumerate(recipe.drones):
        with naming(f"drones[{k}]"):
            given.require_pace(around.height_map.resolution, recipe.step)
            team = given.added_to(team, around, rng)
    say_moved(recipe.drones, around.height_map)
    return team


def _problem(recipe: Recipe, **fields: Any) -> Problem:
    """Returns the problem; what is wrong with a drone in it has the names that the recipe has."""
    try:
        return Problem(**fields)
    except ProblemError as error:
        names = list(_names(recipe))

        def named(found: re.Match[str]) -> str:
            table, start = names[int(found[1])]
            return start if found[2] else table

        raise ProblemError(re.sub(r"robots\[(\d+)\](\.start)?", named, str(error))) from error


def _names(recipe: Recipe) -> Iterator[tuple[str, str]]:
    """Yields the names of each drone's table and start."""
    for k, given in enumerate(recipe.drones):
        table = f"drones[{k}]"
        stated = len(given.stated)
        yield from ((table, f"{table}.starts[{n}]") for n in range(stated))
        area = f"{table}.starts" if given.starts is not None and not stated else table
        yield from ((table, area) for _ in range(given.count or 0))


def decoded(path: Path) -> Recipe:
    """Returns the content of a recipe's file; a ProblemError says what is wrong with it."""
    text = read_text(path, (JSON,))  # `[[1]]` is TOML, too
    try:
        return msgspec.toml.decode(text, type=Recipe)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(in_words(error, text, Recipe)) from error
    except ValueError as error:  # Python's own, of numbers of thousands of digits
        raise ProblemError(f"must hold whole numbers of at most {MOST_DIGITS} digits") from error


def _earth(recipe: Recipe, terrain: Terrain) -> Earth | None:
    """Returns where the scene is on the Earth, if the recipe or the map's file says it."""
    if recipe.earth is None:
        return None if terrain.crs is None else Earth(crs=terrain.crs)
    with naming("earth"):
        return recipe.earth.earth(terrain.crs, terrain.height_map)


def _meshes(
    recipe: Recipe, folder: Path, terrain: Terrain, projection: MapProjection
) -> Iterator[Mesh]:
    for k, given in enumerate(recipe.mesh):
        with naming(f"mesh[{k}]"):
            mesh = given.mesh(folder)
            _require_on_map([mesh], terrain.height_map)
        yield from mesh.parts
    for k, plan in enumerate(recipe.walls):
        with naming(f"walls[{k}]"):
            walls = plan.meshes(folder, float(terrain.ground.min()), projection)
            _require_on_map(walls, terrain.height_map, _ways_to_walls(recipe, walls))
        yield from walls


def _ways_to_walls(recipe: Recipe, walls: list[Mesh]) -> str:
    """Suggests ways to bring a map and the walls that do not lie on it together."""
    if recipe.map.file is not None:
        return "`at` moves them, `unit` scales them"
    low = np.concatenate([wall.vertices for wall in walls]).min(axis=0)
    x, y = np.floor(low[:2] / _ROUND) * _ROUND
    return (
        f"origin = [{x:.10g}, {y:.10g}] in [map] begins the map there, so that all keep their "
        "coordinates; `at` moves these walls alone, `unit` scales them"
    )


def _require_on_map(
    meshes: list[Mesh], height_map: HeightMap, way_out: str = "`at` moves it, `unit` scales it"
) -> None:
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    low, high = vertices.min(axis=0)[:2], vertices.max(axis=0)[:2]
    first, last = height_map.ends
    if (high < first).any() or (low > last).any():
        raise ProblemError(
            f"must lie on the map, {rectangle(first, last)}, not at {rectangle(low, high)}; "
            f"{way_out}"
        )


def _say_moments(begins: dict[int, Epoch]) -> None:
    """Warns if tables of dated tracks begin at moments that differ, by number of the table."""
    for k, begin in list(begins.items())[1:]:
        first = next(iter(begins))
        if begin.is_universal == begins[first].is_universal and begin != begins[first]:
            log.warning(
                "tracks[%d]: step 0 is %s for its people, and %s for those of tracks[%d], who are "
                'filmed as if it were at once; file = ["..", ".."] in one table puts files on one '
                "clock",
                k, begin, begins[first], first,
            )  # fmt: skip


def _people(
    recipe: Recipe, folder: Path, terrain: Terrain, projection: MapProjection
) -> Iterator[tuple[Actor, float | None]]:
    """Yields the people, and the factor of each one's weight in the objective's views."""
    begins: dict[int, Epoch] = {}
    for k, given in enumerate(recipe.tracks):
        with naming(f"tracks[{k}]"):
            _require_views(recipe, given)
            actors, begin = given.actors(folder, terrain, recipe.step, recipe.steps, projection)
        if begin is not None:
            begins[k] = begin
        yield from ((actor, given.views_weight) for actor in actors)
    _say_moments(begins)
    for k, walk in enumerate(recipe.walk):
        with naming(f"walk[{k}]"):
            _require_views(recipe, walk)
            actor = walk.actor(terrain, recipe.step, recipe.steps)
        yield actor, walk.views_weight


def _require_views(recipe: Recipe, table: TracksTable | WalkTable) -> None:
    """Raises a ProblemError if people have a factor for views that nobody counts."""
    if table.views_weight is not None and recipe.objective.views is None:
        raise ProblemError("views_weight: must be left out where [objective] has no views")
