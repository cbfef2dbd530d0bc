"""Benchmarks: `cocap-opt study`, and its commands `solvers` and `growth`.

What is measured is a ratio within one run, or a median over seeds: machines are slow and busy.
"""
