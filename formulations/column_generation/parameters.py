"""The parameters of column generation and branch-and-price: every number that guides the search.

None of them affects whether a bound is valid: that depends on the certificate, which has its own
tolerances. They determine how fast bound and plan converge. Rounding guards of a formula stay
beside the formula. The defaults were tuned on the built-in scenes; if one scene was decisive, its
name is given. Each docstring gives the units and the meanings that the reference lists.
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
        gap that counts as 0, as no solver is more accurate
    infeasible : of what all robots see alone
        a bound this far below 0 proves that there is no plan
    first_responses : responses per robot
        largest number of best responses in the first local search
    responses_per_class : responses per class
        allowed in each iteration of a relaxation, in addition to half the number of robots; a
        quarter of the time (field-long 0.2, measured)
    most_states : states times steps
        largest problem in which states are ruled out, as that takes sweeps over all of them
    report_seconds : s
        longest silence before a message reports that the search is still running
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
        difference of bound and master below which both have converged
    worst_accuracy : of the master's value
        accuracy of the roughest solve of a master
    broken : robots
        uses above the limit of a collision rule that are tolerated
    least_cut : of the bound
        smallest violation for an envelope cut to be added
    most_cut_rounds : rounds
        largest number of rounds of cuts in a node
    most_cuts : cuts
        largest number of cuts in a round, the most violated first
    early : share
        gap between bound and master at which cuts are added before convergence, as a share of what
        is open (field-long, seed 0, is at 1.70 % after 25 s, at 2.8 % if cuts have to wait)
    tail : of the bound
        smallest gain of a round of cuts for another round to follow
    tail_open : share
        the same smallest gain, as a share of the remaining gap
    most_penalty_raises : times
        largest number of times that the penalty of broken rules is multiplied by 10
    smoothing : share
        weights of the master's multipliers in an average with the best multipliers, so that
        prices oscillate less (Wentges 1997)
    least_responses : responses per robot
        budget below which the search for plans does not start
    most_idle : solves
        number of solves after which an unused column is dropped
    few_in_vain : plans
        a quick search for plans ends after this number of plans in a row without a better one
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
    """The root: its first mixture, and the methods that are tried before the tree.

    Attributes
    ----------
    enough : of the bound
        gap at which the ascent of the first mixture ends
    enough_large : of the bound
        the same gap if rules are added before there is any master
    most_raises : steps
        largest number of steps of the first ascent
    patience : steps
        number of steps in which the gap of the first mixture must shrink by `least_closed`
    least_closed : share
        smallest part of the gap to close in that number of steps
    less_open : share
        the paths of better plans are tried again once the gap is at most this share of the gap at
        the last trial
    least_amount : of a robot
        smallest amount of a column that enters the first master
    most_disaggregated : robots x steps x states
        largest problem in which each robot becomes a class of its own
    least_gain : share
        smallest share of the remaining gap that the first cuts of disaggregated robots must close,
        multiplied by the growth of the master
    at_once : of the bound
        largest gap at which paths are tried before there is a master
    many_states : states of all classes
        smallest number of states for such an early trial
    few_joint_states : joint states of all steps
        largest number for which step envelopes precede cuts; the bottleneck has fewer, and needs
        half the time that cuts take
    far : relative gap
        gap that no tree closes soon, so that any gain above `least_gain_far` is accepted
    least_gain_far : share
        smallest gain at such a gap, as a share of the remaining gap
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
    """The root of very many robots: the order of turns, masters, and moves over known arcs.

    Moves are those of a large neighbourhood search (Shaw 1998).

    Attributes
    ----------
    many_robot_steps : robots x steps
        smallest size at which masters take too long: a master of field-large (64 drones, 40 steps)
        takes six to eight seconds
    first_steps : steps
        steps of the ascent before the first plan; new rows need as many to take effect
    most_first_steps : steps
        largest number of these steps, to leave time for plans if bound and mixture stay apart
    steps : steps
        steps of the ascent in a turn, to settle after rows and cuts
    least_closed : share
        part of the gap between bound and mixture below which a turn of the ascent is its last:
        masters then lower the bound
    masters : masters
        masters in a turn, as the first after other work may lower no bound
    turns_per_cuts : turns
        turns near the bound for each round of cuts, which takes as long as several turns
    nearly : of the bound
        largest gap between bound and mixture at which cuts are added: before that, a mixture breaks
        cuts that the next one does not
    starts : plans
        plans that a turn of the search by prices improves
    moves : moves
        moves of the plan in a turn, so that all kinds of work take about as long
    patience : times
        factor on the expected gain of a kind of work for each turn of the others
    least_gain : share
        smallest gain of a turn for more of its kind to follow, as a share of the remaining gap
    most_others : robots
        largest number of robots that are removed together with the first one
    most_turns : turns
        largest number of responses of each robot in one move
    neighbours : robots
        robots that respond in addition to the removed ones
    """

    many_robot_steps: int = 1500
    first_steps: int = 20
    most_first_steps: int = 80
    steps: int = 5
    least_closed: Share = 0.25
    masters: int = 2
    turns_per_cuts: int = 3
    nearly: float = 0.004
    starts: int = 4
    moves: int = 250
    patience: float = 1.2
    least_gain: Share = 5e-4
    most_others: int = 3
    most_turns: int = 20
    neighbours: int = 4


