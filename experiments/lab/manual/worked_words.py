"""The worked examples in words, numbers and tables, as the concept pages insert them."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from cocap_opt.experiments.lab.manual import one_face, worked
from cocap_opt.experiments.lab.manual.recorded_tree import Closed
from cocap_opt.formulations.certificates import Branch
from cocap_opt.formulations.certificates.resources import Cells, Resource
from cocap_opt.output.printing import Record, markdown_table
from cocap_opt.problem import Conflict, SwapConflict, VertexConflict


def number(amount: float) -> str:
    """Returns an amount with two decimals."""
    return f"{amount:,.2f}"


def told_conflict(conflict: Conflict | None) -> str:
    """Describes where two drones meet."""
    if conflict is None:
        return "none"
    if isinstance(conflict, SwapConflict):
        first, second = (f"({cell.x}, {cell.y})" for cell in conflict.cells)
        return f"they swap {first} and {second} after step {conflict.t}"
    assert isinstance(conflict, VertexConflict), "the doorway's rules have no other kind"
    cell = conflict.cells[0]
    return f"both in ({cell.x}, {cell.y}) at step {conflict.t}"


def told_closed(closed: Sequence[Closed]) -> str:
    """Names the cells and moves that constraints forbid drones."""
    return "; ".join(map(_told_closed, closed)) or "none"


def _told_closed(closed: Closed) -> str:
    cells = [f"({cell.x}, {cell.y})" for cell in closed.cells]
    if len(cells) == 1:
        return f"drone {closed.robot} not in {cells[0]} at step {closed.t}"
    return f"drone {closed.robot} not from {cells[0]} to {cells[1]} after step {closed.t}"


def _tree_table() -> str:
    return markdown_table([
        {
            "node": str(n),
            "child of": "" if node.parent is None else str(node.parent),
            "constraints": told_closed(node.closed),
            "J": number(node.value),
            "first conflict": told_conflict(node.conflict),
            "taken from OPEN": "never" if node.turn is None else f"number {node.turn}",
        }
        for n, node in enumerate(worked.doorway_tree())
    ])  # fmt: skip


def _bounds_table() -> str:
    return markdown_table([
        {"bound": f"`{name}`", "tiny-trap": number(trap),
         f"bottleneck, {worked.SHORT} steps": f"{short:,.3f}"}
        for name, (trap, short) in worked.compared()
    ])  # fmt: skip


def _trade_off_table() -> str:
    front = worked.trade_off()
    return markdown_table([
        {
            "views": f"{point.views:g}",
            "of all (%)": f"{100 * front.share(point.views):.1f}",
            "seen by 2 (%)": f"{100 * front.seen(point):.1f}",
            "J": number(point.reward),
            "no plan has more than": number(front.reward_bound(point.views)),
        }
        for point in front.plans
    ])  # fmt: skip


def _certificate_table() -> str:
    parts, rows = worked.doorway_parts(), worked.doorway_multipliers().rows
    steps = parts.faces.reshape(worked.doorway().horizon + 1, -1).sum(axis=1)
    named = [(f"constant of the front at step {t}", v) for t, v in enumerate(steps.tolist()) if v]
    named += [(f"price of {told_resource(row.resource)}", row.multiplier) for row in rows]
    named += [(f"best path of drone {i}", value) for i, value in enumerate(parts.paths)]
    named.append(("**the bound**", parts.total))
    return markdown_table([{"part": words, "amount": f"{amount:.4f}"} for words, amount in named])


def told_resource(resource: Resource) -> str:
    """Names the cells of a row or a decision."""
    assert isinstance(resource, Cells)
    cells = ", ".join(f"({cell.x}, {cell.y})" for cell in resource.cells)
    return f"cell {cells} at step {resource.t}"


def _stages_table() -> str:
    return markdown_table([
        {"": stage.words, "states left": f"{stage.left[1:].sum():,}", "bound": number(stage.bound),
         "joint states reached": f"{sum(stage.reached[1:]):,}" if n else ""}
        for n, stage in enumerate(worked.stages())
    ])  # fmt: skip


def _reached() -> str:
    """Lists how many joint states are reached from the multipliers alone, step by step."""
    return ", ".join(map(str, worked.stages()[1].reached[1:]))


def _parts_table() -> str:
    explained = worked.explained()
    rows = list(explained.parts().items())
    rows.append(("**bound - J**", explained.explanation.gap))
    return markdown_table([
        {"source of the gap": words, "amount": number(amount),
         "% of the bound": f"{100 * explained.explanation.share(amount):.3f}"}
        for words, amount in rows
    ])  # fmt: skip


def _costliest() -> str:
    losses = worked.explained().explanation.losses()
    robot, step = np.unravel_index(int(losses.argmax()), losses.shape)
    share = 100 * worked.explained().explanation.share(float(losses.max()))
    return f"drone {robot}'s move from step {step} costs {share:.2f} % of the bound"


def _second() -> str:
    second = float(np.sort(worked.explained().explanation.losses(), axis=None)[-2])
    return f"{100 * worked.explained().explanation.share(second):.2f} %"


def _replan() -> str:
    best = max(worked.explained().replans, key=lambda replan: replan.gain)
    return (
        f"Replanning drone {best.robot} alone, given all others, raises "
        f"J by {number(best.gain)}, which is "
        f"{100 * best.gain / worked.explained().explanation.gap:.0f} % of the gap."
    )


def _proof_table() -> str:
    rows: list[Record] = []
    leaves = iter(worked.proof().bounds)
    for n, node in enumerate(worked.proof().file.nodes):
        if isinstance(node, Branch):
            told = f"at most {node.robots}: node {node.at_most}; more: node {node.at_least}"
            rows.append({"node": str(n), "content": f"branch, {told}", "bound": ""})
        else:
            rows.append({"node": str(n), "content": "leaf", "bound": number(next(leaves))})
    return markdown_table(rows)


def _curve(name: str) -> str:
    return number(one_face.curves().at(0.75)[name])


WORKED: dict[str, Callable[[], str]] = {
    "doorway_root": lambda: number(worked.doorway_tree()[0].value),
    "doorway_plan": lambda: number(worked.planned(worked.doorway(), "cocap").value),
    "doorway_tree": _tree_table,
    "doorway_made": lambda: str(len(worked.doorway_tree())),
    "doorway_taken": lambda: str(sum(node.turn is not None for node in worked.doorway_tree())),
    "doorway_states": lambda: str(worked.doorway_graph().number_of_nodes()),
    "doorway_moves": lambda: str(worked.doorway_graph().number_of_edges()),
    "doorway_certificate": _certificate_table,
    "doorway_alpha": lambda: f"{worked.doorway_multipliers().alpha[1][0]:.4f}",
    "doorway_beta": lambda: f"{worked.doorway_multipliers().beta[1][0]:.5f}",
    "trap_in_turn": lambda: number(worked.planned(worked.trap(), "sequential").value),
    "trap_best": lambda: number(worked.compared()[-1][1][0]),
    "bounds_compared": _bounds_table,
    "trade_off": _trade_off_table,
    "trade_off_steps": lambda: str(worked.BRIEF),
    "shadow_visible": lambda: f"{100 * one_face.shadow().visible:.0f} %",
    **{f"curve_{name}": partial(_curve, name) for name in ("concave", "least")},
    "middle_step": lambda: str(worked.middle()),
    "rounds_first": lambda: number(worked.bottleneck().progress[0].bound),
    "rounds_last": lambda: number(worked.stages()[0].bound),
    "rounds_columns": lambda: str(worked.bottleneck().progress[-1].columns),
    "stages": _stages_table,
    "stages_bound": lambda: number(worked.stages()[-1].bound),
    "stages_target": lambda: number(worked.in_stages().target),
    "joint_states_left": lambda: f"{worked.stages()[1].joint:,}",
    "joint_states_reached": _reached,
    "gap_bound": lambda: number(worked.bottleneck().bound),
    "gap_reward": lambda: number(worked.bottleneck().plan.value),
    "gap_parts": _parts_table,
    "gap_costliest": _costliest,
    "gap_second": _second,
    "gap_replan": _replan,
    "proof_value": lambda: number(worked.proof().value),
    "proof_bound": lambda: number(worked.proof().file.proved),
    "proof_leaves": lambda: str(len(worked.proof().bounds)),
    "proof_tree": _proof_table,
}
