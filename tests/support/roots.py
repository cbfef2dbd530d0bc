"""A root of column generation from which tests of its later stages begin."""

from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.model import compiled
from cocap_opt.scenarios import load_scene


def solved_root() -> Root:
    """The root of the bottleneck before its cuts, with a plan."""
    root = Root.of(Search(compiled(load_scene("bottleneck", 0).replace(horizon=6))), OPTIMALITY)
    for column in root.search.alone.columns:
        root.relaxation.master.add(column)
    root.relaxation.solve(root.cutoff, until_cuts=True)
    root.relaxation.round_to_plans()
    return root
