"""The digest of a module's code with all that it imports, kept on disk.

Parsing the seventy modules that compute coverage takes half a second, reading them a few
milliseconds. So a file lists the modules with digests of their text, and the digest of their code,
which is the same as long as no text has changed.
"""

import hashlib
import sys
from contextlib import suppress
from pathlib import Path

import msgspec

from cocap_opt.files import code
from cocap_opt.files.atomic_write import write_atomically


class _Known(msgspec.Struct, forbid_unknown_fields=True):
    """The content of a file.

    Attributes
    ----------
    modules : digest of the text of each module, by full name
    digest : digest of their code
    """

    modules: dict[str, str]
    digest: str


def digest_with_imports(module: str, folder: Path | None) -> str:
    """Returns the digest of the code of a module and of all project modules that it imports.

    Parameters
    ----------
    module : full name
    folder : folder of the file that keeps the digest, which is made if needed; None: it is computed
        each time

    Raises
    ------
    ValueError
        If there is no such module.
    """
    path = None if folder is None else folder / f"{_name(module)}.code"
    known = None if path is None else _read(path)
    if known is not None and module in known.modules and _is_up_to_date(known):
        return known.digest
    modules = code.with_imports(module)
    texts = {name: _text_digest(name) for name in sorted(modules)}
    known = _Known(texts, code.code_digest(*modules))
    with suppress(OSError):  # a folder that cannot be written to
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically({path: msgspec.json.encode(known)})
    return known.digest


def _name(module: str) -> str:
    """Returns a digest of all that a digest of code depends on but the modules' texts."""
    parts = module, sys.version, Path(code.__file__).read_text("utf-8")
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _read(path: Path) -> _Known | None:
    """Returns the content of a file; None if there is none that can be read."""
    try:
        if not path.is_file():  # opening a pipe would wait for a writer
            return None
        return msgspec.json.decode(path.read_bytes(), type=_Known)
    except (OSError, msgspec.MsgspecError, UnicodeError):
        return None


def _is_up_to_date(known: _Known) -> bool:
    try:
        return all(_text_digest(name) == digest for name, digest in known.modules.items())
    except OSError:  # a module is gone
        return False


def _text_digest(module: str) -> str:
    return hashlib.sha256(code.text_of(module).encode()).hexdigest()
