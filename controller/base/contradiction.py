"""Whether the images contradict the odometry for long, so that the base does not go where it reports.

Motors that are mirrored together with their encoders, a wrong scale of the counters, or tracks that spin on
the spot do not show in what the base reports. Perception marks a frame as disputed where nearly all that it
sees contradicts the odometry (vision/ego_motion/camera_motion.py). A single disputed frame may be due to a
vehicle that fills the view, so the difference is summed up over many frames.
"""

from __future__ import annotations

from collections import deque

from hal.records import record

# Number of the last frames with a visual motion that are summed up: two seconds at 30 Hz. Frames for which
# there is the odometry alone do not count; while the robot spins, most are of this kind.
_FRAMES = 60
# Maximum difference between the sums over the disputed frames: a constant, plus a share of the odometry's.
_MAX_APART_M, _MAX_APART_RAD = 0.3, 0.3
_MAX_SHARE = 0.5
# Minimum sum of the odometry: a standing robot may see anything that passes close before it.
_MIN_M, _MIN_RAD = 0.1, 0.1


@record(frozen=True, slots=True)
class FrameMotion:
    """Distance ahead (negative: backwards) and turn to the left in one frame."""

    ahead_m: float
    turn_rad: float


class Contradiction:
    """sentence: what is wrong, for the user; "" unless the images have contradicted the odometry for long."""

    def __init__(self) -> None:
        self.sentence = ""
        self._frames: deque[tuple[bool, FrameMotion, FrameMotion]] = deque(maxlen=_FRAMES)

    def add(self, told: FrameMotion, seen: FrameMotion, *, disputed: bool) -> None:
        """Add a frame: its motion by the odometry (told) and by the images (seen)."""
        self._frames.append((disputed, told, seen))
        told_m = sum(told.ahead_m for disputed, told, _ in self._frames if disputed)
        seen_m = sum(seen.ahead_m for disputed, _, seen in self._frames if disputed)
        told_rad = sum(told.turn_rad for disputed, told, _ in self._frames if disputed)
        seen_rad = sum(seen.turn_rad for disputed, _, seen in self._frames if disputed)
        moves = abs(told_m) > _MIN_M or abs(told_rad) > _MIN_RAD
        elsewhere = abs(seen_m - told_m) > _MAX_APART_M + _MAX_SHARE * abs(told_m)
        turned = abs(seen_rad - told_rad) > _MAX_APART_RAD + _MAX_SHARE * abs(told_rad)
        self.sentence = ""
        if moves and (elsewhere or turned):
            self.sentence = (
                f"the camera sees {seen_m:+.2f} m ahead and {seen_rad:+.2f} rad where the base reports "
                f"{told_m:+.2f} m and {told_rad:+.2f} rad; do its motors turn the right way, "
                "are its scales right in chassis:, do its tracks slip?"
            )
