"""Options of scene files in words, such as {"triangles": "no"}, and what they stand for."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from cocap_opt.data import ProblemError

Values = Mapping[str, Mapping[str, Any]]  # by name, then by word; the first word is the default

YES_NO: Mapping[str, Any] = MappingProxyType({"yes": True, "no": False})
NO_YES: Mapping[str, Any] = MappingProxyType({"no": False, "yes": True})


def words(values: Values) -> Mapping[str, tuple[str, ...]]:
    """The words that each option may have."""
    return MappingProxyType({name: tuple(some) for name, some in values.items()})


def chosen(options: Mapping[str, str], values: Values) -> dict[str, Any]:
    """Values of the options that are given, by name.

    Raises
    ------
    ProblemError
        If there is no such option, or it has no such value; one line with what is allowed.
    """
    for name, word in options.items():
        if name not in values:
            raise ProblemError(f"option {name!r}: must be one of {', '.join(values)}")
        if word not in values[name]:
            allowed = ", ".join(values[name])
            raise ProblemError(f"option {name}: must be one of {allowed}, not {word!r}")
    return {name: values[name][word] for name, word in options.items()}
