"""Writes everything on the pages that is made from code and stored results.

    python docs/write.py            text between the marks, and schemas of files
    python docs/write.py pictures   all pictures, too
    python docs/write.py player     those of the player, too

The first two need the extra `docs` (`pip install -e '.[docs]'`); the third needs `test`, too, for
selenium, PDFium and pymavlink, and Chromium with its driver.

It prints each file that it has changed. The tests fail where a page differs from what this writes.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import cocap_opt
from cocap_opt.cli.commands import app
from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.manual.entries import all_entries
from cocap_opt.experiments.lab.manual.written import PICTURES, ROOT, write_pictures, write_text
from cocap_opt.experiments.lab.studies.options import chromium
from cocap_opt.files.documents import FileError

_WHAT = ("text", "pictures", "player")


def _write(last: str) -> Iterator[Path]:
    yield from write_text(all_entries(app, cocap_opt))
    if last != "text":
        yield from write_pictures()
    if last == "player":
        with chromium("player.png"):
            from cocap_opt.experiments.lab.studies.first_flight import write_first_flight
            from cocap_opt.experiments.lab.studies.pictures import write_pictures as write_player

            yield from write_player(PICTURES)
            yield from write_first_flight(PICTURES)


def main(words: list[str]) -> int:
    """Writes as much as the word says, and returns the exit code."""
    last = words[0] if words else "text"
    if last not in _WHAT or len(words) > 1:
        say(f"write.py: must have one of {', '.join(_WHAT)}")
        return 2
    try:
        for path in _write(last):
            say(str(path.relative_to(ROOT)))
    except FileError as error:
        say(str(error))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
