"""The terminal: its streams, progress, and the options of commands."""

__all__ = ["options", "progress", "streams", "threads", "versions"]
