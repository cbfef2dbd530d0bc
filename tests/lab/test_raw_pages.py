"""The pages as they are committed: whole for whoever reads them, and true to what is stored."""

import io
import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token
from mdit_py_plugins.dollarmath import dollarmath_plugin
from pages import DOCS, ROOT, counted
from PIL import Image

import cocap_opt as co
from cocap_opt.cli.commands import app
from cocap_opt.experiments.lab.manual import entries, written
from cocap_opt.experiments.lab.manual.diagrams import DIAGRAMS
from cocap_opt.experiments.lab.manual.entries import ENTRIES, all_entries
from cocap_opt.experiments.lab.manual.marks import filled, names_in, on_the_site, without_marks
from cocap_opt.experiments.lab.manual.worked_words import WORKED
from cocap_opt.experiments.lab.manual.written import DRAWN, PICTURES, SCHEMAS
from cocap_opt.experiments.lab.studies.drawings import DRAWINGS
from cocap_opt.files.documents import FileError
from cocap_opt.pictures.style import WIDTH

GITHUB = MarkdownIt("commonmark").enable(["table", "strikethrough"]).use(dollarmath_plugin)
READ = [
    *written.pages(), ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").rglob("*.ipynb")),
]  # fmt: skip
SLOW = {"trade_off", "trade_off_steps", *WORKED, "tangents"}  # solved anew, which takes a minute
_MOST = 4_000_000  # bytes of all pictures
_LARGEST = 600_000  # of one of them
_REST = re.compile(r"\{\{|\}\}|^:::|\{[a-z-]+\}`", re.MULTILINE)
_NUMBER = re.compile(r"-?\d[\d,]*(?:\.\d+)?(?:e-?\d+)?")


def parsed(page: Path) -> list[Token]:
    """What a page is for a renderer that knows GitHub's Markdown, its inline parts included."""
    tokens = GITHUB.parse(page.read_text(encoding="utf-8"))
    return [*tokens, *(child for token in tokens for child in token.children or ())]


