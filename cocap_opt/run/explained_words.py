"""Explains a gap in sentences: broken rules, the largest terms, the leaf, and remedies."""

import math
from collections.abc import Iterable, Sequence

from cocap_opt.formulations.certificates.resources import Cells, Move, Moves, Resource, Swap, Visit
from cocap_opt.formulations.explanation import Term
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.graph.choke_points import ChokePoint
from cocap_opt.output.conflicts import told_conflict
from cocap_opt.output.printing import rounded
from cocap_opt.problem import Cell
from cocap_opt.run.explained import SHOWN, Explained
from cocap_opt.text import counted

_TOLD = 6  # sentences on single terms
_OVER = "the bound overestimates"
# Parts of a gap, in the wording of sentences.
_ADDING = {
    "drones leave the best paths of the bound": "moves off the best paths of the bound",
    "face rewards overestimated": "overestimated sides of people",
    "views of people overestimated": "overestimated views of people",
    "priced rules unused or broken": "priced rules, unused or broken,",
    "priced decisions of the plan's leaf": "priced decisions of the plan's leaf",
}
_WANTED = "cells with a view of somebody at the last step"


def explained_sentences(explained: Explained) -> list[str]:
    """Returns sentences on broken rules, the largest terms, the leaf, and possible improvements.

    For a proved optimum there is one sentence: that there is no gap. Its terms cancel, and none is
    a cause.
    """
    if explained.is_closed:
        return [*map(_sentence, _told_gap(explained))]
    broken = _broken(explained)
    costly = _costly(explained)
    nothing = f"no single term is above {100 * SHOWN:g} % of the bound"
    told = [_told(explained, term) for term in broken[:_TOLD]]
    if more := broken[_TOLD:]:
        amount = _amount(explained, sum(term.amount for term in more))
        told.append(f"{counted(len(more), 'more broken rule')} with a price: {amount}")
    told += [
        *_told_unpriced(explained, broken),
        *(_told(explained, term) for term in costly[:_TOLD]),
        *filter(None, [_told_off(explained)]),
    ]
    told = [*(told or [nothing]), *_told_leaves(explained), *_told_queue(explained)]
    told += _told_replans(explained)
    return [*map(_sentence, told)]


def in_three_sentences(explained: Explained) -> list[str]:
    """Returns the gap with its largest part, its largest term, and the largest gain by replanning a
    single drone.

    If no single term is large, the second sentence is left out. For a proved optimum there is one
    sentence: that there is no gap.
    """
    if explained.is_closed:
        return [*map(_sentence, _told_gap(explained))]
    gap, off = "; ".join(_told_gap(explained)), _told_off(explained)
    name, amount = max(explained.parts().items(), key=lambda part: part[1])
    largest = f'the largest part of it is "{name}", {_amount(explained, amount)}'
    term = next(iter(_broken(explained) or _costly(explained)), None)
    if off:  # a part may then be larger than the gap
        back = _amount(explained, explained.taken_off)
        adds = f"{_ADDING.get(name, name)} add {_amount(explained, amount)}"
        largest = f"{adds}, and stages and path search subtract {back}"
    if explained.is_blurred:
        told = [gap, off]
    elif term is None:
        told = [f"{gap}; {largest}"]
    else:
        told = [f"{gap}; {largest}", f"the largest single term: {_told(explained, term)}"]
    return [*map(_sentence, [*told, next(iter(_told_replans(explained)))])]


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."


def _told_off(explained: Explained) -> str:
    """Returns words for the part of the other terms that is subtracted again; empty if it is
    small.
    """
    off = explained.taken_off
    if explained.explanation.share(off) < SHOWN:
        return ""
    words = f"stages and path search reduce it again by {_amount(explained, off)}"
    if not explained.is_blurred:
        return words
    return f"{words}, far more than remains, so no single term is the cause of the gap"


def _told_gap(explained: Explained) -> Iterable[str]:
    """Yields the difference between the bound and J, and its meaning."""
    found = explained.explanation
    conflicts = [*explained.plan.conflicts(explained.problem)]
    if conflicts:
        yield f"the plan has {counted(len(conflicts), 'conflict')}, so its J may exceed the bound"
        yield f"bound - J is {_amount(explained, found.gap)}"
    elif found.share(found.gap) <= OPTIMALITY:
        yield (
            "no plan is better: up to rounding, J of this plan equals the bound, and there is no "
            "gap to explain"
        )
    else:
        yield f"the plan is at most {_amount(explained, found.gap)} below the best plan"


def _broken(explained: Explained) -> list[Term]:
    """Returns the priced rules that the plan breaks, largest first."""
    broken = (term for term in explained.explanation.terms if term.is_broken)
    return sorted(broken, key=lambda term: term.amount)


def _costly(explained: Explained) -> list[Term]:
    """Returns the terms that are large enough for a sentence, largest first.

    There are none if far more was subtracted than remains as the gap.
    """
    if explained.is_closed or explained.is_blurred:
        return []
    terms = explained.explanation.of_kind("path", "face", "views", "row", "decision")
    shown = [term for term in terms if explained.explanation.share(term.amount) >= SHOWN]
    return sorted(shown, key=lambda term: -term.amount)


