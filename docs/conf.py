"""Settings of Sphinx for the pages of this folder: `sphinx-build -W docs build/docs`."""

import re
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

import cocap_opt
from cocap_opt.cli.commands import app
from cocap_opt.experiments.lab.manual.diagrams import write_diagrams
from cocap_opt.experiments.lab.manual.docstrings import with_meanings
from cocap_opt.experiments.lab.manual.entries import all_entries
from cocap_opt.experiments.lab.manual.formats import write_schemas
from cocap_opt.experiments.lab.studies.browser.files import write_check
from cocap_opt.experiments.lab.studies.drawings import write_drawings, write_players
from cocap_opt.player.player_proof import CHECK_PAGE

project = "cocap-opt"
author = "the authors of cocap-opt"
project_copyright = author
version = release = cocap_opt.__version__
extensions = [
    "myst_nb",  # Markdown and notebooks
    "numpydoc",
    "sphinx.ext.autodoc",
]
exclude_patterns = ["notebooks/.ipynb_checkpoints", "notebooks/__init__.py"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "substitution"]
myst_heading_anchors = 3
myst_substitutions = all_entries(app)  # {{ name }}; a name that is missing fails the build
smartquotes = False  # they would join the hyphens of options
nb_execution_mode = "off"  # `cocap-opt study notebooks` runs them
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True  # names of defaults, not where they are in memory
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
default_role = "literal"  # docstrings put code between single backquotes
numpydoc_show_class_members = False
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"cocap-opt {release}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_theme_options = {"navigation_with_keys": True}

_STOPPED = re.compile(r"(<math\b(?:(?!</math>).)*</math>[.,;:)]+)", re.DOTALL)


def _write_files(app: Sphinx) -> None:
    write_players(Path(app.outdir) / "players")
    write_schemas(Path(app.outdir) / "schemas")
    write_drawings(Path(app.srcdir) / "pictures")
    write_diagrams(Path(app.srcdir) / "concepts" / "pictures")
    if write_check(Path(app.outdir) / "check"):
        app.tags.add("python_in_pages")


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


def _move_meanings(app: Sphinx, kind: str, name: str, thing: object, options: object,
                   lines: list[str]) -> None:  # fmt: skip
    lines[:] = with_meanings(lines)


def setup(app: Sphinx) -> None:
    """Write players, schemas and pictures, and prepare docstrings before numpydoc reads them."""
    app.add_html_math_renderer("mathml", (_write_formula, None), (_write_formulas, None))
    app.connect("builder-inited", _write_files)
    app.connect("html-page-context", _keep_stops)
    app.connect("html-page-context", _add_check)
    app.connect("autodoc-process-docstring", _move_meanings, priority=100)
