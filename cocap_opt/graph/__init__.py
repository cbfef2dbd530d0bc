"""The time-expanded graph: networkx motion graphs, their compiled form, and its charges."""
