"""Experiments: sweeps, tables, figures and studies, the command line and the Python functions.

The rooms, from the inside out: `console` (terminal), `results` (rows, tables, files), `missions`
(files that drones fly), `sweeps` (many scenes and planners at once), `report` (figures, players,
pages), `api` (the functions of `import cocap_opt as co`), `studies` (the project's own
measurements), `notebooks`, `cli` (the command `cocap-opt`) and `manual` (what pages show of the
code); `pictures` holds those of the README.
"""

__all__ = ["api", "cli", "console", "manual", "report", "results", "studies"]
