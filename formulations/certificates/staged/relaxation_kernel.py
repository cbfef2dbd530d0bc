"""The relaxation at a node, compiled into the search; `relaxation` explains the method."""

from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.compiling import compiled
from cocap_opt.data import FloatArray, IndexArray
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.kernel_arrays import (
    CHARGED,
    PIXELS,
    PRICED,
    VALUES,
    Inputs,
    Memory,
)
from cocap_opt.formulations.certificates.staged.relaxation import (
    BEND,
    HEAT,
    LEAST_MASS,
    LEAST_PIXELS,
    LEAST_SHARE,
    ROOM,
    ROUNDS,
    STEP,
)

# Rows of `Relaxed.mixed` and `.slopes`: PIXELS and this.
GAINS = 1

# Rows of `Relaxed.conditions`.
CONSTANTS, AT_MIXTURE, SHARES = range(3)

# Inlined into the callers: calls that pass all arrays took half as long again.
_inlined = partial(compiled, kept=False, forceinline=True)


class Relaxed(NamedTuple):
    """The arrays of `relaxation`, for n states, E entries of coverage, F faces, P conditions."""

    margin: float  # margin of the relaxation, for rounding
    may_repeat: bool
    cliques: IndexArray  # [n]
    least_pixels: FloatArray  # [F] smallest number of pixels at which a tangent touches the root
    gains: FloatArray  # [E] at the current node
    shares: FloatArray  # [R+1, n] of the mixture at each depth
    mixed: FloatArray  # [2, F] pixels and single gains of the mixture
    slopes: FloatArray  # [2, F] for pixels and for single gains, weighted
    conditions: FloatArray  # [3, P] constants, values at the mixture, shares
    worth: FloatArray  # [n] of the node's states
    picks: IndexArray  # [R] numbers of the picked states among the node's states
    last: FloatArray  # [C] worth of the last pick of each class, or mass of its mixture
    active: IndexArray  # [B] numbers of the bounds with a share
    moved: IndexArray  # [n] new number of each of the node's states


def relaxed_of(data: Inputs, joint: JointStates) -> Relaxed:
    """Returns the arrays of the relaxation, as they are before the first node."""
    n, n_faces, robots = len(data.class_of), len(data.weights), len(data.classes)
    return Relaxed(
        margin=ROOM * joint.margin,
        may_repeat=joint.conflicts.may_repeat,
        cliques=joint.cliques.astype(np.uint32),
        least_pixels=LEAST_PIXELS * joint.most_pixels,
        gains=np.zeros(len(data.pixels)),
        shares=np.zeros((robots + 1, n)),
        mixed=np.zeros((2, n_faces)),
        slopes=np.zeros((2, n_faces)),
        conditions=np.zeros((3, 2 + len(data.raised))),
        worth=np.zeros(n),
        picks=np.zeros(robots, dtype=np.uint32),
        last=np.zeros(len(joint.sizes)),
        active=np.zeros(len(data.raised), dtype=np.uint32),
        moved=np.zeros(n, dtype=np.uint32),
    )


@_inlined
def _pick(data: Inputs, memory: Memory, relaxed: Relaxed, depth: int) -> float:
    """Picks the best states for the remaining robots; returns their worth, or -inf if there are too
    few.
    """
    worth, picks, states = relaxed.worth, relaxed.picks, memory.states
    total, begin = 0.0, 0
    for c in range(data.counts.shape[1]):
        count, found = data.counts[depth, c], 0
        for i in range(memory.numbers[depth, 0] if count else 0):
            s = states[depth, i]
            is_worse = found == count and worth[i] <= worth[picks[begin + count - 1]]
            if data.class_of[s] != c or is_worse:
                continue
            if relaxed.may_repeat:
                for k in range(count):
                    picks[begin + k] = i
                found = count
                continue
            j = 0  # the position of the pick from its clique, if there is one
            while j < found:
                if relaxed.cliques[states[depth, picks[begin + j]]] == relaxed.cliques[s]:
                    break
                j += 1
            if j < found and worth[picks[begin + j]] >= worth[i]:
                continue
            if j == found and found < count:
                found += 1
            elif j == found:
                j = count - 1
            while j > 0 and worth[picks[begin + j - 1]] < worth[i]:
                picks[begin + j] = picks[begin + j - 1]
                j -= 1
            picks[begin + j] = i
        if found < count:
            return -np.inf
        for k in range(count):
            total += worth[picks[begin + k]]
        if count:
            relaxed.last[c] = worth[picks[begin + count - 1]]
        begin += count
    return total


