"""Adds the built pages of a version to the folder that is published, beside all other versions.

    python .ci/add_version.py build/docs site v0.2.0

The folder then has a folder for each version, versions.json, which the choice of versions reads,
and at its root a way to the newest release, and llms.txt of it.
"""

import json
import re
import shutil
import sys
from pathlib import Path

LATEST = "latest"  # of the main branch
_TAG = re.compile(r"v?(\d+(?:\.\d+)*)")


def add_version(built: Path, site: Path, name: str) -> None:
    """Copies the pages, and writes what names the versions.

    Raises
    ------
    ValueError
        If the name is neither `latest` nor a number such as v0.2.0.
    """
    found = _TAG.fullmatch(name)
    if name != LATEST and found is None:
        raise ValueError(f"{name}: must be {LATEST} or a number such as v0.2.0")
    version = LATEST if found is None else found[1]
    shutil.rmtree(site / version, ignore_errors=True)
    shutil.copytree(built, site / version, ignore=shutil.ignore_patterns(".doctrees", ".buildinfo"))
    versions = sorted((p.name for p in site.iterdir() if _is_version(p)), key=_newest_first)
    first = next((name for name in versions if name != LATEST), LATEST)
    (site / "versions.json").write_text(json.dumps(versions) + "\n")
    (site / "index.html").write_text(
        f'<!doctype html><meta charset="utf-8"><title>cocap-opt</title>'
        f'<meta http-equiv="refresh" content="0; url={first}/"><a href="{first}/">cocap-opt</a>\n'
    )
    short = (site / first / "llms.txt").read_text(encoding="utf-8")
    (site / "llms.txt").write_text(short.replace("](", f"]({first}/"), encoding="utf-8")
    (site / ".nojekyll").touch()  # folders such as _static are published, too


def _is_version(path: Path) -> bool:
    return path.is_dir() and (path.name == LATEST or _TAG.fullmatch(path.name) is not None)


def _newest_first(version: str) -> tuple[bool, list[int]]:
    """Returns the key by which `latest` comes first, and then greater numbers before smaller."""
    return version != LATEST, [-int(n) for n in version.split(".")] if version != LATEST else []


if __name__ == "__main__":
    add_version(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
