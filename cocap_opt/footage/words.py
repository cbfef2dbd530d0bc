"""Describes the quality of a plan in words, for a terminal or a notebook."""

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.footage.assumptions import Assumptions
from cocap_opt.footage.moments import APART
from cocap_opt.footage.summary import Summary, share, whole_percent
from cocap_opt.letters import folded
from cocap_opt.text import counted, significant

USUAL_WIDTH = 80  # characters per line
_LABEL = 24  # characters before a number
_SHARP = 0.5  # px of blur


def quality_words(
    found: Summary,
    worst: Sequence[str],
    blur: FloatArray | None,
    has_pictures: BoolArray,
    had: Assumptions,
    takes: Sequence[tuple[str, Summary]] = (),
    width: int = USUAL_WIDTH,
) -> str:
    """Returns the summary of a plan's quality, its worst moments, and the assumptions.

    Parameters
    ----------
    worst : the worst moments in words
    blur : [n, R] px for the person-steps that count; nan if a drone does not see the person or has
        no image. None if the scene defines no step length
    has_pictures : [R] True for drones with a pinhole camera
    takes : names of the takes, each with its summary
    width : largest number of characters per line
    """
    if not found.person_steps:
        return "Quality of the plan: no person has a weight, so no person-step counts"
    line = partial(_line, width=min(width, USUAL_WIDTH))
    lines = [
        f"Quality of the plan: {counted(found.person_steps, 'person-step')} that "
        f"{'counts' if found.person_steps == 1 else 'count'}, "
        f"{counted(len(has_pictures), 'drone')}",
        line("seen by two or more", whole_percent(found.by_two)),
        line("seen by three or more", whole_percent(found.by_three)),
        line(f"two, {APART:g} degrees apart", whole_percent(found.apart)),
        line("RMS error of a point", _told_errors(found, has_pictures)),
        line("blur", _told_blur(blur)),
        line("drones in images", _told_intruders(found)),
        *(
            line("" if k else "take by take", f"{name}: {of.line or 'no person-step counts'}")
            for k, (name, of) in enumerate(takes)
        ),
        *(line("" if k else "worst moments", words) for k, words in enumerate(worst)),
        *(
            folded(words, min(width, USUAL_WIDTH))
            for words in _notes(had, blur is not None, has_pictures)
        ),
    ]
    return "\n".join(lines)


def _told_errors(found: Summary, has_pictures: BoolArray) -> str:
    """Describes the errors."""
    if math.isnan(found.median):
        whose = "drones without images" if has_pictures.any() else "no images"
        return f"unknown: {whose}"
    parts = [
        f"{words} within {error:,.0f} mm"
        for words, error in (("half", found.median), ("nine tenths", found.most_of_them))
        if math.isfinite(error)
    ]
    if found.infinite:
        parts.append(f"infinite at {whole_percent(found.infinite)}")
    return ", ".join(parts)


def _told_blur(blur: FloatArray | None) -> str:
    """Describes the blur over the images of all person-steps that count."""
    if blur is None:
        return "unknown: the scene defines no step length"
    known = blur[~np.isnan(blur)]
    if not len(known):
        return "none: no images"
    blurred = share(known > _SHARP)
    remedy = "; a shorter exposure reduces it" if blurred > 0.5 else ""
    return (
        f"{significant(np.median(known), 2)} px median, {significant(known.max(), 2)} at most; "
        f"above {_SHARP:g} px in {whole_percent(blurred)} of views{remedy}"
    )


def _told_intruders(found: Summary) -> str:
    """Describes how many drones are large in the images of others."""
    if not found.in_pictures:
        return "none: no images" if math.isnan(found.disturbed) else "none"
    return f"{found.in_pictures}, in {whole_percent(found.disturbed)} of all images"


def _notes(had: Assumptions, is_timed: bool, has_pictures: BoolArray) -> Iterator[str]:
    """Yields the assumptions of the numbers."""
    pose = (
        f"poses known to {1000 * had.position_error:.3g} mm and "
        f"{math.degrees(had.attitude_error):.3g} degrees"
        if had.position_error or had.attitude_error
        else "exact poses"
    )
    exposure = f", an exposure of {_told_seconds(had.exposure)}" if is_timed else ""
    yield (
        f"Assumed: an error of {had.pixel_error:g} px in an image{exposure}, and {pose}. A drone "
        f"sees a person if its image contains at least {100 * had.at_least:g} % of the person's "
        "unobstructed solid angle. The error is infinite if fewer than two drones see the "
        "person, or if all of them look along one line. A drone counts as in the image of "
        f"another if its {had.drone_size:g} m cover at least {had.drone_pixels:g} px there."
    )
    if not has_pictures.all():
        yield (
            f"{int((~has_pictures).sum())} of {len(has_pictures)} drones have no images: their "
            "views count, but have neither errors nor blur."
        )


def _line(label: str, words: str, width: int) -> str:
    """Returns a label and its value, in lines folded below each other."""
    return folded(words, width, f"{label:{_LABEL}}", " " * _LABEL)


def _told_seconds(exposure: float) -> str:
    """Returns an exposure time in the notation of cameras."""
    return f"1/{1 / exposure:.0f} s" if 0 < exposure < 0.5 else f"{exposure:g} s"
