"""The page for choosing starts of drones on a clickable map, without network or other files.

It shows where the drones of a recipe may start, at each of their flight heights, and which starts
in the recipe are rejected. It prints the chosen starts as TOML.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cocap_opt.output.heights import over_datum
from cocap_opt.pictures.start_map import COLOURS, Level, levels
from cocap_opt.player.pages import inert, page_text, style_text
from cocap_opt.player.scripts import bundled
from cocap_opt.problem import StartArea, State
from cocap_opt.scenarios import Site

_DIGITS = 3  # decimals of lengths in m

Data = dict[str, Any]


def start_page(site: Site, heights: Sequence[float] = ()) -> str:
    """Returns the text of the HTML file.

    Parameters
    ----------
    heights : m, flight heights that are shown (default: those of the recipe's drones)
    """
    parts = {
        "style": style_text("starts.css"),
        "script": bundled("starts"),
        "data": inert(start_data(site, levels(site, heights))),
    }
    return page_text("starts.html", parts)


def start_data(site: Site, shown: Sequence[Level]) -> Data:
    """Returns all data that the page draws; lengths in m, places in the map's coordinates.

    `kinds` of a level has a digit for each cell, column by column: the number of its colour in
    `COLOURS`.
    """
    scene = site.scene
    above = (scene.height_map.heights - scene.height_map.ground).round(1)
    return {
        "name": scene.name,
        "over": over_datum(scene),
        "origin": list(scene.height_map.origin),
        "cell": scene.height_map.resolution,
        "cells": list(scene.height_map.shape),
        "colours": COLOURS,
        "levels": [
            {"height": level.height, "kinds": "".join(map(str, level.kinds.ravel().tolist()))}
            for level in shown
        ],
        "above": above.ravel().tolist(),
        "people": [
            {
                "called": actor.name or f"person {j}",
                "walk": _rounded(actor.poses[: scene.horizon + 1, :2]),
            }
            for j, actor in enumerate(scene.actors)
        ],
        "headings": max(motion.headings for motion in site.motions),
        "separation": scene.rules.separation,
        "starts": list(_starts(site)),
        "areas": [
            [[*cell] for cell in robot.start.cells]
            for robot in dict.fromkeys(scene.robots)
            if isinstance(robot.start, StartArea) and robot.start.cells is not None
        ],
        "notes": site.words[len(site.refusals) :],
    }


def _starts(site: Site) -> list[Data]:
    """Returns the stated starts; rejected ones have the reason `why` and the nearest free place."""
    scene, refused = site.scene, {found.robot: found for found in site.refusals}
    found = []
    for number, robot in enumerate(scene.robots):
        if not isinstance(robot.start, State):
            continue
        refusal = refused.get(number)
        nearest = refusal and refusal.nearest
        found.append(
            {
                "called": site.starts[number],
                "at": scene.height_map.centre(robot.start.x, robot.start.y),
                "height": robot.motion.layers[robot.start.layer],
                "heading": math.degrees(math.tau * robot.start.heading / robot.motion.headings),
                "why": None if refusal is None else site.why(refusal),
                "free": nearest and scene.height_map.centre(nearest.x, nearest.y),
            }
        )
    return found


def _rounded(points: Any) -> list[list[float]]:
    rows: list[list[float]] = np.asarray(points).round(_DIGITS).tolist()
    return rows
