"""The tree of branch-and-price: the relaxation of each node, the root, and the nodes below it.

`relaxation` solves a node and makes plans of it; `root` solves the first one, `large_root` that of
very many robots; `tree` keeps the nodes and writes the proof.
"""
