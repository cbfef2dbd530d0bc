"""Column generation: the relaxation solved over the paths that matter.

Restricted master (`master`) and pricing (`pricing`) take turns. Every iteration's multipliers
are a certificate; conflict rows and envelope cuts are added when a mixture breaks them; every
mixture is a source of plans (`primal`).
"""

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cocap_opt.model import Model, compiled
from cocap_opt.plan import Plan
from cocap_opt.problem import FloatArray, Problem
from cocap_opt.result import Reason, relative_gap
from cocap_opt.reward import group_weights, largest_roots, no_pixels
from cocap_opt.stop import Limit, Stop, never, seconds_left
from formulations import envelope
from formulations.certificate import CertificateFile, Decision, certify
from formulations.duals import Duals, blended
from formulations.envelope import Cut, Seen
from formulations.master import BEST_ACCURACY, Arc, Column, Master, Solution, make_column
from formulations.pricing import Priced, Pricer
from formulations.primal import Incumbent, best_response, improved, incumbent_of, kicked
from formulations.proof import ProofFile
from formulations.resources import broken_rules, flight_of
from formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    Snapshot,
    only_start,
    silent,
    usable_start,
)

METHOD = "column-generation"
ACCURACY = 2e-7  # of the bound: where bound and master agree to this, they have converged
EXACT = 2e-8  # of what all robots see alone: no solver is more accurate than that
INFEASIBLE = 1e-6  # of what all robots see alone: a bound so far below 0 proves it
BROKEN = 1e-6  # uses of a resource in excess of the rule that are left alone
LEAST_CUT = 2e-6  # of the bound: what an envelope cut must cut off
MOST_CUT_ROUNDS = 20
TAIL = 1e-5  # of the bound: what a round of cuts must gain for another one
TAIL_OPEN = 0.05  # of what is open to the cutoff, likewise
MOST_PENALTY_RAISES = 8
SMOOTHING = (0.25, 0.5, 0.75)
WORST_ACCURACY = 1e-5  # of the master
KICK = 4  # iterations after which the incumbent is kicked, in masters of at most
MANY_ARCS = 2000
FIRST_PLAN = 8  # iterations, and twice as many each time, after which plans are looked for
MOST_APART = 20_000_000  # robots x steps x states up to which robots may be apart
APART_GAIN = 0.12  # of what is open, that the first round of cuts of robots apart must close
# for every time that it makes the master larger
FAR = 0.005  # gap that no tree closes soon: any gain is welcome, if it is more than
APART_GAIN_FAR = 0.02  # of what is open
MOST_IDLE = 12  # solves after which an unused column is dropped


@dataclass
class Search:
    """What the relaxations of all nodes of a search share.

    Attributes
    ----------
    incumbent : the best plan so far
    report : told about every iteration
    """

    model: Model
    stop: Stop = never
    report: Report = silent
    begin: float = field(default_factory=time.perf_counter)
    incumbent: Incumbent | None = None
    columns: int = 0  # generated in all

    def __post_init__(self) -> None:
        """Compile what pricing needs."""
        self.pricer = Pricer(self.model)
        self.rng = np.random.default_rng(0)
        self.largest = largest_roots(self.model)
        self.weights = group_weights(self.model.problem)
        alone = self.alone().bound
        self.scale = alone if 0 < alone < np.inf else 1.0

    @property
    def value(self) -> float:
        """J of the incumbent; -inf without one."""
        return -np.inf if self.incumbent is None else self.incumbent.value

    def offer(self, candidate: Incumbent | None) -> None:
        """Take a better plan in."""
        if candidate is not None and candidate.value > self.value:
            self.incumbent = candidate

    def snapshot(self, bound: float, nodes: int = 0) -> Snapshot:
        """How far the search is."""
        seconds = time.perf_counter() - self.begin
        return Snapshot(self.value, bound, seconds, self.columns, nodes)

    def alone(self) -> Priced:
        """The multipliers, and their worth, of the bound in which every robot is alone."""
        zeros = no_pixels(self.model.problem)
        return self.pricer(Duals(zeros + 1.0, zeros))

    def first_columns(self) -> list[Column]:
        """Each robot's best path given the earlier ones: with the rules, and ignoring them."""
        robots = range(len(self.model.problem.robots))
        self.offer(self.hovering())
        obeying: list[Column] = []
        for robot in robots:
            if self.stop() is not Limit.NONE:
                break
            answer = best_response(self.model, robot, obeying)
            if answer is None:
                break
            obeying.append(answer)
        if len(obeying) == len(robots):
            self.offer(incumbent_of(self.model, obeying))
        return [*obeying, *(() if self.incumbent is None else self.incumbent.columns)]

    def apart(self) -> "Search":
        """The same search with every robot as a class of its own."""
        model = self.model.apart()
        other = Search(model, self.stop, self.report, self.begin, columns=self.columns)
        if self.incumbent is not None:
            other.incumbent = _incumbent_of_model(model, self.incumbent)
        return other

    def kick(self, arcs: Collection[Arc]) -> None:
        """Offer what local search makes of the incumbent after some robots are planned anew."""
        if self.incumbent is not None:
            self.offer(kicked(self.model, self.incumbent, arcs, self.rng, self.stop))

    def hovering(self) -> Incumbent | None:
        """The plan in which nobody moves: starts obey all rules. None where a goal is elsewhere."""
        problem, model = self.model.problem, self.model
        if any(r.goal not in (None, (r.start.x, r.start.y)) for r in problem.robots):
            return None
        stay = [(model.start(i),) * (problem.horizon + 1) for i in range(len(problem.robots))]
        return incumbent_of(model, [make_column(model, i, path) for i, path in enumerate(stay)])