@_inlined
def _mix(data: Inputs, memory: Memory, relaxed: Relaxed, depth: int, share: float) -> None:
    """Moves the mixture a share of the way towards the picks."""
    conditions, mixed = relaxed.conditions, relaxed.mixed
    for f in range(len(data.weights)):
        for row in (PIXELS, GAINS):
            mixed[row, f] *= 1 - share
    for p in range(conditions.shape[1]):
        gone = conditions[CONSTANTS, p] - conditions[AT_MIXTURE, p]
        conditions[AT_MIXTURE, p] += share * gone
    for i in range(memory.numbers[depth, 0]):
        relaxed.shares[depth, memory.states[depth, i]] *= 1 - share
    for k in range(len(data.classes) - depth):
        _add(data, relaxed, depth, memory.states[depth, relaxed.picks[k]], share)


@_inlined
def _add(data: Inputs, relaxed: Relaxed, depth: int, state: int, share: float) -> None:
    """Adds a share of a state to the mixture."""
    conditions = relaxed.conditions
    relaxed.shares[depth, state] += share
    for e in range(data.first[state], data.first[state + 1]):
        relaxed.mixed[PIXELS, data.faces[e]] += share * data.pixels[e]
        relaxed.mixed[GAINS, data.faces[e]] += share * relaxed.gains[e]
    conditions[AT_MIXTURE, PRICED] -= share * data.price[state]
    conditions[AT_MIXTURE, CHARGED] -= share * data.charge[state]
    for k in range(len(data.raised)):
        conditions[AT_MIXTURE, 2 + k] -= share * data.raised[k, state]


@_inlined
def _begin_mixture(data: Inputs, memory: Memory, relaxed: Relaxed, depth: int) -> None:
    """Starts from the mixture of the parent node, if enough of it remains; otherwise from the
    picks.
    """
    conditions, shares, last = relaxed.conditions, relaxed.shares, relaxed.last
    for f in range(len(data.weights)):
        for row in (PIXELS, GAINS):
            relaxed.mixed[row, f] = 0.0
    for p in range(conditions.shape[1]):
        conditions[AT_MIXTURE, p] = conditions[CONSTANTS, p]
    for c in range(len(last)):
        last[c] = 0.0
    for i in range(memory.numbers[depth, 0]):
        s = memory.states[depth, i]
        shares[depth, s] = 0.0
        if depth > 0:
            last[data.class_of[s]] += shares[depth - 1, s]
    is_left = depth > 0
    for c in range(len(last)):
        is_left &= data.counts[depth, c] == 0 or last[c] > LEAST_MASS * data.counts[depth, c]
    if not is_left:
        for k in range(len(data.classes) - depth):
            _add(data, relaxed, depth, memory.states[depth, relaxed.picks[k]], 1.0)
        return
    for i in range(memory.numbers[depth, 0]):
        s = memory.states[depth, i]
        c = data.class_of[s]
        if data.counts[depth, c] and shares[depth - 1, s] > 0:
            share = shares[depth - 1, s] * data.counts[depth, c] / last[c]
            _add(data, relaxed, depth, s, share)


@_inlined
def _find_slopes(data: Inputs, memory: Memory, relaxed: Relaxed, depth: int) -> tuple[float, float]:
    """Finds alpha and beta at the mixture; returns its gains and the sum of kappas."""
    seen, slopes, high, kappa = memory.seen, relaxed.slopes, 0.0, 0.0
    for f in range(len(data.weights)):
        before, value, weight = seen[PIXELS, depth, f], seen[VALUES, depth, f], data.weights[f]
        pixels, gains = relaxed.mixed[PIXELS, f], relaxed.mixed[GAINS, f]
        slopes[PIXELS, f], slopes[GAINS, f] = 0.0, weight
        if f < data.n_roots:
            together = np.sqrt(before + pixels) - value
        else:
            together = data.caps[f - data.n_roots] - value
        if gains <= 0.0 or together <= 0.0:
            continue
        high += weight * min(gains, together)
        alpha = min(max(0.5 - BEND * (gains - together) / together, 0.0), 1.0)
        slopes[GAINS, f] = weight * alpha
        if f < data.n_roots:
            square = before + max(pixels, relaxed.least_pixels[f])
            root = np.sqrt(square)
            beta = (1.0 - alpha) / (2.0 * root)
            kappa += weight * ((1.0 - alpha) * (root - value) - beta * (square - before))
            slopes[PIXELS, f] = weight * beta
        else:
            kappa += weight * (1.0 - alpha) * together
    return high, kappa


@_inlined
def _find_shares(relaxed: Relaxed, high: float, lowest: float, heat: float) -> None:
    """Finds a share for each condition; the conditions that are lowest at the mixture get the
    largest.
    """
    conditions, total = relaxed.conditions, 0.0
    for p in range(conditions.shape[1]):
        value = conditions[AT_MIXTURE, p] + (high if p <= CHARGED else 0.0)
        share = np.exp((lowest - value) / heat)
        conditions[SHARES, p] = share if share >= LEAST_SHARE else 0.0
        total += conditions[SHARES, p]
    for p in range(conditions.shape[1]):
        conditions[SHARES, p] /= total