def prose(page: Path) -> Iterator[str]:
    """The texts of a page that are neither code nor comments."""
    for token in parsed(page):
        if token.type == "text":
            yield token.content
        elif token.type in ("html_block", "html_inline"):
            yield re.sub(r"<!--.*?-->", "", token.content, flags=re.DOTALL)


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives the headings of a page."""
    tokens = GITHUB.parse(page.read_text(encoding="utf-8"))
    found = set[str]()
    for head, inline in pairwise(tokens):
        if head.type == "heading_open":
            words = "".join(t.content for t in inline.children or () if t.type != "html_inline")
            found.add(re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-"))
    return found


def links(page: Path) -> Iterator[str]:
    """The addresses of links and pictures of a page, those of other sites left out."""
    for token in parsed(page):
        addresses = [token.attrGet("href"), token.attrGet("src")]
        if token.type in ("html_block", "html_inline"):
            shown = re.sub(r"<!--.*?-->", "", token.content, flags=re.DOTALL)
            addresses += re.findall(r'(?:href|src)="([^"]+)"', shown)
        for address in addresses:
            if isinstance(address, str) and not re.match(r"\w+:", address):
                yield address


MARKDOWN = [page for page in READ if page.suffix == ".md"]
each = pytest.mark.parametrize("page", MARKDOWN, ids=lambda page: str(page.relative_to(ROOT)))


@each
def test_nothing_of_the_workshop_is_left_on_a_page(page: Path) -> None:
    """Neither placeholders nor directives nor roles of Sphinx, which GitHub shows as they are."""
    assert [text for text in prose(page) if _REST.search(text)] == []
    fences = [token.info for token in parsed(page) if token.type == "fence"]
    assert [info for info in fences if "{" in info] == []
    assert "<!--" not in "".join(prose(page))


def shown_raw(page: Path) -> str:
    """Returns the text of a page as GitHub shows it, without what only the site has."""
    return re.sub(r"<!--.*?-->", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)


@each
def test_pages_are_whole_where_they_are_read_raw(page: Path) -> None:
    """No page includes another file on the site alone: it holds the text, or links to the file.

    Nor is a page left with a heading and a sentence.
    """
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"(?m)^```\{(?:literal)?include\}", text) == []
    assert counted(shown_raw(page)) > 80


def test_the_page_of_the_checker_names_its_parts() -> None:
    """What it says of `cocap_check.py` is there, in that order."""
    page = (DOCS / "reference" / "cocap-check.md").read_text(encoding="utf-8")
    source = (ROOT / "formulations" / "independent" / "cocap_check.py").read_text(encoding="utf-8")
    listed = re.findall(r"^\d\. (.+)$", page, re.MULTILINE)
    assert len(listed) == 6
    firsts = [re.findall(r"`(\w+)`", line)[0] for line in listed]
    places = [re.search(rf"^(?:def|class) {name}\b", source, re.MULTILINE) for name in firsts]
    starts = [place.start() for place in places if place is not None]
    assert len(starts) == len(firsts) and starts == sorted(starts)


@each
def test_formulas_are_those_of_github(page: Path) -> None:
    """Blocks are fenced; in a line no sign is escaped, for Markdown takes the backslash away."""
    found = [token for token in parsed(page) if token.type.startswith("math_")]
    assert [token.content for token in found if token.type != "math_inline"] == []
    assert [token.content for token in found if re.search(r"\\[^a-zA-Z ]", token.content)] == []


@each
def test_marks_are_in_pairs(page: Path) -> None:
    """Each has its end, also those of parts that only the built site shows."""
    if page in written.pages():  # others explain marks
        written.rewritten(page, str)
        on_the_site(page.read_text(encoding="utf-8"))


@each
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    """Each file that a page names is in the repository, and each heading on its page."""
    missing = []
    for address in links(page):
        name, _, anchor = address.partition("#")
        path = (page.parent / name).resolve() if name else page
        real = path.is_relative_to(ROOT.resolve()) and path.exists()
        if not real or (anchor and path.suffix == ".md" and anchor not in anchors(path)):
            missing.append(address)
    assert missing == []


def test_no_link_of_a_page_goes_through_a_link_of_files() -> None:
    """GitHub does not follow these."""
    linked = [path for path in DOCS.rglob("*") if path.is_symlink()]
    assert linked == []


@pytest.fixture(scope="module")
def entry() -> Callable[[str], str]:
    """The function that makes what stands between the marks."""
    return all_entries(app, co)


MARKED = [page for page in written.pages() if names_in(page.read_text(encoding="utf-8"))]


def held(text: str) -> dict[str, str]:
    """Returns what stands between the marks of a page, by name."""
    found = dict[str, str]()
    filled(text, lambda name: found.setdefault(name, name))
    block = r"<!-- quote: (\S+) -->\n\n(.*?)\n\n<!-- end of quote -->"
    inline = r"<!-- n: (\S+) -->(.*?)<!-- /n -->"
    stood = dict(re.findall(block, text, re.DOTALL)) | dict(re.findall(inline, text))
    assert set(stood) == set(found), "a mark is empty; run python docs/write.py"
    return stood


@pytest.mark.slow
@pytest.mark.parametrize("page", MARKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_hold_what_is_stored(page: Path, entry: Callable[[str], str]) -> None:
    """`python docs/write.py` would change nothing."""
    for name, text in held(page.read_text(encoding="utf-8")).items():
        if name not in SLOW:
            assert text == entry(name), f"{name}: run python docs/write.py"


@pytest.mark.slow(seconds=40)
def test_pages_hold_what_is_solved(entry: Callable[[str], str]) -> None:
    """The worked examples, solved again, say the same; numbers may differ in the last digits."""
    for page in MARKED:
        for name, text in held(page.read_text(encoding="utf-8")).items():
            if name in SLOW:
                again = entry(name)
                words, numbers = _NUMBER.split(text), numbers_of(text)
                assert words == _NUMBER.split(again), name
                assert numbers == pytest.approx(numbers_of(again), rel=1e-3), name


def numbers_of(text: str) -> list[float]:
    """Returns all numbers in a text."""
    return [float(number.replace(",", "")) for number in _NUMBER.findall(text)]


def test_schemas_are_those_of_the_code() -> None:
    """Each document has its JSON Schema beside the pages, and no other is there."""
    there = {path.name: path.read_text(encoding="utf-8") for path in SCHEMAS.iterdir()}
    assert there == written.schemas()


def test_all_entries_are_on_a_page() -> None:
    """Nothing is made that no page shows, numbers of single planners and scenes aside."""
    shown = {name for page in MARKED for name in names_in(page.read_text(encoding="utf-8"))}
    assert {name for name in ENTRIES if not name.startswith("gap_")} - shown == set()
    assert shown - {*ENTRIES, *entries.COMMANDS, *entries.PYTHON} == set()


# -- pictures -------------------------------------------------------------------------------


def test_pictures_are_committed() -> None:
    """Each has its file, which is small, and each file is on a page."""
    there = {path.name: path.stat().st_size for path in PICTURES.iterdir()}
    assert set(there) == {*DRAWN, *written.PHOTOGRAPHED}
    assert len(DRAWN) == len(DRAWINGS) + len(DIAGRAMS), "two pictures have one name"
    assert sum(there.values()) < _MOST
    assert {name: size for name, size in there.items() if size > _LARGEST} == {}
    shown = {address.rpartition("/")[2] for page in MARKDOWN for address in links(page)}
    assert set(there) <= shown


def test_pictures_fit_a_column_and_a_phone() -> None:
    """None is wider than the width at which the letters of all are readable on both."""
    for name in DRAWN:
        if name.endswith(".svg"):
            head = (PICTURES / name).read_text(encoding="utf-8")[:2000]
            width = re.search(r'<svg [^>]*width="([\d.]+)pt"', head)
            assert width is not None and float(width[1]) <= 72 * WIDTH, name


def test_each_picture_says_what_it_shows() -> None:
    """Its alternative text is a sentence or a title, for whoever does not see it."""
    images = [token for page in MARKDOWN for token in parsed(page) if token.type == "image"]
    assert len(images) > 30
    assert [image.attrs for image in images if len(image.content) < 20] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_pictures_are_drawn_from_what_is_stored(name: str) -> None:
    """`python docs/write.py pictures` would change nothing that anybody sees."""
    there, again = (PICTURES / name).read_bytes(), written.drawn(name)
    if name.endswith(".svg"):
        stored, now = there.decode(), again.decode()
        assert _NUMBER.split(stored) == _NUMBER.split(now), "run python docs/write.py pictures"
        assert numbers_of(stored) == pytest.approx(numbers_of(now), rel=1e-4, abs=0.05)
    else:
        assert np.abs(pixels(there) - pixels(again)).max() <= 2


@pytest.mark.parametrize(
    ("number", "short"),
    [
        (b"71.999999", b"72"), (b"71.994", b"71.99"), (b"-71.996", b"-72"), (b"-0.001", b"0"),
        (b"-0", b"0"), (b"-0.126", b"-0.13"), (b"0.5", b"0.5"), (b"100", b"100"),
    ],
)  # fmt: skip
def test_places_are_rounded(number: bytes, short: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """To 0.01 points, wherever a picture states them; factors keep their digits."""
    svg = b'<path d="M %b 1" transform="translate(%b 2) rotate(%b) scale(0.015625 -0.11)"/>'
    monkeypatch.setattr(written, "DRAWN", {"a.svg": lambda: svg.replace(b"%b", number)})
    assert written.drawn("a.svg") == svg.replace(b"%b", short)


def test_pictures_of_others_are_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that nothing draws is named, and stays; nothing is drawn before."""
    monkeypatch.setattr(written, "PICTURES", tmp_path)
    monkeypatch.setattr(written, "DRAWN", {"a.svg": lambda: b"<svg/>"})
    (tmp_path / "mine.svg").write_text("work of hours")
    with pytest.raises(FileError, match=r"mine\.svg: unlisted; delete it, or add it"):
        list(written.write_pictures())
    assert [path.name for path in tmp_path.iterdir()] == ["mine.svg"]
    (tmp_path / "mine.svg").rename(tmp_path / "player.png")
    assert list(written.write_pictures()) == [tmp_path / "a.svg"]
    assert list(written.write_pictures()) == []


