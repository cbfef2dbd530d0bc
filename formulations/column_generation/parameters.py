"""The parameters of column generation and branch-and-price: every number that guides the search.

None of them decides whether a bound holds: that is the certificate's, whose tolerances are its own.
They decide how fast bound and plan come near. Rounding guards of a formula stay beside the formula.
The defaults were tuned on the built-in scenes; where one scene decided, its name is given.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

_SHARE = "share"  # the unit of parameters between 0 and 1


def _parameter(default: float | tuple[float, ...], unit: str, meaning: str) -> Any:
    """Returns a field with what its table says."""
    return field(default=default, metadata={"unit": unit, "meaning": meaning})


class _Section:
    """The parameters of one part of the search, checked where they are made."""

    def __post_init__(self) -> None:
        """Raises ValueError, which names the parameter, for a number that makes no sense."""
        for parameter in fields(self):  # type: ignore[arg-type]  # its subclasses are dataclasses
            given, default = getattr(self, parameter.name), parameter.default
            several = given if isinstance(default, tuple) else (given,)
            whole = isinstance(default, int)
            if not isinstance(several, tuple) or not all(
                _is_allowed(number, whole, parameter.metadata["unit"]) for number in several
            ):
                kind = "a whole number" if whole else "a number"
                most = " between 0 and 1" if parameter.metadata["unit"] == _SHARE else " from 0 on"
                raise ValueError(
                    f"{type(self).__name__}.{parameter.name}: {given!r} is not {kind}{most}"
                )


def _is_allowed(number: object, whole: bool, unit: str) -> bool:
    """Returns True for a finite number from 0 on, whole where it has to be, a share up to 1."""
    if isinstance(number, bool) or not isinstance(number, int if whole else int | float):
        return False
    return math.isfinite(number) and 0 <= number <= (1 if unit == _SHARE else math.inf)


@dataclass(frozen=True)
class SearchParameters(_Section):
    """What all nodes share: accuracy, and how often local search responds."""

    exact: float = _parameter(
        2e-8, "of what all robots see alone", "gap that counts as none: no solver is more accurate"
    )
    infeasible: float = _parameter(
        1e-6, "of what all robots see alone", "a bound so far below 0 proves that there is no plan"
    )
    first_responses: int = _parameter(
        2, "responses per robot", "best responses that local search may ask for at first"
    )
    responses_per_class: int = _parameter(
        4, "responses per class", "allowed in every iteration of a relaxation besides half of the "
        "robots; takes about a quarter of its time (field-long 0.2, measured)",
    )  # fmt: skip
    most_states: int = _parameter(
        10_000_000, "states times steps", "up to which states are ruled out: sweeps go through all"
    )
    report_seconds: float = _parameter(
        1.0, "s", "silence after which it is told that the search goes on"
    )


@dataclass(frozen=True)
class RelaxationParameters(_Section):
    """The relaxation of a node: accuracy, rounds of cuts, pricing between multipliers."""

    accuracy: float = _parameter(
        2e-7, "of the bound", "where bound and master agree to this, they have converged"
    )
    worst_accuracy: float = _parameter(1e-5, "of the master's value", "roughest solve of a master")
    broken: float = _parameter(
        1e-6, "robots", "uses in excess of a collision rule that are left alone"
    )
    least_cut: float = _parameter(2e-6, "of the bound", "what an envelope cut must cut off")
    most_cut_rounds: int = _parameter(20, "rounds", "of cuts in a node")
    most_cuts: int = _parameter(300, "cuts", "in a round: those that can cut off most")
    early: float = _parameter(
        0.1, _SHARE, "of what is open: once bound and master are nearer, cuts are looked for "
        "(field-long, seed 0, is at 1.70 % after 25 s, at 2.8 % if cuts have to wait)",
    )  # fmt: skip
    tail: float = _parameter(1e-5, "of the bound", "what a round of cuts must gain for another one")
    tail_open: float = _parameter(0.05, _SHARE, "of what is open, likewise")
    most_penalty_raises: int = _parameter(
        8, "times", "the penalty of broken rules is multiplied by 10"
    )
    smoothing: tuple[float, ...] = _parameter(
        (0.25, 0.5, 0.75), _SHARE, "of the master's multipliers, priced with the best ones for the "
        "rest: they oscillate less (Wentges 1997)",
    )  # fmt: skip
    least_responses: int = _parameter(
        2, "responses per robot", "that must be allowed for plans to be looked for"
    )
    most_idle: int = _parameter(12, "solves", "after which an unused column is dropped")


@dataclass(frozen=True)
class RootParameters(_Section):
    """The root: its first mixture, and what is tried before the tree."""

    enough: float = _parameter(0.003, "of the bound", "to which the first mixture is raised")
    enough_large: float = _parameter(
        0.015, "of the bound", "likewise, where rules come in before there is any master"
    )
    most_raises: int = _parameter(80, "steps", "of the first mixture")
    least_amount: float = _parameter(
        0.01, "of a robot", "from which on a column is in the first master"
    )
    most_disaggregated: int = _parameter(
        20_000_000, "robots x steps x states", "up to which each robot becomes a class of its own"
    )
    least_gain: float = _parameter(
        0.12, _SHARE, "of what is open, that the first cuts of disaggregated robots must close, "
        "times by how much they make the master larger",
    )  # fmt: skip
    few_joint_states: float = _parameter(
        2e7, "joint states of all steps", "up to which step envelopes have stages before any cuts: "
        "half of the time of cuts on the bottleneck, which has fewer",
    )  # fmt: skip
    last_look: int = _parameter(
        10, "iterations' worth of responses", "for plans once the root is solved"
    )
    last_look_far: int = _parameter(
        35, "iterations' worth of responses", "likewise, far from proved: ruling out states needs "
        "a good plan",
    )  # fmt: skip
    many_pairings: int = _parameter(
        5, "robots", "fewer have few pairings, which are soon found (heavy_mixing of Hughes et "
        "al.: 12 of 60 s saved)",
    )  # fmt: skip
    far: float = _parameter(
        0.003, "relative gap", "that no tree closes soon: any gain above `least_gain_far` is taken"
    )
    least_gain_far: float = _parameter(0.02, _SHARE, "of what is open, likewise")


@dataclass(frozen=True)
class LargeRootParameters(_Section):
    """The root of very many robots, without masters: whose turn it is, and moves over known arcs.

    Moves are those of a large neighbourhood search (Shaw 1998).
    """

    many_robot_steps: int = _parameter(
        1500, "robots x steps", "from which on masters take too long: one of field-large's 64 "
        "drones and 40 steps takes six to eight seconds, and gains next to nothing",
    )  # fmt: skip
    first_steps: int = _parameter(
        20, "steps", "of the ascent before any plan: new rows need as many to become worth it"
    )
    most_first_steps: int = _parameter(
        80, "steps", "likewise at most, to leave time for plans where bound and mixture stay apart"
    )
    steps: int = _parameter(5, "steps", "of the ascent in a turn, to settle after rows and cuts")
    turns_per_cuts: int = _parameter(
        3, "turns", "of the ascent for each round of cuts, which takes as long as several"
    )
    nearly: float = _parameter(
        0.004, "of the bound", "bound and mixture must be nearer for cuts: further off, a mixture "
        "breaks cuts that the next one does not",
    )  # fmt: skip
    moves: int = _parameter(
        250, "moves", "of the plan in a turn: all three kinds of work take about as long then"
    )
    patience: float = _parameter(
        1.2, "times", "what is expected of a kind of work grows so after each turn of others"
    )
    least_gain: float = _parameter(
        5e-4, _SHARE, "of what is open, that a turn must gain for more of its kind"
    )
    most_others: int = _parameter(3, "robots", "that are taken out beside the first one")
    most_turns: int = _parameter(20, "turns", "of each robot that answers, in one move")
    neighbours: int = _parameter(4, "robots", "that answer beside those that are taken out")


@dataclass(frozen=True)
class TreeParameters(_Section):
    """The nodes below the root: when they are branched on, and diving."""

    rough: float = _parameter(
        0.1, _SHARE, "of what is open: less is not worth converging to before branching"
    )
    rough_root: float = _parameter(0.02, _SHARE, "likewise, at the root, whose bound holds for all")
    nearly_integral: float = _parameter(
        1e-7, "robots", "amounts that count as integral where nothing else is left to branch on"
    )
    dive_nearly: float = _parameter(
        0.75, "of a robot", "from which on a dive decides that a state is used by one more"
    )
    dive_share: float = _parameter(
        0.15, _SHARE, "of the undecided states, at least, that are decided in a round of a dive"
    )
    most_dive_rounds: int = _parameter(40, "rounds", "of a dive")
    dive_pricings: int = _parameter(2, "pricings", "in each round of a dive")
    dive_responses: int = _parameter(
        10, "iterations' worth of responses", "for the plan that a dive ends with"
    )
    dive_tolerance: float = _parameter(
        1e-3, "robots", "amounts nearer than this to an integer count as integral in a dive"
    )


@dataclass(frozen=True)
class EnvelopeParameters(_Section):
    """Step envelopes: rounds, and how long the search of a step may take."""

    most_states_left: int = _parameter(
        12_000, "states of all steps", "beyond it, searches take too long"
    )
    most_at_a_step: int = _parameter(1_000, "states of a step", "likewise")
    few_states_left: int = _parameter(
        6_500, "states of all steps", "beyond it, lists are faster, where there can be any"
    )
    most_listed_robots: int = _parameter(8, "robots", "searches of more take too long")
    most_rounds: int = _parameter(40, "rounds", "of stages")
    many_nodes: int = _parameter(2_000_000, "nodes", "of a step's search, compiled")
    many_plain_nodes: int = _parameter(50_000, "nodes", "likewise, not compiled: as long")
    few_work: int = _parameter(
        500_000, "nodes x states", "of a search that is worth a try, compiled"
    )
    few_plain_work: int = _parameter(50_000, "nodes x states", "likewise, not compiled")
    few_nodes: int = _parameter(10_000, "nodes", "of such a search at most")
    responses: int = _parameter(10, "iterations' worth of responses", "for plans after each bundle")
    most_corrections: int = _parameter(
        4, "times", "that joint states which only the exact search finds correct a bundle"
    )
    least_round: float = _parameter(
        0.05, _SHARE, "of what is open, that a round must close for another one"
    )
    wide: float = _parameter(
        8.0, "times the first slack", "lists are wide: their rounds take as long as trials for "
        "higher targets, which close more",
    )  # fmt: skip
    least_wide: float = _parameter(
        0.12, _SHARE, "of what is open, that a round of wide lists closes"
    )
    least_listed: float = _parameter(
        0.1, _SHARE, "likewise, for lists that stay as long as they are"
    )


@dataclass(frozen=True)
class ListParameters(_Section):
    """The lists of states that step envelopes are searched among: their lengths and their slack."""

    slack: float = _parameter(1.4, "of what is open per step", "of states that are listed at first")
    of_all_steps: int = _parameter(
        4_000, "states", "on the first lists of all steps (Hughes et al.'s priority_speaker, 60 "
        "steps: 0.06 % are left after a minute; 0.24 % with 100 a step, all with 200)",
    )  # fmt: skip
    fewest_first: int = _parameter(60, "states", "on the first list of a step, at least")
    most_first: int = _parameter(200, "states", "on the first list of a step, at most")
    fewest: int = _parameter(30, "states", "on a later list: the search of fewer is short anyway")
    most: int = _parameter(600, "states", "on a later list: the search of more is hopeless")
    mean: float = _parameter(
        0.6,
        _SHARE,
        "of the most on the first lists: with fewer on the mean, there is time for more",
    )
    long_search: float = _parameter(
        200_000.0, "nodes", "from which on a search is long, and the step's next list is shorter"
    )
    shorter: float = _parameter(
        0.2, "power", "of how many times longer a search was: by so much the next list is shorter"
    )
    not_ended: float = _parameter(20.0, "times a long search", "that one counts as if unfinished")
    short_search: float = _parameter(
        0.1, "times a long search", "up to which the next list may be longer"
    )
    longer: float = _parameter(1.2, "times", "the next list of a step may be longer")
    more_slack: float = _parameter(1.5, "times", "as much slack after a round that closes little")
    more_nodes: float = _parameter(1.7, "times", "as many nodes of a long search, likewise")
    longest_search: float = _parameter(
        2_000_000.0, "nodes", "up to which long searches grow: no search of a step may take more"
    )
    a_little_more_slack: float = _parameter(1.15, "times", "where lists are too short on the whole")
    most_slack: float = _parameter(12.0, "times the first slack", "at most")


@dataclass(frozen=True)
class TrialParameters(_Section):
    """Trials of the paths of all robots together: when they are made, and of how many nodes."""

    fewest_nodes: int = _parameter(
        100_000, "nodes", "of any trial, compiled: a tenth of a second; the bottleneck and the "
        "passage need 16,000 before there are any stages",
    )  # fmt: skip
    fewest_plain_nodes: int = _parameter(5_000, "nodes", "likewise, not compiled")
    more_nodes: float = _parameter(
        2.0, "times", "as many must be allowed for another trial after one that has failed"
    )
    share_of_nodes: float = _parameter(
        0.25, _SHARE, "of what stages took, that all trials may take: most of them are in vain"
    )
    shares: tuple[float, ...] = _parameter(
        (0.75, 0.5, 0.375, 0.25, 0.125, 0.0), _SHARE, "of what is open, by which higher targets "
        "are above the best plan, one after the other",
    )  # fmt: skip
    next_times: int = _parameter(
        10, "times", "as many nodes as the trial before (field, seed 1: it takes about four times)"
    )
    most_nodes: int = _parameter(300_000_000, "nodes", "of a trial for a higher target")
    first_times: int = _parameter(10, "times `fewest_nodes`", "that the first of these may take")


@dataclass(frozen=True)
class BundleParameters(_Section):
    """The bundle method over prices of states (Kiwiel 1990), and its search for joint states."""

    most_iterations: int = _parameter(60, "iterations", "of a bundle")
    most_listed_iterations: int = _parameter(
        14, "iterations", "where only some states are listed: the next round has better lists"
    )
    converged: float = _parameter(0.02, _SHARE, "of what is open: less is not worth an iteration")
    serious: float = _parameter(0.1, _SHARE, "of what the master promises, for a new centre")
    good: float = _parameter(0.3, _SHARE, "of what the master promises, for a longer step")
    first_weight: float = _parameter(
        5.0, "over the mean price", "weight of the distance to the centre at first"
    )
    most_heights: int = _parameter(
        30, "joint states of a step", "in the master: the highest at the centre, and as many of "
        "the latest prices",
    )  # fmt: skip
    known_starts: int = _parameter(6, "starts", "at joint states that are known")
    random_starts: int = _parameter(3, "starts", "that are changed at random")
    highest_starts: int = _parameter(4, "starts", "at the highest ones, where it is compiled")
    many_random_starts: int = _parameter(10, "starts", "changed at random, where it is compiled")


@dataclass(frozen=True)
class RecombinationParameters(_Section):
    """Recombination: the best plan along the states of several plans."""

    first_plans: int = _parameter(
        4, "plans", "at first: on field-long (seed 0) four take 0.1 s, eight 0.5 s, sixteen 4 s"
    )
    more_plans: int = _parameter(2, "times", "as many plans each time")
    most_plans: int = _parameter(64, "plans", "are kept, once there are twice as many")
    most_nodes: int = _parameter(
        3_000_000, "nodes", "of the searches from all joint states, compiled: one or two seconds"
    )
    most_plain_nodes: int = _parameter(10_000, "nodes", "likewise, not compiled")
    less_room: float = _parameter(
        0.7, "times", "what was open when it was too much: then it is tried again, also by trials "
        "of paths; nodes grow tenfold from a room to one twice as large (field, seed 1)",
    )  # fmt: skip


@dataclass(frozen=True)
class RuledAscentParameters(_Section):
    """The ascent of a mixture under collision rules and cuts, for very many robots."""

    least_amount: float = _parameter(
        1e-3, "of a robot or a multiplier", "below which a column or a cut is dropped"
    )
    broken: float = _parameter(
        1e-3, "robots", "uses in excess of a rule that are left alone: as rough as the steps"
    )
    steepness: float = _parameter(
        0.2, "of a robot's reward at a step", "charge of one robot too many at first: a part of "
        "what a conflict can bring, so that rows come to their price in some steps without swings",
    )  # fmt: skip
    least_factor: float = _parameter(
        0.01, "of a column's amount", "that a step leaves, before the power: it must not be lost "
        "where charges have risen too far, before they have fallen",
    )  # fmt: skip
    least_share: float = _parameter(
        1e-9, "of a root's multiplier", "from which on pixels have a multiplier of their own"
    )
    least_cut: float = _parameter(
        1e-6, "of the bound", "what an envelope cut must cut off: half of what masters ask for"
    )
    most_cuts: int = _parameter(
        1500, "cuts", "in a round, those that can cut off most: it must not take minutes"
    )
    again: float = _parameter(
        1.5, "times", "as much to cut off as when no cut was found: then it is looked for again"
    )


@dataclass(frozen=True)
class AscentParameters(_Section):
    """The ascent of the first mixture, without a master: steps by its gradient."""

    power: float = _parameter(
        2.0, "of the gradient", "1 is safe and slow; 3 does not settle under rules (field-large)"
    )
    most_steps: int = _parameter(60, "steps", "in which a mixture is raised between two pricings")
    rough: float = _parameter(
        0.02, _SHARE, "of bound less value: what these steps may leave to gain"
    )
    least_mean: float = _parameter(1e-6, "J", "a robot that gains no more keeps its amounts")
    least_amount: float = _parameter(1e-4, "of a robot", "below which a column is dropped")


@dataclass(frozen=True)
class AlikeCutParameters(_Section):
    """Envelope cuts where many robots of one class share a view sum."""

    breakpoints: int = _parameter(5, "breakpoints", "of a cut at most; certificates allow few")
    first_multisets: int = _parameter(400, "multisets", "of the first program at most")
    most_added: int = _parameter(60, "multisets", "that are added at a time")
    most_rounds: int = _parameter(12, "rounds", "of adding multisets")
    most_growing: int = _parameter(4000, "multisets", "of one size that are gone through")
    nearly: float = _parameter(0.02, _SHARE, "of what a cut can cut off that may be left")
    least_mass: float = _parameter(
        1e-6, "robots", "everywhere, which keeps phi low where there is no mass"
    )


@dataclass(frozen=True)
class LocalSearchParameters(_Section):
    """Local search: roundings of a mixture, best responses, best pairs."""

    draws: int = _parameter(60, "roundings", "at random, of which the best are taken up")
    most_pairs: int = _parameter(250_000, "pairs of states at a step", "for best pairs")
    most_partners: int = _parameter(5, "robots", "with which each is paired")
    perturbed: int = _parameter(3, "robots", "that are planned anew at a time")
    promising: float = _parameter(
        0.01, _SHARE, "of J, up to which a worse local optimum is worth best pairs"
    )
    least_amount: float = _parameter(
        1e-6, "of a robot", "from which on a column of a mixture is used"
    )
    found_amount: float = _parameter(
        0.05, "of a robot", "that the columns of each plan that was found add to a pool"
    )
    most_in_vain: int = _parameter(
        8, "plans", "one after the other, that are improved without a better one"
    )


@dataclass(frozen=True)
class Parameters:
    """All parameters of column generation and branch-and-price; the defaults suit most scenes.

    `dataclasses.replace` changes a section, for instance
    `Parameters(relaxation=RelaxationParameters(most_cuts=100))`.
    """

    search: SearchParameters = SearchParameters()
    relaxation: RelaxationParameters = RelaxationParameters()
    root: RootParameters = RootParameters()
    large_root: LargeRootParameters = LargeRootParameters()
    tree: TreeParameters = TreeParameters()
    envelopes: EnvelopeParameters = EnvelopeParameters()
    lists: ListParameters = ListParameters()
    trials: TrialParameters = TrialParameters()
    bundle: BundleParameters = BundleParameters()
    recombination: RecombinationParameters = RecombinationParameters()
    ruled_ascent: RuledAscentParameters = RuledAscentParameters()
    ascent: AscentParameters = AscentParameters()
    alike_cuts: AlikeCutParameters = AlikeCutParameters()
    local_search: LocalSearchParameters = LocalSearchParameters()

    def rows(self) -> Iterator[tuple[str, str, str, str]]:
        """Yields name, value, unit and meaning of each parameter, as the reference lists them."""
        for part in fields(self):
            section = getattr(self, part.name)
            for parameter in fields(section):
                value = getattr(section, parameter.name)
                told = parameter.metadata
                yield f"{part.name}.{parameter.name}", repr(value), told["unit"], told["meaning"]


DEFAULTS = Parameters()
