"""Several files in a zip file."""

import io
from collections.abc import Mapping
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo


def zipped(texts: Mapping[str, str]) -> bytes:
    """Returns a zip file of texts, given by name; the bytes are the same each time."""
    content = io.BytesIO()
    with ZipFile(content, "w", ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            archive.writestr(ZipInfo(name), text, ZIP_DEFLATED)
    return content.getvalue()
