"""The parts of the documentation that are made from the code: commands, files, worked examples."""

__all__ = ["code_lines", "contents", "entries", "marks", "wholes", "written"]
