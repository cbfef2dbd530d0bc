"""Random instances of few places with random staged certificates: a hunt for a false bound.

`python tests/support/staged_hunt.py 3000` draws so many instances, and three certificates for each.
Their prices are rough, but their constants are what the searches find, so that bounds are near the
best J; their targets are near it, too. `cocap_check` must prove no less than the best J, which a
sweep over all joint states finds, and no more than without the constants of moves.
"""

import argparse
import json
import math
import random
import sys
from collections import Counter, defaultdict
from itertools import combinations, product
from pathlib import Path
from typing import Any, NamedTuple

from cocap_opt.formulations.independent.cocap_check import ONE, Bound, Instance, Staged

State = tuple[int, int]  # place, orientation
Team = tuple[State, ...]

# Two drones on two places that may not exchange them. The first sees 100 px/m2 on the left at step
# 1 and on the right at step 2, and 36 px/m2 from the other place; its partner sees nothing. Prices
# of states prove no less than 10 + 10, but the drones have to stay: the best J is 10 + 6.
EXCHANGE = """cocap-instance 1
digest exchange
coverage 2
horizon 2
groups 3 1 0
rewards 0x0p+0 0x0p+0 0x0p+0 0x0p+0
rules 1 1 0x0p+0 0x0p+0
weight 1 0x1p+0
weight 2 0x1p+0
kind
orientation 0 0 : 0
place 0 0 0 0 0x0p+0 0x0p+0 0x1p+2 : 0 1
place 1 0 0 0 0x1p+0 0x0p+0 0x1p+2 : 0 1
sees 1 0 0 : 1:0x1.9p+6
sees 1 1 0 : 1:0x1.2p+5
sees 2 0 0 : 2:0x1.2p+5
sees 2 1 0 : 2:0x1.9p+6
kind
orientation 0 0 : 0
place 0 0 0 0 0x0p+0 0x0p+0 0x1p+2 : 0 1
place 1 0 0 0 0x1p+0 0x0p+0 0x1p+2 : 0 1
class 0
drone 0 : 0,0
class 1
drone 1 : 1,0
end
"""


def exchange_file(*stages: dict[str, Any]) -> dict[str, Any]:
    """Returns a certificate for `EXCHANGE` that sets all prices to 0 before the given stages."""
    nothing = {"states": [[x, 0, 0, 0, 0] for x in (0, 1)], "payments": [0.0, 0.0]}
    zero = {
        "payments": [{"t": t, "robot_class": 0, **nothing} for t in (1, 2)],
        "constants": [{"t": t, "constant": 10.0} for t in (1, 2)],
    }
    multipliers = {"type": "multipliers", "alpha": [[1.0]] * 3, "beta": [[0.0]] * 3}
    return {
        "format": "cocap-opt certificate", "version": 8, "digest": "exchange", "bound": 20.0,
        "certificate": {
            "type": "staged", "target": 15.0, "multipliers": multipliers, "stages": [zero, *stages],
        },
    }  # fmt: skip


# -- instances -------------------------------------------------------------------------------------


