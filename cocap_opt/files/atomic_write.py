"""Files that are written completely or not at all."""

import errno
import os
import stat
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from cocap_opt.stop import Interrupt

UNFINISHED = ".cocap-opt-"  # prefix of the names of temporary files


def write_atomically(
    contents: Mapping[Path, bytes] | Mapping[Path, Callable[[BinaryIO], None]],
) -> None:
    """Writes files completely or not at all; none gets its name before all are written.

    A file's content is given, or a function that writes it into the file.

    Each is written to a temporary file beside it, which is then renamed. If Ctrl-C comes
    before that, no file is written; if it comes later, all are.

    Raises
    ------
    OSError
        If a file cannot be written, or its name belongs to a folder, a device or the like.
    KeyboardInterrupt
        If they were written in spite of Ctrl-C; the message says so.
    """
    written: list[tuple[str, Path]] = []
    try:
        for path, content in contents.items():
            target = file_to_write(path)
            # The target's own name may be as long as names can be.
            with Interrupt.held_back():
                handle, name = tempfile.mkstemp(dir=target.parent, prefix=UNFINISHED)
                written.append((name, target))
            with os.fdopen(handle, "wb") as file:
                if callable(content):
                    content(file)
                else:
                    file.write(content)
            # mkstemp makes private files; give it the mode any other new file would get.
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(name, 0o666 & ~umask)
        _rename(written, ", ".join(map(str, contents)))
    except BaseException as error:
        for name, _ in written:
            Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno is not None:
            # The error of a full disk names no file, other errors the temporary file.
            raise OSError(error.errno, error.strerror, ", ".join(map(str, contents))) from error
        raise


def _rename(written: list[tuple[str, Path]], names: str) -> None:
    """Gives all files their names."""
    done = False
    try:
        with Interrupt.held_back():
            for name, target in written:
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
