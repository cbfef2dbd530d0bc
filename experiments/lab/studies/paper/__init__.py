"""The experiments of the CoCap paper, made again over many seeds and answered with bounds."""

__all__ = [
    "answers",
    "claims",
    "conditions",
    "figures",
    "giving_way",
    "measured",
    "page",
    "planner_table",
    "reproduction",
]
