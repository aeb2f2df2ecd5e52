"""Tracks that are one body are joined, and a track that holds two bodies is divided, in this order.

vision/tracker.py calls it once movers reach down to the floor (vision/bodies/grounding.py). Terms:
vision/__init__.py.
"""

from __future__ import annotations

from vision.bodies.arrivals import Changes
from vision.bodies.carving import SUSPECT_EVIDENCE
from vision.bodies.division import second_bodies
from vision.bodies.merging import merge_labels, pairs_to_merge
from vision.bodies.tracks import Tracks
from vision.depth.connected import IntGrid
from vision.depth.regions import Regions
from vision.detection import Detection

# Standard deviations of a second body, which begins with the position and the velocity of both: they are a
# shoulder apart, and one of them may stand.
_SIGMA_M, _SIGMA_MPS = 0.3, 1.0


def regrouped(
    tracks: Tracks, detection: Detection, labels: IntGrid, measured: Regions, changes: Changes
) -> IntGrid | None:
    """labels (h, w), track index + 1, after joining and dividing; None: there is nothing to join or divide.

    Tracks that were joined to another one are marked as merged away; a second body begins a track of its own.
    measured: regions of the tracks.
    """
    may_be_two = tracks.moving | (tracks.restless_s > 0.0)
    if not may_be_two.any():
        return None
    grid = detection.grid
    pairs = pairs_to_merge(
        grid,
        measured,
        tracks.velocity_mps,
        tracks.velocity_sigma_mps,
        tracks.mover,
        tracks.moving,
        tracks.moving_s,
    )
    displacement_m = tracks.speed_mps * changes.stayed_s
    labels, gone = merge_labels(grid, labels, pairs, changes.stayed, displacement_m)
    tracks.merged_away[gone] = True
    visible = (may_be_two & (measured.cells > 0)).nonzero()[0]
    seconds = second_bodies(grid, labels, visible, changes.stayed, displacement_m)
    for number, (track, cells) in enumerate(seconds, start=len(tracks) + 1):
        tracks.start_from(track, _SIGMA_M, _SIGMA_MPS, SUSPECT_EVIDENCE, detection.captured_ns)
        labels = labels.copy()
        labels.ravel()[cells] = number
    return labels if gone or seconds else None
