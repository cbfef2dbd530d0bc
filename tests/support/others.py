"""The folder of scenes and data that other projects made, which may be missing."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("COCAP_OPT_DATA", Path(__file__).parents[3] / "shared" / "data"))


def data(name: str) -> Path:
    """Return a file or folder of the data folder, or skip the test where it is missing."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"needs {name} in the data folder (COCAP_OPT_DATA)")
    return path
