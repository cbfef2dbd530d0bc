"""The experiments of the CoCap paper, repeated over many seeds; bounds answer its claims."""

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
