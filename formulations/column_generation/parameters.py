"""The parameters of column generation and branch-and-price: every number that guides the search.

None of them decides whether a bound holds: that is the certificate's, whose tolerances are its own.
They decide how fast bound and plan come near. Rounding guards of a formula stay beside the formula.
The defaults were tuned on the built-in scenes; where one scene decided, its name is given. Each
docstring gives the units and the meanings that the reference lists.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

from cocap_opt.mixtures.parameters import (
    AscentParameters,
    PlanSearchParameters,
    Section,
    Share,
    Shares,
)


@dataclass(frozen=True)
class SearchParameters(Section):
    """The parameters that all nodes share: accuracy, and the responses of local search.

    Attributes
    ----------
    exact : of what all robots see alone
        gap that counts as none: no solver is more accurate
    infeasible : of what all robots see alone
        a bound so far below 0 proves that there is no plan
    first_responses : responses per robot
        best responses that local search may ask for at first
    responses_per_class : responses per class
        allowed in every iteration of a relaxation besides half of the robots; takes about a
        quarter of its time (field-long 0.2, measured)
    most_states : states times steps
        up to which states are ruled out: sweeps go through all
    report_seconds : s
        silence after which a message says that the search goes on
    """

    exact: float = 2e-8
    infeasible: float = 1e-6
    first_responses: int = 2
    responses_per_class: int = 4
    most_states: int = 10_000_000
    report_seconds: float = 1.0


@dataclass(frozen=True)
class RelaxationParameters(Section):
    """The relaxation of a node: accuracy, rounds of cuts, pricing between multipliers.

    Attributes
    ----------
    accuracy : of the bound
        where bound and master agree to this, they have converged
    worst_accuracy : of the master's value
        roughest solve of a master
    broken : robots
        uses in excess of a collision rule that are left alone
    least_cut : of the bound
        what an envelope cut must cut off
    most_cut_rounds : rounds
        of cuts in a node
    most_cuts : cuts
        in a round: those that can cut off most
    early : share
        of what is open: once bound and master are nearer, cuts are looked for (field-long,
        seed 0, is at 1.70 % after 25 s, at 2.8 % if cuts have to wait)
    tail : of the bound
        what a round of cuts must gain for another one
    tail_open : share
        of what is open, likewise
    most_penalty_raises : times
        the penalty of broken rules is multiplied by 10
    smoothing : share
        of the master's multipliers, priced with the best ones for the rest: they oscillate
        less (Wentges 1997)
    least_responses : responses per robot
        that must be allowed for plans to be looked for
    most_idle : solves
        after which an unused column is dropped
    few_in_vain : plans
        that a quick search for plans takes up without a better one
    """

    accuracy: float = 2e-7
    worst_accuracy: float = 1e-5
    broken: float = 1e-6
    least_cut: float = 2e-6
    most_cut_rounds: int = 20
    most_cuts: int = 300
    early: Share = 0.1
    tail: float = 1e-5
    tail_open: Share = 0.05
    most_penalty_raises: int = 8
    smoothing: Shares = (0.25, 0.5, 0.75)
    least_responses: int = 2
    most_idle: int = 12
    few_in_vain: int = 2


@dataclass(frozen=True)
class RootParameters(Section):
    """The root: its first mixture, and what is tried before the tree.

    Attributes
    ----------
    enough : of the bound
        to which the first mixture is raised
    enough_large : of the bound
        likewise, where rules come in before there is any master
    most_raises : steps
        of the first mixture
    patience : steps
        over which the gap of the first mixture must shrink by `least_closed`
    least_closed : share
        of that gap
    less_open : share
        of the gap when the paths of better plans were last tried, up to which they are tried again
    least_amount : of a robot
        from which on a column is in the first master
    most_disaggregated : robots x steps x states
        up to which each robot becomes a class of its own
    least_gain : share
        of what is open, that the first cuts of disaggregated robots must close, times by
        how much they make the master larger
    at_once : of the bound
        what is open, up to which paths are tried before there is a master
    many_states : states of all classes
        from which on that is done
    few_joint_states : joint states of all steps
        up to which step envelopes have stages before any cuts: half of the time of cuts on
        the bottleneck, which has fewer
    far : relative gap
        that no tree closes soon: any gain above `least_gain_far` is taken
    least_gain_far : share
        of what is open, likewise
    """

    enough: float = 0.003
    enough_large: float = 0.015
    most_raises: int = 80
    patience: int = 8
    least_closed: Share = 0.05
    less_open: Share = 0.6
    least_amount: float = 0.01
    most_disaggregated: int = 20_000_000
    least_gain: Share = 0.12
    at_once: Share = 0.003
    many_states: int = 1000
    few_joint_states: float = 2e7
    far: float = 0.003
    least_gain_far: Share = 0.02


@dataclass(frozen=True)
class LargeRootParameters(Section):
    """The root of very many robots, without masters: whose turn it is, and moves over known arcs.

    Moves are those of a large neighbourhood search (Shaw 1998).

    Attributes
    ----------
    many_robot_steps : robots x steps
        from which on masters take too long: one of field-large's 64 drones and 40 steps
        takes six to eight seconds, and gains next to nothing
    first_steps : steps
        of the ascent before any plan: new rows need as many to become worth it
    most_first_steps : steps
        likewise at most, to leave time for plans where bound and mixture stay apart
    steps : steps
        of the ascent in a turn, to settle after rows and cuts
    turns_per_cuts : turns
        of the ascent for each round of cuts, which takes as long as several
    nearly : of the bound
        bound and mixture must be nearer for cuts: further off, a mixture breaks cuts that
        the next one does not
    moves : moves
        of the plan in a turn: all three kinds of work take about as long then
    patience : times
        what is expected of a kind of work grows so after each turn of others
    least_gain : share
        of what is open, that a turn must gain for more of its kind
    most_others : robots
        that are taken out beside the first one
    most_turns : turns
        of each robot that answers, in one move
    neighbours : robots
        that answer beside those that are taken out
    """

    many_robot_steps: int = 1500
    first_steps: int = 20
    most_first_steps: int = 80
    steps: int = 5
    turns_per_cuts: int = 3
    nearly: float = 0.004
    moves: int = 250
    patience: float = 1.2
    least_gain: Share = 5e-4
    most_others: int = 3
    most_turns: int = 20
    neighbours: int = 4


@dataclass(frozen=True)
class TreeParameters(Section):
    """The nodes below the root: when they are branched on, and diving.

    Attributes
    ----------
    rough : share
        of what is open: less is not worth converging to before branching
    rough_root : share
        likewise, at the root, whose bound holds for all
    nearly_integral : robots
        amounts that count as integral where nothing else is left to branch on
    dive_nearly : of a robot
        from which on a dive decides that a state is used by one more
    dive_share : share
        of the undecided states, at least, that are decided in a round of a dive
    most_dive_rounds : rounds
        of a dive
    dive_pricings : pricings
        in each round of a dive
    dive_responses : iterations' worth of responses
        for the plan that a dive ends with
    dive_tolerance : robots
        amounts nearer than this to an integer count as integral in a dive
    """

    rough: Share = 0.1
    rough_root: Share = 0.02
    nearly_integral: float = 1e-7
    dive_nearly: float = 0.75
    dive_share: Share = 0.15
    most_dive_rounds: int = 40
    dive_pricings: int = 2
    dive_responses: int = 10
    dive_tolerance: float = 1e-3


@dataclass(frozen=True)
class EnvelopeParameters(Section):
    """Step envelopes: rounds, and how long the search of a step may take.

    Attributes
    ----------
    few_states_left : states of all steps
        up to which all have prices; beyond it, lists close more in the same time
    most_states_left : states of all steps
        likewise, once a round of lists has closed little
    most_states_of_few : states of all steps
        up to which all have prices, of few robots: a tenth of a millisecond each to search
    few_robots : robots
        of teams that are few
    most_unlisted : states of all steps
        likewise, of teams too large for lists, whose searches take longer
    most_at_a_step : states of a step
        beyond it, its search takes too long
    most_listed_robots : robots
        searches of more take too long
    most_rounds : rounds
        of stages
    many_nodes : nodes
        of a step's search, compiled
    many_plain_nodes : nodes
        likewise, not compiled: as long
    few_work : nodes x states
        of a search that is worth a try, compiled
    few_plain_work : nodes x states
        likewise, not compiled
    few_nodes : nodes
        of such a search at most
    first_nodes : nodes
        of a search of a step that is tried first; longer ones wait for what it closes
    next_times : times
        the nodes of before, for searches that have not ended
    patience : searches
        that may fail before all have more nodes: most need about as many
    most_in_vain : nodes
        of such searches, up to which more may fail
    nodes_of_stage : nodes
        of searches after which better prices of some steps are a stage of their own
    least_of_stage : share
        of the room above the target, that such a stage closes at least
    responses : iterations' worth of responses
        for plans after each bundle
    most_corrections : times
        that joint states which only the exact search finds correct a bundle
    least_round : share
        of what is open, that a round must close for another one
    wide : times the first slack
        lists are wide: their rounds take as long as trials for higher targets, which close
        more
    least_wide : share
        of what is open, that a round of wide lists closes
    least_listed : share
        likewise, for lists that stay as long as they are
    """

    few_states_left: int = 6_500
    most_states_left: int = 50_000
    most_states_of_few: int = 200_000
    few_robots: int = 4
    most_unlisted: int = 12_000
    most_at_a_step: int = 3_000
    most_listed_robots: int = 8
    most_rounds: int = 40
    many_nodes: int = 300_000
    many_plain_nodes: int = 5_000
    few_work: int = 100_000
    few_plain_work: int = 10_000
    few_nodes: int = 2_000
    first_nodes: int = 1_000
    next_times: int = 3
    patience: int = 2
    most_in_vain: int = 40_000
    nodes_of_stage: int = 2_000
    least_of_stage: Share = 0.03
    responses: int = 10
    most_corrections: int = 4
    least_round: Share = 0.12
    wide: float = 8.0
    least_wide: Share = 0.12
    least_listed: Share = 0.2


@dataclass(frozen=True)
class ListParameters(Section):
    """The lists of states that step envelopes are searched among: their lengths and their slack.

    Attributes
    ----------
    slack : of what is open per step
        of states that are listed at first
    of_all_steps : states
        on the first lists of all steps
    fewest_first : states
        on the first list of a step, at least
    most_first : states
        on the first list of a step, at most: with 200 a step, searches and their checks take
        two to four times the nodes on field (seeds 0, 3, 5, 6), and proofs longer
    fewest : states
        on a later list: the search of fewer is short anyway
    most : states
        on a later list: the search of more is hopeless
    mean : share
        of the most on the first lists: with fewer on the mean, there is time for more
    long_search : nodes
        from which on a search is long, and the step's next list is shorter
    shorter : power
        of how many times longer a search was: by so much the next list is shorter
    not_ended : times a long search
        that one counts as if unfinished
    short_search : times a long search
        up to which the next list may be longer
    longer : times
        the next list of a step may be longer
    more_slack : times
        as much slack after a round that closes little
    more_nodes : times
        as many nodes of a long search, likewise
    longest_search : nodes
        up to which long searches grow: no search of a step may take more
    a_little_more_slack : times
        where lists are too short on the whole
    most_slack : times the first slack
        at most
    """

    slack: float = 1.4
    of_all_steps: int = 2_000
    fewest_first: int = 60
    most_first: int = 100
    fewest: int = 30
    most: int = 600
    mean: Share = 0.6
    long_search: float = 200_000.0
    shorter: float = 0.2
    not_ended: float = 20.0
    short_search: float = 0.1
    longer: float = 1.2
    more_slack: float = 1.5
    more_nodes: float = 1.7
    longest_search: float = 2_000_000.0
    a_little_more_slack: float = 1.15
    most_slack: float = 12.0


@dataclass(frozen=True)
class TrialParameters(Section):
    """Trials of the paths of all robots together: when they are made, and of how many nodes.

    Attributes
    ----------
    fewest_nodes : nodes
        of any trial, compiled: a tenth of a second; the bottleneck and the passage need
        16,000 before there are any stages
    fewest_plain_nodes : nodes
        likewise, not compiled
    more_nodes : times
        as many must be allowed for another trial after one that has failed
    times_nodes : times
        what stages took, that all trials may take, compiled: a hundred of their nodes take as long
        as one of a step's search among a thousand states
    plain_times_nodes : times
        likewise, not compiled, when nodes of both take about as long
    less : share
        of what was open, by which each higher target is less than the one before: of 5 % less
        a trial takes 1.6 to 5 times as many nodes (field, seed 1, without and with views)
    most_less : share
        by which it is less at most, however fast the trials before were
    aimed_times : times
        the nodes of the trial before that the next one should take
    next_times : times
        as many nodes as the trial before may be taken
    most_nodes : nodes
        of a trial for a higher target
    first_times : times `fewest_nodes`
        that the first of these may take
    """

    fewest_nodes: int = 100_000
    fewest_plain_nodes: int = 5_000
    more_nodes: float = 2.0
    times_nodes: float = 10.0
    plain_times_nodes: float = 0.25
    less: Share = 0.05
    most_less: Share = 0.25
    aimed_times: float = 4.0
    next_times: int = 8
    most_nodes: int = 300_000_000
    first_times: int = 10


@dataclass(frozen=True)
class BundleParameters(Section):
    """The bundle method over prices of states (Kiwiel 1990), and its search for joint states.

    Attributes
    ----------
    most_iterations : iterations
        of a bundle
    most_listed_iterations : iterations
        where only some states are listed: the next round has better lists
    converged : share
        of what is open: less is not worth an iteration
    serious : share
        of what the master promises, for a new centre
    good : share
        of what the master promises, for a longer step
    first_weight : over the mean price
        weight of the distance to the centre at first
    most_heights : joint states of a step
        in the master: the highest at the centre, and as many of the latest prices
    known_starts : starts
        at joint states that are known
    random_starts : starts
        that are changed at random
    highest_starts : starts
        at the highest ones, where it is compiled
    many_random_starts : starts
        changed at random, where it is compiled
    few_robots : robots
        of teams whose local searches mostly end at the same joint states, so that compiled
        ones need not try all states
    full_starts : starts
        at the highest joint states, from which such a team's robots may take all states
    high_states : states of a class
        that they may take from other starts: those that were highest before
    """

    most_iterations: int = 60
    most_listed_iterations: int = 14
    converged: Share = 0.02
    serious: Share = 0.1
    good: Share = 0.3
    first_weight: float = 5.0
    most_heights: int = 30
    known_starts: int = 6
    random_starts: int = 3
    highest_starts: int = 4
    many_random_starts: int = 10
    few_robots: int = 5
    full_starts: int = 2
    high_states: int = 64


@dataclass(frozen=True)
class RecombinationParameters(Section):
    """Recombination: the best plan along the states of several plans.

    Attributes
    ----------
    first_plans : plans
        at first: on field-long (seed 0) four take 0.1 s, eight 0.5 s, sixteen 4 s
    more_plans : times
        as many plans each time
    most_plans : plans
        are kept, once there are twice as many
    most_nodes : nodes
        of the searches from all joint states, compiled: one or two seconds
    most_plain_nodes : nodes
        likewise, not compiled
    less_room : times
        what was open when it was too much: then it is tried again, also by trials of paths;
        nodes grow tenfold from a room to one twice as large (field, seed 1)
    """

    first_plans: int = 4
    more_plans: int = 2
    most_plans: int = 64
    most_nodes: int = 3_000_000
    most_plain_nodes: int = 10_000
    less_room: float = 0.7


@dataclass(frozen=True)
class RuledAscentParameters(Section):
    """The ascent of a mixture under collision rules and cuts, for very many robots.

    Attributes
    ----------
    least_amount : of a robot or a multiplier
        below which a column or a cut is dropped
    broken : robots
        uses in excess of a rule that are left alone: as rough as the steps
    steepness : of a robot's reward at a step
        charge of one robot too many at first: a part of what a conflict can bring, so that
        rows come to their price in some steps without swings
    least_factor : of a column's amount
        that a step leaves, before the power: it must not be lost where charges have risen
        too far, before they have fallen
    least_share : of a root's multiplier
        from which on pixels have a multiplier of their own
    least_cut : of the bound
        what an envelope cut must cut off: half of what masters ask for
    most_cuts : cuts
        in a round, those that can cut off most: it must not take minutes
    again : times
        as much to cut off as when no cut was found: then it is looked for again
    """

    least_amount: float = 1e-3
    broken: float = 1e-3
    steepness: float = 0.2
    least_factor: float = 0.01
    least_share: float = 1e-9
    least_cut: float = 1e-6
    most_cuts: int = 1500
    again: float = 1.5


@dataclass(frozen=True)
class AlikeCutParameters(Section):
    """Envelope cuts where many robots of one class share a view sum.

    Attributes
    ----------
    breakpoints : breakpoints
        of a cut at most; certificates allow few
    first_multisets : multisets
        of the first program at most
    most_added : multisets
        that are added at a time
    most_rounds : rounds
        of adding multisets
    most_growing : multisets
        of one size that are gone through
    nearly : share
        of what a cut can cut off that may be left
    least_mass : robots
        everywhere, which keeps phi low where there is no mass
    """

    breakpoints: int = 5
    first_multisets: int = 400
    most_added: int = 60
    most_rounds: int = 12
    most_growing: int = 4000
    nearly: Share = 0.02
    least_mass: float = 1e-6


@dataclass(frozen=True)
class LocalSearchParameters(Section):
    """Local search: roundings of a mixture and best responses.

    Attributes
    ----------
    draws : roundings
        at random, of which the best are taken up
    perturbed : robots
        that are planned anew at a time
    least_amount : of a robot
        from which on a column of a mixture is used
    found_amount : of a robot
        that the columns of each plan that was found add to a pool
    most_in_vain : plans
        one after the other, that are improved without a better one
    """

    draws: int = 60
    perturbed: int = 3
    least_amount: float = 1e-6
    found_amount: float = 0.05
    most_in_vain: int = 8


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
    ascent: AscentParameters = field(default_factory=AscentParameters)
    alike_cuts: AlikeCutParameters = AlikeCutParameters()
    local_search: LocalSearchParameters = LocalSearchParameters()
    plan_search: PlanSearchParameters = field(
        default_factory=lambda: PlanSearchParameters(responses=10, most_in_vain=6)
    )

    def rows(self) -> Iterator[tuple[str, str, str, str]]:
        """Yields name, value, unit and meaning of each parameter, as the reference lists them."""
        for part in fields(self):
            section = getattr(self, part.name)
            for name, (unit, meaning) in section.told().items():
                yield f"{part.name}.{name}", repr(getattr(section, name)), unit, meaning


DEFAULTS = Parameters()
