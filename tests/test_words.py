"""The words of the code: sentences that begin with their subject or verb, names of the thing."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("cocap_opt", "formulations", "scenarios", "experiments")
SAYS_NOTHING = ("own", "one", "some")
RIDDLE = re.compile(r"(Returns? (what|whether|how)|What|Whether|How|Where|Those)\b")
SUSPECT = re.compile(rf'"""{RIDDLE.pattern}')
# Of the style page's list in CONTRIBUTING.md, what no plain sentence of ours needs: prices that
# pay, things that stand somewhere, tell or want, and people who are but a pronoun; and words with a
# usual one in their place: at least, default, excluding, CPU time, too close.
THINGS = (
    "numbers? words? names? tables? files? lines? comments? pages? folders? columns? pictures? "
    "keys? lists? seconds dicts? modules? marks? texts? which that"
).replace(" ", "|")
PLACES = "in(?! the way)|beside|above|below|behind|under|before|first"
BLACK = re.compile(
    rf"\b(paid|pays?|(?:is|are|was|were|be) told|nobody (?:says|knows)|whoever|wants? `"
    r"|from which on|if not given|comes? on top|processor time|too near(?!ly)|come nearer"
    rf"|(?:{THINGS}) (?:tells?|wants?|stands? (?:{PLACES}))"
    r"|(?:on|in|beside|above|below|behind) (?:it|them|(?:the|a|each) \w+) stands?)\b",
    re.IGNORECASE,
)
# Rooms whose words are those of the player, the crew's sheet and the commands, held by their tests.
SPOKEN = ("cocap_opt/cli/", "cocap_opt/player/", "cocap_opt/missions/sheet/")
NAMED = re.compile(rf"\b({'|'.join(SAYS_NOTHING)})(:| [:=]?=| in |, \w+ (=|in) |[,)])")


def suspects(words: re.Pattern[str]) -> Iterator[tuple[Path, ast.Module]]:
    """Syntax trees of modules that hold such words."""
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):  # does not follow links
            text = path.read_text(encoding="utf-8")
            if words.search(text):
                yield path, ast.parse(text)


def docstrings(tree: ast.Module) -> Iterator[str]:
    """Docstrings of a module and of all classes and functions in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield ast.get_docstring(node) or ""


def variables(tree: ast.Module) -> Iterator[str]:
    """Names that a module gives to values: variables, loops' and comprehensions', parameters."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg


def test_docstrings_are_sentences() -> None:
    """They say who does it, or begin with a verb: "Returns what .." leaves the reader guessing."""
    riddles = [
        f"{path.relative_to(ROOT)}: {text.splitlines()[0]}"
        for path, tree in suspects(SUSPECT)
        for text in docstrings(tree)
        if RIDDLE.match(text)
    ]
    assert riddles == []


def test_variables_are_named_after_the_thing() -> None:
    """No variable is called `own`, `one` or `some`, which say nothing about what it holds."""
    found = {
        f"{path.relative_to(ROOT)}: {name}"
        for path, tree in suspects(NAMED)
        for name in variables(tree)
        if name in SAYS_NOTHING
    }
    assert found == set()


def said(path: Path) -> str:
    """The prose of a page in one line, without code, comments and the list of CONTRIBUTING."""
    text = path.read_text(encoding="utf-8").partition("| rule | not | but |")
    text = text[0] + text[2].partition("\n\n")[2]
    return " ".join(re.sub(r"(?ms)^```.*?^```$|<!--.*?-->|`[^`]*`", "` `", text).split())


def notebook_text(path: Path) -> str:
    """The prose of a notebook, in one line."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    texts = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    return " ".join(" ".join(texts).split())


def test_pages_have_no_word_of_the_black_list() -> None:
    """Things define, contain, pass and show; they do not stand, tell, pay or want."""
    texts = {
        **{path: said(path) for path in ROOT.glob("*.md")},
        **{path: said(path) for path in (ROOT / "docs").rglob("*.md")},
        **{path: said(path) for path in (ROOT / "scenarios").rglob("*.md")},
        **{path: notebook_text(path) for path in (ROOT / "docs").rglob("*.ipynb")},
    }
    assert len(texts) > 100
    found = [
        f"{path.relative_to(ROOT)}: {text[max(0, match.start() - 40) : match.end() + 20]}"
        for path, text in texts.items()
        for match in BLACK.finditer(text)
    ]
    assert found == []


def test_docstrings_have_no_word_of_the_black_list() -> None:
    """They become help and pages."""
    found = [
        f"{path.relative_to(ROOT)}: {' '.join(match[0].split())}"
        for path, tree in suspects(BLACK)
        if not path.relative_to(ROOT).as_posix().startswith(SPOKEN)
        for text in docstrings(tree)
        for match in BLACK.finditer(" ".join(re.sub(r"`+[^`]*`+", "` `", text).split()))
    ]
    assert found == []


def test_pictures_have_no_word_of_the_black_list() -> None:
    """Titles and legends of pictures are read as pages are."""
    comments = [
        (path.name, comment)
        for path in (ROOT / "docs" / "pictures").glob("*.svg")
        for comment in re.findall(r"<!-- (.*?) -->", path.read_text(encoding="utf-8"))
    ]
    assert comments  # as Matplotlib writes them
    found = [f"{name}: {match[0]}" for name, words in comments for match in BLACK.finditer(words)]
    assert found == []


def glossary_rows() -> dict[str, str]:
    """The words of the glossary's rows, by the anchors that links lead to."""
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    table = text.partition("|---")[2].partition("## ")[0]
    rows = re.findall(r'^\| <a id="([a-z0-9-]+)"></a>(.+?) \|', table, re.MULTILINE)
    assert len(rows) == len(re.findall(r"^\| ", table, re.MULTILINE)) == len(dict(rows))
    return dict(rows)


def test_the_glossary_has_the_words_that_were_chosen() -> None:
    """Who meets one of them in code, files or pages finds it there, in a row of its own."""
    words = {word.strip() for row in glossary_rows().values() for word in row.split(",")}
    assert {
        "joint state", "multiplier", "price", "listed", "explored", "reduced profit",
        "reduced cost", "ceiling", "step envelope", "staged", "target", "slack", "incumbent",
        "team", "constraint", "charge", "conflict", "dual bound", "gap", "certificate",
    } <= words  # fmt: skip


def test_each_word_stands_in_the_glossary_once() -> None:
    """One word for one thing, and one meaning for a word; in the order of the alphabet."""
    words = [*glossary_rows().values()]
    assert len(words) > 50
    assert len(set(words)) == len(words)
    assert words == sorted(words, key=lambda word: re.sub(r"[^a-z0-9 ]", "", word.lower()))


def test_contributing_says_where_things_are() -> None:
    """Each path in the table of what one looks for exists, as it is written there."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text.partition("| you look for")[2].partition("To add a planner")[0]
    answers = "\n".join(line.partition(" | ")[2] for line in table.splitlines())
    named = re.findall(r"`([\w/]+/[\w/]+(?:\.py)?|\w+\.py)`", answers)
    assert len(named) > 30
    assert [path for path in named if not (ROOT / path).exists()] == []
