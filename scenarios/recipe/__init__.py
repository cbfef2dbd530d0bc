"""Reader of recipes: scenes of a map, meshes, people whom others tracked, and drones.

The file is TOML. Files are named relative to its folder; lengths are in metres, angles in
degrees, times in seconds. `EXAMPLE` has every table once. Each other module has the tables of one
kind of part; `lighter` changes a recipe to what costs less to plan.
"""

import logging
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta

from cocap_opt.data import LARGEST, MOST_STEPS, ProblemError
from cocap_opt.files.messages import in_words
from cocap_opt.problem import Actor, Earth, Motion, Objective, Problem, Robot
from cocap_opt.problem.refusals import refused_starts
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.takes import in_all_takes, least_chance
from cocap_opt.scenarios.earth.place import EarthTable, MapProjection, require_likely
from cocap_opt.scenarios.kinds import JSON
from cocap_opt.scenarios.maps.layers import LayerTable
from cocap_opt.scenarios.maps.terrain import MapTable, Terrain
from cocap_opt.scenarios.maps.walls import WallsTable
from cocap_opt.scenarios.meshes import MeshTable
from cocap_opt.scenarios.recipe.cameras import say_photos
from cocap_opt.scenarios.recipe.drones import DronesTable, Surroundings, say_moved
from cocap_opt.scenarios.recipe.objective import ObjectiveTable
from cocap_opt.scenarios.recipe.people import TracksTable, WalkTable
from cocap_opt.scenarios.recipe.rules import AirspaceTable, NoFlyTable, RulesTable
from cocap_opt.scenarios.recipe.strides import Strides
from cocap_opt.scenarios.recipe.takes import (
    People,
    SpreadTable,
    TakeTable,
    in_takes,
    people_in_takes,
)
from cocap_opt.scenarios.site import Site
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

[[layer]]                   # a further map on that one, as many as there are: the highest counts
file = "trees.tif"          # unit, band, nodata, lowest and heights as in [map]; absolute heights
                            # are taken above the ground of [map]
trunks = 4.0                # m above the ground up to which crowns leave room for drones and for
                            # sight, stems aside; left out: solid down to the ground, the safe side

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
take = "rehearsed"          # or ["rehearsed", "late"]: takes in which they are; left out: all

[[walk]]
points = [[20, 20], [60, 22]]
name = "Ada"                # as people call the person; left out: nobody says it
speed = 1.2
first = 0.5                 # m of the way that are walked before step 0
# heading = 90              # where the person looks all the time, from x to y; left out: ahead
shape = { type = "cuboid", length = 0.4, width = 0.5, height = 1.8 }
views_weight = 2.0          # likewise: Ada is to be seen by two rather than the others
# take = "late"             # likewise; left out: Ada is there in each take

[[take]]                    # people may walk otherwise: one of several ways; left out: they do not
name = "rehearsed"
probability = 0.75          # those of all takes sum to 1

[[take]]
name = "late"
probability = 0.25

# [spread]                  # in place of [[take]]: ways that are drawn around those above
# takes = 3                 # equally probable; the first is as above
# delay = 1.0               # s: standard deviation of how late a person is, or early
# aside = 0.5               # m, to the left or right
# speed = 0.1               # share by which a person is faster or slower
# seed = 0                  # of the draws; they lead into no obstacle, nor off the map

[[drones]]
count = 3                   # in random cells, chosen by the seed, within 15 m of someone; other
                            # steps or people choose others, `starts` keeps them
