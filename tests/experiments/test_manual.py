"""The parts of the pages that are made from the code."""

import re
from pathlib import Path

import msgspec
import pytest
from pages import DOCS

import cocap_opt as co
from cocap_opt.experiments.cli.commands import app
from cocap_opt.experiments.manual.commands import commands_in_markdown, studies_in_markdown
from cocap_opt.experiments.manual.docstrings import with_meanings
from cocap_opt.experiments.manual.formats import (
    DOCUMENTS,
    example,
    fields_in_markdown,
    schema,
    write_schemas,
)
from cocap_opt.experiments.manual.gallery import SHOWN
from cocap_opt.experiments.manual.lists import LISTS
from cocap_opt.experiments.results.rows import COLUMNS
from cocap_opt.files.documents import decode_document
from cocap_opt.scenarios import SCENES


def test_all_commands_are_on_the_pages() -> None:
    """Each has a part, and each of its options a line."""
    text = commands_in_markdown() + "\n" + studies_in_markdown()
    titles = re.findall(r"(?m)^## (.+)$", text)
    families = ("figure", "study")
    plain = [name for name in app if not name.startswith("-") and name not in families]
    inner = [f"{f} {name}" for f in families for name in app[f] if not name.startswith("-")]
    assert sorted(titles) == sorted(plain + inner)
    solve = text.split("## solve\n")[1].split("\n## ")[0]
    for words in ("cocap-opt solve SCENE [OPTIONS]", "| `--gap` |", "`branch-and-price` |"):
        assert words in solve
    assert "inspect" not in text and "Example:" not in text


def test_the_face_is_on_the_pages() -> None:
    """Every name of `import cocap_opt as co` has its place in the reference."""
    pages = [DOCS / "reference" / f"python{part}.md" for part in ("", "-scenes", "-results")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    told = set(re.findall(r"auto\w+:: (\w+)", text)) | set(re.findall(r"`(?:co\.)?(\w+)`", text))
    assert set(co.__all__) - told == set()


@pytest.mark.parametrize("name", DOCUMENTS)
def test_all_fields_of_files_are_on_the_page(name: str) -> None:
    """Each part of a document that its schema has stands in the text, with each of its fields."""
    text = fields_in_markdown(name)
    for title, part in schema(DOCUMENTS[name])["$defs"].items():
        assert f"**{title}**" in text
        assert all(f"| `{field}` |" in text for field in part.get("properties", ()))


def test_schemas_are_written(tmp_path: Path) -> None:
    """One file for each document, with all of its parts."""
    write_schemas(tmp_path)
    for name, kind in DOCUMENTS.items():
        written = msgspec.json.decode((tmp_path / f"{name}.json").read_bytes())
        assert written == msgspec.json.decode(msgspec.json.encode(schema(kind)))
        assert kind.__name__ in written["$defs"]


def test_fields_have_types_and_meanings() -> None:
    """They come from the types and docstrings of the code."""
    text = fields_in_markdown("scene")
    assert "| `horizon` | integer | required | T, number of moves |" in text
    assert "| `camera` | Camera or Cone |" in text


@pytest.mark.parametrize("name", ["scene", "plan", "certificate"])
def test_examples_of_files_can_be_read(name: str) -> None:
    """What the page shows is what the project reads."""
    text = example(name)
    assert decode_document(text.encode(), "example", DOCUMENTS[name])
    assert msgspec.json.decode(text)["format"] == f"cocap-opt {name}"


@pytest.mark.slow
def test_lists_have_all_that_there_is() -> None:
    """Scenes and columns are all named."""
    assert all(f"| {name} |" in LISTS["scenes"]() for name in SCENES)
    assert LISTS["columns"]().count("\n") == len(COLUMNS) + 2
    assert set(SHOWN) <= set(SCENES)


def test_meanings_stand_below_their_names() -> None:
    """In sections of parameters and attributes only; more lines stay where they are."""
    lines = ["Words : words.", "", "Parameters", "----------", "a, b : one", "    and two", "",
             "Returns", "-------", "x : y"]  # fmt: skip
    assert with_meanings(lines) == [
        "Words : words.", "", "Parameters", "----------", "a, b", "    one", "    and two", "",
        "Returns", "-------", "x : y",
    ]  # fmt: skip
