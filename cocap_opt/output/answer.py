"""The answer of a command on standard output: lines, or one JSON object and nothing else.

What was asked for comes first. How it was computed is shown on request; JSON always has it.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from json import dumps
from math import fsum
from typing import Any

import msgspec
from rich.markup import escape
from rich.table import Table

from cocap_opt.letters import columns_of
from cocap_opt.output.conflicts import grouped_conflicts
from cocap_opt.output.printing import Record, cell_text, counted, path_text, rounded, terminal
from cocap_opt.stop import NO_LIMIT

_BREAK = "\n"
# Names of statistics, as people read them; JSON has the keys.
_LABELS = {
    "reward": "J",
    "cut_short": "attention",
    "plain": "checked without compiled code",
    "generated": "tree: nodes made",
    "expanded": "tree: nodes expanded",
    "depth": "tree: depth of the plan",
    "evaluated": "single views evaluated",
    "leaves": "leaves of the proof",
    "iterations": "pricing rounds",
    "columns": "columns (paths) made",
    "rows": "collision rows",
    "cuts": "envelope cuts",
    "stages": "stages of step envelopes",
    "paths_above": "J above which all plans were tried",
    "step": "seconds of a step",
    "duration": "seconds of the flight",
    "deviation": "most from the straight flight at any moment (m)",
    "least_distance": "least distance of two drones at any moment (m)",
    "people_distance": "least distance to a person at any moment, from above (m)",
    "delay_tolerance": "delay tolerance: drones may be apart in time by less than (s)",
    "delay_tolerance_to_people": "delay tolerance to people: drones may be ahead or behind by (s)",
    "reward_rendered": "J of the rendered pixels",
    "from_step": "the rest begins at step",
    "drones": "drones that fly it",
    "flown_reward": "J of what was flown",
    "whole_reward": "J of the whole mission",
    "old_reward": "J of the old rest",
    "bound_seconds": "seconds of the bound",
    "items": "items of the longest mission",
    "late": "late at the end at most, for legs that cannot be flown in time (s)",
    "slowed": "steps at which a drone passes more slowly, to be safe",
    "shortened": "steps at which a drone changes speed in less time, to be safe",
    "reward_straight": "J of the straight flight, also between steps",
    "reward_smooth": "J of the smooth flight, also between steps",
    "takes": "take by take",
    "smoothing_cost": "J of the smooth flight against that of the straight one",
    "states_reached": "states at steps that drones reach",
    "states_that_see": "of these, states that see anything",
    "near_people_undecided": "places and moves too near to a least distance to be decided",
    "draw": "seed of what is drawn (--draw)",
    "views_enclosed": "states at steps whose coverage is enclosed",
    "numbers_enclosed": "numbers of them that are not 0 on both sides",
    "numbers_undecided": "numbers whose enclosure is too wide to decide",
    "widest_share": "widest of the other enclosures, as a share",
    "widest_pixels": "widest of the other enclosures (px/m2)",
    "rewards_enclosed": "J of each plan, by the scene alone",
    "agrees": "the instance is the scene's",
    "second_opinion": "second opinion",
    "second_bound": "bound by the second opinion",
    "accuracy": "latitudes and longitudes may be off by (m)",
}
# Lists of rewards: what each is of, and the number of the first.
_SERIES = {"reward_per_step": ("step", 1), "reward_per_person": ("person", 0)}
_FEW = 12  # rewards that are listed; of more there is a summary, and JSON has them
# Values that say nothing, by their keys; JSON has them.
_SILENT = {"limit": NO_LIMIT, "evaluated": 0, "reward_at_start": 0.0, "late": 0.0}
_ONLY_JSON = ("digest", "seen_by_two", "seen_by_three", "median_error")
# What was asked for, in the order in which people read it; all else comes after.
_FIRST = (
    "cut_short", "valid", "agrees", "reward", "bound", "gap", "optimal", "cameras", "takes",
    "second_opinion", "second_bound", "violations", "file", "files", "certificate", "rest_scene",
    "rest_plan", "message",
)  # fmt: skip
# Names of files, which are copied: labels are folded so that names need not be.
_NAMES = frozenset({"file", "files", "certificate", "rest_scene", "rest_plan"})
_NARROW = 12  # characters of a label at least
_PADDING = 4  # characters beside a label and a value
# How it was computed, which developers read.
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

    Infinite numbers are null in JSON; what is no text, or would steer a terminal, is escaped.

    Parameters
    ----------
    verbose : True: also how it was computed; False: a last line says how many lines that would be
    """
    if json:
        sys.stdout.write(harmless(msgspec.json.encode(row, enc_hook=path_text).decode()) + "\n")
        return
    shown: list[tuple[str, str]] = []
    hidden = longest = 0
    for key in _in_order(row):
        value = row[key]
        silent = value is None or value == "" or _SILENT.get(key) == value
        if silent or key in _ONLY_JSON or (key == "violations" and not value and "valid" in row):
            continue
        is_internal = key in _INTERNAL or (key == "conflicts" and not value)
        if is_internal and not verbose:
            hidden += 1
            continue
        shown.append((_LABELS.get(key, key), text := _shown(row, key)))
        if key in _NAMES:
            longest = max(longest, *map(columns_of, text.splitlines()))
    console = terminal()
    room = console.width - longest - _PADDING
    table = Table(show_header=False, box=None)
    table.add_column(max_width=room if room >= _NARROW else None)
    table.add_column(overflow="fold")  # nothing is cut off: names of files are to be copied
    for label, text in shown:
        table.add_row(label, escape(text))
    console.print(table)
    if hidden:
        console.print(f" ({counted(hidden, 'more line')} with --verbose)", highlight=False)


