"""Do the images contradict the odometry for so long that the base goes elsewhere than it tells?

Motors that turn the wrong way, mirrored together with their encoders, a wrong scale of the counters, or
tracks that spin on the spot show in nothing that the base itself tells. Perception marks a frame as disputed
where nearly all that it sees contradicts the odometry (vision/ego_motion/camera_motion.py). One such frame
may be a vehicle that fills the view. This file adds up how far the two are apart over many.
"""

from __future__ import annotations

from collections import deque

from hal.records import record

# So many of the last frames in which the images tell of a motion: two seconds at 30 a second. Frames with
# the odometry alone do not count: where the robot spins, they are most.
_FRAMES = 60
# How far apart the sums of the disputed frames may be, and the share of what the odometry tells on top.
_APART_M, _APART_RAD = 0.3, 0.3
_SHARE = 0.5
# The odometry tells of so much motion at least: a robot that stands sees whatever passes close before it.
_LEAST_M, _LEAST_RAD = 0.1, 0.1


@record(frozen=True, slots=True)
class Motion:
    """Distance ahead (negative: back), and turn to the left, in one frame."""

    ahead_m: float
    turn_rad: float


class Contradiction:
    """sentence: "" as long as the images do not contradict the odometry for long."""

    def __init__(self) -> None:
        self.sentence = ""
        self._frames: deque[tuple[bool, Motion, Motion]] = deque(maxlen=_FRAMES)

    def add(self, told: Motion, seen: Motion, *, disputed: bool) -> None:
        """Add a frame in which the odometry told of one motion and the images of another, or of the same."""
        self._frames.append((disputed, told, seen))
        told_m = sum(told.ahead_m for disputed, told, _ in self._frames if disputed)
        seen_m = sum(seen.ahead_m for disputed, _, seen in self._frames if disputed)
        told_rad = sum(told.turn_rad for disputed, told, _ in self._frames if disputed)
        seen_rad = sum(seen.turn_rad for disputed, _, seen in self._frames if disputed)
        moves = abs(told_m) > _LEAST_M or abs(told_rad) > _LEAST_RAD
        elsewhere = abs(seen_m - told_m) > _APART_M + _SHARE * abs(told_m)
        turned = abs(seen_rad - told_rad) > _APART_RAD + _SHARE * abs(told_rad)
        self.sentence = ""
        if moves and (elsewhere or turned):
            self.sentence = (
                f"the camera sees {seen_m:+.2f} m ahead and {seen_rad:+.2f} rad where the base tells of "
                f"{told_m:+.2f} m and {told_rad:+.2f} rad; do its motors turn the right way, "
                "are its scales right in chassis:, do its tracks slip?"
            )
