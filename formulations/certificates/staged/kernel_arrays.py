"""The arrays that the compiled searches of joint states read and write, and their rows."""

from typing import NamedTuple

from cocap_opt.data import BoolArray, FloatArray, IntArray

# What each entry of `Memory.progress` is; the depth is -1 where no search is going on.
DEPTH, IS_NEW, IS_DONE, FOUND, NODES = range(5)

# The rows of `Memory.values`, and the first two of `Memory.profits` and `Memory.largest`.
PRICED, CHARGED, MOST = range(3)

# The rows of `Memory.seen`.
PIXELS, VALUES = range(2)


class Inputs(NamedTuple):
    """The arrays that a search reads: of n states, F faces, C classes, R robots and B bounds."""

    first: IntArray  # [n+1] first entry of each state's coverage
    faces: IntArray  # of each entry
    pixels: FloatArray  # of each entry
    weights: FloatArray  # [F]
    n_roots: int  # faces before those that count drones
    caps: FloatArray  # [F - n_roots] k of those
    price: FloatArray  # [n]
    charge: FloatArray  # [n]
    class_of: IntArray  # [n], not decreasing
    classes: IntArray  # [R] of the robot that is chosen at each depth
    counts: IntArray  # [R+1, C] robots of each class that are left at each depth
    place_of: IntArray  # [n], of P places
    too_near: BoolArray  # [P, P] for two robots at once
    raised: FloatArray  # [B, n] by how much prices or charges are higher than at each bound
    is_limit: BoolArray  # [B]


class Memory(NamedTuple):
    """The arrays that a search writes: at each depth of R + 1, of n states, F faces, B bounds."""

    progress: IntArray  # depth, is its node new, is all done, found so far, nodes so far
    states: IntArray  # [R+1, n] positions of states that may be taken
    numbers: IntArray  # [R+1, 2] how many, and how many of them of the next robot's class
    child: IntArray  # [R+1] the next one
    values: FloatArray  # [3, R+1, n] gains less prices, less charges, and the most reached
    seen: FloatArray  # [2, R+1, F] pixels so far, and their returns
    profits: FloatArray  # [2, R+1] worth so far less prices, and less charges
    below: FloatArray  # [R+1, B] ceilings and limits, less what is raised so far
    largest: FloatArray  # [2, C] of a node's values, by class
    chosen: IntArray  # [2, R] positions of the robots' states, and of the best found
    collected: IntArray  # [most, R] positions of those that are collected
