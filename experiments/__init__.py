"""Batch experiments: many scenes, seeds and planners, and the tables and reports of their results.

`tables` has rows of results and their statistics, `sweeps` runs experiments on several processes,
and `report` makes pages and charts of a sweep's folder. `library` keeps instances with their best
plans and bounds. `lab` measures the project itself; it is in the repository, but not part of the
wheel.
"""
