"""A second exporter: the moves and rules of a scene, by networkx and from its JSON file alone.

It shares no code with the exporter that it is compared with. It knows columns of a height map only:
scenes with meshes, strides, airspace, counted drones or several sets of layers are refused. Pixels
(`sees`) are not compared.
"""

import math
from fractions import Fraction
from itertools import product
from typing import Any

import networkx as nx

CUBOID_FACES = 5  # four sides and the top


class UnknownError(ValueError):
    """The scene has something that the second exporter does not know."""


def facts_of_scene(problem: dict[str, Any]) -> dict[str, Any]:
    """Returns the facts of a scene, `problem` of its JSON file, by names that say which."""
    _refuse(problem)
    objective, rules = problem["objective"], problem["rules"]
    steps = range(problem["horizon"] + 1)
    weights = [w for a in problem["actors"] for w in a["weights"] or [1.0] * CUBOID_FACES]
    faces = len(weights)
    rows = [0] if objective["over_time"] else steps
    first = 0 if objective["over_time"] or objective["count_start"] else 1
    facts = {
        "horizon": problem["horizon"],
        "groups": (len(rows), faces),
        "rewards": tuple(
            objective[name] for name in ("stationarity", "keep_cell", "keep_heading", "balanced")
        ),
        "rules": tuple(
            float(rules[name]) for name in ("vertex", "swap", "separation", "vertical")
        ),
        "weights": {
            t * faces + f: weight * objective["pixels"]
            for t in rows if t >= first
            for f, weight in enumerate(weights) if weight * objective["pixels"]
        },
    }  # fmt: skip
    for i, robot in enumerate(problem["robots"]):
        facts.update(_facts_of_drone(problem, i, robot))
    return facts


def _refuse(problem: dict[str, Any]) -> None:
    """Raises UnknownError if the scene has something that is not known here."""
    airspace, height_map, people = problem["airspace"], problem["height_map"], problem["actors"]
    motions = [robot["motion"] for robot in problem["robots"]]
    beyond = {
        "meshes": problem["meshes"], "takes": problem["takes"],
        "views": problem["objective"]["views"],
        "no-fly zones": airspace["no_fly"], "a ceiling": airspace["ceiling"] is not None,
        "distances to people": airspace["people_aside"] or airspace["people_above"] is not None,
        "a datum or lift": any(height_map[name] is not None for name in ("datum", "lift")),
        "strides": any(motion["stride"] is not None for motion in motions),
        "several sets of layers": any(m["layers"] != motions[0]["layers"] for m in motions),
        "importance": any(a["importance"] is not None for a in people),
        "people who come later": any(a["begin"] is not None for a in people),
        "shapes but cuboids": any(a["shape"]["type"] != "cuboid" for a in people),
        "spacing": any(motion["spacing"] != 1 for motion in motions),
        "several starts": any(isinstance(robot["start"][0], list) for robot in problem["robots"]),
    }  # fmt: skip
    for name, there in beyond.items():
        if there:
            raise UnknownError(f"{problem['name']}: the second exporter does not know {name}")


def _facts_of_drone(problem: dict[str, Any], i: int, robot: dict[str, Any]) -> dict[str, Any]:
    """Returns places, moves, turns, start and goal of a drone, as far as drones of its kind get."""
    motion, start = robot["motion"], tuple(robot["start"])
    space, turns = _moves(problem["height_map"], motion), _turns(robot)
    alike = [  # a kind has what any of its drones can reach
        other for other in problem["robots"]
        if other["motion"] == motion and other["camera"] == robot["camera"]
    ]  # fmt: skip
    near = {tuple(other["start"][:3]) for other in alike}
    places = set(near)
    for _ in range(problem["horizon"]):
        near = {end for place in near for end in space.successors(place)}
        places |= near
    origin, edge = problem["height_map"]["origin"], problem["height_map"]["resolution"]
    return {
        f"places of drone {i}": {
            (*place, place[2], origin[0] + edge * place[0], origin[1] + edge * place[1],
             motion["layers"][place[2]])
            for place in places
        },
        f"moves of drone {i}": {
            (tail, head, data["balanced"])
            for tail, head, data in space.edges(data=True) if {tail, head} <= places
        },
        f"turns of drone {i}": set(turns.edges),
        f"start of drone {i}": {start},
        f"goal of drone {i}": None if robot["goal"] is None else {
            place for place in places if list(place[:2]) == list(robot["goal"])[:2]
        },
    }  # fmt: skip