@_inlined
def _find_worth(data: Inputs, memory: Memory, relaxed: Relaxed, depth: int, kappa: float) -> float:
    """Finds each state's worth in the sum of the conditions; returns the sum's constant."""
    conditions, slopes = relaxed.conditions, relaxed.slopes
    gaining = conditions[SHARES, PRICED] + conditions[SHARES, CHARGED]
    constant: float = gaining * kappa
    for p in range(conditions.shape[1]):
        if conditions[SHARES, p] > 0.0:
            constant += conditions[SHARES, p] * conditions[CONSTANTS, p]
    active = 0
    for k in range(len(data.raised)):
        if conditions[SHARES, 2 + k] > 0.0:
            relaxed.active[active] = k
            active += 1
    for i in range(memory.numbers[depth, 0]):
        s, gain = memory.states[depth, i], 0.0
        for e in range(data.first[s], data.first[s + 1]):
            f = data.faces[e]
            gain += slopes[GAINS, f] * relaxed.gains[e] + slopes[PIXELS, f] * data.pixels[e]
        worth = gaining * gain - conditions[SHARES, PRICED] * data.price[s]
        worth -= conditions[SHARES, CHARGED] * data.charge[s]
        for a in range(active):
            k = relaxed.active[a]
            worth -= conditions[SHARES, 2 + k] * data.raised[k, s]
        relaxed.worth[i] = worth
    return constant


@_inlined
def _drop(data: Inputs, memory: Memory, relaxed: Relaxed, depth: int, bound: float) -> None:
    """Drops states whose sum with the best other states is not above 0."""
    states, values, worth = memory.states, memory.values, relaxed.worth
    kept = 0
    for i in range(memory.numbers[depth, 0]):
        s = states[depth, i]
        relaxed.moved[i] = kept
        if bound - relaxed.last[data.class_of[s]] + worth[i] <= -relaxed.margin:
            continue
        if kept < i:
            states[depth, kept] = s
            worth[kept] = worth[i]
            for row in range(3):
                values[row, depth, kept] = values[row, depth, i]
        kept += 1
    if kept == memory.numbers[depth, 0]:
        return
    memory.numbers[depth, 0] = kept
    for k in range(len(data.classes) - depth):
        relaxed.picks[k] = relaxed.moved[relaxed.picks[k]]


@_inlined
def relax(
    data: Inputs, memory: Memory, relaxed: Relaxed, depth: int, least: float, floor: float
) -> None:
    """Drops the states that the relaxation rules out, or all states if no completion is
    relevant.
    """
    conditions, numbers = relaxed.conditions, memory.numbers
    conditions[CONSTANTS, PRICED] = memory.profits[PRICED, depth] - least
    conditions[CONSTANTS, CHARGED] = memory.profits[CHARGED, depth] - floor
    for k in range(len(data.raised)):
        wanted = floor if data.is_limit[k] else least
        conditions[CONSTANTS, 2 + k] = memory.below[depth, k] - wanted
    row = PRICED if least > -np.inf else CHARGED
    for i in range(numbers[depth, 0]):
        relaxed.worth[i] = memory.values[row, depth, i]
    if _pick(data, memory, relaxed, depth) == -np.inf:
        numbers[depth, 0] = 0
    else:
        _begin_mixture(data, memory, relaxed, depth)
        heat = 0.0
        for k in range(ROUNDS):
            high, kappa = _find_slopes(data, memory, relaxed, depth)
            lowest = np.inf
            for p in range(conditions.shape[1]):
                value = conditions[AT_MIXTURE, p] + (high if p <= CHARGED else 0.0)
                lowest = min(lowest, value)
            if lowest > 0.0:
                break
            if heat == 0.0:
                heat = max(-HEAT * lowest, relaxed.margin)
            if heat == 0.0:  # if all conditions are 0, any value will do
                heat = 1.0
            _find_shares(relaxed, high, lowest, heat)
            bound = _find_worth(data, memory, relaxed, depth, kappa)
            bound += _pick(data, memory, relaxed, depth)
            if bound <= -relaxed.margin:
                numbers[depth, 0] = 0
                break
            _drop(data, memory, relaxed, depth, bound)
            _mix(data, memory, relaxed, depth, 2.0 / (STEP + k))
    numbers[depth, 1] = 0
    for i in range(numbers[depth, 0]):
        if data.class_of[memory.states[depth, i]] == data.classes[depth]:
            numbers[depth, 1] += 1
