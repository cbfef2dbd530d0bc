"""The terminal: streams, progress, options with several values, and how programs begin and end."""

__all__ = ["options", "program", "progress", "streams"]
