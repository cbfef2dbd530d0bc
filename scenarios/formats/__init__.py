"""Readers of other projects' scene files."""
