"""Compiled functions that are kept on disk."""

import os
from pathlib import Path

from cocap_opt import compiling


def test_what_was_kept_of_an_earlier_source_is_removed(tmp_path: Path) -> None:
    """Of the same function alone: it may name a class that is no longer there."""
    changed = Path(__file__).stat().st_mtime
    stem = __name__.rpartition(".")[2]

    def function() -> None:
        """Stands for one that is compiled."""

    own = f"{stem}.{function.__qualname__}"
    ages = {
        f"{own}-1.py311.nbi": -10.0, f"{own}-1.py311.1.nbc": -10.0,
        f"{own}-2.py311.nbi": 10.0, f"{stem}.other-1.py311.nbi": -10.0,
    }  # fmt: skip
    for name, age in ages.items():
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (changed + age, changed + age))
    compiling._forget_what_is_older(tmp_path, function)
    assert {file.name for file in tmp_path.iterdir()} == {
        f"{own}-2.py311.nbi", f"{stem}.other-1.py311.nbi",
    }  # fmt: skip