def draw_instance(draw: random.Random) -> str:
    """Returns an instance of two to four places, one to three drones, and one to six steps."""
    horizon, n_places = draw.choice([1, 2, 3, 3, 4, 4, 5, 6]), draw.choice([2, 3, 3, 4])
    faces, people = draw.choice([1, 2, 3]), draw.choice([0, 0, 0, 1, 2])
    vertex, swap = draw.choice([(1, 1), (1, 1), (1, 0), (0, 0)])
    distance = draw.choice([0, 0, 0, 1.2]) if vertex else 0
    rewards = [draw.choice([0, 1.5]), draw.choice([0, 0.7]), 0, draw.choice([0, 2.0])]
    rewards = rewards if draw.random() < 0.2 else [0, 0, 0, 0]
    lines = [
        "cocap-instance 1", "digest drawn", "coverage 2", f"horizon {horizon}",
        f"groups {horizon + 1} {faces} {people}", f"rewards {_hex(*rewards)}",
        f"rules {vertex} {swap} {_hex(distance, 0)}",
    ]  # fmt: skip
    first, n_roots = int(draw.random() < 0.7), (horizon + 1) * faces
    for group in range(first * faces, n_roots):
        lines.append(f"weight {group} {_hex(draw.choice([0, 0.5, 1, 1, 2, 10]))}")
    for group in range(n_roots + first * people, n_roots + (horizon + 1) * people):
        lines.append(f"weight {group} {_hex(draw.choice([0, 1, 5]))} {draw.choice([1, 2])}")
    cells = draw.sample([*product((0, 1), repeat=2)], n_places)
    n_drones = draw.choice([1, 2, 2, 2, 3])
    n_classes = draw.randint(1, min(n_drones, 2))
    n_kinds, n_turns = draw.randint(1, n_classes), draw.choice([1, 1, 1, 2])
    for _ in range(n_kinds):
        lines += ["kind", *_flying(cells, n_turns, draw)]
        steps = range(horizon + 1)
        lines += [f"closed {t} {q}" for t in steps for q in range(n_places) if draw.random() < 0.03]
        for t, q, o in product(steps, range(n_places), range(n_turns)):
            amounts = [1, 2.5, 4, 9, 30, 100]
            groups = [g for g in range(t * faces, (t + 1) * faces) if draw.random() < 0.6]
            views = [f"{g}:{_hex(draw.choice(amounts))}" for g in groups]
            persons = range(n_roots + t * people, n_roots + (t + 1) * people)
            views += [f"{g}:{_hex(1)}" for g in persons if draw.random() < 0.5]
            if views:
                lines.append(f"sees {t} {q} {o} : {' '.join(views)}")
    is_free = draw.random() < 0.2
    for drone in range(n_drones):
        if drone < n_classes:
            goals = " ".join(map(str, draw.sample(range(n_places), draw.randint(1, n_places))))
            lines.append(f"class {drone % n_kinds}{f' : {goals}' * (draw.random() < 0.15)}")
        starts = {(drone % n_places, draw.randrange(n_turns))}
        if is_free:
            starts |= {(draw.randrange(n_places), draw.randrange(n_turns)) for _ in range(2)}
        lines.append(f"drone {drone} : {' '.join(f'{q},{o}' for q, o in sorted(starts))}")
    return "\n".join([*lines, "end", ""])


def _flying(cells: list[tuple[int, int]], n_turns: int, draw: random.Random) -> list[str]:
    """Returns the lines of orientations and places of a kind, with random moves."""
    lines = []
    for o in range(n_turns):
        turns = {o, draw.randrange(n_turns)}
        lines.append(f"orientation {o} 0 : {' '.join(map(str, turns))}")
    for q, (x, y) in enumerate(cells):
        heads = {*draw.sample(range(len(cells)), draw.randint(1, len(cells) - 1))}
        heads |= {q} if draw.random() < 0.6 else set()
        words = " ".join(f"{head}{'=' * (draw.random() < 0.3)}" for head in heads)
        lines.append(f"place {x} {y} 0 0 {_hex(x, y, 5)} : {words}")
    return lines


def _hex(*numbers: float) -> str:
    return " ".join(float(number).hex() for number in numbers)


# -- the best plan ---------------------------------------------------------------------------------


