"""An example of a recipe, with every table, and comments that explain its fields."""

EXAMPLE = """\
name = "example"            # default: the name of the file
steps = 20                  # number of moves
step = 0.5                  # s, duration of a step; default: 1
flight = "above-ground"     # or "above-sea": zero of all flight heights; default: above the ground,
                            # and higher where the ground is too steep for the drones' limits
flown = "smooth"            # drones with limits make only moves that smooth flights can join in
                            # any order; "straight": only moves slow enough to be flown singly
face_samples = 3            # this number squared of rays tests each triangle that a mesh may hide

[map]
file = "houses.tif"         # .tif or .asc; no default: name a file, or write size = [60, 40] and,
                            # if the corner is not at 0, 0, origin = [10, 10]
unit = "m"                  # "m", "cm", "mm", "ft" or "us-ft" (US survey feet) of the heights in
                            # files; default: the unit that the file states, else m
heights = "above-ground"    # or "absolute", which requires a ground
ground = "terrain.tif"      # bare terrain; "surface": the map itself; default: flat, at 0
resolution = 1.0            # m, cell size of the plan; default: that of the file
window = [10, 10, 70, 50]   # x0, y0, x1, y1 of the part to use; default: the whole map
fill = 0.0                  # m, height where the file has no data; default: reject such files
nodata = -32768             # another value that means "no data"; default: the file's alone
band = 1                    # band of the file; default: its only band
lowest = 0.5                # m above the ground; lower things are not obstacles; default: 0

[[layer]]                   # another map on top of [map]; several are allowed, the highest counts
file = "trees.tif"          # also unit, band, nodata, lowest and heights, as in [map]; absolute
                            # heights are measured from the ground of [map]
trunks = 4.0                # m above the ground: below it, crowns leave room to fly and look
                            # through, except at stems; default: solid down to the ground

[[land_cover]]              # drawn on the ground; `land` of drones uses it, too
file = "land.geojson"       # polygons whose property `kind` is water, green, street, footway,
                            # paved, yard, building or other; a `name` is written on the ground
property = "surface"        # property with the kind; default: kind
kinds = { grass = "green" } # translates other words of the file into kinds; default: none
# unit = "m"                # as in [[walls]]

[[mesh]]
file = "bridge.glb"         # .obj, .glb, .gltf, .stl, .ply or .off
unit = "m"                  # "m", "cm", "mm", "ft" or "us-ft"; default: the unit that a comment
                            # in the file states, else m
up = "y"                    # axis that points up; default: y for glTF, z for other formats
turn = 90                   # degrees counter-clockwise about its origin; default: 0
at = [35, 20, 0]            # place of its origin in the scene; default: 0, 0, 0

[[walls]]
file = "geometry.json"      # polygons of obstacles or of the walkable area: JSON, GeoJSON, WKT
unit = "m"                  # "m", "cm", "mm", "ft" or "us-ft"; default: the unit that the file
                            # states; else degrees in GeoJSON, which requires [earth], m in others
name = "bottleneck"         # which geometry of the file; default: its only one
# polygons = "obstacles"    # or "walkable": meaning of the polygons in GeoJSON and WKT
height = 2.0                # m above base, for polygons without a height of their own; no default
border = 0.2                # m, thickness of walls around the walkable area; default: no walls
at = [30, 10]               # added to the points; default: nothing
base = 50.0                 # m, altitude of the foot, from the zero of [earth] height; default:
                            # the lowest ground below each polygon

[[tracks]]
file = "people.txt"         # or a JuPedSim database, or GPX, which requires [earth]; several files
                            # that share a clock: ["ada.gpx", "ben.gpx"]
columns = ["id", "frame", "x", "y", "z"]   # default: the names in the file; for latitude and
                            # longitude in place of x and y, [earth] is required
unit = "cm"                 # "m", "cm", "mm", "ft" or "us-ft"; default: the unit the file states
fps = 16                    # default: the frame rate that the file states
# time_unit = "ms"          # "s", "ms", "us" or "ns"; default: the unit the file states, else s
gap = 1.0                   # s, longest pause between rows that is bridged by a straight walk;
                            # default: 1, within a segment of GPX 10
begin = 37.0                # s, time of step 0 in the file; dates, and seconds since 1970, count
                            # from the first row; default: the first time from which all people
                            # are present at all steps
ids = [12, 15, 16]          # or: count = 3, the first three people present at all steps; no
                            # default: write one of the two
turn = 90                   # degrees from x to y by which points are turned about x = y = 0 of
                            # the file, before `at`; default: 0
at = [40, 20]               # m, added to the points; default: nothing
delimiter = " "             # default: guessed from the first row
still = 0.1                 # m/s; slower people keep their heading
shape = { type = "prism", sides = 6, apothem = 0.25, height = 1.75 }   # m; a shape that lacks
                            # numbers has sides = 6, apothem = 0.5 and height = 1.8 by default
views_weight = 0.5          # factor on the weight of views in [objective]; default: 1
take = "rehearsed"          # or ["rehearsed", "late"]: takes with these people; default: all

[[walk]]
points = [[20, 20], [60, 22]]
name = "Ada"                # name of the person; default: none
speed = 1.2                 # m/s
first = 0.5                 # m walked before step 0; default: 0
# heading = 90              # degrees from x to y, constant; default: the person looks ahead
shape = { type = "cuboid", length = 0.4, width = 0.5, height = 1.8 }   # m; default: the prism of
                            # [[tracks]]; a cuboid has length = 1 and width = 1 by default
views_weight = 2.0          # views of Ada count twice as much; default: 1
# take = "late"             # as in [[tracks]]

[[take]]                    # one of several ways in which people may walk; default: only one
name = "rehearsed"
probability = 0.75          # the probabilities of all takes sum to 1

[[take]]
name = "late"
probability = 0.25

# [spread]                  # in place of [[take]]: draws takes that vary the walks above
# takes = 3                 # number of equally probable takes; the first has no variation
# delay = 1.0               # s, standard deviation of a person's delay, late or early
# aside = 0.5               # m, standard deviation to the left or right
# speed = 0.1               # standard deviation of a person's speed, as a share of it
# seed = 0                  # seed of the draws; no walk is drawn into an obstacle or off the map

[[drones]]
count = 3                   # the seed chooses cells, within 15 m of a person; they change with
                            # steps and people, so write `starts` to keep them; no default:
                            # write a count or starts
near = 15                   # m; default: wherever drones can meet people
camera = "dji-mavic-pro-4k" # a name from `cocap-opt scenes`; default: "greedy-perspectives",
                            # 4000 x 3000 px, with a warning; or the numbers of another camera:
# camera = { width = 3840, height = 2160, fov = 65 }   # px, and degrees across the width; or, in
#                           # place of fov, one of: focal = 2900 (px), fov_vertical = 40,
#                           # fov_diagonal = 72 (degrees), lens_35mm = 28 (mm, equivalent on 35 mm
#                           # film, by the diagonal), sensor = 6.17 with lens = 4.7 (mm, width of
#                           # the sensor area that the image uses); photo = [4, 3]: the angle or
#                           # lens_35mm is that of photos of this shape, which film crops in height
tilts = [10, 40]            # degrees below the horizon; several make a gimbal; default: [10]
homes = [[8, 4], [10, 4], [12, 4]]   # m, where each drone takes off and lands, in the middle of a
                            # cell; default: straight below its first and its last place
airframe = "px4"            # whose limits apply; default: no limits but those in [drones.limits]

[drones.motion]             # what the drones of this table can do in one step
layers = [4, 6]             # m, flight heights; default: [5]
radius = 1                  # cells along each axis; with cells of 1 m and steps of 0.5 s: 2.8 m/s
climb = 1                   # layers, up or down
headings = 8                # number of headings in a full turn
turn = 1                    # headings, either way
pitch_turn = 1              # tilts, either way
spacing = 1                 # cells; moves are multiples of it
stride = { aside = 2.0, upright = 2.0, space = 3.0 }   # m, longest moves; default: as far as
                            # radius, climb and limits allow
clearance = 0.5             # m, free space above and below; default: 0
corner_cutting = false      # true: only the ends of a move must be free, so it may cut a corner

[drones.limits]             # limits that replace those of the airframe; default: none of them
speed = 8                   # m/s; climb and descent, too
climb = 5
descent = 4
acceleration = 8            # m/s2; a move from rest to rest in a step needs 5.8 x its length /
                            # step^2: at most 0.34 m here, so cells of 1 m are divided by 3
yaw_rate = 90               # degrees/s; gimbal_rate, too
gimbal_rate = 90
endurance = 1200            # s that the battery lasts

[[drones]]
starts = [{ x = 30, y = 20, height = 4, heading = 90 }]   # in the middle of the cell that contains
                            # x and y; heading 0 is along x; default: the lowest layer, heading 0
homes = [[14, 4]]           # for all drones or for none; default: none
# land = "ground"           # in place of homes: drones end where they can land
# starts = { area = [[20, 10], [40, 10], [40, 30]], heights = [4], headings = [0, 90] }   # needs a
#                           # count: planners choose the best starts in the area, or with "anywhere"
#                           # on the whole map; default of heights and headings: all

[[no_fly]]
polygon = [[40, 10], [50, 10], [50, 20]]   # a cell that it covers in part is closed, too
bottom = 50.0               # m, altitude from which it is closed, not above ground, but from the
                            # zero of [earth] height; default: no bottom
top = 80.0                  # m, altitude; default: no top

[airspace]
ceiling = 30.0              # m, measured as layers are; default: no ceiling
people = 3.0                # m from people at every moment, seen from above; default: 0, no
                            # distance
over_people = 5.0           # m above heads from which drones may fly over people; default: never

[earth]
crs = "EPSG:25830"          # x points to its east, y to its grid north; default: the map file's
# latitude = 43.263         # of the point x = 0, y = 0 (WGS 84), if no file states the place
# longitude = -2.935
height = 20.0               # m, altitude of z = 0; default: unknown
heights = "above-sea"       # or "above-ellipsoid"; they are never converted into each other;
                            # default: unknown, as height

[rules]
vertex = true               # no two drones in one cell; false, as swap: they may share cells
swap = true                 # no two drones exchange their cells
separation = 2.0            # m between drones at every moment; default: 2; 0: no separation
vertical = 0.0              # m, difference in height that is enough, too; 0: only distance counts

[objective]
pixels = 1.0                # weight of all pixels; 0: they do not count
stationarity = 0.0          # reward of a drone that keeps its state for a step
keep_cell = 0.0             # reward of a drone that keeps its cell
keep_heading = 0.0          # reward of a drone that keeps its heading
balanced = 0.0              # reward of a step with dx + dy = 0 cells: no move, or as many cells
                            # along x as back along y
count_start = false         # true: step 0 counts, too
over_time = false           # true: pixels add up over the steps before the root is taken

[objective.views]           # reward for drones that see a person; default: none
cameras = 2                 # more cameras than this add nothing
# weight = 250.0            # px^0.5/m, reward of a drone that sees a person at a step; or a list
#                           # with a number for each person; default: half the reward of a view in
#                           # which the person fills a third of the image's height; "first": more
#                           # than all pixels together, so that views come before pixels
at_least = 0.3              # share of the person, as seen without obstacles, that must be visible
# share = 0.95              # share of all views (`cameras` of each person at each step) that plans
#                           # should keep: `plan` raises the weight until they do; see `front`
"""
