"""Checking certificates in a browser: the files that the page needs, and its speed."""

__all__ = ["browser", "files"]