class _Moves(NamedTuple):
    """The moves of a team's drones, with their worth."""

    instance: Instance
    of: list[int]  # class of each drone, in the order of the classes

    def ways(self, robot: int, t: int, state: State) -> list[tuple[State, float]]:
        """Returns the states to which a drone can move, with the rewards of these moves."""
        kind, (p, o) = self.instance.kinds[self.instance.classes[self.of[robot]]], state
        still, cell, heading, even = map(float, self.instance.rewards)
        found = []
        for (q, is_even), turn in product(kind.moves[p], kind.turns[o]):
            if (t, p, q) not in kind.closed and (t + 1, q) not in kind.closed:
                reward = still * ((q, turn) == state) + cell * (p == q) + even * is_even
                same = kind.headings[o][0] == kind.headings[turn][0]
                found.append(((q, turn), reward + heading * same))
        return found

    def worth(self, t: int, team: Team) -> float:
        """Returns what a joint state sees is worth."""
        seen, total = defaultdict[int, float](float), 0.0
        for k, state in zip(self.of, team, strict=True):
            kind = self.instance.kinds[self.instance.classes[k]]
            for group, amount in kind.sees.get((t, *state), ()):
                seen[group] += float(amount)
        for group, amount in seen.items():
            cap = self.instance.caps.get(group)
            value = math.sqrt(amount) if cap is None else min(amount, cap)
            total += float(self.instance.weights.get(group, 0)) * value
        return total

    def may_move(self, tails: Team, heads: Team) -> bool:
        """Returns True if no two drones are in conflict on the way."""
        where, moves = self.instance.where, []
        for k, (p, _), (q, _) in zip(self.of, tails, heads, strict=True):
            cells = self.instance.kinds[self.instance.classes[k]].cells
            moves.append((cells[p], cells[q], where[cells[p]], where[cells[q]]))
        return not any(self.instance.conflict(a, b) for a, b in combinations(moves, 2))


def best_plan(instance: Instance) -> float:
    """Returns the best J, by a sweep over all joint states; -inf if there is no plan."""
    moves = _Moves(instance, [k for k, drones in enumerate(instance.members) for _ in drones])
    kinds = [instance.kinds[instance.classes[k]] for k in moves.of]
    starts = [instance.starts[drone] for drones in instance.members for drone in drones]
    here: dict[Team, float] = {}
    for team in product(*starts):
        is_open = all((0, p) not in kind.closed for kind, (p, _) in zip(kinds, team, strict=True))
        if is_open and moves.may_move(team, team):
            here[team] = moves.worth(0, team)
    for t in range(instance.horizon):
        after: dict[Team, float] = {}
        for team, value in here.items():
            ways = [moves.ways(robot, t, state) for robot, state in enumerate(team)]
            for way in product(*ways):
                heads = tuple(state for state, _ in way)
                if moves.may_move(team, heads) and moves.may_move(heads, heads):
                    gained = value + sum(gain for _, gain in way)
                    after[heads] = max(after.get(heads, -math.inf), gained)
        here = {team: value + moves.worth(t + 1, team) for team, value in after.items()}
    goals = [instance.goals[k] for k in moves.of]
    ends = (
        value for team, value in here.items()
        if all(goal is None or p in goal for goal, (p, _) in zip(goals, team, strict=True))
    )  # fmt: skip
    return max(ends, default=-math.inf)


# -- certificates ----------------------------------------------------------------------------------


def draw_staged(instance: Instance, best: float, draw: random.Random) -> dict[str, Any]:
    """Returns a random staged certificate whose target is near the best J, if there is a plan."""
    steps, value = range(instance.horizon + 1), max(best, 0.0)
    alpha = [[draw.choice([0, 0.2, 0.5, 0.9, 1]) for _ in range(instance.faces)] for _ in steps]
    beta = [[draw.choice([0.01, 0.02, 0.05, 0.2]) for _ in range(instance.faces)] for _ in steps]
    views = [[draw.choice([0, 0.5, 1]) for _ in range(instance.people)] for _ in steps]
    rows = []
    for _ in range(draw.choice([0, 0, 1, 3]) if instance.vertex else 0):
        cell = draw.choice(sorted(instance.where))
        resource = {"type": "cells", "t": draw.choice(steps), "cells": [[*cell]]}
        rows.append({"resource": resource, "multiplier": draw.choice([0.5, 2.0, 6.0])})
    below = draw.choice([1e-6, 1e-3, 0.02, 0.05, 0.3, draw.random(), -0.05])
    target = value - below * (1 + value)
    numbers = {
        "type": "staged", "target": target,
        "multipliers": {"alpha": alpha, "beta": beta, "views": views, "rows": rows},
        "stages": [_draw_stage(instance, draw) for _ in range(draw.randint(1, 4))],
    }  # fmt: skip
    if not any(instance.rewards) and draw.random() < 0.6:
        numbers["paths_above"] = target + draw.choice([0, 0, 0.01, 0.1]) * abs(target)
        if all(len(starts) == 1 for starts in instance.starts.values()) and draw.random() < 0.7:
            numbers["paths_from"] = draw.randint(1, instance.horizon)
    elif not any(instance.rewards):
        first = int(any(len(starts) > 1 for starts in instance.starts.values()))
        numbers["tails"] = [
            {"t": t, "loss": draw.choice([1e4, 1e4, 10, 1, 0, -1])}
            for t in range(instance.horizon, first - 1, -1) if draw.random() < 0.8
        ]  # fmt: skip
    return numbers


