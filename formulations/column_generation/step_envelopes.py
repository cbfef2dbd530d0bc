"""Step envelopes: the second stage of the root, after its relaxation.

Each face of a step has a concave envelope of its own in the relaxation; what is left open is
mostly that the faces of one step want different pairings of the robots. One envelope over all faces
of a step closes that: robots are paid for states, not for pixels, and a step's constant is the
height of its highest joint state (`certificates.staged`, `certificates.joint_states`).

Rounds of three: the constants of the present payments are lowered by search; states that no better
plan visits are closed; and a bundle method (`step_master`) finds better payments. Joint states are
looked for by local search, and only once that finds none above the constants, by the exact one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import (
    BestPlan,
    CertificateFile,
    JointStates,
    Narrowing,
    NotEndedError,
    Stage,
    Staged,
    StepConstant,
    StepPayments,
    Wanted,
    best_plan,
    compiled_search,
    may_be_used,
)
from cocap_opt.formulations.column_generation.incumbent import Incumbent
from cocap_opt.formulations.column_generation.joint_ascent import ascended, greedy
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_master import (
    KnownArc,
    KnownHeight,
    Place,
    StepMaster,
)
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Model, Path

METHOD = "step-envelopes"
MOST_STATES = 10_000_000  # of all steps and classes, which sweeps go through
MOST_STATES_LEFT = 12_000  # over all steps: beyond it, searches take too long
MOST_AT_A_STEP = 1_000
MOST_ROUNDS = 12
FEW_NODES, MANY_NODES = 2_000, 2_000_000  # of a step's search, with old and with new payments
PLAIN_NODES = 50_000  # of a search that is not compiled
FEW_TRIED, MANY_TRIED = 20_000, 200_000  # pairs of joint states
MOST_ITERATIONS = 60  # of the bundle method
CONVERGED = 0.02  # of what is open: less is not worth another iteration
LEAST_ROUND = 0.05  # of what is open, that a round must close for another one
SERIOUS, GOOD = 0.1, 0.3  # of what the master promises: for a new centre, and a longer step
FIRST_STEP = 50.0  # the centre's weight at first: this times less than 1 / a mean payment
KNOWN_STARTS, RANDOM_STARTS = 6, 3  # of local searches of one step
CLEARLY = 1e-9  # of the bound: what counts as higher

JointKey = tuple[tuple[int, int], ...]  # class and state number of each robot, sorted


def step_envelopes(search: Search, duals: Duals, cutoff: Callable[[], float]) -> None:
    """Offers the search a staged certificate of a lower bound, if it finds one.

    Parameters
    ----------
    search : with an incumbent, whose J is the target; without one nothing is done
    duals : of the relaxation without decisions
    cutoff : bound at which nothing is open

    Raises
    ------
    LimitReached
        At a limit; what is proved until then is offered.
    """
    model = search.model
    if search.incumbent is None or model.problem.objective.over_time:
        return
    states = sum(robot_class.graph.n_states for robot_class in model.classes)
    if states * (model.problem.horizon + 1) > MOST_STATES:
        return
    envelopes = _Envelopes(search, Narrowing(model, duals.certificate(model), search.value), duals)
    try:
        envelopes.run(cutoff)
    finally:
        if envelopes.stages:
            search.offer_spare(envelopes.file())


@dataclass
class _Envelopes:
    """The stages so far, and what is known of joint states and paths.

    Attributes
    ----------
    known : by step, the joint states that were found
    paths : class numbers and paths that were found
    tried : the best of all joint states that are left, where all were tried
    """

    search: Search
    narrowing: Narrowing
    duals: Duals
    stages: list[Stage] = field(default_factory=list)
    known: dict[int, dict[JointKey, None]] = field(default_factory=dict)
    paths: dict[tuple[int, Path], None] = field(default_factory=dict)
    tried: BestPlan | None = None

    @property
    def model(self) -> Model:
        """The model of the search."""
        return self.search.model

    @property
    def steps(self) -> range:
        """The steps at which views count."""
        return range(self.model.problem.first_step, self.model.problem.horizon + 1)

    def run(self, cutoff: Callable[[], float]) -> None:
        """Adds stages as long as they close something; raises LimitReached."""
        narrowing = self.narrowing
        narrowing.close_states()
        self._note_incumbent()
        for _ in range(MOST_ROUNDS):
            before = narrowing.pricing.bound
            open_ = before - cutoff()
            if open_ <= 0 or not self._is_small():
                return
            self._lower()
            if narrowing.pricing.bound <= cutoff() or self._tried_all(FEW_NODES, FEW_TRIED):
                return
            self._pay(cutoff)
            if before - narrowing.pricing.bound < LEAST_ROUND * open_:
                break
        if narrowing.pricing.bound > cutoff():
            self._tried_all(MANY_NODES if compiled_search.is_there() else PLAIN_NODES, MANY_TRIED)

    def _tried_all(self, most_nodes: int, most_tried: int) -> bool:
        """Tries all sequences of joint states that are left; False if there are too many."""
        if not may_be_used(self.model):
            return False
        try:
            best = best_plan(self.narrowing, most_nodes, most_tried, self.search.stop)
        except NotEndedError:
            return False
        if best.paths:
            self.search.offer(Incumbent.along(self.model, best.paths))
        self.tried = best
        return True

    def _note_incumbent(self) -> None:
        """Remembers the paths and the joint states of the incumbent."""
        incumbent = self.search.incumbent
        assert incumbent is not None
        numbers = [column.along.class_number for column in incumbent.columns]
        for number, path in zip(numbers, incumbent.paths, strict=True):
            self.paths[number, path] = None
        for t in self.steps:
            at = ((number, path[t]) for number, path in zip(numbers, incumbent.paths, strict=True))
            self.known[t] = {tuple(sorted(at)): None}

    def file(self) -> CertificateFile:
        """Returns the certificate of the stages so far."""
        model, narrowing = self.model, self.narrowing
        pricing = (
            narrowing.pricing if self.tried is None else narrowing.pricing_of(self.tried.value)
        )
        return CertificateFile(
            scene=model.problem.name,
            digest=problem_digest(model.problem),
            method=METHOD,
            classes="single" if model.is_disaggregated else "alike",
            bound=pricing.bound,
            certificate=Staged(
                self.duals.certificate(model),
                narrowing.target,
                tuple(self.stages),
                joint_paths=self.tried is not None,
            ),
        )

    def _is_small(self) -> bool:
        """Returns True if the searches of the steps may end."""
        left = self.narrowing.states_left[self.model.problem.first_step :]
        return int(left.sum()) <= MOST_STATES_LEFT and int(left.max()) <= MOST_AT_A_STEP

    # -- constants -------------------------------------------------------------------------

    def _lower(self) -> None:
        """Lowers the constants of the present payments, where that takes few nodes."""
        constants = []
        for t in self.steps:
            joint, before = self.narrowing.joint_states(t), float(self.narrowing.constants[t])
            least = self._highest_known(t, joint)
            try:
                found = self.narrowing.lower(t, Wanted(least, FEW_NODES), self.search.stop)
            except NotEndedError:
                continue
            self._note(t, joint, found.positions)
            if self.narrowing.constants[t] < before:
                constants.append(StepConstant(t, found.height))
        self._close(Stage(constants=tuple(constants)))

    def _close(self, stage: Stage) -> None:
        """Ends a stage, and reports it."""
        self.narrowing.close_states()
        self.stages.append(stage)
        search = self.search
        search.report(search.snapshot(self.narrowing.pricing.bound))

    def _note(self, t: int, joint: JointStates, positions: Sequence[int]) -> bool:
        """Remembers a joint state; returns True if it is new."""
        if not positions:
            return False
        key = tuple(sorted((int(joint.class_of[k]), int(joint.states[k])) for k in positions))
        own = self.known.setdefault(t, {})
        is_new = key not in own
        own[key] = None
        return is_new

    def _known(self, t: int, joint: JointStates) -> list[list[int]]:
        """Returns the positions of the joint states that are known and still count."""
        at = {
            (int(c), int(s)): k
            for k, (c, s) in enumerate(zip(joint.class_of, joint.states, strict=True))
        }
        found = [
            [at[one] for one in key] for key in self.known.get(t, {}) if all(o in at for o in key)
        ]
        return [positions for positions in found if joint.counts(positions)]

    def _highest_known(self, t: int, joint: JointStates) -> float:
        """Returns the largest height that local search finds, from the joint states known."""
        return max((joint.height(found) for found in self._ascended(t, joint)), default=-np.inf)

    # -- local search ----------------------------------------------------------------------

    def _ascended(self, t: int, joint: JointStates) -> list[tuple[int, ...]]:
        """Returns joint states that count and that no robot can raise alone."""
        rng, robots = self.search.rng, sum(joint.sizes)
        known = self._known(t, joint)
        rng.shuffle(known)
        starts: list[Sequence[int]] = [*known[:KNOWN_STARTS]]
        if first := greedy(joint):
            starts.append(first)
        for start in starts[:RANDOM_STARTS]:
            changed = list(start)
            for k in rng.integers(robots, size=robots // 2 + 1).tolist():
                same = np.flatnonzero(joint.class_of == joint.class_of[changed[k]])
                changed[k] = int(rng.choice(same))
            starts.append(changed)
        found = dict.fromkeys(ascended(joint, start) for start in starts)
        return [positions for positions in found if positions and joint.counts(positions)]

    # -- payments --------------------------------------------------------------------------

    def _pay(self, cutoff: Callable[[], float]) -> None:
        """Finds better payments and their constants, and adds them as a stage."""
        bundle = _Bundle(self, {t: self.narrowing.joint_states(t) for t in self.steps})
        payments = bundle.run(cutoff)
        if payments is None:
            return
        heights = {}
        most_nodes = MANY_NODES if compiled_search.is_there() else PLAIN_NODES
        for t, joint in sorted(bundle.joints.items(), key=lambda item: len(item[1].states)):
            paid = replace(joint, payment=payments[bundle.span(t)])
            least = self._highest_known(t, paid)
            try:
                found = paid.highest(Wanted(least, most_nodes), self.search.stop)
            except NotEndedError:
                continue
            self._note(t, joint, found.positions)
            heights[t] = found.height
        self._adopt(bundle, payments, heights)

    def _adopt(self, bundle: "_Bundle", payments: FloatArray, heights: dict[int, float]) -> None:
        """Makes payments a stage where they are better; steps without a height keep theirs."""
        chosen = bundle.centre.copy()
        for t in heights:
            chosen[bundle.span(t)] = payments[bundle.span(t)]
        constants = self.narrowing.constants
        total = sum(heights[t] if t in heights else float(constants[t]) for t in self.steps)
        total += bundle.rest + bundle.best_paths(chosen)[0]
        if not heights or total >= self.narrowing.bound:
            return
        written = [part for t in heights for part in bundle.written(t, payments[bundle.span(t)])]
        stage = Stage(tuple(written), tuple(StepConstant(t, heights[t]) for t in heights))
        for part in stage.payments:
            self.narrowing.pay(part)
        self.narrowing.price()
        for step in stage.constants:
            margin = self.narrowing.joint_states(step.t).margin
            self.narrowing.constants[step.t] = step.constant + margin
        self._close(stage)


class _Bundle:
    """The bundle method over the payments of the states that are left.

    Attributes
    ----------
    joints : of each step, the joint states that are left
    centre : [n] the payments of all their states, step by step
    rest : what the bound has beside the steps' constants and the paths
    """

    def __init__(self, envelopes: _Envelopes, joints: dict[int, JointStates]) -> None:
        self._envelopes, self.joints = envelopes, joints
        narrowing = self._narrowing = envelopes.narrowing
        self._model, self._stop = envelopes.model, envelopes.search.stop
        ends = np.cumsum([0, *(len(joint.states) for joint in joints.values())]).tolist()
        self._spans = {t: slice(a, b) for t, a, b in zip(joints, ends[:-1], ends[1:], strict=True)}
        self.centre = np.concatenate([joint.payment for joint in joints.values()])
        self._paid: dict[Place, int] = {
            (int(c), t, int(s)): self._spans[t].start + k
            for t, joint in joints.items()
            for k, (c, s) in enumerate(zip(joint.class_of, joint.states, strict=True))
        }
        self._bonuses = Bonuses.of(self._model.problem.objective)
        self._unpaid = [
            np.where(left, rewards, -np.inf)
            for left, rewards in zip(narrowing.left, narrowing.rewards, strict=True)
        ]
        steps = sum(float(narrowing.constants[t]) for t in joints)
        self.rest = narrowing.bound - steps - self.best_paths(self.centre)[0]
        self._starts: dict[Place, int] = {}
        for number, robot_class in enumerate(self._model.classes):
            for start in robot_class.starts:
                place = (number, 0, start)
                self._starts[place] = self._starts.get(place, 0) + 1

    def span(self, t: int) -> slice:
        """Returns the positions of a step's payments."""
        return self._spans[t]

    def run(self, cutoff: Callable[[], float]) -> FloatArray | None:
        """Returns better payments, as far as local search can tell; None if there are none."""
        envelopes, best, payments = self._envelopes, np.inf, None
        centre, rho = self.centre, FIRST_STEP / max(float(np.abs(self.centre).mean()), 1e-9) / 10
        for iteration in range(MOST_ITERATIONS):
            self._stop.check()
            arcs, heights = self._arcs(), self._heights()
            if {height.t for height in heights} != set(self.joints):
                return None  # at some step no joint state is known that counts
            solved = StepMaster.solve(
                centre, rho, self._paid, self._unpaid_of(arcs), self._starts, arcs, heights,
                self._stop,
            )  # fmt: skip
            value, new = self._judged(solved)
            promised = best - solved.value - self.rest
            if value < best - CLEARLY * abs(value) and (
                best == np.inf or best - value >= SERIOUS * promised
            ):
                rho /= 3 if best < np.inf and best - value > GOOD * promised else 1
                best, centre, payments = value, solved.payments, solved.payments
            elif iteration % 4 == 3:
                rho *= 1.5
            open_ = self._narrowing.bound - cutoff()
            if not new or best - cutoff() < CONVERGED * open_:
                break
            if best - solved.value - self.rest < CONVERGED * open_:
                break
            envelopes.search.report(envelopes.search.snapshot(self._narrowing.pricing.bound))
        return payments if best < self._narrowing.bound else None

    def _judged(self, solved: StepMaster) -> tuple[float, int]:
        """Returns the bound of payments as far as local search can tell, and what is new."""
        envelopes, new = self._envelopes, 0
        total, paths = self.best_paths(solved.payments)
        for path in paths:
            new += path not in envelopes.paths
            envelopes.paths[path] = None
        for t, joint in self.joints.items():
            paid = replace(joint, payment=solved.payments[self._spans[t]])
            highest = solved.constants[t]
            for found in envelopes._ascended(t, paid):
                if (height := paid.height(found)) > solved.constants[t] + CLEARLY * abs(total):
                    new += envelopes._note(t, joint, found)
                    highest = max(highest, height)
            total += highest
        return total + self.rest, new

    def best_paths(self, payments: FloatArray) -> tuple[float, list[tuple[int, Path]]]:
        """Returns what the best paths are worth together, and the paths with their classes."""
        total, paths = 0.0, []
        for number, robot_class in enumerate(self._model.classes):
            reward = self._unpaid[number].copy()
            for t, joint in self.joints.items():
                own = joint.class_of == number
                reward[t, joint.states[own]] = payments[self._spans[t]][own]
            charges = self._narrowing.charges(number)
            value = backward_sweep(
                robot_class.graph, reward, self._bonuses, charges, robot_class.goal, self._stop
            )
            for start in robot_class.starts:
                total += float(value[0, start])
                path = best_path(robot_class.graph, value, start, self._bonuses, charges)
                if path is not None:
                    paths.append((number, tuple(path)))
        return total, paths

    def _arcs(self) -> list[KnownArc]:
        """Returns the arcs of the known paths that visit only states that are left."""
        found: dict[tuple[Place, Place], KnownArc] = {}
        for number, path in self._envelopes.paths:
            left, graph = self._narrowing.left[number], self._model.classes[number].graph
            if not all(left[t, state] for t, state in enumerate(path)):
                continue
            charges, n_places = self._narrowing.charges(number), graph.n_places
            for t in range(len(path) - 1):
                tail, head = path[t], path[t + 1]
                ends = (number, t, tail), (number, t + 1, head)
                if ends in found:
                    continue
                gain = float(self._bonuses.of_edges(graph.shape, tail, np.array([head]))[0])
                gain -= charges.moves.get((t, tail % n_places, head % n_places), 0.0)
                gain -= charges.places.get((t + 1, head % n_places), 0.0)
                gain -= charges.states.get((t + 1, head), 0.0)
                if t == 0:
                    gain -= charges.places.get((0, tail % n_places), 0.0)
                    gain -= charges.states.get((0, tail), 0.0)
                found[ends] = KnownArc(*ends, gain)
        return list(found.values())

    def _unpaid_of(self, arcs: list[KnownArc]) -> dict[Place, float]:
        """Returns the rewards of the states on arcs that have no payment."""
        places = {place for arc in arcs for place in (arc.tail, arc.head)}
        return {
            place: float(self._unpaid[place[0]][place[1], place[2]])
            for place in places
            if place not in self._paid
        }

    def _heights(self) -> list[KnownHeight]:
        """Returns the joint states that are known and count."""
        return [
            KnownHeight(
                t,
                tuple(self._spans[t].start + k for k in positions),
                joint.worth(positions),
            )
            for t, joint in self.joints.items()
            for positions in self._envelopes._known(t, joint)
        ]

    def written(self, t: int, payments: FloatArray) -> list[StepPayments]:
        """Returns the payments of a step as they stand in a certificate, class by class."""
        joint = self.joints[t]
        parts = []
        for number in np.unique(joint.class_of).tolist():
            own = joint.class_of == number
            graph = self._model.classes[number].graph
            states = tuple(graph.state(int(state)) for state in joint.states[own])
            parts.append(StepPayments(t, number, states, tuple(payments[own].tolist())))
        return parts
