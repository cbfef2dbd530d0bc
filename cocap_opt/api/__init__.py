"""The functions of the face, `import cocap_opt as co`, a module for each of its subjects.

`methods` has those that plan, bound and solve; `judging` those that check and verify, `explaining`
those that tell what a gap is made of; `covering` has what drones see, `filming` how well plans film
people, `measuring` the gap table, `teaming` teams of other drones, `fronts` trade-offs, `flying`
flights of plans, `showing` the player, `variants` problems that ask for more, and `files` what is
read and written. `arguments` judges what they are given.
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
