"""Sweeps: many scenes, seeds and planners, on several processes.

A run is a set of cells. Each finished cell is one file, so a run that was killed continues where it
stopped, and its results do not depend on the process that computed a cell.
"""

__all__ = [
    "cells",
    "crew",
    "instances",
    "results",
    "scenes",
    "start_choices",
    "sweep",
    "teams",
]