def _draw_stage(instance: Instance, draw: random.Random) -> dict[str, Any]:
    """Returns a stage with new prices of some steps, and claims that are mostly too low."""
    steps, share = range(instance.horizon + 1), draw.choice([0.2, 0.5, 1.0])
    payments = []
    for t in steps:
        if draw.random() < share:
            payments += [_draw_prices(instance, t, k, draw) for k in range(len(instance.classes))]
    claimed = {part["t"] for part in payments} | {t for t in steps if draw.random() < 0.3}
    stage: dict[str, Any] = {
        "payments": payments,
        "constants": [{"t": t, "constant": draw.choice([-1e3] * 3 + [0, 5, 30])} for t in claimed],
    }
    if draw.random() < 0.85:
        stage["moves"] = [
            {"t": draw.choice(steps[:-1]), "constant": draw.choice([-1e3] * 4 + [0, 10, 1e3])}
            for _ in range(draw.randint(1, len(steps)))
        ]
    return stage


def _draw_prices(instance: Instance, t: int, k: int, draw: random.Random) -> dict[str, Any]:
    """Returns prices near a share of what the drones of a class see alone at a step."""
    kind, team = instance.kinds[instance.classes[k]], _Moves(instance, [k])
    names, share = sorted(kind.states), draw.uniform(0.3, 1.0)
    if draw.random() < 0.3:
        names = draw.sample(names, draw.randint(1, len(names)))
    prices = []
    for name in names:
        alone = team.worth(t, (kind.states[name],)) * share
        prices.append(alone * draw.uniform(0.9, 1.1) + draw.choice([0, 0, 0, draw.uniform(-3, 3)]))
    return {
        "t": t, "robot_class": k, "states": [[*name] for name in names], "payments": prices,
        "others": draw.choice([0.0, 0.0, -2.0, 3.0]),
    }  # fmt: skip


# -- the hunt --------------------------------------------------------------------------------------


def without_moves(numbers: dict[str, Any]) -> dict[str, Any]:
    """Returns a certificate without its constants of moves."""
    stages = [{k: v for k, v in stage.items() if k != "moves"} for stage in numbers["stages"]]
    return numbers | {"stages": stages}


def hunt(count: int, seed: int) -> Counter[str]:
    """Draws so many instances; raises AssertionError at the first bound that is false."""
    draw, counts = random.Random(seed), Counter[str]()
    for n in range(count):
        text = draw_instance(draw)
        instance = Instance(text)
        best = best_plan(instance)
        for _ in range(3):
            numbers = draw_staged(instance, best, draw)
            bounds = []
            for certificate in (numbers, without_moves(numbers)):
                staged = Staged(Bound(instance, single=False), certificate, 10**6)
                bounds.append(staged.value / ONE)
            allowance = 1e-9 * (1 + max(best, 0.0))
            is_true = bounds[0] >= max(best, numbers["target"]) - allowance
            if not (is_true and bounds[0] <= bounds[1] + allowance):
                Path("hunted.json").write_text(json.dumps({"instance": text, "numbers": numbers}))
                raise AssertionError((bounds, best, numbers["target"]))
            counts["certificates"] += 1
            counts["lower because of moves"] += bounds[0] < bounds[1] - allowance
            counts["paths explored"] += "paths_above" in numbers
            counts["from the middle"] += "paths_from" in numbers
            counts["tails"] += bool(numbers.get("tails"))
        if not (n + 1) % 1000:
            sys.stderr.write(f"{n + 1:,} instances: {dict(counts)}\n")
    return counts


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    sys.stdout.write(f"{dict(hunt(given.count, given.seed))}\n")
