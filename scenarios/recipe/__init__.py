"""Reader of recipes: scenes that consist of a map, meshes, tracked or walking people, and drones.

The file is TOML. Files are named relative to its folder; lengths are in metres, angles in degrees,
times in seconds. `example` contains every table once, and `schema` lists them; the tables of each
kind of part are in `drones`, `people`, `takes`, `cameras`, `objective` and `rules`. `contents` puts
everything except the drones onto the map, `strides` adapts the drones' moves so that they can be
flown, and `scenes` makes the scene; `names` has the drones' names for messages. `lighter` changes a
recipe so that planning costs less.
"""

from cocap_opt.scenarios.recipe.example import EXAMPLE
from cocap_opt.scenarios.recipe.scenes import parts, read, site
from cocap_opt.scenarios.recipe.schema import Recipe, decoded, without_limits

__all__ = ["EXAMPLE", "Recipe", "decoded", "parts", "read", "site", "without_limits"]
