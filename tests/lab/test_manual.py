"""The parts of the pages that are made from the code."""

import re
import tokenize
from importlib import import_module
from itertools import pairwise

import msgspec
import pytest
from pages import DOCS, pages
from sources import sources

import cocap_opt as co
from cocap_opt.cli.commands import app
from cocap_opt.experiments.lab.manual import one_face, worked
from cocap_opt.experiments.lab.manual.commands import COMMANDS
from cocap_opt.experiments.lab.manual.contents import Section, llms_in_full, llms_in_short
from cocap_opt.experiments.lab.manual.diagrams import DIAGRAMS
from cocap_opt.experiments.lab.manual.formats import (
    DOCUMENTS,
    PAGES,
    example,
    fields_in_markdown,
    schema,
)
from cocap_opt.experiments.lab.manual.lists import LISTS
from cocap_opt.experiments.lab.manual.python_reference import NAMES, PYTHON
from cocap_opt.experiments.lab.manual.recorded_tree import recorded_tree
from cocap_opt.experiments.lab.manual.trusted import CHECKER, TRUSTED, UPPER, storeys
from cocap_opt.experiments.lab.manual.worked_words import told_closed
from cocap_opt.experiments.lab.studies.drawings import GALLERY, RECIPES
from cocap_opt.experiments.tables.rows import COLUMNS
from cocap_opt.files.documents import decode_document
from cocap_opt.scenarios import SCENES
from cocap_opt.scenarios.built_in.tiny import TINY_OPTIMA

NO_CODE = (tokenize.COMMENT, tokenize.NL, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)


def test_options_have_their_defaults_on_the_pages() -> None:
    """A default of 0 is one, too; what groups options in the code is none of them."""
    text = COMMANDS["commands_plan"](app)
    assert "| `--seed` | seed of the scene, >= 0 | `0` |" in text
    assert (
        "| `--time-limit` | seconds for coverage and search, excluding reading, estimating, "
        "compiling and checking; inf: no limit | `60.0` |" in text
    )
    assert "`*`" not in text and "Budget" not in text


def test_all_commands_are_on_the_pages() -> None:
    """Each has a part, and each of its options a line."""
    text = "\n".join(make(app) for make in COMMANDS.values())
    titles = re.findall(r"(?m)^## (.+)$", text)
    families = ("figure", "library", "study")
    plain = [name for name in app if not name.startswith("-") and name not in families]
    inner = [f"{f} {name}" for f in families for name in app[f] if not name.startswith("-")]
    assert sorted(titles) == sorted(plain + inner)
    solve = text.split("## solve\n")[1].split("\n## ")[0]
    for words in ("cocap-opt solve SCENE [OPTIONS]", "| `--gap` |", "`branch-and-price` |"):
        assert words in solve
    assert "inspect" not in text and "Example:" not in text


def test_the_face_is_on_the_pages() -> None:
    """Every name of `import cocap_opt as co` has its place in the reference."""
    named = {name.partition(".")[0] for names in NAMES.values() for name in names}
    text = "\n".join(
        page.read_text(encoding="utf-8") for page in (DOCS / "reference").glob("python*.md")
    )
    told = named | set(re.findall(r"`(?:co\.)?(\w+)`", text))
    assert set(co.__all__) - told == set()


def test_the_reference_is_that_of_the_code() -> None:
    """Signatures have no names of modules; sections of docstrings become lists and examples."""
    text = PYTHON["python_plans"](co)
    assert '    planner: str | Planner = "cocap-prices",\n    *,\n' in text
    assert "- `without`: numbers of the drones that are lost at that step\n" in text
    assert "- `UnsupportedError`: If the planner does not support such problems.\n" in text
    assert "```pycon\n>>> result = co.plan(problem, time_limit=10)\n" in text
    assert "cocap_opt." not in "".join(make(co) for make in PYTHON.values())
    assert "- `Limit.MEMORY`" in PYTHON["python_stopping"](co)


