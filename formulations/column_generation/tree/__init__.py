"""The tree of branch-and-price: the relaxation of each node, the root, and the nodes below it.

`relaxation` solves a node and makes plans from it, and `diving` makes one more; `root` solves the
root, `large_root` the root of scenes with very many robots; `tree` manages the nodes and writes the
proof.
"""
