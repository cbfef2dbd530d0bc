"""The command line, `cocap-opt`: a module per family of commands."""

__all__ = ["commands", "main", "scene_commands"]