def pixels(content: bytes) -> "np.ndarray[tuple[int, ...], np.dtype[np.int16]]":
    """Returns the pixels of a picture."""
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(np.int16)


# -- marks ----------------------------------------------------------------------------------


def test_marks_are_filled() -> None:
    """What stands around marks stays; filling again changes nothing, and a reader sees no mark."""
    page = "a\n<!-- quote: x -->\nold\n<!-- end of quote -->\nb <!-- n: y -->1<!-- /n --> c\n"
    new = filled(page, {"x": "| t |", "y": "2"}.__getitem__)
    assert new == (
        "a\n<!-- quote: x -->\n\n| t |\n\n<!-- end of quote -->\nb <!-- n: y -->2<!-- /n --> c\n"
    )
    assert filled(new, {"x": "| t |", "y": "2"}.__getitem__) == new
    assert names_in(new) == ["x", "y"]
    assert without_marks(new) == "a\n| t |\n\nb 2 c\n"
    # A mark at the end of a paragraph leaves the blank line before the next heading.
    assert without_marks("b <!-- n: y -->2<!-- /n -->\n\n## c\n") == "b 2\n\n## c\n"


def test_wrong_marks_are_refused() -> None:
    """Words that begin a line would be HTML; several lines are no words; names must be known.

    A mark without its end would take the text up to the next end with it.
    """
    with pytest.raises(FileError, match="y: must not begin a line"):
        filled("<!-- n: y -->1<!-- /n --> c", str)
    with pytest.raises(FileError, match="y: has several lines"):
        filled("b <!-- n: y -->1<!-- /n -->", lambda _: "1\n2")
    with pytest.raises(FileError, match="none: unknown entry"):
        all_entries(app, co)("none")


