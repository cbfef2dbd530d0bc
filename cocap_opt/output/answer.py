"""The answer of a command on standard output: lines, or a single JSON object.

Requested values come first. How they were computed is shown on request; JSON always includes it.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from json import dumps
from math import fsum
from typing import Any

import msgspec

from cocap_opt.flight.earth import told_accuracy
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.letters import columns_of, folded
from cocap_opt.output.conflicts import are_conflicts, grouped_conflicts
from cocap_opt.output.printing import (
    Record,
    cell_text,
    path_text,
    print_line,
    rounded,
    terminal,
)
from cocap_opt.output.told_bounds import told_bound
from cocap_opt.stop import NO_LIMIT
from cocap_opt.text import counted

_BREAK = "\n"
# Labels of keys, short enough to be beside their values in 60 columns; JSON uses the keys.
LABELS = {
    "reward": "J",
    "cut_short": "attention",
    "message": "note",
    "plain": "without compiled code",
    "generated": "tree: nodes made",
    "expanded": "tree: nodes expanded",
    "depth": "tree: depth of plan",
    "evaluated": "single views evaluated",
    "leaves": "leaves of the proof",
    "iterations": "pricing rounds",
    "columns": "columns (paths) made",
    "rows": "collision rows",
    "cuts": "envelope cuts",
    "stages": "envelope stages",
    "paths_above": "all plans tried",
    "reward_of_views": "J from views",
    "reward_rendered": "J of rendered pixels",
    "reward_per_step": "J by step",
    "reward_per_person": "J by person",
    "reward_per_face": "J by side",
    "reward_at_start": "J at the start",
    "from_step": "rest begins at step",
    "drones": "drones that fly it",
    "flown_reward": "J flown so far",
    "whole_reward": "J of whole mission",
    "old_reward": "J of the old rest",
    "rest_scene": "scene of the rest",
    "rest_plan": "plan of the rest",
    "seconds": "time",
    "coverage_seconds": "coverage",
    "checking_seconds": "checking",
    "bound_seconds": "bounding",
    "bound_by_verify": "bound by verify",
    "bound_claimed": "bound claimed",
    "bound_proved": "bound proved",
    "bound_there": "bound, file's objective",
    "reward_there": "J, file's objective",
    "solver_bound": "bound of the solver",
    "solver_value": "J of the solver",
    "chosen_starts": "starts chosen",
    "failed_robot": "drone without a path",
    "takes": "take by take",
    "states_reached": "states reached",
    "states_that_see": "states with a view",
    "near_people_undecided": "undecided near people",
    "draw": "seed of --draw",
    "views_enclosed": "coverage checked",
    "views_left": "not checked",
    "numbers_enclosed": "not 0 on both sides",
    "numbers_undecided": "undecided",
    "widest_share": "widest, shares",
    "widest_pixels": "widest, pixels",
    "rewards_enclosed": "J by the scene alone",
    "agrees": "agrees with scene",
    "second_opinion": "second opinion",
    "second_bound": "its bound",
    "delay_tolerance": "delay tolerance",
    "delay_tolerance_to_people": "delay to people",
    "deviation": "off the straight flight",
    "least_distance": "between drones",
    "people_distance": "to people",
    "near_drones": "between drones",
    "near_people": "to people",
    "items": "longest mission",
    "late": "late at the end",
    "slowed": "passed more slowly",
    "shortened": "speed changed faster",
    "reward_straight": "J of straight flight",
    "reward_smooth": "J of smooth flight",
    "smoothing_cost": "smooth against straight",
    "crs": "reference system",
    "plan_who": "plan by",
    "plan_date": "date of plan",
    "plan_program": "program of plan",
    "bound_who": "bound by",
    "bound_date": "date of bound",
    "bound_program": "program of bound",
    "accuracy": "place on the Earth",
}
# Wordings of values, by key.
_VALUES = {
    "seconds": "{} s",
    "coverage_seconds": "{} s",
    "checking_seconds": "{} s",
    "bound_seconds": "{} s",
    "paths_above": "above a J of {}",
    "near_people_undecided": "{} places and moves, too close to a minimum distance",
    "views_enclosed": "at {} pairs of a state and a step",
    "views_left": "at {} pairs of state and step, for lack of time",
    "numbers_enclosed": "{} numbers of coverage",
    "numbers_undecided": "{}, as their enclosures are too wide",
    "widest_share": "{} between the ends of an enclosure",
    "widest_pixels": "{} px/m2 between the ends of an enclosure",
    "step": "{} s",
    "duration": "{} s",
    "deviation": "{} m at most, at any moment",
    "least_distance": "{} m at least, at any moment",
    "people_distance": "{} m at least, at any moment, seen from above",
    "delay_tolerance": "less than {} s between drones",
    "delay_tolerance_to_people": "less than {} s",
    "late": "{} s at most: some legs cannot be flown in time",
    "reward_straight": "{}, also between steps",
    "reward_smooth": "{}, also between steps",
}
# Lists of rewards: the item that each belongs to, and the number of the first.
_SERIES = {"reward_per_step": ("step", 1), "reward_per_person": ("person", 0)}
# number of rewards up to which they are listed; with more there is a summary, and JSON has all
_FEW = 12
# Values without information, by key; JSON includes them.
_SILENT = {
    "limit": NO_LIMIT,
    "evaluated": 0,
    "reward_at_start": 0.0,
    "late": 0.0,
    "slowed": 0,
    "shortened": 0,
}
_ONLY_JSON = ("digest", "seen_by_two", "seen_by_three", "median_error")
# Requested values, in the order in which people read them; all others follow.
_FIRST = (
    "cut_short", "valid", "agrees", "reward", "bound", "gap", "optimal", "cameras", "takes",
    "second_opinion", "second_bound", "violations", "near_drones", "near_people", "file", "files",
    "certificate", "rest_scene", "rest_plan", "message",
)  # fmt: skip
WIDEST = 26  # columns of labels; the value of a wider label begins on the next line
_BETWEEN, _INDENT = 2, 3  # columns between label and value, and before a value on a line of its own
# Values about the computation, for developers.
_INTERNAL = frozenset({
    "method", "seconds", "coverage_seconds", "checking_seconds", "bound_seconds", "views",
    "evaluated", "generated", "expanded", "depth", "leaves", "nodes", "iterations", "columns",
    "rows", "cuts", "stages", "paths_above", "proof", "reward_per_step", "reward_per_person",
    "reward_per_face", "reward_at_start", "rules", "motion", "places", "moves", "states_reached",
    "states_that_see", "numbers_enclosed", "widest_share", "widest_pixels", "draw", "sha256",
    "bound_by_verify", "responses", "mixtures", "searches",
})  # fmt: skip


def print_result(row: Record, json: bool, verbose: bool = True) -> None:
    """Prints the answer of a command: a line per key, or one JSON object on one line.

    Infinite numbers are null in JSON; characters that are not text, or would control a terminal,
    are escaped.

    Parameters
    ----------
    verbose : True: also print how the answer was computed; False: a last line gives the number of
        omitted lines
    """
    if json:
        sys.stdout.write(harmless(msgspec.json.encode(row, enc_hook=path_text).decode()) + "\n")
        return
    shown: list[tuple[str, str]] = []
    hidden = 0
    for key in _in_order(row):
        value = row[key]
        silent = value is None or value == "" or _SILENT.get(key) == value
        if silent or key in _ONLY_JSON or (key == "violations" and not value and "valid" in row):
            continue
        is_listed = row.get("violations") or ("violations" in row and "valid" not in row)
        if key == "conflicts" and is_listed:
            continue
        is_internal = key in _INTERNAL or (key == "conflicts" and not value)
        if is_internal and not verbose:
            hidden += 1
            continue
        shown.append((_label(row, key), _shown(row, key)))
    print_pairs(shown)
    if hidden:
        print_line(f" ({counted(hidden, 'more line')} with --verbose)")


def _label(row: Record, key: str) -> str:
    """Returns the label of a value; violations that are all conflicts are labelled as conflicts."""
    if key == "violations" and are_conflicts(row[key]):
        return "conflicts"
    return LABELS.get(key, key)


def print_pairs(pairs: Iterable[tuple[str, str]]) -> None:
    """Prints labels beside their values, whose lines are folded.

    A value is printed on lines of its own, below its label, if the label is long or if a name in
    the value does not fit beside it, as names of files are copied.
    """
    pairs, width = [*pairs], terminal().width
    labels = [columns_of(label) for label, _ in pairs if columns_of(label) <= WIDEST]
    left = 1 + max(labels, default=0) + _BETWEEN
    for label, value in pairs:
        longest = max(map(columns_of, value.split()), default=0)
        is_beside = columns_of(label) <= WIDEST and left + longest <= width
        first = f" {label}{' ' * (left - 1 - columns_of(label))}" if is_beside else " " * _INDENT
        if not is_beside:
            print_line(folded(label, width, " ", " "))
        indent = " " * (left if is_beside else _INDENT)
        for line in value.splitlines() or [""]:
            fits = columns_of(first + line) <= width
            print_line(first + line if fits else folded(line, width, first, indent))
            first = indent


def _in_order(row: Record) -> Iterable[str]:
    """Returns the keys of an answer, requested ones first.

    If there is no plan, the message gives the reason and comes first; so do violations.
    """
    first: tuple[str, ...] = _FIRST
    if row.get("reward", 0.0) is None:
        first = ("cut_short", "message", *first)
    if row.get("violations"):
        first = ("cut_short", "valid", "violations", *first)
    return dict.fromkeys([*(key for key in first if key in row), *row])


def _shown(row: Record, key: str) -> str:
    """Returns a value as text: conflicts in groups, and long lists summarised."""
    value = row[key]
    if key == "gap":
        return f"{cell_text(key, value)}: {_told_gap(row)}"
    if key == "bound" and isinstance(value, float):
        told = told_bound(value, row.get("reward"))
        # J is never negative
        return told if value >= 0 else f"{told}: below 0, so no such plan exists"
    if key == "accuracy":
        return told_accuracy(value)
    if key == "optimal":
        return "yes" if value else "not proved"
    if key == "smoothing_cost":  # negative if smoothness gains
        return f"{-100 * value:+.3f} % of J"
    if key == "items":
        return counted(value, "item")
    if key in ("slowed", "shortened"):
        return f"at {counted(value, 'step')}, to be safe"
    if key == "takes":
        return told_takes(value)
    if key == "violations":
        return cell_text(key, [*_number(row), *grouped_conflicts(value)])
    if key in _SERIES and len(value) > _FEW:
        return _summary(value, *_SERIES[key])
    if isinstance(value, str) and not value[:1].isdigit():  # e.g. "unlimited"
        return cell_text(key, value)
    return _VALUES.get(key, "{}").format(cell_text(key, value))


def _number(row: Record) -> Iterable[str]:
    """Yields the number of conflicts, if an answer counts them and lists pairs of drones."""
    if row["violations"] and row.get("conflicts"):
        yield f"{row['conflicts']:,} in all:"


def told_takes(rows: Sequence[Mapping[str, Any]]) -> str:
    """Returns J and the quality of a plan in each take, one per line."""
    return _BREAK.join(
        "; ".join(filter(None, [
            f"{row['take']} ({100 * row['probability']:.3g} %): J {rounded(row['reward'])}",
            row["cameras"],
        ]))
        for row in rows
    )  # fmt: skip


def _summary(rewards: Sequence[float], noun: str, first: int) -> str:
    """Returns the mean of rewards, and which are smallest and largest."""
    least, most = (rewards.index(end(rewards)) for end in (min, max))
    return "\n".join([
        f"mean {fsum(rewards) / len(rewards):,.2f} over {len(rewards)}; --json has all",
        f"least {rewards[least]:,.2f}, {noun} {least + first}",
        f"most {rewards[most]:,.2f}, {noun} {most + first}",
    ])  # fmt: skip


def _told_gap(row: Record) -> str:
    """Returns the meaning of a gap: J of the best plan is at most the bound."""
    is_proved = row.get("valid") is not False and 0 <= row["gap"] <= OPTIMALITY
    if (
        is_proved
        or row.get("optimal")
        or row.get("reason") == "optimal"
        or row.get("state") == "solved"
    ):
        return "proved, no plan is better"
    if row.get("conflicts") or row["gap"] < 0:
        return "J of a plan that breaks rules may exceed the bound"
    if row.get("valid") is False:
        return "between J and the bound as verified, not as claimed"
    return "J is at most this far below the best possible"


def harmless(json: str) -> str:
    """Returns JSON in which characters that are not text are escaped."""
    return "".join(c if c.isprintable() else dumps(c)[1:-1] for c in json)
