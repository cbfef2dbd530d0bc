"""The scenes that come with the project.

Each module has a dict `SCENES` of its scenes: functions from a seed to a Problem, by name.
"""

__all__ = ["field", "parts", "tiny", "walled"]