def _moves(height_map: dict[str, Any], motion: dict[str, Any]) -> Any:
    """Returns the graph of places (x, y, layer); its edges are moves of a step."""
    heights, layers, gap = height_map["heights"], motion["layers"], motion["clearance"]

    def is_free(x: int, y: int, low: float) -> bool:
        return bool(heights[x][y] < low - gap)

    graph: Any = nx.DiGraph()
    for x, y, layer in product(range(len(heights)), range(len(heights[0])), range(len(layers))):
        if is_free(x, y, layers[layer]):
            graph.add_node((x, y, layer))
    reach = range(-motion["radius"], motion["radius"] + 1)
    climbs = range(-motion["climb"], motion["climb"] + 1)
    for tail, dx, dy, climb in product(list(graph), reach, reach, climbs):
        head = (tail[0] + dx, tail[1] + dy, tail[2] + climb)
        if head not in graph:
            continue
        low = min(layers[tail[2]], layers[head[2]])
        if motion["corner_cutting"] or all(
            is_free(tail[0] + i, tail[1] + j, low) for i, j in _touched(dx, dy)
        ):
            graph.add_edge(tail, head, balanced=dx + dy == 0)
    return graph


def _turns(robot: dict[str, Any]) -> Any:
    """Returns the graph of orientations (heading, tilt); its edges are turns of a step."""
    motion, tilts = robot["motion"], len(robot["camera"]["tilts"])
    graph: Any = nx.DiGraph()
    for heading, tilt in product(range(motion["headings"]), range(tilts)):
        for turn, pitch in product(
            range(-motion["turn"], motion["turn"] + 1),
            range(-motion["pitch_turn"], motion["pitch_turn"] + 1),
        ):
            if 0 <= tilt + pitch < tilts:
                after = ((heading + turn) % motion["headings"], tilt + pitch)
                graph.add_edge((heading, tilt), after)
    return graph


def _touched(dx: int, dy: int) -> list[tuple[int, int]]:
    """Returns the closed unit squares that a segment from (0, 0) to (dx, dy) touches."""
    found = []
    for i, j in product(range(-abs(dx), abs(dx) + 1), range(-abs(dy), abs(dy) + 1)):
        first, last = Fraction(0), Fraction(1)  # of the segment, in the square
        for way, centre in ((dx, i), (dy, j)):
            ends = [Fraction(2 * centre + side, 2) for side in (-1, 1)]
            if way:
                low, high = sorted(end / way for end in ends)
                first, last = max(first, low), min(last, high)
            elif not ends[0] <= 0 <= ends[1]:
                last = Fraction(-1)
        if first <= last:
            found.append((i, j))
    return found


def facts_of_instance(text: str) -> dict[str, Any]:
    """Returns the same facts, as an instance has them."""
    facts: dict[str, Any] = {"weights": {}}
    kinds: list[dict[str, list[Any]]] = []
    kind, goal = 0, None
    for line in text.splitlines():
        word, _, rest = line.partition(" ")
        head, colon, tail = rest.partition(":")
        at, ends = head.split(), tail.split()
        if word == "horizon":
            facts[word] = int(at[0])
        elif word == "groups":
            facts[word] = (int(at[0]), int(at[1]))
        elif word in ("rewards", "rules"):
            facts[word] = tuple(map(float.fromhex, at))
        elif word == "weight":
            facts["weights"][int(at[0])] = float.fromhex(at[1])
        elif word == "kind":
            kinds.append({"orientations": [], "places": [], "closed": []})
        elif word == "orientation":
            kinds[-1]["orientations"].append(((int(at[0]), int(at[1])), [*map(int, ends)]))
        elif word == "place":
            place = (*map(int, at[:4]), *map(float.fromhex, at[4:]))
            kinds[-1]["places"].append((place, ends))
        elif word == "closed":
            raise UnknownError("closed places are not compared")
        elif word == "class":
            kind, goal = int(at[0]), [*map(int, ends)] if colon else None
        elif word == "drone":
            facts.update(_drone(kinds[kind], int(at[0]), ends, goal))
    return facts


def _drone(
    kind: dict[str, list[Any]], i: int, starts: list[str], goal: list[int] | None
) -> dict[str, Any]:
    """Returns the facts of a drone of a kind; numbers become places and orientations."""
    places = [place for place, _ in kind["places"]]
    orientations = [at for at, _ in kind["orientations"]]
    pairs = [tuple(map(int, start.split(","))) for start in starts]
    return {
        f"places of drone {i}": set(places),
        f"moves of drone {i}": {
            (place[:3], places[int(end.rstrip("="))][:3], end.endswith("="))
            for place, ends in kind["places"] for end in ends
        },
        f"turns of drone {i}": {
            (at, orientations[end]) for at, ends in kind["orientations"] for end in ends
        },
        f"start of drone {i}": {(*places[q][:3], *orientations[o]) for q, o in pairs},
        f"goal of drone {i}": None if goal is None else {places[q][:3] for q in goal},
    }  # fmt: skip


def differences(ours: dict[str, Any], theirs: dict[str, Any]) -> list[str]:
    """Returns the names of facts that are not equal; weights may part by a rounding."""
    names = [name for name in {**ours, **theirs} if name != "weights"]
    found = [name for name in names if ours.get(name, ...) != theirs.get(name, ...)]
    a, b = ours["weights"], theirs["weights"]
    if a.keys() != b.keys() or not all(math.isclose(a[g], b[g], rel_tol=1e-15) for g in a):
        found.append("weights")
    return found