@dataclass(frozen=True)
class TreeParameters(Section):
    """The nodes below the root: when to branch on them, and diving.

    Attributes
    ----------
    rough : share
        gap at which a node branches instead of converging further, as a share of the remaining gap
    rough_root : share
        the same gap at the root, whose bound holds for all plans
    nearly_integral : robots
        distance from an integer below which an amount counts as integral if nothing else is left to
        branch on
    dive_nearly : of a robot
        fraction of a robot that a dive rounds up, so that one more robot uses the state
    dive_share : share
        smallest share of the undecided states that a round of a dive decides
    most_dive_rounds : rounds
        largest number of rounds of a dive
    dive_pricings : pricings
        pricings in each round of a dive
    dive_responses : iterations' worth of responses
        budget for improving the plan at the end of a dive
    dive_tolerance : robots
        distance from an integer below which an amount counts as integral in a dive
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
    """Step envelopes: their rounds, and limits on the search of a step.

    Attributes
    ----------
    few_states_left : states of all steps
        largest number at which all states have prices at once
    most_states_left : states of all steps
        the same limit once lists have stalled; 400,000 take 3 GB
    most_states_of_few : states of all steps
        the same limit for few robots, whose searches take a tenth of a millisecond per state
    few_robots : robots
        largest number that counts as few robots
    most_unlisted : states of all steps
        the same limit for teams too large for lists, whose searches take longer
    most_at_a_step : states of a step
        most states for which a step is searched
    most_listed_robots : robots
        largest team for which lists are searched
    most_rounds : rounds
        most rounds of stages
    many_nodes : nodes
        largest search of a step in compiled code
    many_plain_nodes : nodes
        largest search of a step without compiled code, which takes as long
    few_work : nodes x states
        largest size of a short trial search of a step, in compiled code
    few_plain_work : nodes x states
        the same limit without compiled code
    few_nodes : nodes
        largest number of nodes of such a trial search
    first_nodes : nodes
        nodes that each search of a step gets at first; longer searches wait until the short ones
        have closed states
    next_times : times
        factor on the nodes of searches that have not ended
    patience : searches
        searches that may fail before all get more nodes, as most need about as many
    most_in_vain : nodes
        total nodes of failed searches up to which more may fail
    nodes_of_stage : nodes
        nodes of searches after which better prices of some steps become a stage of their own
    least_of_stage : share
        smallest share of the gap above the target that such a stage must close
    responses : iterations' worth of responses
        budget for plans after each bundle
    most_corrections : times
        most corrections of a bundle by joint states that only the exact search finds
    least_round : share
        smallest share of the remaining gap that a round must close to be followed by another
    wide : times the first slack
        slack from which lists are wide; their rounds take as long as explorations of tails,
        which close more
    least_wide : share
        smallest share of the remaining gap that a round of wide lists must close
    least_listed : share
        smallest share of the remaining gap that a round must close if its lists keep their length
    stalled : share
        share of the remaining gap below which a round of lists counts as stalled
    """

    few_states_left: int = 6_500
    most_states_left: int = 400_000
    most_states_of_few: int = 200_000
    few_robots: int = 4
    most_unlisted: int = 12_000
    most_at_a_step: int = 6_500
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
    stalled: Share = 0.12


@dataclass(frozen=True)
class ListParameters(Section):
    """The lists of states to which step envelopes are restricted: their lengths and their slack.

    Attributes
    ----------
    slack : of the remaining gap per step
        largest slack of a state on the first lists
    of_all_steps : states
        largest number of states on all first lists together
    fewest_first : states
        smallest number of states on the first list of a step
    most_first : states
        largest number of states on the first list of a step; with 200, searches and their checks
        take two to four times as many nodes on field (seeds 0, 3, 5, 6), and proofs take longer
    fewest : states
        smallest number of states on a later list, as shorter searches save nothing
    most : states
        largest number of states on a later list, as longer searches do not end
    mean : share
        mean length of the lists, as a share of the longest first list, below which lists may grow
    long_search : nodes
        size from which a search counts as long, so that the step's next list is shorter
    shorter : power
        exponent by which the next list shrinks with the excess of a long search
    not_ended : times a long search
        size that a search counts with if it did not end
    short_search : times a long search
        size up to which the next list may be longer
    longer : times
        largest growth of the next list of a step
    more_slack : times
        factor on the slack after a round that closes little
    more_nodes : times
        factor on the size of a long search after such a round
    longest_search : nodes
        size up to which long searches grow, and the limit of a search of a step
    a_little_more_slack : times
        factor on the slack if lists are too short on the whole
    most_slack : times the first slack
        largest slack
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
    """Trials of the paths of all robots together: when they are made, and with how many nodes.

    Attributes
    ----------
    fewest_nodes : nodes
        smallest size of a trial in compiled code, a tenth of a second; the bottleneck and the
        passage need 16,000 nodes before there are any stages
    fewest_plain_nodes : nodes
        smallest size of a trial without compiled code
    more_nodes : times
        factor on the size of the next trial after a failed one
    times_nodes : times
        largest size of all trials together, relative to the stages, in compiled code; a hundred
        nodes of a trial take as long as one node of a search among a thousand states
    plain_times_nodes : times
        the same without compiled code, when nodes of both take about as long
    most_nodes : nodes
        largest trial; `verify` allows 100 million nodes for a whole file
    """

    fewest_nodes: int = 100_000
    fewest_plain_nodes: int = 5_000
    more_nodes: float = 2.0
    times_nodes: float = 10.0
    plain_times_nodes: float = 0.25
    most_nodes: int = 80_000_000


