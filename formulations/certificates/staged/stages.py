"""Prices staged certificates: bounds of multipliers that stages lower.

A stage replaces prices and constants, and then closes states (see the inequalities in `narrowing`).
At the end, the remaining joint paths of all robots may be explored (`joint_paths`): those of plans
above the target, or above a higher value. They begin at the start, or at a step in the middle
(`middle_paths`).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from cocap_opt.formulations.certificates.format import (
    CertificateError,
    MoveConstant,
    Stage,
    Staged,
    StepConstant,
    Tail,
    UnfinishedError,
)
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.formulations.certificates.resources import Visit
from cocap_opt.formulations.certificates.staged.joint_paths import may_be_used
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.middle_paths import (
    best_plan_from,
    may_begin_later,
)
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.profitable_moves import most_profitable_move
from cocap_opt.formulations.certificates.staged.search import NotEndedError, most_profitable
from cocap_opt.formulations.certificates.staged.tails import Tails, first_tail
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never

# states of a step; with more, the table of conflicts and the search are too large
MOST_STATES = 3000
MOST_NODES = 100_000_000  # nodes of all searches of a file: take a quarter of an hour
LARGEST_PRICE = 1e50  # its square is finite


def price_staged(
    model: Model,
    certificate: Staged,
    stop: Stop = never,
    progress: Callable[[int, int], None] = lambda done, total: None,
    plain: bool = False,
) -> Pricing:
    """Returns the bound that a staged certificate proves.

    Parameters
    ----------
    progress : called with the number of finished searches of steps, and the total
    plain : True: use no compiled code, which takes about twenty times as long

    Raises
    ------
    CertificateError
        If a number is out of range, or a state does not exist.
    UnfinishedError
        If the searches take too long.
    LimitReached
        If a limit is reached.
    """
    above, middle = certificate.paths_above, certificate.paths_from
    _check_paths(model, above, middle)
    _check_tails(model, certificate)
    narrowing = Narrowing.of(model, certificate.multipliers, certificate.target, stop).closed()
    total = sum(len(stage.constants) + len(stage.moves) for stage in certificate.stages)
    total += len(certificate.tails)
    searches = _Searches(MOST_NODES, total, stop, progress, plain)
    for n, stage in enumerate(certificate.stages):
        stop.check()
        narrowing = searches.after(stage, narrowing, f"certificate.stages[{n}]")
    if certificate.tails:
        return searches.priced_tails(certificate.tails, narrowing)
    nodes = MOST_NODES - searches.nodes_left
    if above is None:
        return narrowing.pricing._replace(nodes=nodes)
    higher = narrowing.above(above)
    try:
        best = best_plan_from(higher, middle or 0, searches.nodes_left, stop, plain)
        # Paths above a higher value bound J by no less than that value; stages may prove less.
        lowest = min(best.pricing, narrowing.pricing, key=lambda pricing: pricing.bound)
        return lowest._replace(nodes=nodes + best.nodes)
    except NotEndedError as error:
        raise UnfinishedError(
            "certificate.paths_above: not verified: too many joint states remain to explore; "
            "the claim may still hold"
        ) from error


def _check_paths(model: Model, above: float | None, middle: int | None) -> None:
    """Raises CertificateError if a file's paths_above or paths_from is not allowed."""
    if above is not None and not may_be_used(model):
        raise CertificateError(
            "certificate.paths_above: not allowed if moves are rewarded or views do not "
            "count at step 1"
        )
    if middle is None:
        return
    if above is None:
        raise CertificateError("certificate.paths_from: not allowed without paths_above")
    if not may_begin_later(model):
        raise CertificateError("certificate.paths_from: not allowed if starts are free")
    last = model.problem.horizon
    if not 1 <= middle <= last:
        raise CertificateError(f"certificate.paths_from: must be 1..{last}, not {middle}")


def _check_tails(model: Model, certificate: Staged) -> None:
    """Raises CertificateError if a file's tails are not allowed."""
    if not certificate.tails:
        return
    if not may_be_used(model):
        raise CertificateError(
            "certificate.tails: not allowed if moves are rewarded or views do not count at step 1"
        )
    if certificate.paths_above is not None:
        raise CertificateError("certificate.tails: not allowed together with paths_above")
    first, last = first_tail(model), model.problem.horizon
    for k, tail in enumerate(certificate.tails):
        if not first <= tail.t <= last:
            raise CertificateError(
                f"certificate.tails[{k}].t: must be {first}..{last}, not {tail.t}"
            )
        _check_amount(model, tail.loss, f"certificate.tails[{k}].loss")


