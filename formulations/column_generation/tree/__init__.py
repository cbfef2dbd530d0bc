"""The tree of branch-and-price: the relaxation of each node, the root, and the nodes below it.

`relaxation` solves a node; `root` the first one, `large_root` that of very many robots with
`ruled_ascent`; `diving` makes plans in nodes, and `tree` keeps the nodes and writes the proof.
"""
