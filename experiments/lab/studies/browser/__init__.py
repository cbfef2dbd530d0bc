"""Certificates checked in a browser: the files beside the page that does it, and its speed."""

__all__ = ["browser", "files"]
