"""Cuts: cells of tracks that are to become tracks of their own, and the one place where they do.

vision/bodies/carving.py and left_behind.py find the cuts of a frame and change nothing. cut_out then starts
the tracks, relabels the cells and measures the surfaces anew, all at once, so that labels, tracks and
measures always belong together. Terms: vision/__init__.py.
"""

from __future__ import annotations

import numpy as np

from hal.records import record
from hal.types import Integers
from vision.bodies.births import FIRST_SIGMA_M
from vision.bodies.tracks import Tracks
from vision.depth import regions
from vision.depth.connected import IntGrid
from vision.depth.regions import Regions
from vision.detection import Detection


@record(frozen=True, slots=True, eq=False)
class Cut:
    """Cells that are cut out of a track, or of several that they connect.

    cells: flat indices, (K,).
    evidence: score at which the new track starts; above 0 it is a suspect.
    left_by: index of the mover that has left these cells behind. It has not moved, though the centre of its
        surface jumps as they are cut out of it. None where nothing was left behind.
    """

    cells: Integers
    evidence: float
    left_by: int | None = None


def without(labels: IntGrid, cuts: list[Cut]) -> IntGrid:
    """labels (h, w), track index + 1, with 0 in the cells that are to be cut out."""
    if not cuts:
        return labels
    result = labels.copy()
    for cut in cuts:
        result.ravel()[cut.cells] = 0
    return result


def cut_out(
    tracks: Tracks,
    detection: Detection,
    labels: IntGrid,
    measured: Regions,
    cuts: list[Cut],
    max_speed_mps: float,
) -> tuple[IntGrid, Regions]:
    """Start a track for each of the cuts; labels (h, w), track index + 1, and their regions with these.

    No two cuts share a cell. measured: regions of labels.
    """
    if not cuts:
        return labels, measured
    known, labels = len(tracks), labels.copy()
    for number, cut in enumerate(cuts, start=known + 1):
        labels.ravel()[cut.cells] = number
    measured = regions.measure(detection.grid, labels, known + len(cuts))
    evidence = np.array([cut.evidence for cut in cuts])
    position_m = detection.pose.apply(measured.position_m)
    tracks.start(position_m[known:], FIRST_SIGMA_M, max_speed_mps, evidence, detection.captured_ns)
    tracks.border_is_guess[known:] = evidence > 0.0
    # A piece of a beam hangs as high as the beam. One that reaches down is seen to do so (hanging.py).
    tracks.overhead[known:] = True
    left = np.array([cut.left_by for cut in cuts if cut.left_by is not None], np.intp)
    tracks.reset_position(left, position_m[left], np.tile(FIRST_SIGMA_M**2 * np.eye(3), (len(left), 1, 1)))
    tracks.trailing_m[left] = tracks.state[left, :3]
    return labels, measured
