"""The words of the code: sentences that begin with their subject or verb, names of the thing."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("cocap_opt", "formulations", "scenarios", "experiments")
LAB = ROOT / "experiments" / "lab"
SAYS_NOTHING = ("own", "one", "some")
RIDDLE = re.compile(r"(Returns? (what|whether|how)|What|Whether|How)\b")
SUSPECT = re.compile(r'"""(Returns? (what|whether|how)|What|Whether|How)\b')
NAMED = re.compile(rf"\b({'|'.join(SAYS_NOTHING)})(:| [:=]?=| in |, \w+ (=|in) |[,)])")
# Rooms with sentences that are yet to be written, and with names that are yet to be given.
RIDDLES_LEFT = frozenset({
    "cocap_opt/coordination", "cocap_opt/files", "cocap_opt/flight", "cocap_opt/graph",
    "cocap_opt/missions", "cocap_opt/model", "cocap_opt/output", "cocap_opt/player",
    "cocap_opt/problem", "cocap_opt/run", "cocap_opt/vision", "experiments/sweeps",
    "formulations/certificates", "formulations/column_generation",
    "formulations/explanation.py", "formulations/relaxations", "scenarios/maps",
    "scenarios/meshes", "scenarios/tracks",
})  # fmt: skip
NAMES_LEFT = frozenset({
    "cocap_opt/api", "cocap_opt/cli", "cocap_opt/flight", "cocap_opt/missions",
    "cocap_opt/output", "cocap_opt/pictures", "cocap_opt/player", "cocap_opt/run",
    "experiments/sweeps", "formulations/column_generation", "formulations/early_bound.py",
    "formulations/explanation.py", "formulations/integer_programs", "formulations/relaxations",
    "formulations/second_opinion",
})  # fmt: skip


def room_of(path: Path) -> str:
    """The folder of a module, at most two names deep; a module of a top folder is itself."""
    parts = path.relative_to(ROOT).parts
    return "/".join(parts[:2])


def suspects(words: re.Pattern[str], but: frozenset[str]) -> Iterator[tuple[Path, ast.Module]]:
    """Syntax trees of the wheel's modules that hold such words, but for those of some rooms."""
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):  # does not follow links
            if path.is_relative_to(LAB) or room_of(path) in but:
                continue
            text = path.read_text(encoding="utf-8")
            if words.search(text):
                yield path, ast.parse(text)


def docstrings(tree: ast.Module) -> Iterator[str]:
    """Docstrings of a module and of all public names in it, methods, too."""
    inside: list[ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef] = [tree]
    while inside:
        node = inside.pop()
        yield ast.get_docstring(node) or ""
        if isinstance(node, ast.Module | ast.ClassDef):
            inside += [
                inner for inner in node.body
                if isinstance(inner, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
                and not inner.name.startswith("_")
            ]  # fmt: skip


def variables(tree: ast.Module) -> Iterator[str]:
    """Names that a module gives to values: variables, loops' and comprehensions', parameters."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg


def test_public_docstrings_are_sentences() -> None:
    """They say who does it, or begin with a verb: "Returns what .." leaves the reader guessing."""
    riddles = [
        f"{path.relative_to(ROOT)}: {text.splitlines()[0]}"
        for path, tree in suspects(SUSPECT, RIDDLES_LEFT)
        for text in docstrings(tree)
        if RIDDLE.match(text)
    ]
    assert riddles == []


def test_variables_are_named_after_the_thing() -> None:
    """No variable is called `own`, `one` or `some`, of which nobody knows what it holds."""
    found = {
        f"{path.relative_to(ROOT)}: {name}"
        for path, tree in suspects(NAMED, NAMES_LEFT)
        for name in variables(tree)
        if name in SAYS_NOTHING
    }
    assert found == set()


def test_the_glossary_has_the_words_that_were_chosen() -> None:
    """Who meets one of them in code, files or pages finds it there, in a row of its own."""
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (.+?) \|", text, re.MULTILINE)
    words = {word.strip() for row in rows for word in row.split(",")}
    assert {
        "joint state", "multiplier", "price", "listed", "explored", "reduced profit",
        "reduced cost", "ceiling", "step envelope", "staged", "target", "slack", "incumbent",
        "team", "constraint", "charge", "conflict", "dual bound", "gap", "certificate",
    } <= words  # fmt: skip


def test_each_word_stands_in_the_glossary_once() -> None:
    """One word for one thing, and one meaning for a word."""
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    words = re.findall(r"^\| (.+?) \|", text.partition("## Letters")[0], re.MULTILINE)[2:]
    assert len(words) > 50
    assert len(set(words)) == len(words)


def test_contributing_says_where_things_are() -> None:
    """Each path in the table of what one looks for exists, as it is written there."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text.partition("| you look for")[2].partition("To add a planner")[0]
    answers = "\n".join(line.partition(" | ")[2] for line in table.splitlines())
    named = re.findall(r"`([\w/]+/[\w/]+(?:\.py)?|\w+\.py)`", answers)
    assert len(named) > 30
    assert [path for path in named if not (ROOT / path).exists()] == []
