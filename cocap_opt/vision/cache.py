"""Coverage tables on disk, found by content.

A file's name is the digest of everything on which the table depends, including the code. Its first
bytes are the digest of the rest, so a damaged file is noticed and computed again.
"""

import hashlib
import io
import logging
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO, NamedTuple, cast

import msgspec
import numpy as np

from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.known_digests import digest_with_imports
from cocap_opt.files.users_folder import users_folder
from cocap_opt.vision.coverage import CoverageTable

log = logging.getLogger(__name__)

_DIGEST_BYTES = hashlib.sha256().digest_size
_Computed = tuple[CoverageTable, float]  # a table, and the seconds it took to compute


class TableCache(NamedTuple):
    """A folder of coverage tables; with None, nothing is stored."""

    folder: Path | None

    @classmethod
    def of_user(cls) -> "TableCache":
        """Returns the cache in COCAP_OPT_CACHE, or in cocap-opt in the user's cache folder.

        The cache has no folder if the user has no home.
        """
        return cls(users_folder())

    @staticmethod
    def key(maker: str, *parts: object) -> str:
        """Returns the digest of plain data, arrays and this package's data classes.

        Parameters
        ----------
        maker : full name of the module that makes the table; the digest includes all modules that
            it imports
        """
        digest = hashlib.sha256(_code(maker))
        digest.update(msgspec.msgpack.encode(parts, enc_hook=_plain))
        return digest.hexdigest()

    def has(self, key: str) -> bool:
        """Returns True if a file of the table with this content key exists."""
        return self.folder is not None and self._path(key).is_file()

    def table(self, key: str, make: Callable[[], _Computed]) -> _Computed:
        """Reads the table with this content key from disk, or computes and stores it.

        Also returns the seconds that the computation took, whenever and in whatever process it ran.
        """
        if self.folder is None:
            return make()
        path = self._path(key)
        found = _read(path)
        if found is None:
            found = make()
            _write(path, found)
        return found

    def _path(self, key: str) -> Path:
        return (self.folder or Path()) / f"{key}.coverage"


@cache
def _code(maker: str) -> bytes:
    """Digest of the code that computes coverage, and of the version of the ray caster."""
    return (version("embreex") + digest_with_imports(maker, users_folder())).encode()


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return [str(value.dtype), list(value.shape), np.ascontiguousarray(value).tobytes()]
    raise TypeError(f"no digest for {type(value).__name__}")


def _read(path: Path) -> _Computed | None:
    try:
        if not path.is_file():  # opening a pipe would wait for a writer
            return None
        with path.open("rb") as file:
            digest, body = file.read(_DIGEST_BYTES), file.read()
    except OSError:
        return None
    if hashlib.sha256(body).digest() == digest:
        # NumPy does not specify which errors files of other kinds raise.
        with suppress(Exception), np.load(io.BytesIO(body), allow_pickle=False) as arrays:
            table = CoverageTable(**{name: arrays[name] for name in CoverageTable._fields})
            return table, float(arrays["seconds"])
    log.warning("cache file %s is damaged; computing its content again", path)
    return None


class _Hashing:
    """A file that is written sequentially, and the digest of the written bytes.

    Tables are large, so they are not copied in memory.

    Attributes
    ----------
    digest : digest of everything written so far
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file, self.digest = file, hashlib.sha256()

    def write(self, data: bytes) -> int:
        """Writes some bytes."""
        self.digest.update(data)
        return self._file.write(data)

    def flush(self) -> None:
        """Writes buffered bytes."""
        self._file.flush()

    def read(self, size: int = -1) -> bytes:
        """Reads nothing: NumPy treats an object as a file only if it can be read."""
        raise io.UnsupportedOperation


def _write(path: Path, computed: _Computed) -> None:
    table, seconds = computed

    def write(file: BinaryIO) -> None:
        file.write(bytes(_DIGEST_BYTES))  # reserves space for the digest
        body = _Hashing(file)
        np.savez(cast(BinaryIO, body), seconds=np.float64(seconds), **table._asdict())
        file.seek(0)
        file.write(body.digest.digest())

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically({path: write})
    except OSError as error:  # a full or read-only disk affects the speed, not the result
        words = f"cannot write {path.parent}, the cache: {error.strerror or error}"
        log.warning("%s", words, extra={"once": "coverage is not kept"})
