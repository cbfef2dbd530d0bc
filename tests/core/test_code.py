"""The digest of code: comments, layout and docstrings do not count, everything else does."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cocap_opt.files import code
from cocap_opt.files.code import code_digest, with_imports

MODULE = '''"""A module."""

def double(x):
    """Return twice as much."""
    return 2 * x  # of anything
'''


def digest_of(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Digest of a module with this text."""
    (folder / "made.py").write_text(text, encoding="utf-8")
    monkeypatch.setattr(code, "_FOLDER", folder)
    return code_digest("cocap_opt.made")


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("  # of anything", "", True),
        ('"""Return twice as much."""', '"""Return the double."""', True),
        ('"""A module."""\n\n', "", True),
        ("return 2 * x", "return (2 *\n        x)", True),
        ("return 2 * x", "return 3 * x", False),
        ("return 2 * x", "return x * 2", False),
        ("def double(x)", "def double(x, y=0)", False),
        ("    return", "    'no docstring'\n    return", False),
    ],
)
def test_what_counts_is_what_runs(
    old: str, new: str, same: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sentences and line breaks may change; code that runs may not."""
    assert old in MODULE
    before = digest_of(MODULE, tmp_path, monkeypatch)
    after = digest_of(MODULE.replace(old, new), tmp_path, monkeypatch)
    assert (before == after) is same


def test_a_function_of_a_docstring_only_still_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its docstring it is empty, and not the same as one that is gone."""
    text = 'class Odd(ValueError):\n    """Something odd."""\n'
    assert digest_of(text, tmp_path, monkeypatch) == digest_of(
        text.replace("odd", "very odd"), tmp_path, monkeypatch
    )
    assert digest_of("", tmp_path, monkeypatch) != digest_of(text, tmp_path, monkeypatch)


@pytest.mark.slow
def test_an_installed_package_has_the_digest_of_its_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Links to folders and real folders are the same modules, by the names they are imported by."""
    parts = ("cocap_opt.planners", "cocap_opt.scenarios", "cocap_opt.console")
    here = code_digest(*parts), with_imports(*parts)
    installed = tmp_path / "cocap_opt"
    shutil.copytree(code._FOLDER, installed)  # follows the links
    assert not (installed / "scenarios").is_symlink()
    monkeypatch.setattr(code, "_FOLDER", installed)
    assert (code_digest(*parts), with_imports(*parts)) == here
    (installed / "scenarios" / "more.py").write_text("more = 1\n")
    assert code_digest("cocap_opt.planners") != code_digest(*parts) != here[0]
    with pytest.raises(ValueError, match=r"cocap_opt\.scenarios\.none"):
        code_digest("cocap_opt.scenarios.none")


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("import cocap_opt.inner.deep", {"inner.__init__", "inner.deep"}),
        ("from cocap_opt.inner import deep", {"inner.__init__", "inner.deep"}),
        ("from cocap_opt.inner.deep import name", {"inner.__init__", "inner.deep"}),
        ("def later():\n    from cocap_opt import other", {"other"}),
        ("if TYPE_CHECKING:\n    import cocap_opt.other", set()),
        ("import json, numpy.linalg", set()),
    ],
)
def test_imports_are_followed(
    line: str, names: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A module counts with all that it imports to run, wherever the line stands."""
    (tmp_path / "inner").mkdir()
    for name, text in {
        "made": line, "other": "", "inner/__init__": "", "inner/deep": "import cocap_opt.made",
    }.items():  # fmt: skip
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.setattr(code, "_FOLDER", tmp_path)
    expected = {f"cocap_opt.{name}" for name in names | {"made"}}
    assert with_imports("cocap_opt.made") == expected


@pytest.mark.slow
def test_the_modules_followed_are_those_that_python_loads() -> None:
    """An import that is not understood would leave code out of a digest."""
    for module in ("cocap_opt.model.coverage_tables", "cocap_opt.planners.cocap_lns"):
        command = f"import sys, {module}; print(*sys.modules)"
        loaded = subprocess.run(
            [sys.executable, "-c", command], capture_output=True, text=True, check=True
        ).stdout.split()
        found = {name.removesuffix(".__init__") for name in with_imports(module)}
        assert {name for name in loaded if name.startswith("cocap_opt.")} <= found


def test_a_folder_of_compiled_files_is_no_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is left where a package has become a module, which is the one that is imported."""
    before = digest_of(MODULE, tmp_path, monkeypatch)
    (tmp_path / "made" / "__pycache__").mkdir(parents=True)
    assert digest_of(MODULE, tmp_path, monkeypatch) == before
