"""Usage lines, which are made from the functions of commands, and what answers say of files."""

import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest
from cyclopts import App

from cocap_opt.cli.commands import app, run
from cocap_opt.console.usage import usage_of


def commands(family: App, path: str = "cocap-opt") -> Iterator[tuple[str, App]]:
    """Yields all commands with their names, those of families, too."""
    for name in family:
        if not name.startswith("-"):
            command = family[name]
            inner = [*commands(command, f"{path} {name}")]
            yield from inner or [(f"{path} {name}", command)]


def test_arguments_that_may_be_left_out_are_in_brackets() -> None:
    """And required options are named, so that a command works as its line has it."""
    lines = {name: usage_of(name, command.default_command) for name, command in commands(app)
             if command.default_command is not None}  # fmt: skip
    for name, words in (
        ("recipe", "[PLACE] [OPTIONS]"), ("limits", "SCENE [PLAN] [OPTIONS]"),
        ("audit", "SCENE [PLAN...] [OPTIONS]"), ("verify", "SCENE [FILE...] [OPTIONS]"),
        ("library status", "[NAME] [OPTIONS]"), ("report", "FOLDER -o PATH [OPTIONS]"),
        ("figure conflicts", "SCENE [PLAN...] -o PATH [OPTIONS]"), ("compile", ""),
    ):  # fmt: skip
        assert lines[f"cocap-opt {name}"] == f"Usage: cocap-opt {name} {words}".rstrip()


def test_a_required_argument_has_no_default() -> None:
    """The brackets of a line are where the parser asks for nothing."""
    for name, command in commands(app):
        function = command.default_command
        assert function is not None
        words = usage_of(name, function).split()
        for each in inspect.signature(function).parameters.values():
            if each.kind is each.POSITIONAL_ONLY:
                assert (each.name.upper() in words) == (each.default is each.empty), name


@pytest.mark.parametrize("name", ["recipe", "limits", "figure gaps", "library get"])
def test_help_begins_with_the_usage_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Of families, whose commands are loaded late, too."""
    with pytest.raises(SystemExit):
        app([*name.split(), "--help"])
    command = dict(commands(app))[f"cocap-opt {name}"]
    assert command.default_command is not None
    line = usage_of(f"cocap-opt {name}", command.default_command)
    assert capsys.readouterr().out.startswith(f"{line}\n")


@pytest.mark.parametrize("name", [name for name in app if not name.startswith("-")])
def test_every_command_has_an_example(name: str) -> None:
    """Also those that hold others."""
    assert "Example: cocap-opt" in str(app[name].help)


def test_a_plan_that_is_not_written_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A search of a minute is lost otherwise; JSON, which programs read, has what it had."""
    for command in ("plan", "solve"):
        for words, is_said in (
            ((), True), (("--json",), False), (("-o", str(tmp_path / "plan.json")), False)
        ):  # fmt: skip
            assert run([command, "tiny-trap", *words]) == 0
            told = " ".join(capsys.readouterr().out.split())
            assert ("the plan is not written; use -o plan.json to write it" in told) == is_said
