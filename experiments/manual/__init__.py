"""The parts of the documentation that are made from the code: commands, columns, files, scenes."""

__all__ = ["commands", "entries", "formats", "gallery", "lists"]
