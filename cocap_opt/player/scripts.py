"""Scripts of pages: the ES modules of the folder `page`, bundled as one script.

A page is one file, but browsers load each module from a separate file. So each module becomes a
function that runs once, after the modules that it imports, and returns its exports; all other names
stay private. A bundler from npm would have no advantage here: pages are made from the scripts
wherever cocap-opt is installed, and a committed bundle would be a second copy of them, to be
rebuilt and merged at each change.

Modules may use only these forms, and are rejected otherwise: imports of names from files in the
same folder, and exports before a `const` with one name, a function or a class.
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
    """A script, the names that it imports from each other script, and the names it exports."""

    imports: dict[str, list[str]]
    exports: list[str]
    body: str


def bundled(*entries: str) -> str:
    """Returns one script for modules of the folder `page`, which are named without `.js`.

    The exports of a module are in an object named after it, such as `$geometry`.

    Raises
    ------
    ValueError
        If a module imports a name that is not exported, if modules import each other in a circle,
        or if an import or export has another form; one line that names the module.
    """
    made: dict[str, _Module] = {}
    functions = [function for entry in entries for function in _functions(entry, made, ())]
    return "\n".join(('"use strict";', *functions))


def _functions(name: str, made: dict[str, _Module], above: tuple[str, ...]) -> Iterator[str]:
    """Yields the function of a module after those of the modules it imports, each only once."""
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
    """Returns a module without comments and indentation, which would be a fifth of a page."""
    text = _COMMENT.sub("", text)
    imports = {found[2]: re.findall(r"\w+", found[1]) for found in _IMPORT.finditer(text)}
    exports, body = _EXPORT.findall(text), _EXPORT.sub("", _IMPORT.sub("", text))
    if other := _OTHER.search(body):
        raise ValueError(f"{name}.js: must import and export as other modules do, not {other[0]!r}")
    return _Module(imports, exports, body)
