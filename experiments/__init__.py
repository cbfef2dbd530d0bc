"""Sweeps, tables, figures and the command line."""
