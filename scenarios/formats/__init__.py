"""Readers of scene files, one module for each format, and the options of the formats.

A reader has `read(path, seed)`, which returns the Problem, or `read(path, seed, options)` if its
format has options. If it can read plans, it has `read_plan(path, problem)`, which returns one path
of states per robot. `parts(path)` returns the further files of a scene, which must not be
overwritten. Readers raise a ProblemError with a message of one line that names the file. They are
listed in `cocap_opt.scenarios.FORMATS` and imported when a file needs them. Options are given as
words, such as {"triangles": "no"}; `Options` maps the words to values.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from cocap_opt.data import ProblemError

Values = Mapping[str, Mapping[str, Any]]

YES_NO: Mapping[str, Any] = MappingProxyType({"yes": True, "no": False})
NO_YES: Mapping[str, Any] = MappingProxyType({"no": False, "yes": True})
# no option is given: all have their default values
NOTHING: Mapping[str, str] = MappingProxyType({})


class Options(NamedTuple):
    """The options that a format has, and the words that each option may have."""

    values: Values = MappingProxyType({})  # by option and word; the first word is the default

    @property
    def allowed(self) -> Mapping[str, tuple[str, ...]]:
        """The words that each option may have, the default first."""
        return MappingProxyType({name: tuple(words) for name, words in self.values.items()})

    def chosen(self, given: Mapping[str, str]) -> dict[str, Any]:
        """Returns the values of all options; options without a given word have their default.

        Raises
        ------
        ProblemError
            If an option or its word is unknown; the message lists in one line what is allowed.
        """
        for name, word in given.items():
            if name not in self.values:
                raise ProblemError(f"option {name!r}: must be one of {', '.join(self.values)}")
            if word not in self.values[name]:
                allowed = ", ".join(self.values[name])
                raise ProblemError(f"option {name}: must be one of {allowed}, not {word!r}")
        return {name: self.values[name][word] for name, word in given.items()}