def costliest(explained: Explained) -> str:
    """Returns a few words on the largest term; empty if none is large enough."""
    return _told(explained, _costly(explained)[0]) if _costly(explained) else ""


def _amount(explained: Explained, amount: float) -> str:
    share = round(100 * explained.explanation.share(amount), 3) + 0.0
    return f"{share:.3f} % of the bound ({rounded(amount)})"


def _told(explained: Explained, term: Term) -> str:
    amount = _amount(explained, term.amount)
    if term.kind == "path":
        return f"drone {term.robot}'s move from step {term.step} costs {amount}"
    if term.actor is not None and term.face is not None:
        name = explained.problem.actors[term.actor].shape.face_names[term.face]
        when = "over all steps" if term.step is None else f"at step {term.step}"
        return f"{when} {_OVER} the reward of person {term.actor}, side {name}, by {amount}"
    if term.kind == "views" and term.actor is not None:
        drones = {0: "no drone", 1: "one drone"}.get(term.robots or 0, f"{term.robots} drones")
        person = explained.problem.person(term.actor)
        return (
            f"at step {term.step} {_OVER} the views of {person}, whom {drones} "
            f"{'sees' if term.robots in (0, 1) else 'see'}, by {amount}"
        )
    at = "at" if isinstance(term.resource, Cells | Visit) else "from"
    where = f"{explained.named(term.resource)} {at} step {term.step}"
    who = _listed(term.users or ())
    if term.is_broken:
        return f"{who} use {where}, which breaks a rule: {amount}"
    return (
        f"{who} use{'' if len(term.users or ()) > 1 else 's'} {where} ({term.sense} "
        f"{term.robots}, price {rounded(term.price or 0.0)}), which costs {amount}"
    )


def _told_unpriced(explained: Explained, broken: Sequence[Term]) -> Iterable[str]:
    """Yields conflicts of the plan that no priced rule accounts for."""
    priced = [(term.step, set(term.users or ())) for term in broken]
    free = [
        conflict
        for conflict in explained.plan.conflicts(explained.problem)
        if not any(conflict.t == t and users >= set(conflict.robots) for t, users in priced)
    ]
    for conflict in free[:_TOLD]:
        words = told_conflict(explained.problem, conflict)
        yield f"{words} at step {conflict.t}, which breaks a rule without a price there"
    if len(free) > _TOLD:
        yield f"{counted(len(free) - _TOLD, 'more broken rule')} without a price"


def _told_leaves(explained: Explained) -> Iterable[str]:
    leaf, leaves = explained.explanation.leaf, explained.leaves
    if leaf is None or len(leaves) < 2:
        return
    most = max(bound for n, bound in enumerate(leaves) if n != leaf.position)
    others = f"bounds of up to {most:,.2f}" if math.isfinite(most) else "no plans"
    yield (
        f"the plan belongs to leaf {leaf.position + 1} of {len(leaves)}, of bound "
        f"{leaf.bound:,.2f}; the others have {others}"
    )


def _told_queue(explained: Explained) -> Iterable[str]:
    """Yields sentences on where drones must queue, and on the prices of rules there."""
    problem = explained.problem
    wanted = explained.model.cells_with_a_view(problem.horizon)
    choke = None if problem.rules.none else ChokePoint.of(problem, wanted)
    if choke is not None:
        rows = explained.explanation.of_kind("row")
        price = sum(t.price or 0.0 for t in rows if _touches(t.resource, choke.cells))
        paid = f"; rules there carry prices of {_amount(explained, price)}" if price else ""
        yield f"{choke.told(len(problem.robots), _WANTED)}{paid}"


def _told_replans(explained: Explained) -> Iterable[str]:
    found = explained.explanation
    gaining = [replan for replan in explained.replans if found.share(replan.gain) >= SHOWN]
    gaining.sort(key=lambda replan: -replan.gain)
    for replan in gaining[:_TOLD]:
        yield (
            f"replanning drone {replan.robot} alone would gain {_amount(explained, replan.gain)}"
        )
    if len(gaining) > _TOLD:
        yield f"{counted(len(gaining) - _TOLD, 'more drone')} would gain less, each alone"
    if not gaining:
        # If pixels add up over time, the path found is not always the best.
        can = "was found to" if explained.problem.objective.over_time else "can"
        yield f"no single drone {can} gain by replanning within the rules"


def _touches(resource: Resource | None, cells: Sequence[Cell]) -> bool:
    """Returns True if drones are in one of the cells at the beginning or end of using a
    resource.
    """
    if isinstance(resource, Moves):
        return any(cell in cells for move in resource.moves for cell in move)
    if isinstance(resource, Cells | Swap | Move):
        return any(cell in cells for cell in resource.cells)
    return False


def _listed(robots: Sequence[int]) -> str:
    if not robots:
        return "nobody"
    *first, last = map(str, robots)
    return f"drones {', '.join(first)} and {last}" if first else f"drone {last}"