near = 15
camera = "dji-mavic-pro-4k" # `cocap-opt scenes` lists them; in its place the numbers of any other:
# camera = { width = 3840, height = 2160, fov = 65 }   # px, and degrees across the width; or, in
#                           # place of fov, one of: focal = 2900 (px), fov_vertical = 40,
#                           # fov_diagonal = 72 (degrees), lens_35mm = 28 (mm, as on 35 mm film, by
#                           # the diagonal), sensor = 6.17 with lens = 4.7 (mm, width of the sensor
#                           # that makes the image); photo = [4, 3]: the maker tells the angle or
#                           # lens_35mm of photos of this shape, from which film cuts its height
tilts = [10, 40]            # below the horizon; several make a gimbal
homes = [[8, 4], [10, 4], [12, 4]]   # m, where each takes off and lands, in the middle of a cell;
                            # left out: straight below its first and its last place
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
homes = [[14, 4]]           # of all drones or of none
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
    drones: tuple[DronesTable, ...] = ()  # to look at; a problem needs one
    name: str | None = None  # None: as the file
    step: Annotated[float, Meta(gt=0, le=LARGEST)] = 1.0
    flight: Flight | None = None  # None: above the ground, and level where that is too steep
    flown: Literal["smooth", "straight"] = "smooth"
    layer: tuple[LayerTable, ...] = ()
    mesh: tuple[MeshTable, ...] = ()
    walls: tuple[WallsTable, ...] = ()
    tracks: tuple[TracksTable, ...] = ()
    walk: tuple[WalkTable, ...] = ()
    take: tuple[TakeTable, ...] = ()
    spread: SpreadTable | None = None
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
        place = _Place.of(change(decoded(path)), path)
        return place.problem(place.team(np.random.default_rng(seed)))


def site(path: Path, seed: int = 0) -> Site:
    """Reads a recipe whose drones need not have places yet, nor be there at all.

    Raises
    ------
    ProblemError
        If anything else is wrong; one line, naming file and field.
    """
    with naming(path):
        place = _Place.of(decoded(path), path)
        rng, team, starts, notes = np.random.default_rng(seed), list[Robot](), list[str](), []
        for k, given in enumerate(place.recipe.drones):
            with naming(f"drones[{k}]"):
                given.require_pace(place.around.height_map.resolution, place.recipe.step)
            try:
                with naming(f"drones[{k}]"):
                    added = given.added_to(team, place.around, rng)[len(team) :]
            except ProblemError as error:
                notes.append(str(error))
                continue
            team += added
            starts += [start for _, start in _names_of(k, given)]
        fields = place.fields(team)
        people, _ = in_all_takes(fields["takes"], fields["actors"], Objective())
        scene = SceneData(**fields | {"actors": people})
        refusals = refused_starts(scene)
        if not refusals and team:
            try:
                _ = scene.first_starts
            except ProblemError as error:
                notes.append(str(error))
        problem = None if refusals or notes or not team else place.problem(team)
        if problem is not None:
            place.say()
        motions = tuple(dict.fromkeys(given.motion for given in place.recipe.drones)) or (Motion(),)
        return Site(problem, scene, motions, tuple(refusals), tuple(starts), tuple(notes))


