"""The uses that a certificate charges for, spelt out: being in cells and states, and moves."""

import math
from collections.abc import Iterator, Sequence

from cocap_opt.formulations.certificates import Decision, ReferencePixels
from cocap_opt.formulations.certificates.format import Certificate
from cocap_opt.formulations.certificates.resources import Cells, Move, Moves, Resource, Swap
from cocap_opt.formulations.second_opinion.paths import Uses


def uses_of(certificate: Certificate, decisions: Sequence[Decision], number: int) -> Uses:
    """Returns what robots of a class pay for each use of a resource; infinity closes it."""
    if isinstance(certificate, ReferencePixels):
        return {}
    priced = [(row.resource, row.multiplier) for row in certificate.rows]
    for decision, nu in zip(decisions, certificate.decisions, strict=True):
        priced.append((decision.resource, math.inf if decision.closes else decision.sign * nu))
    costs: Uses = {}
    for resource, cost in priced:
        if getattr(resource, "class_number", None) in (None, number):
            for use in _ways_to_use(resource):
                costs[use] = costs.get(use, 0.0) + cost
    return costs


def _ways_to_use(resource: Resource) -> Iterator[tuple[object, ...]]:
    """Yields what uses a resource: being in a cell or in a state at t, or a move from t on."""
    t = resource.t
    if isinstance(resource, Cells):
        yield from ((t, cell) for cell in resource.cells)
    elif isinstance(resource, Swap):
        one, other = resource.cells
        yield from ((t, one, other), (t, other, one))
    elif isinstance(resource, Moves):
        yield from ((t, tail, head) for tail, head in resource.moves)
    elif isinstance(resource, Move):
        yield (t, *resource.cells)
    else:
        yield (t, resource.state)
