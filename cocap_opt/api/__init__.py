"""The functions of the public interface, `import cocap_opt as co`, with a module for each subject.

`methods` has the functions that plan, bound and solve, `judging` those that check and verify, and
`explaining` those that split a gap into its parts. `covering` computes coverage, `filming` measures
how well plans film people, `measuring` makes the gap table, `teaming` compares teams of drones,
`fronts` finds trade-offs, `flying` makes flights of plans, `showing` shows the player, `variants`
changes problems, and `files` reads and writes files. `arguments` checks the arguments of them all.
"""

__all__ = [
    "covering",
    "explaining",
    "files",
    "filming",
    "flying",
    "fronts",
    "hedging",
    "judging",
    "measuring",
    "methods",
    "showing",
    "teaming",
    "variants",
]