QUOTED = "<!-- quote: b -->\nx\n<!-- end of quote -->\n"


@pytest.mark.parametrize(
    ("page", "words"),
    {
        f"<!-- quote: a -->\nold\n\nPROSE\n\n{QUOTED}": "quote: a -->: must end with .* before",
        f"{QUOTED}\n<!-- quote: a -->\nold\n\nPROSE\n": "quote: a -->: must end with",
        f"{QUOTED}\nPROSE\n<!-- end of quote -->\n": "<!-- end of quote -->: has no opening mark",
        "a <!-- n: y -->1, b <!-- n: z -->2<!-- /n -->": "n: y -->: must end with .* before",
        "a <!-- n: y -->1<!-- /n -->, b <!-- n: z -->2": "n: z -->: must end with <!-- /n -->",
        "a 1<!-- /n -->, b <!-- n: z -->2<!-- /n -->": "<!-- /n -->: has no opening mark",
        f"a <!-- n: y -->1\n{QUOTED}<!-- /n -->": "n: y -->: must end with .* before",
        "<!-- quote: a -->\n1<!-- /n -->\n": "<!-- /n -->: has no opening mark",
        "<!-- quote: a --> x\n<!-- end of quote -->\n": "quote: a -->: must be alone",
        "<!-- quote: a -->\nx <!-- end of quote -->\n": "end of quote -->: must be alone",
        f"<!-- off the site -->\na\n\n{QUOTED}<!-- end -->\n": "off the site -->: must end",
        "<!-- off the site -->\na\n\nPROSE\n": "off the site -->: must end with <!-- end -->",
        f"<!-- on the site\na\n\n{QUOTED}": "on the site: must end with --> before",
    }.items(),
)  # fmt: skip
def test_marks_that_would_take_prose_are_refused(page: str, words: str) -> None:
    """A mark has its end before another begins, on the built site, too."""
    with pytest.raises(FileError, match=words):
        filled(page, str)
    if "alone" not in words:
        with pytest.raises(FileError, match=words):
            on_the_site(page)


def test_an_entry_says_something(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that stands for nothing is refused."""
    monkeypatch.setattr(entries, "ENTRIES", {"none": lambda: " \n"})
    with pytest.raises(FileError, match="none: its text is empty"):
        all_entries(app, co)("none")


def test_the_site_shows_what_raw_pages_hide() -> None:
    """Directives for the site are opened, what stands for them is left out; comments stay."""
    page = "a\n<!-- on the site\n```{only} x\nb\n```\n-->\nc <!-- d -->\n"
    page += "<!-- off the site -->\ne\n<!-- end -->\nf\n"
    assert on_the_site(page) == "a\n```{only} x\nb\n```\n\nc <!-- d -->\nf\n"
