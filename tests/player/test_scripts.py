"""The scripts of pages: modules put together as one script."""

import re

import pytest
from players import ROOT

from cocap_opt.player import scripts
from cocap_opt.player.scripts import bundled

PAGE = ROOT / "cocap_opt" / "player" / "page"
ENTRIES = ("player", "starts")
SOURCES = {
    "main": """// Runs.
import { twice } from "./more.js";
import {
  one, A,
} from "./less.js";

globalThis.found = twice(one) + A;
""",
    "more": """import { one } from "./less.js";

export function twice(x) {
  return 2 * x;  // of one
}
""",
    "less": "const hidden = 1;\nexport const one = hidden;\nexport class A {}\n",
}


@pytest.fixture
def sources(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Modules in place of those of the folder."""
    found = dict(SOURCES)
    monkeypatch.setattr(scripts, "page_text", lambda name: found[name.removesuffix(".js")])
    return found


def test_each_module_runs_once_after_those_that_it_needs(sources: dict[str, str]) -> None:
    """It has what it imports, and gives what it exports; comments and indents are left out."""
    assert (
        bundled("main")
        == """"use strict";
const $less = (() => {
const hidden = 1;
const one = hidden;
class A {}
return { one, A };
})();
const $more = (() => {
const { one } = $less;
function twice(x) {
return 2 * x;  // of one
}
return { twice };
})();
const $main = (() => {
const { twice } = $more;
const { one, A } = $less;
globalThis.found = twice(one) + A;
return {  };
})();"""
    )


KNOWN = "less.js: must import and export as other modules do, not "


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("const one = 1;\nexport class A {}\n", "more.js: less.js does not export 'one'"),
        ('import { twice } from "./more.js";\n', "must not import itself: main -> more -> less"),
        ("export default 3;\n", KNOWN + "'export default 3;'"),
        ("export let one = 3;\n", KNOWN + "'export let one = 3;'"),
        ('import * as x from "./a.js";\n', KNOWN + "'import * as"),
        ('const one = await import("./a.js");\n', KNOWN + "'import("),
    ],
)
def test_what_modules_may_not_do_is_said(text: str, words: str, sources: dict[str, str]) -> None:
    """One line that names the module: nothing is bundled that would mean something else."""
    sources["less"] = text
    with pytest.raises(ValueError, match=re.escape(words)) as raised:
        bundled("main")
    assert "\n" not in str(raised.value)


def test_each_script_is_part_of_a_page() -> None:
    """All files are bundled, and nothing is imported or exported that nobody uses.

    Tests use names, too.
    """
    files = {path.stem: path.read_text("utf-8") for path in PAGE.glob("*.js")}
    whole = "".join(bundled(entry) for entry in ENTRIES)
    assert set(re.findall(r"^const \$(\w+) = ", whole, re.MULTILINE)) == set(files)
    browsing = (ROOT / "tests" / "lab").glob("*browser.py")
    tests = "".join(path.read_text("utf-8") for path in browsing)
    taken = set[str]()
    for name, text in files.items():
        module = scripts._module(name, text)
        for names in module.imports.values():
            assert [n for n in names if not re.search(rf"\b{n}\b", module.body)] == [], name
            taken |= set(names)
    for name, text in files.items():
        exports = scripts._module(name, text).exports
        assert [n for n in exports if n not in taken and n not in tests] == [], name


# What declares a name: a statement, a parameter or a part of one, a method.
DECLARED = (
    r"\b(?:const|let|function|class|for \(const)\s+{0}\b|^\s*(?:static |get )?{0}\([^;]*\) \{{$"
    r"|(?:const|let|,|\(|\[|\{{)[^=;()]*[\s,\[{{(]{0}\b[^=;()]*[\]}}] (?:=|of|=>)|\b{0}\)? =>"
    r"|\([^()]*\b{0}\b[^()]*\) (?:=>|\{{)|, {0} = "
)


def test_no_module_uses_names_that_it_does_not_import() -> None:
    """Constants, classes and calls of functions that are others', which only fail when they run."""
    files = {path.stem: path.read_text("utf-8") for path in PAGE.glob("*.js")}
    top = r"^(?:export )?(?:const|function|class) (\w+)"
    owned = {name: set(re.findall(top, text, re.MULTILINE)) for name, text in files.items()}
    missing = []
    for name, text in files.items():
        module = scripts._module(name, text)
        body = re.sub(r"//.*|\"[^\"\n]*\"", "", module.body)
        known = owned[name].union(*module.imports.values())
        for other in sorted(set[str]().union(*owned.values()) - known):
            use = rf"(?<![.\w$`]){other}\b(?!:)" if other[0].isupper() else rf"(?<![.\w$]){other}\("
            if other not in body or not re.search(use, body):
                continue
            if not re.search(DECLARED.format(other), body, re.MULTILINE):  # it takes seconds
                missing.append(f"{name}.js: {other}")
    assert missing == []
