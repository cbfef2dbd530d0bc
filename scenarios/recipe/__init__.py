"""Reader of recipes: scenes of a map, meshes, people whom others tracked, and drones.

The file is TOML. Files are named relative to its folder; lengths are in metres, angles in
degrees, times in seconds. `example` has every table once, and `schema` says which there are; the
tables of one kind of part are in `drones`, `people`, `takes`, `cameras`, `objective` and `rules`.
`contents` puts onto the map all but the drones, which `strides` makes able to fly their moves, and
`scenes` makes the scene; `names` has the drones' names for messages. `lighter` changes a recipe to
what costs less to plan.
"""

from cocap_opt.scenarios.recipe.example import EXAMPLE
from cocap_opt.scenarios.recipe.scenes import parts, read, site
from cocap_opt.scenarios.recipe.schema import Recipe, decoded, without_limits

__all__ = ["EXAMPLE", "Recipe", "decoded", "parts", "read", "site", "without_limits"]
