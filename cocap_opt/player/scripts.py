"""Scripts of pages: the ES modules of the folder `page`, put together as one script.

A page is one file, and browsers load modules from files of their own only. So each module becomes a
function that runs once, after those from which it imports, and returns what it exports: names of
one module are unknown to the others, as between modules. A bundler from npm would do no more here
that is needed: pages are made wherever cocap-opt is installed, from the scripts themselves, and a
committed bundle would be a second copy of them, to be made anew, and merged, at each change.

Modules keep to a part of the language, beyond which they are refused: imports of names from files
beside them, and exports in front of a `const` with one name, a function or a class.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

from cocap_opt.player.pages import page_text

_IMPORT = re.compile(r'^import \{([\w\s,]+)\} from "\./(\w+)\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:const|function|class) (\w+))", re.MULTILINE)
_COMMENT = re.compile(r"^\s*(?://.*)?\n|^ +", re.MULTILINE)
_OTHER = re.compile(r"^(?:import|export)\b.*|\bimport\(.*", re.MULTILINE)


class _Module(NamedTuple):
    """A script, and the names that it takes from others by their names, and gives to them."""

    imports: dict[str, list[str]]
    exports: list[str]
    body: str


def bundled(*entries: str) -> str:
    """Returns a script that does what modules of the folder `page` do, named without `.js`.

    What a module exports is in an object named after it, such as `$geometry`.

    Raises
    ------
    ValueError
        If modules import what is not exported, or each other in a circle, or say so otherwise than
        is known here; one line that names the module.
    """
    made: dict[str, _Module] = {}
    functions = [function for entry in entries for function in _functions(entry, made, ())]
    return "\n".join(('"use strict";', *functions))


def _functions(name: str, made: dict[str, _Module], above: tuple[str, ...]) -> Iterator[str]:
    """Yields the function of a module, after those of modules that it needs, if not made yet."""
    if name in above:
        raise ValueError(f"{name}.js: must not import itself: {' -> '.join((*above, name))}")
    if name in made:
        return
    module = _module(name, page_text(f"{name}.js"))
    lines = []
    for other, names in module.imports.items():
        yield from _functions(other, made, (*above, name))
        for unknown in sorted(set(names) - set(made[other].exports)):
            raise ValueError(f"{name}.js: {other}.js does not export {unknown!r}")
        lines.append(f"const {{ {', '.join(names)} }} = ${other};\n")
    made[name] = module
    head, exports = "".join(lines), ", ".join(module.exports)
    yield f"const ${name} = (() => {{\n{head}{module.body}return {{ {exports} }};\n}})();"


def _module(name: str, text: str) -> _Module:
    """Returns a module without comments and indents, which would be a fifth of a page."""
    text = _COMMENT.sub("", text)
    imports = {found[2]: re.findall(r"\w+", found[1]) for found in _IMPORT.finditer(text)}
    exports, body = _EXPORT.findall(text), _EXPORT.sub("", _IMPORT.sub("", text))
    if other := _OTHER.search(body):
        raise ValueError(f"{name}.js: must import and export as other modules do, not {other[0]!r}")
    return _Module(imports, exports, body)
