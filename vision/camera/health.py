"""Camera health: whether a frame can be trusted, and if not, why, in a plain sentence.

vision/detector.py asks before it tracks anything in the frame (HealthMonitor), and once the camera's motion
is estimated (with_ego_motion). In doubt a frame is not trusted.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

import numpy as np

from config.perception import PerceptionConfig
from hal.compiled import compiled
from hal.records import record
from hal.types import Pose, RgbdFrame
from vision.camera.frozen_depth import FrozenDepth
from vision.depth.depth_grid import DepthGrid
from vision.fragments.edges import GreyImage
from vision.scene import CameraCondition, CameraHealth, EgoMotion

_STEP = 16  # pixels between two samples: 1200 samples of 640x480 are enough for shares
_BLACK_LEVEL = 12  # grey: black, with room for a sensor's noise
_WHITE_LEVEL = 243  # grey: as far from white as that from black
_BAD_SHARE = 0.9  # of the image: a lamp or a dark hall is less
_MIN_DEPTH_SHARE = 0.02  # of the grid: what is left is stray cells
_POOR_DEPTH_SHARE = 0.25  # of the grid: most of the view is dark, glass or too near
_FROZEN_FRAMES = 2  # successive repetitions; a single one is left out without a complaint
_STEPPED_FRAMES = 3  # this many old frames in order show that time itself has gone back

_BAD, _POOR = CameraCondition.UNTRUSTWORTHY, CameraCondition.DEGRADED
_Problem = tuple[CameraCondition, str]


class Continuity(Enum):
    """How a frame follows the one before."""

    FIRST = "first"
    NEXT = "next"
    REPEATED = "repeated"
    BACKWARD = "backward"
    STEPPED = "stepped"
    GAP = "gap"


@record(frozen=True, slots=True)
class FrameCheck:
    """usable: whether both images say anything. health: what the scene reports."""

    usable: bool
    continuity: Continuity
    health: CameraHealth


class HealthMonitor:
    """Looks at each frame once. Keeps the time and the image of the frame before."""

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config
        self._last_ns: int | None = None
        self._last_grey: GreyImage = np.empty((0, 0), np.uint8)
        self._same = 0
        self._frozen_depth = FrozenDepth()
        self._earlier_ns: int | None = None
        self._earlier_frames = 0

    def check(
        self, frame: RgbdFrame, grey: GreyImage, grid: DepthGrid, odometry: Pose | None = None
    ) -> FrameCheck:
        """The worst finding decides the condition; each finding has its sentence. odometry: of the camera."""
        dark, bright, alike = _samples(grey, self._last_grey)
        continuity, gap_s = self._continuity(frame)
        # Colour alone: a sensor's noise never repeats, also where depth does (frozen_depth.py). The
        # comparison of samples is quick, and hardly any image that has changed passes it.
        repeated = alike and bool((self._last_grey == grey).all())
        self._same = self._same + 1 if repeated else 0
        frozen_frames = self._frozen_depth.step(frame.depth, grey, odometry, repeated)
        usable_depth, share, depth_problems = _depth_findings(grid, frozen_frames)
        problems = [
            *_time_problems(continuity, gap_s),
            *_colour_problems(self._same, dark, bright),
            *depth_problems,
        ]
        if continuity is not Continuity.BACKWARD:
            self._last_ns = frame.captured_ns
            self._last_grey = grey
        if repeated and continuity is Continuity.NEXT:
            continuity = Continuity.REPEATED
        usable = usable_depth and max(dark, bright) < _BAD_SHARE
        return FrameCheck(usable, continuity, _verdict(problems, share))

    def _continuity(self, frame: RgbdFrame) -> tuple[Continuity, float]:
        if self._last_ns is None:
            return Continuity.FIRST, 0.0
        gap_s = (frame.captured_ns - self._last_ns) * 1e-9
        if gap_s < 0:
            return self._backward(frame.captured_ns), gap_s
        self._earlier_ns = None
        if gap_s == 0:
            return Continuity.REPEATED, 0.0
        return (Continuity.GAP if gap_s > self._config.max_gap_s else Continuity.NEXT), gap_s

    def _backward(self, captured_ns: int) -> Continuity:
        """Classify a frame older than the last one: late, or one of a series after time has stepped back."""
        earlier_ns, self._earlier_ns = self._earlier_ns, captured_ns
        follows = earlier_ns is not None and 0 < captured_ns - earlier_ns <= self._config.max_gap_s * 1e9
        self._earlier_frames = self._earlier_frames + 1 if follows else 1
        if self._earlier_frames < _STEPPED_FRAMES:
            return Continuity.BACKWARD
        self._earlier_ns = None
        return Continuity.STEPPED


def _time_problems(continuity: Continuity, gap_s: float) -> Iterator[_Problem]:
    """What is wrong with the time of a frame, gap_s after the one before."""
    match continuity:
        case Continuity.BACKWARD:
            yield _BAD, f"frame is {-gap_s:.3f} s older than the one before"
        case Continuity.STEPPED:
            yield _BAD, f"time has gone back by {-gap_s:.3f} s: everything begins anew"
        case Continuity.REPEATED:
            yield _BAD, "frame has the time of the one before: it is a repetition"
        case Continuity.GAP:
            yield _POOR, f"{gap_s:.2f} s without a frame: motion cannot be compared across it"


def _colour_problems(same_frames: int, dark: float, bright: float) -> Iterator[_Problem]:
    """What is wrong with the colour image: frozen, dark or saturated. dark, bright: shares of the image."""
    if same_frames >= _FROZEN_FRAMES:
        yield _BAD, f"image has not changed by a single grey level for {same_frames} frames"
    if dark >= _BAD_SHARE:
        yield _BAD, f"{dark:.0%} of the colour image is black: is the lens covered?"
    elif bright >= _BAD_SHARE:
        yield _BAD, f"{bright:.0%} of the colour image is saturated"


def _depth_findings(grid: DepthGrid, frozen_frames: int) -> tuple[bool, float, list[_Problem]]:
    """Whether depth is usable, which share of it holds data, and what is wrong with it."""
    # Depth beyond the mask counts as measured, but shows nothing that could be touched.
    # What own parts hide is none of the camera's faults.
    size = max(grid.valid.size - int(np.count_nonzero(grid.own)), 1)
    near_share = float(np.count_nonzero(grid.valid)) / size
    share = near_share + float(np.count_nonzero(grid.beyond)) / size
    usable, problems = near_share >= _MIN_DEPTH_SHARE, list[_Problem]()
    if not usable:
        within = f"data nearer than {grid.range_m:.3g} m"
        problems.append((_BAD, f"only {near_share:.1%} of the depth image holds {within}"))
    elif share < _POOR_DEPTH_SHARE:
        problems.append((_POOR, f"only {share:.0%} of the depth image holds data"))
    if usable and frozen_frames:
        problems.append(
            (_BAD, f"depth has not changed by a single unit for {frozen_frames} frames of motion")
        )
    return usable, share, problems


@compiled("uint8[:, ::1], uint8[:, ::1]")
def _samples(grey: GreyImage, before: GreyImage) -> tuple[float, float, bool]:
    """Shares of an image's samples that are black and white, and whether all are as in the image before.

    An image of another size is not alike.
    """
    height, width = grey.shape
    black, white, size, alike = 0, 0, 0, grey.shape == before.shape
    for i in range(_STEP // 2, height, _STEP):
        for j in range(_STEP // 2, width, _STEP):
            size += 1
            black += grey[i, j] <= _BLACK_LEVEL
            white += grey[i, j] >= _WHITE_LEVEL
            alike = alike and grey[i, j] == before[i, j]
    return black / size, white / size, alike


def worsened(health: CameraHealth, condition: CameraCondition, reason: str) -> CameraHealth:
    """health with one more finding; the worse condition stands."""
    present = [] if health.condition is CameraCondition.GOOD else [(health.condition, health.reason)]
    return _verdict([*present, (condition, reason)], health.valid_depth_ratio)


def with_ego_motion(health: CameraHealth, ego: EgoMotion, blurred: bool, reckoned: bool) -> CameraHealth:
    """health, worsened by what the ego-motion shows.

    blurred: without odometry, too few fragments fit one motion of the camera. reckoned: there is odometry.
    """
    problem = _motion_problem(ego, blurred, reckoned)
    return health if problem is None else worsened(health, *problem)


def _motion_problem(ego: EgoMotion, blurred: bool, reckoned: bool) -> _Problem | None:
    if blurred:
        return _POOR, (
            f"only {ego.inlier_ratio:.0%} of the fragments fit one motion of the camera:"
            " is depth aligned with colour, in place and in time?"
        )
    if ego.source == "visual":
        return None
    if ego.source == "disputed" and reckoned:
        return _POOR, (
            "the images and the odometry tell of two motions of the camera:"
            " do the tracks slip, or is the odometry wrong?"
        )
    if ego.source == "disputed":
        # By the kinematics of the base (rolling_prior of vision/ego_motion/motion_prior.py).
        return _POOR, (
            "the images show a motion of the camera that a tracked base hardly makes,"
            " sideways, backwards or too sudden: is the camera loose, does the base slide,"
            " or does everything in view move?"
        )
    if ego.source == "odometry":
        return _POOR, "too few static fragments: the camera's motion rests on the odometry alone"
    return _BAD, "the camera's motion is not known: too few static fragments agree, and there is no odometry"


def _verdict(problems: list[_Problem], share: float) -> CameraHealth:
    conditions = [condition for condition, _ in problems]
    if CameraCondition.UNTRUSTWORTHY in conditions:
        condition = CameraCondition.UNTRUSTWORTHY
    elif conditions:
        condition = CameraCondition.DEGRADED
    else:
        condition = CameraCondition.GOOD
    return CameraHealth(condition, "; ".join(reason for _, reason in problems), share)
