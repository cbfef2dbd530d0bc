"""The strip of the player: the number of cameras that see each person at each step."""

import math
from typing import Any

from cocap_opt.data import FloatArray
from cocap_opt.footage.quality import Quality
from cocap_opt.footage.shares import visible_shares
from cocap_opt.problem import Plan, Problem

Data = dict[str, Any]


def filmed(problem: Problem, plan: Plan) -> Data | None:
    """Returns the quality of a plan for each person at each step; None where nobody counts.

    `rows` has the people who count at any step: number (`person`) and `name`, and for each step
    `counts`, `views` (drones that see the person), `angles` (degrees), `errors` (mm, null if not
    finite), and the drone that sees most of the person: its number (`best`) and the share that it
    sees (`most`). `line` is a summary, and `atLeast` is the share of a person that a drone must see
    to count.
    """
    shares = visible_shares(problem, plan)
    found = Quality.of(problem, plan, shares)
    if not found.summary.person_steps:
        return None
    angles, errors = _rounded(found.angles), _rounded(found.errors)
    most, best = shares.max(axis=1).round(4).T.tolist(), shares.argmax(axis=1).T.tolist()
    rows = [
        {
            "person": person.actor,
            "name": person.person,
            "counts": found.counts[:, person.actor].tolist(),
            "views": found.views[:, person.actor].tolist(),
            "angles": angles[person.actor],
            "errors": errors[person.actor],
            "most": most[person.actor],
            "best": best[person.actor],
        }
        for person in found.by_person
    ]
    return {"rows": rows, "line": found.summary.line, "atLeast": found.assumptions.at_least}


def _rounded(values: FloatArray) -> list[list[float | None]]:
    """Returns numbers [A, T+1] of [T+1, A] with one decimal; None where they are not finite."""
    return [
        [round(value, 1) if math.isfinite(value) else None for value in row]
        for row in values.T.tolist()
    ]
