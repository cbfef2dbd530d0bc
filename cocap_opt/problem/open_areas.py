"""The parts of a map between which a drone cannot move at a flight height, e.g. closed yards."""

import numpy as np

from cocap_opt.data import BoolArray


def largest_area(free: BoolArray, corner_cutting: bool) -> BoolArray:
    """Returns the cells [X, Y] of the largest free area, or of all areas of that size.

    Adjacent free cells belong to one area; with corner cutting, so do cells that share only a
    corner.

    Parameters
    ----------
    free : [X, Y] cells without solid matter or closed airspace, at one flight height
    corner_cutting : as in `Motion`
    """
    from scipy.ndimage import generate_binary_structure, label  # takes long to import

    area, _ = label(free, generate_binary_structure(2, 2 if corner_cutting else 1))
    sizes = np.bincount(area[free], minlength=1)
    largest: BoolArray = free & (sizes[area] == sizes.max())
    return largest
