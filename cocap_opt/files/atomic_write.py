"""Files each of which is written completely or not at all."""

import errno
import os
import secrets
import stat
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from cocap_opt.stop import Interrupt

UNFINISHED = ".cocap-opt-"  # prefix of the names of temporary files
# a new file, of bytes also on Windows; the system applies the umask
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)


def write_atomically(
    contents: Mapping[Path, bytes] | Mapping[Path, Callable[[BinaryIO], None]],
) -> None:
    """Writes each file completely or not at all; none gets its name before all are written.

    A file's content is given, or a function that writes it into the file.

    Each is written to a temporary file beside it, which is then renamed. If Ctrl-C comes
    before that, no file is written; if it comes later, all are. A file that is replaced keeps its
    permissions.

    Raises
    ------
    OSError
        If a file cannot be written, or its name belongs to a file that may only be read, a folder,
        a device or the like. It names the files that were not written: all, unless the system
        refuses a new name after others were given.
    KeyboardInterrupt
        If they were written in spite of Ctrl-C; the message says so.
    """
    written: list[tuple[str, Path, Path]] = []  # temporary name, target, path as given
    try:
        for path, content in contents.items():
            target = file_to_write(path)
            mode = _mode_of(target)
            # The target's own name may be as long as names can be.
            name = str(target.parent / f"{UNFINISHED}{secrets.token_hex(8)}")
            with Interrupt.held_back():
                handle = os.open(name, _NEW, 0o666 if mode is None else mode)
                written.append((name, target, path))
            with os.fdopen(handle, "wb") as file:
                if callable(content):
                    content(file)
                else:
                    file.write(content)
            if mode is not None:
                os.chmod(name, mode)
        _rename(written, ", ".join(map(str, contents)))
    except BaseException as error:
        renamed = {path for name, _, path in written if not os.path.lexists(name)}
        for name, _, _ in written:
            Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno is not None:
            names = ", ".join(str(path) for path in contents if path not in renamed)
            # The error of a full disk names no file, other errors the temporary file.
            raise OSError(error.errno, error.strerror, names) from error
        raise


def _mode_of(target: Path) -> int | None:
    """Returns the permissions of a file that is to be replaced; None if there is none.

    Raises
    ------
    OSError
        If it may only be read.
    """
    if not target.exists():
        return None
    if not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return stat.S_IMODE(target.stat().st_mode)


def _rename(written: list[tuple[str, Path, Path]], names: str) -> None:
    """Gives all files their names."""
    done = False
    try:
        with Interrupt.held_back():
            for name, target, _ in written:
                os.replace(name, target)
            done = True
    except KeyboardInterrupt as interrupt:
        if done:
            interrupt.args = (f"written: {names}",)
        raise


def file_to_write(path: Path) -> Path:
    """Returns the regular file, existing or not, to which a path leads through symbolic links.

    Raises
    ------
    OSError
        If links form a circle, a name is too long, or the path is not a regular file.
    """
    target = Path(os.path.realpath(path))
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(target.stat().st_mode):
            raise OSError(errno.EINVAL, "must be a regular file, not a folder, device or pipe")
    return target
