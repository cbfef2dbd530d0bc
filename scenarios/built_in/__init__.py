"""The scenes that come with the project."""