@dataclass(frozen=True)
class MiddleParameters(Section):
    """The choice of the step from which large trials explore paths.

    Attributes
    ----------
    least_trial : nodes
        smaller trials begin at the start: a choice would take longer
    first_less : share
        first reduction of the target, relative to the remaining gap; it is doubled from one
        comparison of steps to the next
    few : share
        size of the best exploration, relative to the trial that follows, at which comparisons end
    many : share
        largest size of an exploration, relative to the trial that follows
    times : times
        largest size of an exploration, relative to the best one of the same comparison
    least_nodes : nodes
        size of an exploration that is always allowed, however small the best one is
    most_steps : steps
        largest number of steps compared at first, at equal distances; the steps around the best of
        them follow
    most_kept : steps
        number of best steps of a comparison that are compared again
    """

    least_trial: int = 1_000_000
    first_less: Share = 0.05
    few: Share = 0.003
    many: Share = 0.03
    times: int = 3
    least_nodes: int = 1_000
    most_steps: int = 20
    most_kept: int = 3


@dataclass(frozen=True)
class TailParameters(Section):
    """Explorations of the latest steps of plans: when they are made, and with how many nodes.

    Attributes
    ----------
    fewest_nodes : nodes
        smallest size of an exploration of all steps, in compiled code
    fewest_plain_nodes : nodes
        the same without compiled code, which takes twenty times as long
    times_nodes : times
        largest size of all explorations between stages, relative to the stages
    times_at_the_end : times
        largest size of an exploration at the end, relative to the stages, unless time is kept for
        it
    most_nodes : nodes
        largest exploration of all steps; `verify` allows 100 million nodes for a whole file
    less_room : times
        share of the gap at the last exploration at which tails are explored again
    first_loss : share
        first loss up to which tails are explored, as a share of the gap
    growth : times
        factor on what is explored beyond the loss of the next step
    time_kept : share
        time kept for tails, as a share of what a limit leaves before the first stage
    enough : share
        share of the nodes of a step after which it is the turn of the step before: the next
        exploration would take about three times as many
    ahead : times
        factor on what joint states may lose at the step alone with which tails begin, so that one
        search serves several explorations
    beginnings : share
        share of the nodes of a step that may be joint states with which tails begin
    """

    fewest_nodes: int = 1_000_000
    fewest_plain_nodes: int = 30_000
    times_nodes: float = 6.0
    times_at_the_end: float = 15.0
    most_nodes: int = 80_000_000
    less_room: Share = 0.7
    first_loss: Share = 0.01
    growth: float = 1.5
    time_kept: Share = 0.15
    enough: Share = 0.3
    ahead: float = 3.0
    beginnings: Share = 0.25


