"""Adds the built pages of a version to the folder that is published, beside all other versions.

    python .ci/add_version.py build/docs site v0.2.0

The folder then has a folder for each version, versions.json, which the choice of versions reads,
and at its root a way to the newest release, and llms.txt of it. A candidate such as v1.0.0rc1 comes
first only where there is no release yet.
"""

import json
import shutil
import sys
from pathlib import Path

from packaging.version import InvalidVersion, Version

LATEST = "latest"  # of the main branch


def add_version(built: Path, site: Path, name: str) -> None:
    """Copies the pages, and writes what names the versions.

    Raises
    ------
    ValueError
        If the name is neither `latest` nor a version such as v0.2.0 or v1.0.0rc1.
    """
    version = _version(name)
    if name != LATEST and version is None:
        raise ValueError(f"{name}: must be {LATEST} or a version such as v0.2.0 or v1.0.0rc1")
    folder = site / (LATEST if version is None else str(version))
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(built, folder, ignore=shutil.ignore_patterns(".doctrees", ".buildinfo"))
    numbers = [number for path in site.iterdir() if (number := _version(path.name)) is not None]
    numbers.sort(reverse=True)  # a candidate is less than its release
    final = [number for number in numbers if not number.is_prerelease]
    first = str(next(iter(final or numbers), LATEST))
    latest = [LATEST] if (site / LATEST).is_dir() else []
    versions = [*latest, *map(str, numbers)]
    (site / "versions.json").write_text(json.dumps(versions) + "\n")
    (site / "index.html").write_text(
        f'<!doctype html><meta charset="utf-8"><title>cocap-opt</title>'
        f'<meta http-equiv="refresh" content="0; url={first}/"><a href="{first}/">cocap-opt</a>\n'
    )
    short = (site / first / "llms.txt").read_text(encoding="utf-8")
    (site / "llms.txt").write_text(short.replace("](", f"]({first}/"), encoding="utf-8")
    (site / ".nojekyll").touch()  # folders such as _static are published, too


def _version(name: str) -> Version | None:
    """Returns the version that a tag or a folder names, None if it names none."""
    try:
        return Version(name)
    except InvalidVersion:
        return None


if __name__ == "__main__":
    add_version(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
