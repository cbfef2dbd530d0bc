"""Experiments: sweeps, tables, figures and studies, the command line and the Python functions.

The rooms, from the inside out: `console` (terminal), `results` (rows, tables, files), `report`
(figures, players, pages), `sweeps` (many scenes and planners at once), `studies` (the project's own
measurements), `cli` (the command `cocap-opt`), `api` (the functions of `import cocap_opt as co`)
and `notebooks`, with `pictures` for the README.
"""

__all__ = ["api", "cli", "console", "notebooks", "report", "results", "studies", "sweeps"]