@dataclass
class _Searches:
    """The searches of a file, which share a limit on the number of nodes.

    Attributes
    ----------
    nodes_left : remaining number of nodes
    total : number of searches
    progress : called with the number of finished searches, and the total
    done : number of finished searches
    """

    nodes_left: int
    total: int
    stop: Stop
    progress: Callable[[int, int], None]
    plain: bool
    done: int = 0

    def after(self, stage: Stage, narrowing: Narrowing, field: str) -> Narrowing:
        """Checks a stage and returns the narrowing after it."""
        _check(narrowing.model, stage, field)

        def most_profit(k: int, joint: JointStates) -> float:
            return self._most_profit(joint, stage.constants[k], f"{field}.constants[{k}]")

        def most_profit_of_moves(k: int, narrowing: Narrowing) -> float:
            return self._most_profit_of_moves(narrowing, stage.moves[k], f"{field}.moves[{k}]")

        return narrowing.after(stage, most_profit, most_profit_of_moves, field, MOST_STATES)

    def priced_tails(self, claims: Sequence[Tail], narrowing: Narrowing) -> Pricing:
        """Returns the bound that losses of tails prove; each is the claim, or less if that is too
        high.
        """
        tails = Tails.of(narrowing)
        for k, claim in enumerate(claims):
            with self._searched(f"certificate.tails[{k}]"):
                found = tails.least_loss(
                    claim.t, claim.loss, self.nodes_left, self.stop, self.plain
                )
                self.nodes_left -= found.nodes
            tails = tails.longer(claim.t, found.loss)
        return tails.pricing._replace(nodes=MOST_NODES - self.nodes_left)

    def _most_profit(self, joint: JointStates, claim: StepConstant, field: str) -> float:
        """Returns the largest profit of joint states, or the claimed constant if it is larger."""
        with self._searched(field):
            found = most_profitable(joint, claim.constant, self.nodes_left, self.stop, self.plain)
            self.nodes_left -= found.nodes
        return found.profit

    def _most_profit_of_moves(self, narrowing: Narrowing, claim: MoveConstant, field: str) -> float:
        """Returns the largest profit of moves, or the claimed constant if it is larger."""
        with self._searched(field):
            searches = MoveSearches(self.nodes_left, self.plain)
            found = most_profitable_move(narrowing, claim.t, claim.constant, searches, self.stop)
            self.nodes_left = searches.nodes_left
        return found

    @contextmanager
    def _searched(self, field: str) -> Iterator[None]:
        """Counts a search, and reports one that does not end.

        Parameters
        ----------
        field : name of the claim in its file, for the message
        """
        self.stop.check()
        try:
            yield
        except NotEndedError as error:
            raise UnfinishedError(
                f"{field}: not verified: the searches of the file take more than {MOST_NODES:,} "
                "nodes in total, or find too many joint states; the claim may still hold"
            ) from error
        self.done += 1
        self.progress(self.done, self.total)


def _check(model: Model, stage: Stage, field: str) -> None:
    """Rejects steps, classes and states that do not exist, and values that are not finite."""
    for k, step in enumerate(stage.prices):
        name = f"{field}.payments[{k}]"
        _check_step(model, step.t, name)
        if not 0 <= step.class_number < len(model.classes):
            raise CertificateError(
                f"{name}.robot_class: must be 0..{len(model.classes) - 1}, not {step.class_number}"
            )
        if len(step.prices) != len(step.states):
            raise CertificateError(f"{name}.payments: must hold a number for each state")
        if not all(abs(price) <= LARGEST_PRICE for price in step.prices):
            raise CertificateError(
                f"{name}.payments: must be -{LARGEST_PRICE:g}..{LARGEST_PRICE:g}"
            )
        if not abs(step.others) <= LARGEST_PRICE:
            raise CertificateError(f"{name}.others: must be finite")
        for state in step.states:
            if wrong := Visit(step.t, state, step.class_number).why_absent(model):
                raise CertificateError(f"{name}.{wrong}")
    for k, claim in enumerate(stage.constants):
        _check_step(model, claim.t, f"{field}.constants[{k}]")
        _check_amount(model, claim.constant, f"{field}.constants[{k}].constant")
    for k, move in enumerate(stage.moves):
        _check_step(model, move.t, f"{field}.moves[{k}]", model.problem.horizon - 1)
        _check_amount(model, move.constant, f"{field}.moves[{k}].constant")


def _check_amount(model: Model, amount: float, field: str) -> None:
    """Rejects an amount of J that is not finite."""
    if not abs(amount) <= LARGEST_PRICE * len(model.problem.robots):
        raise CertificateError(f"{field}: must be finite")


def _check_step(model: Model, t: int, field: str, last: int | None = None) -> None:
    """Rejects a step at which no view counts, or one after the last that is allowed."""
    first, last = model.problem.first_step, model.problem.horizon if last is None else last
    if not first <= t <= last:
        raise CertificateError(f"{field}.t: must be {first}..{last}, not {t}")