@dataclass
class Relaxation:
    """The relaxation under some decisions: a node of the search.

    Attributes
    ----------
    best : the best bound so far with its multipliers
    solution : the last mixture
    limit : what stopped it; NONE where it has converged or is cut off
    """

    search: Search
    master: Master
    best: Priced
    decisions: tuple[Decision, ...] = ()
    solution: Solution | None = None
    limit: Limit = Limit.NONE
    iterations: int = 0
    cut_rounds: int = 0

    def solve(
        self,
        cutoff: Callable[[], float],
        rough: float = 0.0,
        others: float = -np.inf,
        nodes: int = 0,
        rounds: int = MOST_CUT_ROUNDS,
    ) -> None:
        """Solve and price in turn until the bound is at most the cutoff, or has converged.

        Parameters
        ----------
        cutoff : bound from which on the node is of no interest; it may rise meanwhile
        rough : share of what is open to the cutoff that convergence may leave
        others, nodes : largest bound of the other nodes and how many have been solved, for
            the report
        rounds : most rounds of cuts
        """
        search, raises, before = self.search, 0, np.inf
        while self.best.bound > cutoff():
            self.limit = search.stop()
            if self.limit is not Limit.NONE:
                return
            self.iterations += 1
            open_ = self.best.bound - cutoff()
            least = rough * open_ if np.isfinite(open_) else 0.0
            wanted = max(ACCURACY * abs(self.best.bound), least)
            accuracy = min(max(wanted / 10 / search.scale, BEST_ACCURACY), WORST_ACCURACY)
            solution = self.solution = self.master.solve(seconds_left(search.stop), accuracy)
            priced = search.pricer(solution.duals, self.decisions)
            improves = priced.bound < self.best.bound
            # Half way to the best multipliers so far (Wentges 1997): they oscillate less.
            best = self.best.duals
            between = [
                search.pricer(blended(solution.duals, best, share), self.decisions)
                for share in SMOOTHING
            ]
            self.best = min(self.best, priced, *between, key=lambda some: some.bound)
            columns = [column for some in (priced, *between) for column in some.columns]
            priced = priced._replace(columns=columns)
            if self.iterations >= FIRST_PLAN and self.iterations & (self.iterations - 1) == 0:
                self.look_for_plans()
            elif self.iterations >= FIRST_PLAN:
                large = len(self.master.arcs) > MANY_ARCS  # kicks are cheap beside its solves
                if large or self.iterations % KICK == 0:
                    search.kick(self.master.arcs)
            search.report(search.snapshot(max(self.best.bound, others), nodes))
            open_gap = self.best.bound - solution.value
            changed = self._add(priced, solution, open_gap > wanted)
            if changed:
                continue
            if not solution.solved and not improves:
                self.limit = search.stop()
                self.limit = self.limit if self.limit is not Limit.NONE else Limit.NUMERICS
                return
            if solution.slack > BROKEN * 10:
                # Rows are still paid for: either there is no plan or the penalty is too low.
                if raises == MOST_PENALTY_RAISES:
                    self.limit = Limit.NUMERICS
                    return
                self.master.penalty *= 10
                raises += 1
                continue
            gain = before - self.best.bound
            before = self.best.bound
            tailing = gain < max(TAIL * abs(before), TAIL_OPEN * min(open_, abs(before)))
            if (tailing and self.cut_rounds) or self.cut_rounds >= rounds:
                return
            self.cut_rounds += 1
            if not self._add_cuts(solution):
                return

    def look_for_plans(self) -> None:
        """Offer what rounding and local search make of the last mixture."""
        search, solution = self.search, self.solution
        if solution is not None:
            search.offer(
                improved(
                    search.model, solution.columns, solution.mixture, self.master.arcs, search.stop
                )
            )

    def _add(self, priced: Priced, solution: Solution, columns_too: bool) -> bool:
        """Take in broken conflict rows and new columns; False if there are none."""
        pairs = zip(solution.columns, solution.mixture.tolist(), strict=True)
        flights = [(column.flight, amount) for column, amount in pairs if amount > 1e-9]
        broken = broken_rules(self.search.model, flights, BROKEN)
        new = [self.master.add_row(resource) for resource in broken]
        if columns_too or any(new):
            # The longer it takes, the longer arcs are kept: else the same ones come and go.
            self.master.drop_idle(MOST_IDLE + self.iterations // 8)
            added = sum(self.master.add(column) for column in priced.columns)
            self.search.columns += added
            return any(new) or added > 0
        return False

    def _add_cuts(self, solution: Solution) -> bool:
        """Take in the envelope cuts that the mixture breaks; False if there are none."""
        search, found = self.search, 0
        sizes = tuple(len(group.robots) for group in search.model.classes)
        if search.model.problem.objective.over_time:  # a robot sees a group more than once
            return False
        self.master.drop_cuts(solution.duals)
        known: dict[int, list[Cut]] = {}
        for cut in self.master.cuts:
            known.setdefault(cut.group, []).append(cut)
        for group, seen in seen_in(solution.columns, solution.mixture):
            weight = float(search.weights[group])
            if weight == 0 or search.stop() is not Limit.NONE:
                continue
            height = min(
                float(np.sqrt(seen.amounts @ seen.roots**2)), float(seen.amounts @ seen.roots)
            )
            height = min([height, *(seen.height(cut) for cut in known.get(group, []))])
            least = LEAST_CUT * abs(self.best.bound) / weight
            if seen.is_exact(sizes) or height - envelope.coupled(seen, sizes) < least:
                continue
            largest = search.largest[:, group]
            best = envelope.best_cut(group, seen, largest, sizes, height, least)
            if best is not None:
                self.master.add_cut(best[0])
                found += 1
        return found > 0


def seen_in(columns: Sequence[Column], mixture: FloatArray) -> list[tuple[int, Seen]]:
    """Groups that a mixture sees, and what it sees of them."""
    used = np.flatnonzero(mixture > 1e-7).tolist()
    groups = np.concatenate([np.zeros(0, dtype=np.int64), *(columns[n].groups for n in used)])
    if not len(groups):
        return []
    roots = np.sqrt(np.concatenate([columns[n].pixels for n in used]))
    counts = [len(columns[n].groups) for n in used]
    amounts = np.repeat(mixture[used], counts)
    classes = np.repeat([columns[n].flight.robots for n in used], counts)
    order = np.argsort(groups, kind="stable")
    distinct, first = np.unique(groups[order], return_index=True)
    parts = np.split(order, first[1:])
    return [
        (g, Seen(classes[p], roots[p], amounts[p]))
        for g, p in zip(distinct.tolist(), parts, strict=True)
    ]


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


def apart(relaxation: Relaxation) -> Relaxation:
    """The same relaxation with every robot as a class of its own: its envelopes are lower."""
    model, old = relaxation.search.model, relaxation.master
    search = relaxation.search.apart()

    def own(cut: Cut) -> Cut:
        curves = {
            robot: cut.curves[number]
            for number, group in enumerate(model.classes) if number in cut.curves
            for robot in group.robots
        }  # fmt: skip
        return Cut(cut.group, dict(sorted(curves.items())), cut.constant)

    cuts = {id(cut): own(cut) for cut, _ in relaxation.best.duals.cuts}
    cuts |= {id(cut): own(cut) for cut in old.cuts if id(cut) not in cuts}
    master = Master(search.model, old.penalty)
    used = [] if relaxation.solution is None else relaxation.solution.columns
    incumbent = () if search.incumbent is None else search.incumbent.columns
    for column in (*used, *incumbent, *old.used_columns(2)):
        master.add(_of_model(search.model, column))
    for resource in old.rows:
        master.add_row(resource)
    for cut in old.cuts:
        master.add_cut(cuts[id(cut)])
    duals = relaxation.best.duals
    duals = replace(duals, cuts=tuple((cuts[id(cut)], share) for cut, share in duals.cuts))
    best = relaxation.best._replace(duals=duals)
    return Relaxation(search, master, best, iterations=relaxation.iterations)


def _incumbent_of_model(model: Model, incumbent: Incumbent) -> Incumbent:
    """A plan by another model's classes."""
    columns = tuple(_of_model(model, column) for column in incumbent.columns)
    return Incumbent(incumbent.value, columns)


def _of_model(model: Model, column: Column) -> Column:
    """A column with its flight by another model's classes."""
    return column._replace(flight=flight_of(model, column.robot, column.path))


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
                search.offer(_incumbent_of_model(search.model, own.incumbent))
            return root
        other.solve(lambda: cutoff_of(own, gap), rough)
    return other


def _may_pay_apart(root: Relaxation, gap: float) -> bool:
    """Whether the root is still open, its robots are not apart yet, and they are not too many."""
    model = root.search.model
    states = sum(len(group.robots) * group.graph.n_states for group in model.classes)
    return (
        root.best.bound > cutoff_of(root.search, gap)
        and root.search.incumbent is not None
        and len(model.classes) < len(model.problem.robots)
        and states * (model.problem.horizon + 1) <= MOST_APART
    )


def cutoff_of(search: Search, gap: float) -> float:
    """Bound at which a node is of no more interest: it holds no better plan, or none at all.

    J >= 0, so that a bound clearly below 0 proves that there is no plan.
    """
    if search.incumbent is None:
        return -INFEASIBLE * search.scale
    return search.value + max(gap * search.value, EXACT / 2 * search.scale)


def use_start(search: Search, start: Plan | None) -> str:
    """Begin with a plan; returns why it is rejected, if it is."""
    plan, message = usable_start(search.model.problem, start)
    if plan is not None:
        paths = search.model.paths(plan)
        columns = [make_column(search.model, i, path) for i, path in enumerate(paths)]
        search.offer(incumbent_of(search.model, columns))
    return message


def column_generation(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    make_root: Callable[[Search, float], Relaxation] = solved_root,
) -> CertifiedResult:
    """Bound of the relaxation with all cuts at the root, and the best plan found on the way.

    Parameters
    ----------
    make_root : solves the relaxation to a relative gap

    Returns
    -------
    CertifiedResult
        The best certificate found, also where a limit stopped it. A negative bound proves
        that there is no plan, since J >= 0.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    limit = model.prepare_all(stop)
    if limit is not Limit.NONE:
        return only_start(problem, start, limit, time.perf_counter() - begin)
    search = Search(model, stop, report, begin)
    message = use_start(search, start)
    root = make_root(search, OPTIMALITY / 2)
    search, model = root.search, root.search.model
    if root.limit is Limit.NONE:
        root.look_for_plans()
    file = certify(problem, model, METHOD, root.best.duals.certificate(model))
    return result_of(search, file, root.limit, OPTIMALITY, message, {
        "iterations": root.iterations, "columns": search.columns,
        "rows": len(root.master.rows), "cuts": len(root.master.cuts),
    })  # fmt: skip


def result_of(
    search: Search,
    file: CertificateFile | ProofFile,
    limit: Limit,
    gap: float,
    message: str,
    statistics: Mapping[str, float],
) -> CertifiedResult:
    """The result of a search: its plan, and the bound that a file proves."""
    reason = Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED
    reached = relative_gap(search.value, file.proved)
    if reached <= OPTIMALITY or file.proved - search.value <= EXACT * search.scale:
        reason, limit = Reason.OPTIMAL, Limit.NONE
    elif file.proved < 0:  # J >= 0
        reason, limit = Reason.INFEASIBLE, Limit.NONE
    elif reached <= gap:
        reason, limit = Reason.FINISHED, Limit.NONE
    plan = None if search.incumbent is None else search.model.plan(search.incumbent.paths)
    return CertifiedResult(
        plan,
        search.value,
        reason,
        limit,
        file.proved,
        time.perf_counter() - search.begin,
        message,
        statistics,
        file,
    )
