"""Relaxations over the aggregated flow, and parts that several formulations share.

A flow (`flow`) may split robots into fractions; rows for conflicts (`collision_rows`), cones for
roots (`cone_program`) and cuts (`separation`) bound J; `duals` makes a certificate from a solver's
multipliers.
"""

__all__ = [
    "collision_rows",
    "duals",
    "flow",
    "separation",
]
