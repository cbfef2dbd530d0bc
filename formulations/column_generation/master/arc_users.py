"""Finds the arcs that use each resource."""

from collections import defaultdict
from collections.abc import Sequence

from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.mixtures.columns import Arc
from cocap_opt.model import Model


def users_of(model: Model, arcs: Sequence[Arc], resources: Sequence[Resource]) -> list[list[int]]:
    """Returns the numbers of the arcs that use each resource.

    A state is used by the arcs that enter it, a start by the arcs that leave it.
    """
    into: dict[tuple[int, int, int], list[int]] = defaultdict(list)  # arcs by class, step and head
    # arcs by class, step, tail and head
    along: dict[tuple[int, int, int, int], list[int]] = defaultdict(list)
    n_places = [robot_class.graph.n_places for robot_class in model.classes]
    for k, (number, t, tail, head) in enumerate(arcs):
        start, end = tail % n_places[number], head % n_places[number]
        along[number, t, start, end].append(k)
        into[number, t + 1, end].append(k)
        if t == 0:
            into[number, 0, start].append(k)
    found = []
    for resource in resources:
        t, numbers = resource.t, list[int]()
        for number in range(len(model.classes)):
            used = resource.footprint(model, number)
            for place in used.places:
                numbers += into.get((number, t, place), [])
            for start, end in used.moves:
                numbers += along.get((number, t, start, end), [])
            for state in used.states:
                near = into.get((number, t, state % n_places[number]), [])
                numbers += [k for k in near if (arcs[k].head if t else arcs[k].tail) == state]
        found.append(numbers)
    return found
