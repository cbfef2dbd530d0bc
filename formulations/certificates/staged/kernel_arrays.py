"""The arrays that the compiled searches of joint states read and write, and the names of their
rows.
"""

from typing import NamedTuple

from cocap_opt.data import BoolArray, FloatArray, IndexArray, IntArray

# Entries of `Memory.progress`; the depth is -1 if no search is in progress.
DEPTH, IS_NEW, IS_DONE, FOUND, NODES = range(5)

# Rows of `Memory.values`; the first two are also those of `Memory.profits` and `Memory.largest`.
PRICED, CHARGED, MOST = range(3)

# Rows of `Memory.seen`.
PIXELS, VALUES = range(2)


class Inputs(NamedTuple):
    """The arrays that a search reads, for n states, F faces, C classes, R robots and B bounds."""

    first: IndexArray  # [n+1] first entry of each state's coverage
    faces: IndexArray  # face of each entry
    pixels: FloatArray  # pixels of each entry
    weights: FloatArray  # [F]
    n_roots: int  # number of faces before those that count drones
    caps: FloatArray  # [F - n_roots] limit k of each face that counts drones
    price: FloatArray  # [n]
    charge: FloatArray  # [n]
    class_of: IndexArray  # [n], not decreasing
    classes: IndexArray  # [R] class of the robot that is chosen at each depth
    counts: IntArray  # [R+1, C] remaining robots of each class at each depth
    place_of: IndexArray  # [n] place of each state, out of P places
    too_near: BoolArray  # [P, P] True if two robots may not be there at once
    raised: FloatArray  # [B, n] increase of prices or charges since each bound
    is_limit: BoolArray  # [B]


class Memory(NamedTuple):
    """The arrays that a search writes: at each of R + 1 depths, for n states, F faces, B bounds."""

    # depth, whether its node is new, whether all is done, number found, number of nodes
    progress: IntArray
    states: IndexArray  # [R+1, n] positions of states that may be taken
    numbers: IntArray  # [R+1, 2] their number, and the number of those of the next robot's class
    child: IndexArray  # [R+1] the next child
    # [3, R+1, n] gains less prices, gains less charges, and the largest reachable profit
    values: FloatArray
    seen: FloatArray  # [2, R+1, F] pixels so far, and their returns
    profits: FloatArray  # [2, R+1] worth so far less prices, and worth so far less charges
    below: FloatArray  # [R+1, B] ceilings and limits, less the increases so far
    largest: FloatArray  # [2, C] largest values of a node, by class
    chosen: IntArray  # [2, R] positions of the robots' states, and of the best joint state found
    collected: IntArray  # [most, R] positions of the collected joint states
