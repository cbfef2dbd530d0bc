"""Lists of built-in scenes, file formats, cameras and airframes."""

import math
from collections.abc import Iterator
from fractions import Fraction

from cocap_opt.output.printing import Record
from cocap_opt.problem import Camera, Limits
from cocap_opt.scenarios import FORMATS, SCENES
from cocap_opt.scenarios.hardware import AIRFRAMES, CAMERAS

_MOST_SIDE = 9  # largest second number of an aspect ratio, as in 16:9


def known_scenes() -> dict[str, list[Record]]:
    """Returns rows of all scenes, formats, cameras and airframes, and of the options of formats."""
    return {
        "scenes": [
            {
                "scene": name,
                "rules": str(build(0).rules),
                "about": (build.__doc__ or "").strip().splitlines()[0],
            }
            for name, build in SCENES.items()
        ],
        "formats": [{"format": name, "about": f.description} for name, f in FORMATS.items()],
        "cameras": [
            {
                "camera": name, "width": camera.width, "height": camera.height,
                "shape": _shape(camera), "focal": camera.focal,
                "angle of view (deg)": 2 * math.degrees(camera.half_angle),
            }
            for name, camera in CAMERAS.items()
        ],
        "airframes": [
            {
                "airframe": name,
                "limits": ", ".join(f"{kind} {value:,.4g}" for kind, value in _known(limits)),
            }
            for name, limits in AIRFRAMES.items()
        ],
        "options": [
            {"option": name, "values": values, "of files": ", ".join(files)}
            for (name, values), files in _options().items()
        ],
    }  # fmt: skip


def _options() -> dict[tuple[str, str], list[str]]:
    """Returns the formats that have an option, by the option's name and values."""
    found: dict[tuple[str, str], list[str]] = {}
    for key, kind in FORMATS.items():
        if kind.options is not None:
            for name, words in kind.options.allowed.items():
                found.setdefault((name, ", ".join(words)), []).append(key)
    return found


def _shape(camera: Camera) -> str:
    """Returns the aspect ratio of the image in small whole numbers, possibly rounded."""
    ratio = Fraction(camera.width, camera.height).limit_denominator(_MOST_SIDE)
    return f"{ratio.numerator}:{ratio.denominator}"


def _known(limits: Limits) -> Iterator[tuple[str, float]]:
    """Yields the known limits, in degrees where recipes use degrees."""
    for kind in limits.__struct_fields__:
        if (value := getattr(limits, kind)) is not None:
            yield kind, math.degrees(value) if kind.endswith("_rate") else value
