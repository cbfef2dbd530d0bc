"""An example of a recipe, which has every table and says in comments what its fields mean."""

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

[[land_cover]]              # drawn on the ground; read for `land` of drones
file = "land.geojson"       # polygons whose property `kind` is water, green, street, footway,
                            # paved, yard, building or other; a `name` is written on the ground
property = "surface"        # that says the kind; left out: kind
kinds = { grass = "green" } # of words of the file that are no kinds
# unit = "m"                # as in [[walls]]

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
name = "Ada"                # name of the person (optional)
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
# land = "ground"           # in place of homes: they end where they can land
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
cameras = 2                 # more cameras than this add nothing
# weight = 250.0            # px^0.5/m, of a drone that sees a person at a step; or a list, a number
                            # for each person; left out: half of what a view of the person pays from
                            # where the person fills a third of the image's height; "first": more
                            # than all pixels can pay, so that people are seen before all else
at_least = 0.3              # share that must be visible of all that a person shows in a direction
# share = 0.95              # of all views, `cameras` of each person at each step, that plans should
                            # keep: `plan` gives views more weight until they do; see `front`
"""
