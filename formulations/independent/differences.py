"""Describes the differences between the facts of a scene and those of an instance, one per line."""

import math
from collections.abc import Iterable, Iterator
from typing import Any

from cocap_opt.formulations.independent.instance_facts import Sight
from cocap_opt.formulations.independent.scene_facts import Facts, Kind, Place

_ROUNDING = 1e-14  # relative rounding error of a weight, which is a product of a few numbers
_METRES = 1e-9  # m, rounding error of positions


def of_facts(scene: Facts, instance: Facts) -> Iterator[str]:
    """Yields the differences between facts, as lines that give both values."""
    for name, value in scene.single.items():
        theirs = instance.single.get(name)
        if value != theirs:
            yield _told(name, value, theirs)
    yield from _weights(scene, instance)
    for i in sorted({*scene.starts} | {*instance.starts}):
        if i not in scene.starts or i not in instance.starts:
            yield _told(f"drone {i}", *_there(i in scene.starts))
            continue
        states = "state x, y, layer, heading, tilt"
        yield from _sets(f"drone {i}: start in {states}", scene.starts[i], instance.starts[i])
        ours, theirs = scene.goals[i], instance.goals[i]
        if ours is None or theirs is None:
            if ours is not theirs:
                yield _told(f"drone {i}: goal", ours, theirs)
        else:
            yield from _sets(f"drone {i}: goal at x, y, layer", ours, theirs)
    kinds = {kind.drones: kind for kind in instance.kinds}
    for mine in scene.kinds:
        if mine.drones not in kinds:
            drones = [kind.drones for kind in instance.kinds if {*kind.drones} & {*mine.drones}]
            yield _told(f"drones that are alike, {_list(mine.drones)}", "yes", drones)
            continue
        yield from _of_kind(f"drones {_list(mine.drones)}", mine, kinds[mine.drones])


def _weights(scene: Facts, instance: Facts) -> Iterator[str]:
    for group in sorted({*scene.weights} | {*instance.weights}):
        ours, theirs = (facts.weights.get(group, (0.0, 0)) for facts in (scene, instance))
        if ours[1] != theirs[1] or not math.isclose(ours[0], theirs[0], rel_tol=_ROUNDING):
            yield _told(f"group {group}: weight, and cap of drones that count", ours, theirs)


def _of_kind(drones: str, ours: Kind, theirs: Kind) -> Iterator[str]:
    for place in sorted({*ours.places} | {*theirs.places}):
        where = f"{drones}: place x, y, layer {place}"
        if place not in ours.places or place not in theirs.places:
            yield _told(where, *_there(place in ours.places))
            continue
        mine, other = ours.places[place], theirs.places[place]
        if mine.layer != other.layer or math.dist(mine[1:], other[1:]) > _METRES:
            yield _told(f"{where}: layer among all, and m", tuple(mine), tuple(other))
    yield from _sets(f"{drones}: move from, to, balanced", ours.moves, theirs.moves)
    yield from _sets(f"{drones}: turn from, to heading, tilt", ours.turns, theirs.turns)
    unsure = ours.unsure
    for name in ("closed_places", "closed_moves"):
        told = f"{drones}: {name.replace('_', ' ')[:-1]}, from step"
        mine, other = getattr(ours, name) - unsure, getattr(theirs, name) - unsure
        yield from _sets(told, mine, other)


def of_sight(sight: Sight, scene: Facts, kind: Kind, first_step: int) -> Iterator[str]:
    """Yields the errors of a state that, by the instance, sees something, except errors in its
    pixels.

    Parameters
    ----------
    scene, kind : the facts of the scene, and those of the sight's kind of drones
    first_step : first step whose views count
    """
    state = told_state(sight.step, sight.place, sight.turned)
    if not first_step <= sight.step <= scene.single["horizon"]:
        yield _told(f"{state}: step whose views count", "no", "yes")
    elif sight.turned not in kind.reached[sight.step].get(sight.place, ()):
        yield _told(f"{state}: reached by drones {_list(kind.drones)}", "no", "yes")
    faces, people = scene.single["faces"], scene.single["people who count"]
    rows = scene.single["rows of groups"]
    first = 0 if rows == 1 else sight.step * faces
    counted = rows * faces + sight.step * people
    for group, amount in sight.amounts.items():
        is_person = counted <= group < counted + people
        if not is_person and not first <= group < first + faces:
            yield _told(f"{state}: group {group} of this step", "no", "yes")
        elif not amount > 0 or (is_person and amount != 1):
            yield _told(f"{state}: group {group}", "1 drone" if is_person else "> 0", amount)


def told_state(step: int, place: Place, turned: tuple[int, int]) -> str:
    """Returns a text that identifies a state at a step."""
    return f"step {step}, state x, y, layer, heading, tilt {(*place, *turned)}"


def _sets(subject: str, ours: Iterable[Any], theirs: Iterable[Any]) -> Iterator[str]:
    mine, other = {*ours}, {*theirs}
    for entry in sorted(mine ^ other):
        yield _told(f"{subject} {_plain(entry)}", *_there(entry in mine))


def _there(in_scene: bool) -> tuple[str, str]:
    return ("yes", "no") if in_scene else ("no", "yes")


def _told(subject: str, scene: Any, instance: Any) -> str:
    return f"{subject}: scene {_plain(scene)}, instance {_plain(instance)}"


def _list(drones: Iterable[int]) -> str:
    return ", ".join(map(str, drones))


def _plain(value: Any) -> str:
    """Returns a value as text."""
    if isinstance(value, str):
        return value
    if value is None:
        return "none"
    return str(value)
