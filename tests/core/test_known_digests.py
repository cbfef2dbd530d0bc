"""Digests of code that are kept on disk: the same as computed ones, whatever happens to files."""

from pathlib import Path

import msgspec
import pytest

from cocap_opt.files import code
from cocap_opt.files.known_digests import digest_with_imports

MODULE = "cocap_opt.made"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with a module that imports another, and a folder for digests within."""
    monkeypatch.setattr(code, "_FOLDER", tmp_path)
    (tmp_path / "made.py").write_text("from cocap_opt.other import x\n", encoding="utf-8")
    (tmp_path / "other.py").write_text("x = 1\n", encoding="utf-8")
    return tmp_path


def computed() -> str:
    """The digest without any file."""
    return code.code_digest(*code.with_imports(MODULE))


def parsed_never(*modules: str) -> frozenset[str]:
    """A function in place of one that parses."""
    raise AssertionError(modules)


def test_a_known_digest_is_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second time, no module is parsed; without a folder, nothing is kept."""
    kept, expected = folder / "new" / "kept", computed()
    assert digest_with_imports(MODULE, None) == expected
    assert not kept.exists()
    assert digest_with_imports(MODULE, kept) == expected
    monkeypatch.setattr(code, "with_imports", parsed_never)
    assert digest_with_imports(MODULE, kept) == expected
    with pytest.raises(AssertionError):
        digest_with_imports("cocap_opt.other", kept)


@pytest.mark.parametrize("name", ["made.py", "other.py"])
def test_a_changed_module_changes_the_digest(folder: Path, name: str) -> None:
    """Each module counts, and so do modules that are imported since; a comment does not."""
    kept, first = folder / "kept", digest_with_imports(MODULE, folder / "kept")
    path = folder / name
    text = path.read_text("utf-8")
    path.write_text(f"{text}# a comment\n", encoding="utf-8")
    assert digest_with_imports(MODULE, kept) == computed() == first
    (folder / "third.py").write_text("y = 1\n", encoding="utf-8")
    path.write_text(f"{text}from cocap_opt.third import y\n", encoding="utf-8")
    second = digest_with_imports(MODULE, kept)
    assert second == computed() != first
    (folder / "third.py").write_text("y = 2\n", encoding="utf-8")
    assert digest_with_imports(MODULE, kept) == computed() not in {first, second}
    path.write_text(text, encoding="utf-8")
    (folder / "third.py").unlink()
    assert digest_with_imports(MODULE, kept) == first


@pytest.mark.parametrize("content", [b"", b"{}", b"\xff", b"no JSON", None])
def test_what_cannot_be_read_is_computed(folder: Path, content: bytes | None) -> None:
    """Damaged files are written again; those of other modules do not count."""
    kept, expected = folder / "kept", digest_with_imports(MODULE, folder / "kept")
    (path,) = kept.iterdir()
    if content is None:
        content = msgspec.json.encode({"modules": {}, "digest": "forged"})
    path.write_bytes(content)
    assert digest_with_imports(MODULE, kept) == expected
    assert msgspec.json.decode(path.read_bytes())["digest"] == expected


def test_a_folder_that_cannot_be_made_keeps_nothing(folder: Path) -> None:
    """The digest is computed each time."""
    (folder / "file").touch()
    assert digest_with_imports(MODULE, folder / "file" / "kept") == computed()


def test_a_module_that_does_not_exist_is_named(folder: Path) -> None:
    """It is an error, with a file and without."""
    for kept in (None, folder / "kept"):
        with pytest.raises(ValueError, match="none: there is no such module"):
            digest_with_imports("cocap_opt.none", kept)
