"""Sweeps: many scenes, seeds and planners, on as many processes as there are.

A run is a set of cells. Each finished cell is one file, so a run that was killed goes on where
it was, and what it makes of its cells does not depend on who computed them.
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
