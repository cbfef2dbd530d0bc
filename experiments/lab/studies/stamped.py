"""Pictures of other programs, which say in a text what they are made of.

A browser and PDFium draw a little otherwise in each release, so that no test can compare pixels. A
picture has a digest instead of the scene and of all that draws it here; where that has changed, a
test asks for the picture to be made again.
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
_ROUNDS = 2  # in which colours move to the middle of what they stand for


def made_from(*parts: str) -> str:
    """Returns a digest of what draws pictures, of coverage, of the place, and of further parts."""
    found = hashlib.sha256("\n".join([str(COVERAGE_VERSION), *parts]).encode())
    root = Path(scripts.__file__).parents[1]
    for pattern in _DRAWN_BY:
        for path in sorted(root.glob(pattern)):
            found.update(path.read_bytes())
    for name, content in sorted(places.files("delft").items()):
        found.update(name.encode() + content)
    return found.hexdigest()


def stamp(picture: Path) -> str:
    """Returns the digest that a picture has in it; empty if there is none."""
    with Image.open(picture) as image:
        found = image.info.get(_MADE_FROM) or image.info.get("xmp") or ""
    return found.decode() if isinstance(found, bytes) else str(found)


def stamped(picture: Image.Image, digest: str) -> bytes:
    """Returns a PNG of a picture in few colours, with a digest in it."""
    content, info = BytesIO(), PngInfo()
    info.add_text(_MADE_FROM, digest)
    few = picture.convert("RGB").quantize(
        _COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=_ROUNDS, dither=_PLAIN
    )
    few.save(content, "png", pnginfo=info, optimize=True)
    return content.getvalue()
