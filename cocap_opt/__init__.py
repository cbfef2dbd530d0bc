"""Offline multi-drone view planning: problem, graph, coverage, objective, planners, referee."""
