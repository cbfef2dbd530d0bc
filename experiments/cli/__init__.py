"""The command line, `cocap-opt`: a module per family of commands."""

__all__ = [
    "commands",
    "figure_commands",
    "fly_command",
    "gap_command",
    "main",
    "options",
    "picture_commands",
    "result_commands",
    "scene_commands",
    "solver_commands",
    "verify_command",
]
