"""Everything that pages contain between marks, by name: quotes, and lists made from the code."""

from collections.abc import Callable, Mapping
from functools import cache, partial
from types import ModuleType

from cyclopts import App

from cocap_opt.experiments.lab.manual.changes import for_updates
from cocap_opt.experiments.lab.manual.commands import COMMANDS
from cocap_opt.experiments.lab.manual.formats import FORMATS
from cocap_opt.experiments.lab.manual.lists import LISTS
from cocap_opt.experiments.lab.manual.python_reference import PYTHON
from cocap_opt.experiments.lab.manual.trusted import TRUSTED
from cocap_opt.experiments.lab.manual.worked_words import WORKED
from cocap_opt.experiments.lab.studies.browser.files import copied_in_words
from cocap_opt.experiments.lab.studies.drawings import gallery_in_markdown
from cocap_opt.experiments.lab.studies.quotes import QUOTES
from cocap_opt.files.documents import FileError

# Made from stored results and from the code; functions that return Markdown.
ENTRIES: Mapping[str, Callable[[], str]] = {
    **QUOTES,
    **LISTS,
    **WORKED,
    **TRUSTED,
    **FORMATS,
    "gallery": gallery_in_markdown,
    "changes": for_updates,
    "checker_copied": copied_in_words,
}


def all_entries(program: App, face: ModuleType) -> Callable[[str], str]:
    """Returns a function that returns the Markdown of a name; it makes each text only once.

    Parameters
    ----------
    program : the program cocap-opt, which this package must not import
    face : the package `cocap_opt`, likewise

    Raises
    ------
    FileError
        Raised by the returned function if the name is unknown, or if its text is empty, which would
        leave a gap in a sentence.
    """
    made: dict[str, Callable[[], str]] = {
        **ENTRIES,
        **{name: partial(make, program) for name, make in COMMANDS.items()},
        **{name: partial(make, face) for name, make in PYTHON.items()},
    }

    @cache
    def entry(name: str) -> str:
        if name not in made:
            raise FileError(f"{name}: unknown entry; add it to {__name__}")
        text = made[name]().strip()
        if not text:
            raise FileError(f"{name}: its text is empty")
        return text

    return entry
