"""Files are written whole or not at all."""

import errno
import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from cocap_opt.files.atomic_write import write_atomically


@pytest.mark.parametrize("name", ["x" * 255, "\N{LATIN SMALL LETTER SHARP S}" * 127])
def test_a_name_may_be_as_long_as_names_can_be(name: str, tmp_path: Path) -> None:
    """The temporary file's name is not longer than the one asked for, of 255 bytes at most."""
    write_atomically({tmp_path / name: b"content"})
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [(name, b"content")]
    with pytest.raises(OSError, match="too long"):
        write_atomically({tmp_path / (name + "xx"): b"content"})
    assert len(list(tmp_path.iterdir())) == 1


def test_links_are_followed(tmp_path: Path) -> None:
    """A symbolic link stays one and its target is written, be it there already or not."""
    (tmp_path / "elsewhere").mkdir()
    target, first, second = tmp_path / "elsewhere" / "file", tmp_path / "a", tmp_path / "b"
    first.symlink_to("b")
    second.symlink_to(Path("elsewhere") / "file")
    for content in (b"new", b"newer"):
        write_atomically({first: content})
        assert first.is_symlink() and second.is_symlink()
        assert target.read_bytes() == content
    assert list(target.parent.iterdir()) == [target]


def test_nothing_but_files_is_replaced(tmp_path: Path) -> None:
    """A folder, a pipe, a circle of links, and a link to one of these are left as they are."""
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name, target in (("loop", "pool"), ("pool", "loop"), ("way", "pipe"), ("null", os.devnull)):
        (tmp_path / name).symlink_to(target)
    before = {path.name: path.lstat().st_mode for path in tmp_path.iterdir()}
    for name in before:
        with pytest.raises(OSError, match=r"regular file|symbolic links"):
            write_atomically({tmp_path / name: b"content"})
    assert {path.name: path.lstat().st_mode for path in tmp_path.iterdir()} == before


def test_a_failed_write_leaves_no_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write that fails before the end keeps the old content and removes its temporary file."""
    path = tmp_path / "file"
    write_atomically({path: b"old"})

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space"):
        write_atomically({path: b"new"})
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_told_with_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The system names no file where there is no room; whoever reads the message needs it."""

    def full(_: object) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "file"
    with pytest.raises(OSError, match="No space") as caught:
        write_atomically({path: full})
    assert caught.value.filename == str(path) and caught.value.errno == 28
    assert list(tmp_path.iterdir()) == []


def test_files_that_belong_together_are_all_new_or_all_old(tmp_path: Path) -> None:
    """Where the second of two cannot be written, the first keeps what it had."""
    path, folder = tmp_path / "plan", tmp_path / "proof"
    write_atomically({path: b"old"})
    folder.mkdir()
    with pytest.raises(OSError, match="regular file"):
        write_atomically({path: b"new", folder: b"new"})
    assert path.read_bytes() == b"old"
    assert sorted(tmp_path.iterdir()) == [path, folder]
    folder.rmdir()
    write_atomically({path: b"new", folder: b"newer"})
    assert (path.read_bytes(), folder.read_bytes()) == (b"new", b"newer")


def test_files_that_are_not_renamed_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the system gives one file its name but not the other, the error names the other."""
    first, second, replace = tmp_path / "first", tmp_path / "second", os.replace

    def refused(name: str, target: Path) -> None:
        if target == second:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        replace(name, target)

    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(OSError, match="busy") as raised:
        write_atomically({first: b"new", second: b"new"})
    assert raised.value.filename == str(second)
    assert [*tmp_path.iterdir()] == [first]


def test_ctrl_c_leaves_none_or_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the first file has its name there is none, and later all, which is said."""
    first, second = tmp_path / "a", tmp_path / "b"
    for name, words, kept in (("fdopen", "^$", []), ("replace", "^written: .*a, .*b$", ["a", "b"])):
        real = getattr(os, name)

        def press(*args: object, real: Callable[..., object] = real) -> object:
            signal.raise_signal(signal.SIGINT)
            return real(*args)

        with monkeypatch.context() as patch:
            patch.setattr(os, name, press)
            with pytest.raises(KeyboardInterrupt, match=words):
                write_atomically({first: b"one", second: b"two"})
        assert sorted(path.name for path in tmp_path.iterdir()) == kept