def test_all_fields_of_files_are_on_a_page() -> None:
    """Each part of a document that its schema has is in a table, with each of its fields."""
    text = "\n\n".join(map(fields_in_markdown, PAGES))
    for kind in DOCUMENTS.values():
        for title, part in schema(kind)["$defs"].items():
            shown = text.split(f"**{title}**")[1].split("\n\n**")[0]
            assert all(f"| `{field}` |" in shown for field in part.get("properties", ()))


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
    assert all(f"| {name} " in LISTS["scenes"]() for name in SCENES)
    assert LISTS["columns"]().count("\n") == len(COLUMNS) + 2
    assert set(GALLERY) <= {*SCENES, *RECIPES}


def test_the_index_has_all_pages() -> None:
    """Each page is listed once, and llms.txt names it in the order of the index."""
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = [f"{e.page}.{e.ending}" for s in Section.all_of(index) for e in s.entries]
    there = [*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")]
    assert sorted(listed) == sorted(
        path.relative_to(DOCS).as_posix() for path in there if path != DOCS / "index.md"
    )
    short = llms_in_short(index)
    assert short.startswith("# cocap-opt\n\n> Several camera drones film")
    assert re.findall(r"\(_sources/(\S+)\)", short) == listed
    full = llms_in_full(DOCS)
    titles = [line for line in full.splitlines() if line.startswith("# ")]
    assert (
        titles.index("# Why cocap-opt") < titles.index("# Quickstart") < titles.index("# Gallery")
    )
    assert "<!--" not in full


# -- the concept pages ------------------------------------------------------------------------


def test_the_tree_is_the_one_that_the_page_tells() -> None:
    """The page on CoCap follows five nodes; the planner makes these, in this order."""
    tree = recorded_tree(co.load("tiny-doorway"))
    assert [node.parent for node in tree] == [None, 0, 0, 1, 1]
    assert [node.turn for node in tree] == [1, 2, 3, None, None]
    root, swap, plan = 12 + 3 * 41**0.5 + 15 * 2**0.5, 12 + 6 * 41**0.5, 12 + 6 * 41**0.5
    assert [node.value for node in tree[:3]] == pytest.approx([root, swap, plan])
    assert all(node.value < plan for node in tree[3:])
    kinds = [type(node.conflict) for node in tree]
    assert kinds == [
        co.VertexConflict, co.SwapConflict, type(None), co.VertexConflict, co.VertexConflict,
    ]  # fmt: skip
    assert [told_closed(node.closed) for node in tree] == [
        "none",
        "drone 0 not in (2, 0) at step 3",
        "drone 1 not in (2, 0) at step 3",
        "drone 0 not in (2, 0) at step 3; drone 0 not from (2, 0) to (1, 0) after step 2",
        "drone 0 not in (2, 0) at step 3; drone 1 not from (1, 0) to (2, 0) after step 2",
    ]
    found = co.plan(co.load("tiny-doorway"), "cocap")
    assert (found.plan, found.statistics["generated"]) == (tree[2].plan, len(tree))


def test_a_bound_is_the_sum_of_its_parts() -> None:
    """What the page on certificates adds up by hand is the bound of the file."""
    assert worked.doorway_parts().total == pytest.approx(worked.doorway_bound().proved, rel=1e-9)
    assert worked.doorway_bound().proved == pytest.approx(TINY_OPTIMA["tiny-doorway"], rel=1e-6)


def test_curves_of_a_face_are_bounds() -> None:
    """No curve is below a mixture of plans, and the envelope cut meets the best of them."""
    curves = one_face.curves()
    none, single, both = curves.plans
    for share in (0.0, 0.3, 0.5, 0.75, 1.0):
        mixture = 2 * share * single if share <= 0.5 else (2 - 2 * share) * single + (
            2 * share - 1) * both  # fmt: skip
        assert curves.at(share)["least"] >= mixture + none - 1e-9
    assert curves.at(0.75)["cut"] == pytest.approx((single + both) / 2)
    assert curves.at(0.75)["cut"] < curves.at(0.75)["concave"]


def test_a_shadow_leaves_convex_pieces_of_a_face() -> None:
    """Visible pieces lie in the face, and none of them behind the column."""
    shadow = one_face.shadow()
    assert 0 < shadow.visible < 1
    for piece in shadow.pieces:
        assert (piece.min(axis=0) >= shadow.face.min(axis=0) - 1e-9).all()
        assert (piece.max(axis=0) <= shadow.face.max(axis=0) + 1e-9).all()
        right_of, above = (max(side[:, k].max() for side in shadow.column) for k in (0, 1))
        middle = piece.mean(axis=0)
        assert middle[0] > right_of or middle[1] > above


def test_each_diagram_is_on_a_page() -> None:
    """Pages show all pictures that are drawn for them, and say what each shows."""
    text = "".join(page.read_text(encoding="utf-8") for page in pages())
    shown = re.findall(r"!\[.{40,}\]\(\.\./pictures/([\w-]+)\.svg\)\n\n\*\S", text)
    assert set(DIAGRAMS) <= set(shown)


@pytest.mark.slow
def test_worked_examples_are_consistent() -> None:
    """Bounds fall from stage to stage and from method to method; a gap is the sum of its terms."""
    stages, target = worked.stages(), worked.in_stages().target
    assert all((a.left >= b.left).all() and a.bound >= b.bound for a, b in pairwise(stages))
    # As the page tells: there are stages, which do not close all; paths do, before any of them.
    assert len(stages) > 3 and stages[-1].bound > target
    assert all(sum(a.reached) >= sum(b.reached) for a, b in pairwise(stages))
    file = worked.bottleneck().staged
    assert (file.stages, file.paths_above, file.target) == ((), target, target)
    assert file.multipliers == worked.in_stages().multipliers
    assert worked.bottleneck().bound == pytest.approx(target)
    shown = (values for name, values in worked.compared() if name != "online")
    for column in zip(*shown, strict=True):
        assert all(a >= b - 1e-6 * b for a, b in pairwise(column))
    gap = worked.explained().explanation
    assert gap.total() == pytest.approx(gap.gap, rel=1e-9, abs=1e-6)
    assert worked.overestimates().sum() == pytest.approx(gap.total("face"))
    assert max(worked.proof().bounds) <= worked.proof().file.proved


def lines_without_comments(module: str) -> int:
    """The lines that hold a token of code; a statement that is a string alone is a docstring."""
    lines, statement = set[int](), list[tokenize.TokenInfo]()
    with tokenize.open(sources()[module.removesuffix(".__init__")]) as file:
        for token in tokenize.generate_tokens(file.readline):
            if token.type == tokenize.NEWLINE:
                if [part.type for part in statement] != [tokenize.STRING]:
                    lines |= {
                        n for part in statement for n in range(part.start[0], part.end[0] + 1)
                    }
                statement.clear()
            elif token.type not in NO_CODE:
                statement.append(token)
    return len(lines)


def test_what_must_be_trusted_is_counted() -> None:
    """The pages' lines of each storey are those of its files; the docstrings' are about as many."""
    parts = storeys()
    every = [name for part in parts.values() for name in part.modules]
    assert len(set(every)) == len(every)
    for name, part in parts.items():
        counted = sum(map(lines_without_comments, part.modules))
        assert counted == pytest.approx(part.lines, rel=0.02), name
        assert f"{part.lines:,}" == TRUSTED[f"{name}_lines"]()
    upper = {name for name in sources() if name.startswith(f"{UPPER}.")} | {f"{UPPER}.__init__"}
    assert {*parts["upper"].modules, *parts["compiled"].modules} == upper
    words = " ".join((import_module(CHECKER).__doc__ or "").split())
    lower, searched, compiled, core = re.findall(r"([\d,]+) (?:lines|more)", words)
    for told, part in (
        (lower, "lower"), (searched, "upper"), (compiled, "compiled"), (core, "core"),
    ):  # fmt: skip
        assert int(told.replace(",", "")) == pytest.approx(parts[part].lines, rel=0.1), part
