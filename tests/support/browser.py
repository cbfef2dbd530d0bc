"""Looks into a page in a browser."""

from typing import Any


def value(page: Any, expression: str) -> Any:
    """Value of an expression in the page."""
    return page.execute_script(f"return {expression}")
