"""What the paper reports (Daeef 2020, Table 2)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reported:
    """One row of the table. objects: true ones; correct, wrong: detections; precision, recall: as printed."""

    objects: int
    correct: int
    wrong: int
    precision: float
    recall: float
    seconds_per_frame: float


PAPER_OURS = Reported(50, 40, 2, 0.96, 0.80, 0.30)
PAPER_LIDAR = Reported(52, 48, 0, 1.0, 0.9231, 0.26)
