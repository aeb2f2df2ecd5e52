"""The free space of a scene as points on the floor, in the frame of the path: the nearest surfaces around."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from config.perception import TYPICAL_DEPTH_NOISE, DepthNoise
from controller.decision.bodies import Bodies, covering
from controller.decision.situation import SceneError
from hal.compiled import compiled, inlined
from hal.directions import along_and_left
from hal.records import record
from hal.types import CameraMount, FlagMatrix, Flags, FloatArray, PlanarPose
from vision.scene import FreeSpace

# x_m and y_m of the camera on the floor, and the cosine and sine of where it looks.
Eye = Annotated[tuple[float, float, float, float], "UniTuple(float64, 4)"]

# A point this near to an obstacle's box is part of it: swinging limbs, a box that lags a little.
AROUND_M = 0.3
_DEPTH_SIGMAS = 3.5
# Bands lie side by side: the distance of their middles differs from their width by this share at most.
_APART = 0.1
_NO_SCAN = "the scan of the free space is impossible"
# In the order in which _impossible() checks them.
_CHECKED = ("half_width_tan", "blind_m", "floor_from_m", "up_tan", "bearing_tan", "nearest_m", "known_m")


@record(frozen=True, slots=True, eq=False)
class Surfaces:
    """P points on the floor where depth sees something, left to right, and how far it sees in B bands.

    seen_m: (B,) how far each band of the scan was seen through, to a surface or over free floor; 0: nothing
        was measured.
    bands: (P,) the band of each point.
    forward_m: (P,) distance ahead of the camera.
    half_band_m: (P,) half of the band's width there: a point stands for that much to either side.
    points_m: (P, 2) in the frame of the path.
    noise: of the camera's depth.
    """

    seen_m: FloatArray
    bands: NDArray[np.intp]
    forward_m: FloatArray
    half_band_m: FloatArray
    points_m: FloatArray
    noise: DepthNoise = TYPICAL_DEPTH_NOISE

    def of(self, bodies: Bodies) -> FlagMatrix:
        """(P, N) which points belong to which bodies. Along the view the tolerance grows with depth noise."""
        return _belongs(bodies, self.points_m, self.forward_m, _DEPTH_SIGMAS * self.noise.quadratic_per_m)


NO_SURFACES = Surfaces(np.zeros(0), np.zeros(0, np.intp), np.zeros(0), np.zeros(0), np.zeros((0, 2)))


def check_scan(free: FreeSpace) -> None:
    """Raises SceneError if the arrays of free differ in length or type, or hold impossible values.

    Compiled steps index them without checks, NaN would compare as free, and no distance is negative.
    """
    bands = free.bearing_tan.shape
    blank = np.zeros(bands, np.bool_) if free.blank is None else free.blank
    alike = len(bands) == 1 and free.nearest_m.shape == free.known_m.shape == blank.shape == bands
    if not (alike and free.bearing_tan.dtype == free.nearest_m.dtype == free.known_m.dtype == np.float64):
        raise SceneError(f"{_NO_SCAN}: its bands are not told of alike")
    wrong, band = _impossible(free)
    if wrong < 0:
        return
    name, value = _CHECKED[wrong], getattr(free, _CHECKED[wrong])
    if band >= 0:
        raise SceneError(f"{_NO_SCAN}: {name} of band {band} is {value[band]:g}")
    raise SceneError(f"{_NO_SCAN}: {name} is {value:g}")


def surfaces_of(
    free: FreeSpace, pose: PlanarPose, mount: CameraMount, noise: DepthNoise = TYPICAL_DEPTH_NOISE
) -> Surfaces:
    """The surfaces of free, which check_scan() passes, seen by the camera of a robot at pose.

    noise: of its depth.
    """
    return Surfaces(*_surfaces(free, pose, mount), noise)


def floor_points(pose: PlanarPose, ahead_m: FloatArray, left_m: FloatArray) -> FloatArray:
    """(..., 2) the floor points that lie ahead_m (...) and left_m (...) of a body at pose."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    points = np.empty((*ahead_m.shape, 2))
    points[..., 0] = pose.x_m + ahead_m * cos - left_m * sin
    points[..., 1] = pose.y_m + ahead_m * sin + left_m * cos
    return points


