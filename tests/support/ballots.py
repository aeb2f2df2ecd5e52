"""Ballots of the predicted cells of tracks (vision/bodies/votes.py) in parts on the grid of grids.py."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.support.grids import block, labelled
from vision.bodies import votes

PART = labelled(block((10, 30), (10, 50)))  # 800 cells
MOVES = np.array([False, True])  # of two tracks, the first stands and the second moves


def vote(
    *expected: NDArray[np.bool_], mover: tuple[bool, ...], parts: NDArray[np.int32] = PART
) -> votes.Ballot:
    """The ballot in which each track is predicted in the cells expected, one mask a track."""
    return votes.count_votes(parts, int(parts.max()), labelled(*expected), len(mover), np.array(mover))
