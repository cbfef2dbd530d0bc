"""Pictures made by other programs, which contain a digest of what they are made from.

Browsers and PDFium draw slightly differently in each release, so tests cannot compare pixels.
Instead, a picture contains a digest of the scene and of all code that draws it here; if that has
changed, a test asks for the picture to be made again.
"""

import hashlib
from io import BytesIO
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

from cocap_opt.player import scripts
from cocap_opt.problem import COVERAGE_VERSION
from cocap_opt.scenarios.built_in import places

_MADE_FROM = "made-from"  # the text in a picture
_DRAWN_BY = ("player/page/*.*", "missions/sheet/*.py", "problem/pictures.py",
             "problem/whole_names.py")  # fmt: skip
_PLAIN = Image.Dither.NONE
_COLOURS = 256
_ROUNDS = 2  # rounds of k-means: each colour moves to the mean of the colours that it replaces


def made_from(*parts: str) -> str:
    """Returns a digest of the drawing code, coverage's version, the place, and further parts."""
    found = hashlib.sha256("\n".join([str(COVERAGE_VERSION), *parts]).encode())
    root = Path(scripts.__file__).parents[1]
    for pattern in _DRAWN_BY:
        for path in sorted(root.glob(pattern)):
            found.update(path.read_bytes())
    for name, content in sorted(places.files("delft").items()):
        found.update(name.encode() + content)
    return found.hexdigest()


def stamp(picture: Path) -> str:
    """Returns the digest in a picture; empty if there is none."""
    with Image.open(picture) as image:
        found = image.info.get(_MADE_FROM) or image.info.get("xmp") or ""
    return found.decode() if isinstance(found, bytes) else str(found)


def stamped(picture: Image.Image, digest: str) -> bytes:
    """Returns a PNG of a picture with few colours, and with a digest in it."""
    content, info = BytesIO(), PngInfo()
    info.add_text(_MADE_FROM, digest)
    few = picture.convert("RGB").quantize(
        _COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=_ROUNDS, dither=_PLAIN
    )
    few.save(content, "png", pnginfo=info, optimize=True)
    return content.getvalue()
