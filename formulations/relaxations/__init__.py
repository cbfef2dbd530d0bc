"""Concave relaxations, their cuts, and the multipliers that they give."""