def _in_order(row: Record) -> Iterable[str]:
    """Returns the keys of an answer, those that were asked for first.

    Where there is no plan, the message says why, and comes before all else; so do violations.
    """
    first: tuple[str, ...] = _FIRST
    if row.get("reward", 0.0) is None:
        first = ("cut_short", "message", *first)
    if row.get("violations"):
        first = ("cut_short", "valid", "violations", *first)
    return dict.fromkeys([*(key for key in first if key in row), *row])


def _shown(row: Record, key: str) -> str:
    """Returns a value as people read it: conflicts in groups, and long lists summed up."""
    value = row[key]
    if key == "gap":
        return f"{cell_text(key, value)}: {_told_gap(row)}"
    if key == "smoothing_cost":  # which is below 0 where smoothness gains
        return f"{-100 * value:+.3f} %"
    if key == "takes":
        return told_takes(value)
    if key == "violations":
        return cell_text(key, grouped_conflicts(value))
    if key in _SERIES and len(value) > _FEW:
        return _summary(value, *_SERIES[key])
    return cell_text(key, value)


def told_takes(rows: Sequence[Mapping[str, Any]]) -> str:
    """Returns J and the quality of a plan in each take, a line each."""
    return _BREAK.join(
        "; ".join(filter(None, [
            f"{row['take']} ({100 * row['probability']:.3g} %): J {rounded(row['reward'])}",
            row["cameras"],
        ]))
        for row in rows
    )  # fmt: skip


def _summary(rewards: Sequence[float], noun: str, first: int) -> str:
    """Returns the mean of rewards, and which is the least and which the largest."""
    least, most = (rewards.index(end(rewards)) for end in (min, max))
    return "\n".join([
        f"mean {fsum(rewards) / len(rewards):,.2f} over {len(rewards)}; --json has all",
        f"least {rewards[least]:,.2f}, {noun} {least + first}",
        f"most {rewards[most]:,.2f}, {noun} {most + first}",
    ])  # fmt: skip


def _told_gap(row: Record) -> str:
    """Returns the meaning of a gap; J of the best plan is the bound at most."""
    if row.get("optimal") or row.get("reason") == "optimal" or row.get("state") == "solved":
        return "proved, no plan is better"
    return "J is at most this far below the best possible"


def harmless(json: str) -> str:
    """Returns JSON whose characters that are no text are escaped, as JSON escapes them."""
    return "".join(c if c.isprintable() else dumps(c)[1:-1] for c in json)
