"""The versions of Python, libraries and the system, for bug reports and to reproduce results."""

import platform
import re
import sys
from importlib.metadata import PackageNotFoundError, requires, version

_OWN = "cocap-opt"
_FOR_DEVELOPERS = r"extra == .(test|docs)\b"  # extras that do not affect results


def show_versions() -> None:
    """Print the versions of Python, cocap-opt, its libraries and the system, for bug reports.

    Examples
    --------
    >>> co.show_versions()
    """
    rows = versions()
    width = max(map(len, rows))
    sys.stdout.write("".join(f"{name:{width}}  {found}\n" for name, found in rows.items()))


def versions() -> dict[str, str]:
    """Returns the versions by name; "-" for a library of an extra that is not installed."""
    wanted = [line for line in requires(_OWN) or () if not re.search(_FOR_DEVELOPERS, line)]
    libraries = {name[0] for line in wanted if (name := re.match(r"[\w.-]+", line))}
    return {
        _OWN: version(_OWN),
        "python": platform.python_version(),
        "system": platform.platform(),
        **{name: _installed(name) for name in sorted(libraries, key=str.lower)},
    }


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "-"
