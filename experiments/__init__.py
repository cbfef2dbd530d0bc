"""Batch experiments: many scenes, seeds and planners, and what is said of them.

`tables` has rows of results and what is counted of them, `sweeps` runs them on as many processes as
there are, and `report` makes pages and charts of a sweep's folder. `library` keeps instances with
their best plans and bounds. `lab` measures the project
itself; it is there in the repository and no part of what is installed from a wheel.
"""