class _Place(NamedTuple):
    """All that a recipe makes but its drones and the objective, which depends on them."""

    recipe: Recipe
    name: str
    terrain: Terrain
    solid: tuple[Mesh, ...]
    people: Sequence[tuple[Actor, float | None]]
    filmed: People
    earth: Earth | None
    around: Surroundings

    @classmethod
    def of(cls, recipe: Recipe, path: Path) -> "_Place":
        """Reads all files that a recipe names."""
        with naming("map"):
            terrain = recipe.map.terrain(path.parent, recipe.flight or ABOVE_GROUND)
        crowns: list[Mesh] = []
        for k, layer in enumerate(recipe.layer):
            with naming(f"layer[{k}]"):
                terrain, bodies = layer.onto(terrain, path.parent)
            crowns += bodies
        earth = _earth(recipe, terrain)
        projection = MapProjection(earth, terrain.height_map.centre(0, 0))
        recipe, terrain, stray = _flyable(recipe, terrain)
        solid = (*crowns, *_meshes(recipe, path.parent, terrain, projection))
        people = list(_people(recipe, path.parent, terrain, projection))
        given = tuple(actor for actor, _ in people)
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
        filmed = people_in_takes(
            recipe.take, recipe.spread, given, workspace, recipe.steps, recipe.step
        )
        around = Surroundings(workspace, filmed.actors, recipe.steps, rules, airspace)
        return cls(recipe, recipe.name or path.stem, terrain, solid, people, filmed, earth, around)

    def team(self, rng: np.random.Generator) -> list[Robot]:
        """Returns the drones of all tables, each of which keeps away from those before."""
        recipe, height_map = self.recipe, self.around.height_map
        if not recipe.drones:
            raise ProblemError(
                "drones: must have a table [[drones]]; `cocap-opt show` draws the map without any"
            )
        team: list[Robot] = []
        for k, given in enumerate(recipe.drones):
            with naming(f"drones[{k}]"):
                given.require_pace(height_map.resolution, recipe.step)
                team = given.added_to(team, self.around, rng)
        self.say()
        return team

    def say(self) -> None:
        """Says what is doubtful in the tables of drones."""
        tables = self.recipe.drones
        say_photos([given.camera for given in tables if isinstance(given.camera, str)])
        say_moved(tables, self.around.height_map)

    def fields(self, team: Sequence[Robot]) -> dict[str, Any]:
        """Returns the fields of a scene but the objective."""
        return {
            "name": self.name,
            "height_map": self.terrain.height_map,
            "meshes": self.solid,
            "robots": tuple(team),
            "actors": self.around.actors,
            "takes": self.filmed.takes,
            "horizon": self.recipe.steps,
            "rules": self.around.rules,
            "airspace": self.around.airspace,
            "face_samples": self.recipe.face_samples,
            "step": self.recipe.step,
            "earth": self.earth,
        }

    def problem(self, team: Sequence[Robot]) -> Problem:
        """Returns the problem; what is wrong with a drone in it has the names of the recipe."""
        with naming("objective"):
            given, factors = [person for person, _ in self.people], [f for _, f in self.people]
            objective = self.recipe.objective.objective(
                given, factors, team, self.recipe.steps, least_chance(self.filmed.takes)
            )
        try:
            return Problem(**self.fields(team), objective=self.filmed.objective(objective))
        except ProblemError as error:
            names = list(_names(self.recipe))

            def named(found: re.Match[str]) -> str:
                table, start = names[int(found[1])]
                return {".start": start, ".home": f"{table}.homes"}.get(found[2], table)

            pattern = r"robots\[(\d+)\](\.start|\.home)?"
            raise ProblemError(re.sub(pattern, named, str(error))) from error


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


def _names(recipe: Recipe) -> Iterator[tuple[str, str]]:
    """Yields the names of each drone's table and start."""
    for k, given in enumerate(recipe.drones):
        yield from _names_of(k, given)


def _names_of(k: int, given: DronesTable) -> Iterator[tuple[str, str]]:
    """Yields the names of the table and the start of each drone of a table, by its number."""
    table, stated = f"drones[{k}]", len(given.stated)
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
            actors = [copy for who in actors for copy in in_takes(who, given.take, recipe.take)]
        if begin is not None:
            begins[k] = begin
        yield from ((actor, given.views_weight) for actor in actors)
    _say_moments(begins)
    for k, walk in enumerate(recipe.walk):
        with naming(f"walk[{k}]"):
            _require_views(recipe, walk)
            actor = walk.actor(terrain, recipe.step, recipe.steps)
            actors = in_takes(actor, walk.take, recipe.take)
        yield from ((actor, walk.views_weight) for actor in actors)


def _require_views(recipe: Recipe, table: TracksTable | WalkTable) -> None:
    """Raises a ProblemError if people have a factor for views that nobody counts."""
    if table.views_weight is not None and recipe.objective.views is None:
        raise ProblemError("views_weight: must be left out where [objective] has no views")
