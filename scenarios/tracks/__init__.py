"""Tracks: people whom others recorded, in text, databases and GPX."""
