"""Benchmarks: ratios measured within one run. `python -m experiments.benchmarks`."""
