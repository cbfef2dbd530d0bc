"""The folder in which this project caches reproducible data, for all programs of a user."""

import os
from pathlib import Path


def users_folder() -> Path | None:
    """Returns COCAP_OPT_CACHE, or cocap-opt in the user's cache folder.

    It is None if the user has no home.
    """
    if folder := os.environ.get("COCAP_OPT_CACHE"):
        return Path(folder)
    if caches := os.environ.get("XDG_CACHE_HOME"):
        return Path(caches) / "cocap-opt"
    try:
        return Path.home() / ".cache" / "cocap-opt"
    except RuntimeError:  # no HOME, and the user is not in the password database
        return None
