"""The parts of a map between which a drone cannot move at a flight height, such as closed yards."""

import numpy as np

from cocap_opt.data import BoolArray


def largest_area(free: BoolArray, corner_cutting: bool) -> BoolArray:
    """Returns the cells [X, Y] of the largest free area; of several that are as large, of all.

    Free cells side by side are in one area, and with corner cutting those that share a corner, too.

    Parameters
    ----------
    free : [X, Y] cells without solid matter and closed airspace, at one flight height
    corner_cutting : as `Motion` has it
    """
    from scipy.ndimage import generate_binary_structure, label  # slow to import

    area, _ = label(free, generate_binary_structure(2, 2 if corner_cutting else 1))
    sizes = np.bincount(area[free], minlength=1)
    largest: BoolArray = free & (sizes[area] == sizes.max())
    return largest