@dataclass(frozen=True)
class BundleParameters(Section):
    """The bundle method over prices of states (Kiwiel 1990), and its search for joint states.

    Attributes
    ----------
    most_iterations : iterations
        largest number of iterations of a bundle
    most_listed_iterations : iterations
        the same limit if only some states are listed, as the next round has better lists
    converged : share
        gain below which iterations end and prices are given up, as a share of the remaining gap
    serious : share
        share of the predicted gain that makes a new centre
    good : share
        share of the predicted gain that makes a longer step
    first_weight : over the mean price
        initial weight of the distance to the centre
    most_heights : joint states of a step
        joint states of a step in the master: the highest at the centre, and as many of the latest
        prices
    known_starts : starts
        local searches that start at known joint states
    random_starts : starts
        local searches that start at randomly changed joint states
    highest_starts : starts
        local searches that start at the highest joint states, in compiled code
    many_random_starts : starts
        local searches that start at randomly changed joint states, in compiled code
    few_robots : robots
        largest team that counts as small in compiled local search
    full_starts : starts
        searches, from the highest joint states, that may move robots to all states; of small teams
    high_states : states of a class
        states to which other searches may move robots: those that were highest before; of small
        teams
    many_full_starts : starts
        the same as `full_starts`, of larger teams
    many_high_states : states of a class
        the same as `high_states`, of larger teams
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
    many_full_starts: int = 4
    many_high_states: int = 500


@dataclass(frozen=True)
class MoveParameters(Section):
    """The bundle method over prices of states whose heights are those of moves between two steps.

    Attributes
    ----------
    most_iterations : iterations
        largest number of iterations of a bundle; 0: no stage has constants of moves
    of_stage : share
        gain for which a centre becomes a stage at once, as a share of the remaining gap
    least_gain : share
        predicted gain below which iterations end, and gain of a bundle below which no other
        follows, as a share of the remaining gap
    serious : share
        share of the predicted gain that makes a new centre
    good : share
        share of the predicted gain that makes a longer step
    first_weight : over the mean price
        initial weight of the distance to the centre
    most_heights : moves between two steps
        moves in the master: the highest at the centre, and as many of the latest prices
    most_new : moves between two steps
        moves that a search adds
    starts : moves between two steps
        known moves from which local search starts, the highest at the latest prices
    random_starts : times
        local searches from random changes of each of these
    most_nodes : nodes
        largest search for joint states of a step or for moves between two steps
    most_total_nodes : nodes
        largest size of all these searches together, when a file is verified; `verify` allows 100
        million nodes for a whole file, and trials of paths may take most of them
    """

    most_iterations: int = 60
    of_stage: Share = 0.2
    least_gain: Share = 0.01
    serious: Share = 0.1
    good: Share = 0.6
    first_weight: float = 100.0
    most_heights: int = 60
    most_new: int = 40
    starts: int = 8
    random_starts: int = 2
    most_nodes: int = 3_000_000
    most_total_nodes: int = 20_000_000


@dataclass(frozen=True)
class RecombinationParameters(Section):
    """Recombination: the best plan along the states of several plans.

    Attributes
    ----------
    first_plans : plans
        plans of the first recombination: on field-long (seed 0) four take 0.1 s, eight 0.5 s,
        sixteen 4 s
    more_plans : times
        factor on the number of plans each time
    most_plans : plans
        plans that are kept once there are twice as many
    most_nodes : nodes
        total size of the searches from all joint states in compiled code, one or two seconds
    most_plain_nodes : nodes
        the same size without compiled code
    less_room : times
        share of the gap at a failed search at which it is tried again, also for trials of paths;
        nodes grow tenfold when the gap doubles (field, seed 1)
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
        amount below which a column or a cut is dropped
    broken : robots
        uses above the limit of a rule that are tolerated, as the steps are no finer
    steepness : of a robot's reward at a step
        initial charge for one robot too many: a part of the cost of a conflict, so that prices of
        rows settle without oscillating
    least_factor : of a column's amount
        smallest factor of a step, before the power, so that no column is lost while charges are too
        high
    least_share : of a root's multiplier
        smallest share at which pixels have a multiplier of their own
    least_cut : of the bound
        smallest violation for an envelope cut to be added, half of that in masters
    few_cuts : cuts
        number of envelope cuts of a round below which state cuts are added, too: they take longer,
        but see that robots cannot share a cell
    most_cuts : cuts
        largest number of view sums that are tried in a round, the most violated first, so that a
        round does not take minutes
    again : times
        growth of the violation since the last failed search for a cut at which the search is
        repeated
    """

    least_amount: float = 1e-3
    broken: float = 1e-3
    steepness: float = 0.2
    least_factor: float = 0.01
    least_share: float = 1e-9
    least_cut: float = 1e-6
    few_cuts: int = 100
    most_cuts: int = 2500
    again: float = 1.5


@dataclass(frozen=True)
class AlikeCutParameters(Section):
    """Envelope cuts where many robots of one class share a view sum.

    Attributes
    ----------
    breakpoints : breakpoints
        largest number of breakpoints of a cut, as certificates allow few
    first_multisets : multisets
        largest number of multisets in the first program
    most_added : multisets
        multisets that are added at a time
    most_rounds : rounds
        largest number of rounds of adding multisets
    most_growing : multisets
        multisets of one size that are examined
    nearly : share
        share of the violation of a cut that may remain
    least_mass : robots
        mass that is added everywhere, which keeps phi low where a mixture has none
    """

    breakpoints: int = 5
    first_multisets: int = 400
    most_added: int = 60
    most_rounds: int = 12
    most_growing: int = 4000
    nearly: Share = 0.02
    least_mass: float = 1e-6


@dataclass(frozen=True)
class StateCutParameters(Section):
    """State cuts where very many robots share a view sum.

    Attributes
    ----------
    nearly : share
        share of the violation of a cut that may remain
    touching : of a mixture's pixels
        pixels at which the price of all states that are not listed is that of the root: more makes
        new paths less attractive, and the cut higher
    least_mass : robots
        mass that is added everywhere, which keeps phi low where a mixture has little
    least_cut : of the bound
        smallest violation for a state cut to be added: the view sums of a large team lose little
        each
    """

    nearly: Share = 0.05
    touching: Share = 0.75
    least_mass: float = 1e-4
    least_cut: float = 2e-7


@dataclass(frozen=True)
class LocalSearchParameters(Section):
    """Local search: roundings of a mixture and best responses.

    Attributes
    ----------
    draws : roundings
        random roundings, of which the best are improved
    perturbed : robots
        robots that are planned anew at a time
    least_amount : of a robot
        smallest amount of a column of a mixture that is used
    found_amount : of a robot
        amount that the columns of each plan found add to a pool
    most_in_vain : plans
        plans in a row that are improved without a better one, after which the search ends
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
    middle: MiddleParameters = MiddleParameters()
    tails: TailParameters = TailParameters()
    bundle: BundleParameters = BundleParameters()
    moves: MoveParameters = MoveParameters()
    recombination: RecombinationParameters = RecombinationParameters()
    ruled_ascent: RuledAscentParameters = RuledAscentParameters()
    ascent: AscentParameters = field(default_factory=AscentParameters)
    alike_cuts: AlikeCutParameters = AlikeCutParameters()
    state_cuts: StateCutParameters = StateCutParameters()
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
