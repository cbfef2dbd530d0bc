"""The parts of the documentation that are made from the code: commands, files, worked examples."""

__all__ = ["contents", "entries", "marks", "written"]
