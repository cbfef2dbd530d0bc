"""Settings of Sphinx for the pages of this folder: `sphinx-build -W docs build/docs`."""

import re
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

import cocap_opt
from cocap_opt.experiments.lab.manual.code_lines import with_lines
from cocap_opt.experiments.lab.manual.contents import llms_in_full, llms_in_short, with_menu
from cocap_opt.experiments.lab.manual.marks import on_the_site
from cocap_opt.experiments.lab.manual.wholes import with_wholes
from cocap_opt.experiments.lab.studies.browser.files import write_check
from cocap_opt.experiments.lab.studies.drawings import with_players, write_players
from cocap_opt.player.player_proof import CHECK_PAGE

project = "cocap-opt"
author = "the authors of cocap-opt"
project_copyright = author
version = release = cocap_opt.__version__
extensions = ["myst_nb"]  # Markdown and notebooks
exclude_patterns = ["notebooks/.ipynb_checkpoints"]
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # as GitHub has formulas
myst_heading_anchors = 4
smartquotes = False  # they would join the hyphens of options
nb_execution_mode = "off"  # `cocap-opt study notebooks` runs them
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"cocap-opt {release}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_js_files = ["versions.js"]
html_sourcelink_suffix = ""  # _sources/page.md, which llms.txt names
html_theme_options = {"navigation_with_keys": True}

_OUTSIDE = re.compile(r"\]\((?=\.\./[A-Z]+\.md\))")  # links to files beside this folder
_PROSE = (nodes.paragraph, nodes.strong, nodes.emphasis)  # text that may be divided
_PICTURE = re.compile(r'<p>(<img\b[^>]*\bsrc="([^"]+)"[^>]*>)</p>')
_STOPPED = re.compile(r"(<math\b(?:(?!</math>).)*</math>[.,;:)]+)", re.DOTALL)


def _write_files(app: Sphinx) -> None:
    out, source = Path(app.outdir), Path(app.srcdir)
    write_players(out / "players")
    index = (source / "index.md").read_text(encoding="utf-8")
    (out / "llms.txt").write_text(llms_in_short(index), encoding="utf-8")
    (out / "llms-full.txt").write_text(llms_in_full(source), encoding="utf-8")
    if write_check(out / "check"):
        app.tags.add("python_in_pages")


def _prepare(app: Sphinx, page: str, content: list[str]) -> None:
    """Removes the marks, adds the parts for the site alone and the menu of the index.

    Files in Markdown outside of this folder are no pages: the site offers them for download.
    """
    if app.env.doc2path(page).suffix != ".ipynb":
        text = on_the_site(with_menu(content[0]) if page == "index" else content[0])
        content[0] = _OUTSIDE.sub("](path:", text)


def _keep_wholes(app: Sphinx, page: nodes.document, name: str) -> None:
    """Keeps numbers with their units, and the like: each in an element that is never divided."""
    for text in [*page.findall(nodes.Text)]:
        pieces = [*with_wholes(text.astext())]
        if isinstance(text.parent, _PROSE) and any(is_whole for _, is_whole in pieces):
            parts = [
                nodes.inline("", piece, classes=["whole"]) if is_whole else nodes.Text(piece)
                for piece, is_whole in pieces
            ]
            text.parent.replace(text, parts)


def _add_check(
    app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object
) -> None:
    """Adds script and style to the page that checks files."""
    if page == CHECK_PAGE and "python_in_pages" in app.tags:
        app.add_js_file("check.js", loading_method="defer")
        app.add_css_file("check.css")


def _write_formula(page: HTML5Translator, node: nodes.math) -> None:
    """Writes MathML, which browsers show without a script; what TeX does not know fails."""
    page.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _write_formulas(page: HTML5Translator, node: nodes.math_block) -> None:
    formula = tex2mathml(node.astext(), as_block=True)
    page.body.append(f'<div class="formula">{formula}</div>\n')
    raise nodes.SkipNode


def _keep_stops(
    app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object
) -> None:
    """Keeps a full stop or comma on the line of the formula before it."""
    if body := context.get("body"):
        context["body"] = _STOPPED.sub(r'<span class="formula">\1</span>', body)


def _divide_code(
    app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object
) -> None:
    """Makes each line of code an element, which the style sheet folds if it is too long."""
    if body := context.get("body"):
        context["body"] = with_lines(body)


def _add_players(
    app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object
) -> None:
    """Puts players in place of the pictures of the gallery."""
    if page == "gallery":
        context["body"] = with_players(context["body"])


def _link_pictures(
    app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object
) -> None:
    """Makes each picture a link to itself: on a phone it is then shown in its full size."""
    if body := context.get("body"):
        context["body"] = _PICTURE.sub(r'<p><a class="picture" href="\2">\1</a></p>', body)


def setup(app: Sphinx) -> None:
    """Writes players and llms.txt, and prepares each page before it is read."""
    app.add_html_math_renderer("mathml", (_write_formula, None), (_write_formulas, None))
    app.connect("builder-inited", _write_files)
    app.connect("source-read", _prepare)
    app.connect("doctree-resolved", _keep_wholes)
    for change in (_keep_stops, _divide_code, _add_check, _add_players, _link_pictures):
        app.connect("html-page-context", change)
