"""All that pages of `docs` insert by a name, `{{ name }}`: quotes, and lists made from the code."""

from collections.abc import Callable
from functools import partial

from cyclopts import App

from cocap_opt.experiments.lab.manual.commands import commands_in_markdown, studies_in_markdown
from cocap_opt.experiments.lab.manual.formats import DOCUMENTS, example, fields_in_markdown
from cocap_opt.experiments.lab.manual.lists import LISTS
from cocap_opt.experiments.lab.manual.trusted import TRUSTED
from cocap_opt.experiments.lab.manual.worked_words import WORKED
from cocap_opt.experiments.lab.studies.browser.files import copied_in_words
from cocap_opt.experiments.lab.studies.drawings import gallery_in_markdown
from cocap_opt.experiments.lab.studies.quotes import QUOTES


def _json(name: str) -> str:
    return f"```json\n{example(name).strip()}\n```"


# Made from stored results and from the code; functions that return Markdown.
ENTRIES: dict[str, Callable[[], str]] = {
    **QUOTES,
    **LISTS,
    **WORKED,
    **TRUSTED,
    "gallery": gallery_in_markdown,
    "checker_copied": copied_in_words,
    **{f"{name}_fields": partial(fields_in_markdown, name) for name in DOCUMENTS},
    **{f"{name}_example": partial(_json, name) for name in ("scene", "plan", "certificate")},
}


# Made from the program `cocap-opt`, which is above this room.
OF_PROGRAM: dict[str, Callable[[App], str]] = {
    "commands": commands_in_markdown,
    "studies": studies_in_markdown,
}


def all_entries(program: App) -> dict[str, str]:
    """Returns the Markdown of each name; what is said of commands is made from the program.

    Raises
    ------
    ValueError
        If a name stands for nothing, which a page would show as a gap in a sentence.
    """
    made = {name: make().strip() for name, make in ENTRIES.items()}
    made |= {name: make(program) for name, make in OF_PROGRAM.items()}
    if empty := [name for name, text in made.items() if not text]:
        raise ValueError(f"{empty[0]}: stands for nothing")
    return made
