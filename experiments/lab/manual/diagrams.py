"""Pictures of the concept pages, drawn from the worked examples.

To add one: a function that returns a figure, and a line in `DIAGRAMS`. Pages show
`pictures/NAME.svg`.
"""

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure

from cocap_opt.experiments.lab.manual.bound_pictures import (
    draw_curves,
    draw_losses,
    draw_parts,
    draw_rounds,
    draw_states_left,
    draw_tangent,
    draw_trade_off,
)
from cocap_opt.experiments.lab.manual.node_pictures import node_picture
from cocap_opt.experiments.lab.manual.scene_pictures import (
    draw_cells_left,
    draw_graph,
    draw_root,
    draw_seen_from,
    draw_shadow,
    draw_trap,
)
from cocap_opt.experiments.lab.manual.tree_pictures import draw_overview, draw_proof_tree, draw_tree

DIAGRAMS: dict[str, Callable[[], Figure]] = {
    "overview": draw_overview,
    "root": draw_root,
    "trap": draw_trap,
    "seen-from": draw_seen_from,
    "shadow": draw_shadow,
    "graph": draw_graph,
    "tree": draw_tree,
    **{f"node-{n}": partial(node_picture, n) for n in range(5)},
    "curves": draw_curves,
    "rounds": draw_rounds,
    "states-left": draw_states_left,
    "cells-left": draw_cells_left,
    "tangent": draw_tangent,
    "parts": draw_parts,
    "proof-tree": draw_proof_tree,
    "losses": draw_losses,
    "trade-off": draw_trade_off,
}
