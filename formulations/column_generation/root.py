"""The root of the search: the relaxation without decisions."""

from dataclasses import replace

import numpy as np

from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.column_generation.master import Master
from cocap_opt.formulations.column_generation.relaxation import Relaxation
from cocap_opt.formulations.column_generation.search import (
    Search,
    column_in,
    cutoff_of,
    incumbent_in,
)
from cocap_opt.stop import Limit

MOST_APART = 20_000_000  # robots x steps x states up to which robots may be apart
APART_GAIN = 0.12  # of what is open, that the first cuts of robots apart must close, times by
# how much they make the master larger
FAR = 0.003  # gap that no tree closes soon: any gain is welcome, if it is more than
APART_GAIN_FAR = 0.02  # of what is open


def root_relaxation(search: Search) -> Relaxation:
    """The relaxation without decisions, with its first columns."""
    best = search.alone()
    # Twice what all robots can see is more than a broken rule can mostly bring.
    master = Master(search.model, penalty=2 * search.scale)
    for column in search.first_columns():
        master.add(column)
    for column in best.columns:
        master.add(column)
    return Relaxation(search, master, best)


def aggregated_root(search: Search, gap: float, rough: float = 0.0) -> Relaxation:
    """The relaxation without decisions, solved, with the classes of robots as they are."""
    root = root_relaxation(search)
    if root.best.bound > -np.inf:
        root.solve(lambda: cutoff_of(search, gap), rough)
    return root


def solved_root(search: Search, gap: float, rough: float = 0.0) -> Relaxation:
    """The relaxation without decisions, solved; with every robot apart where that is tighter.

    Robots apart need more columns and larger masters. Whether that pays is tried with one
    round of cuts: where robots start side by side they are as good as exchangeable.

    Parameters
    ----------
    gap, rough : as in `cutoff_of` and `Relaxation.solve`
    """
    root = aggregated_root(search, gap, rough)
    if root.limit is not Limit.NONE or not _may_pay_apart(root, gap):
        return root
    root.look_for_plans()
    other = apart(root)
    own = other.search
    before = root.best.bound
    other.solve(lambda: cutoff_of(own, gap), rough, rounds=1)
    if other.limit is Limit.NONE:
        open_ = before - cutoff_of(own, gap)
        larger = len(other.master.arcs) / len(root.master.arcs)
        share = APART_GAIN * larger if open_ < FAR * before else APART_GAIN_FAR
        if before - other.best.bound < share * open_:
            if own.incumbent is not None:
                search.offer(incumbent_in(search.model, own.incumbent))
            return root
        other.solve(lambda: cutoff_of(own, gap), rough)
    return other


def _may_pay_apart(root: Relaxation, gap: float) -> bool:
    """Whether the root is still open, its robots are not apart yet, and they are not too many."""
    model = root.search.model
    states = sum(
        len(robot_class.robots) * robot_class.graph.n_states for robot_class in model.classes
    )
    return (
        root.best.bound > cutoff_of(root.search, gap)
        and root.search.incumbent is not None
        and len(model.classes) < len(model.problem.robots)
        and states * (model.problem.horizon + 1) <= MOST_APART
    )


def apart(relaxation: Relaxation) -> Relaxation:
    """The same relaxation with every robot as a class of its own: its envelopes are lower."""
    model, old = relaxation.search.model, relaxation.master
    search = relaxation.search.apart()

    def own(cut: Cut) -> Cut:
        curves = {
            robot: cut.curves[number]
            for number, robot_class in enumerate(model.classes) if number in cut.curves
            for robot in robot_class.robots
        }  # fmt: skip
        return Cut(cut.view_sum, dict(sorted(curves.items())), cut.constant)

    duals = relaxation.best.duals
    cuts = {id(cut): own(cut) for cut in (*old.cuts, *(cut for cut, _ in duals.cuts))}
    master = Master(search.model, old.penalty)
    used = [] if relaxation.solution is None else relaxation.solution.columns
    incumbent = () if search.incumbent is None else search.incumbent.columns
    for column in (*used, *incumbent, *old.used_columns(2)):
        master.add(column_in(search.model, column))
    for resource in old.rows:
        master.add_row(resource)
    for cut in old.cuts:
        master.add_cut(cuts[id(cut)])
    duals = replace(duals, cuts=tuple((cuts[id(cut)], share) for cut, share in duals.cuts))
    best = relaxation.best._replace(duals=duals)
    return Relaxation(search, master, best, iterations=relaxation.iterations)