@inlined
def _eye(pose: PlanarPose, mount: CameraMount) -> Eye:
    """The camera of a robot at pose."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return (
        pose.x_m + mount.forward_m * cos - mount.left_m * sin,
        pose.y_m + mount.forward_m * sin + mount.left_m * cos,
        cos,
        sin,
    )


@compiled(FreeSpace)
def _impossible(free: FreeSpace) -> tuple[int, int]:
    """Index in _CHECKED of the first impossible value, and its band; -1: none, or not of a single band."""
    # Written so that NaN fails every comparison.
    if not 0.0 < free.half_width_tan < math.inf:
        return 0, -1
    if not 0.0 <= free.blind_m < math.inf:
        return 1, -1
    if not 0.0 <= free.floor_from_m < math.inf:
        return 2, -1
    if not free.up_tan > -math.inf:
        return 3, -1
    bearing_tan, width_tan = free.bearing_tan, 2.0 * free.half_width_tan
    for b in range(len(bearing_tan)):
        apart_tan = width_tan if b == 0 else bearing_tan[b] - bearing_tan[b - 1]
        if not (math.isfinite(bearing_tan[b]) and abs(apart_tan - width_tan) <= _APART * width_tan):
            return 4, b
        if not free.nearest_m[b] >= 0.0:
            return 5, b
        if not 0.0 <= free.known_m[b] < math.inf:
            return 6, b
    return -1, -1


@compiled(Bodies, "float64[:, :], float64[:], float64")
def _belongs(bodies: Bodies, points_m: FloatArray, forward_m: FloatArray, off_per_m: float) -> FlagMatrix:
    """(P, N) as Surfaces.of(). off_per_m: growth of the depth noise with the square of forward_m."""
    return covering(bodies, points_m, AROUND_M + off_per_m * forward_m * forward_m, AROUND_M)


@compiled(FreeSpace, PlanarPose, CameraMount)
def _surfaces(
    free: FreeSpace, pose: PlanarPose, mount: CameraMount
) -> tuple[FloatArray, NDArray[np.intp], FloatArray, FloatArray, FloatArray]:
    """The fields of Surfaces, as surfaces_of()."""
    bearing_tan, nearest_m = free.bearing_tan, free.nearest_m
    eye_x, eye_y, cos, sin = _eye(pose, mount)
    count, found = len(bearing_tan), 0
    seen, bands, forward = np.empty(count), np.empty(count, np.intp), np.empty(count)
    half_band, points = np.empty(count), np.empty((count, 2))
    for b in range(count):
        z = nearest_m[b]
        if not math.isfinite(z):
            seen[b] = free.known_m[b]
            continue
        seen[b] = z
        right = z * bearing_tan[b]
        points[found, 0], points[found, 1] = eye_x + z * cos + right * sin, eye_y + z * sin - right * cos
        bands[found], forward[found], half_band[found] = b, z, z * free.half_width_tan
        found += 1
    return seen, bands[:found], forward[:found], half_band[:found], points[:found]


@inlined
def _band_at(free: FreeSpace, eye: Eye, x_m: float, y_m: float) -> tuple[float, int]:
    """As bands_at(), for one point."""
    eye_x, eye_y, cos, sin = eye
    forward, left = along_and_left(x_m - eye_x, y_m - eye_y, cos, sin)
    first_tan, width_tan = free.bearing_tan[0] - free.half_width_tan, 2.0 * free.half_width_tan
    band = (-left / max(forward, 1e-3) - first_tan) / width_tan
    return forward, math.floor(band) if math.isfinite(band) else -1


@compiled(FreeSpace, PlanarPose, CameraMount, "float64[:], float64[:]")
def bands_at(
    free: FreeSpace, pose: PlanarPose, mount: CameraMount, x_m: FloatArray, y_m: FloatArray
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Where floor points x_m (P,), y_m (P,) lie in the scan.

    Returns the distance ahead of the camera in metres, and the band, (P,) each. A band number outside of
    0..B - 1 is beside the view. Behind the camera the number has no meaning.
    """
    eye, forward, band = _eye(pose, mount), np.empty(len(x_m)), np.empty(len(x_m), np.intp)
    for k in range(len(x_m)):
        forward[k], band[k] = _band_at(free, eye, x_m[k], y_m[k])
    return forward, band


@compiled(FreeSpace, PlanarPose, CameraMount, "float64[:, :, :], float64, float64, boolean[:]")
def seen_of(
    free: FreeSpace,
    pose: PlanarPose,
    mount: CameraMount,
    points_m: FloatArray,
    before_m: float,
    least_m: float,
    hides: Flags,
) -> NDArray[np.int64]:
    """(R,) how many points of each of R rows of floor points (2, R, K) count as seen.

    These are seen free up to before_m behind them, or they lie behind a surface in a band for which hides
    (B,) is set. Points nearer than least_m do not count.
    """
    eye, seen = _eye(pose, mount), np.zeros(points_m.shape[1], np.int64)
    for row in range(points_m.shape[1]):
        for k in range(points_m.shape[2]):
            forward, b = _band_at(free, eye, points_m[0, row, k], points_m[1, row, k])
            if not (0 <= b < len(free.known_m) and forward > least_m):
                continue
            reach_m = forward + before_m
            seen[row] += reach_m <= free.known_m[b] or (hides[b] and reach_m >= free.nearest_m[b])
    return seen
