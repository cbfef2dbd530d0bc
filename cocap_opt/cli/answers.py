"""Files and answers of the commands that compute on one scene."""

import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import msgspec

from cocap_opt.experiments.tables.rows import PlanRow
from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.documents import FileError, encode
from cocap_opt.output.files import check_output
from cocap_opt.output.printing import Record
from cocap_opt.run.options import Option, UsageError

_ENDINGS = {"--trace": (".csv",)}  # file endings; files with other endings contain JSON


def in_order(answer: Record, has_plan: bool = True) -> Record:
    """Returns an answer that begins with the remark on a limit, or with the message that there is
    no plan.
    """
    first = ("cut_short",) if has_plan else ("cut_short", "message")
    return {key: answer[key] for key in first} | answer


def record_of(row: PlanRow) -> Record:
    """Returns a row's columns, and after those that it sums up a line on how people are seen."""
    record: Record = {}
    for key, value in asdict(row).items():
        record[key] = value
        if key == "median_error":
            record["cameras"] = row.cameras
    return record


def check_outputs(paths: Mapping[str, Path | None], *inputs: str | Path | None) -> None:
    """Rejects files that cannot be written, other endings, and one file for two outputs."""
    used: dict[str, str] = {}
    for option, path in paths.items():
        if path is None:
            continue
        check_output(path, *inputs)
        Option(option).file(path, _ENDINGS.get(option, (".json",)))
        other = used.setdefault(os.path.realpath(path), option)
        if other != option:
            raise UsageError(f"{option}: must differ from the file of {other}, not {path}")


def say(answer: Record, words: str) -> None:
    """Adds words to the message of an answer."""
    answer["message"] = "; ".join(filter(None, (answer["message"], words)))


def say_unwritten(answer: Record, option: str = "-o plan.json") -> None:
    """Adds to an answer's message that its plan is not written, and the option that writes it."""
    say(answer, f"the plan is not written; use {option} to write it")


Wanted = tuple[Path | None, msgspec.Struct | None]  # a file, and its content if there is any


def save(answer: Record, noun: str, files: Mapping[str, Wanted]) -> None:
    """Writes files together; the answer gives, by key, where each is, or why it was not written."""
    contents = {}
    for key, (path, content) in files.items():
        answer[key] = None
        if path is not None and content is not None:
            contents[path] = encode(content)
            answer[key] = path
        elif path is not None:
            kind = noun if key == "file" else key
            say(answer, f"{path} was not written: there is no {kind}")
    try:
        write_atomically(contents)
    except OSError as error:
        names = " and ".join(map(str, contents))
        raise FileError(f"{names}: cannot be written: {error.strerror}") from error
