"""RGB-D frames painted from a few textured rectangles: known motion, exact depth, no simulator.

The world is the floor's frame (x forward, y left, z up). Each rectangle is drawn by its homography, so a
pixel's depth is exact up to the rounding of the depth image (1 mm).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from hal.geometry import camera_in_floor
from hal.types import CameraMount, FloatArray, Intrinsics, PlanarPose, Pose, RgbdFrame

DEPTH_SCALE_M = 0.001
FRAME_NS = 33_333_333
MOUNT = CameraMount(0.0, 0.0, 0.5, 0.0)
VGA = Intrinsics(640, 480, 610.0, 610.0, 319.5, 239.5)
QVGA = Intrinsics(320, 240, 305.0, 305.0, 159.5, 119.5)
_TEXELS = 8  # per cell of a texture


@dataclass(frozen=True, slots=True, eq=False)
class Quad:
    """The rectangle corner + a side + b down for a, b in [0, 1], going on with velocity_mps. All (3,)."""

    corner_m: FloatArray
    side_m: FloatArray
    down_m: FloatArray
    texture: NDArray[np.uint8]
    velocity_mps: FloatArray


def vector(*values: float) -> FloatArray:
    return np.array(values, dtype=float)


def texture(seed: int, width_m: float, height_m: float, cell_m: float = 0.12) -> NDArray[np.uint8]:
    """Cells of random grey, their borders soft enough to be followed to a fraction of a pixel."""
    rng = np.random.default_rng(seed)
    rows, columns = max(2, round(height_m / cell_m)), max(2, round(width_m / cell_m))
    cells = rng.integers(40, 216, (rows, columns), dtype=np.uint8)
    large = np.repeat(np.repeat(cells, _TEXELS, axis=0), _TEXELS, axis=1)
    return np.asarray(cv2.GaussianBlur(large, (0, 0), 0.8), np.uint8)


def plain(level: int = 128) -> NDArray[np.uint8]:
    """No texture at all."""
    return np.full((2, 2), level, np.uint8)


def quad(
    corner_m: FloatArray, side_m: FloatArray, down_m: FloatArray, seed: int, cell_m: float = 0.12
) -> Quad:
    """A textured rectangle that stands still."""
    size = float(np.linalg.norm(side_m)), float(np.linalg.norm(down_m))
    return Quad(corner_m, side_m, down_m, texture(seed, *size, cell_m), np.zeros(3))


def floor(seed: int = 1, cell_m: float = 0.3) -> list[Quad]:
    """12 m ahead and 6 m to either side, with marks."""
    return [quad(vector(-2.0, 6.0, 0.0), vector(0.0, -12.0, 0.0), vector(14.0, 0.0, 0.0), seed, cell_m)]


def wall(x_m: float = 7.0, seed: int = 2, cell_m: float = 0.3) -> list[Quad]:
    """Across the way, 12 m wide and 3 m high."""
    return [quad(vector(x_m, 6.0, 3.0), vector(0.0, -12.0, 0.0), vector(0.0, 0.0, -3.0), seed, cell_m)]


def box(
    front_m: FloatArray, size_m: FloatArray, seed: int, velocity_mps: FloatArray | None = None
) -> list[Quad]:
    """A crate on the floor: front_m is the lower middle of its front; size_m is depth, width, height."""
    x, y, z = front_m
    depth, width, height = size_m
    left, right, top = y + width / 2, y - width / 2, z + height
    across, back, down = vector(0.0, -width, 0.0), vector(depth, 0.0, 0.0), vector(0.0, 0.0, -height)
    faces = [
        quad(vector(x, left, top), across, down, seed),
        quad(vector(x, left, top), back, down, seed + 1),
        quad(vector(x, right, top), back, down, seed + 2),
        quad(vector(x + depth, left, top), across, down, seed + 3),
        quad(vector(x, left, top), across, back, seed + 4),
    ]
    velocity = np.zeros(3) if velocity_mps is None else velocity_mps
    return [Quad(f.corner_m, f.side_m, f.down_m, f.texture, velocity) for f in faces]


def paint(
    quads: Sequence[Quad],
    camera_pose: Pose,
    camera: Intrinsics = VGA,
    time_s: float = 0.0,
    sequence: int = 0,
    noise_levels: int = 2,
    depth_sigma_per_m: float = 0.0,
) -> RgbdFrame:
    """One frame of quads, moved on to time_s, from camera_pose (optical frame in the world).

    Image noise is uniform within +-noise_levels and the same for the same sequence. depth_sigma_per_m:
    standard deviation of depth over its square.
    """
    shape = (camera.height, camera.width)
    inverse = np.zeros(shape, np.float32)
    grey = np.full(shape, 128, np.uint8)
    pixel_to_world = camera_pose.rotation @ np.array(
        [
            [1.0 / camera.fx, 0.0, -camera.cx / camera.fx],
            [0.0, 1.0 / camera.fy, -camera.cy / camera.fy],
            [0.0, 0.0, 1.0],
        ]
    )
    for item in quads:
        corner = item.corner_m + item.velocity_mps * time_s - camera_pose.translation_m
        columns = np.stack((item.side_m, item.down_m, corner), axis=1)
        if abs(np.linalg.det(columns)) < 1e-12:
            continue  # seen exactly from its edge
        # a side + b down + corner = z ray, therefore (a, b, 1) / z = columns^-1 ray.
        _draw(np.linalg.inv(columns) @ pixel_to_world, item.texture, inverse, grey)
    rng = np.random.default_rng(sequence)
    if noise_levels:
        noise = rng.integers(-noise_levels, noise_levels, shape, np.int16, endpoint=True)
        grey = np.clip(grey + noise, 0, 255).astype(np.uint8)
    depth_m = np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0)
    if depth_sigma_per_m:
        depth_m += depth_sigma_per_m * np.square(depth_m) * rng.standard_normal(shape, np.float32)
    depth = np.clip(np.rint(depth_m / DEPTH_SCALE_M), 0, 65535).astype(np.uint16)
    stamp_ns = 1_000_000_000 + round(time_s * 1e9)
    colour = np.repeat(grey[:, :, None], 3, axis=2)
    return RgbdFrame(colour, depth, DEPTH_SCALE_M, stamp_ns, time_s, sequence, camera)


def _draw(
    homography: FloatArray,
    pattern: NDArray[np.uint8],
    inverse: NDArray[np.float32],
    grey: NDArray[np.uint8],
) -> None:
    """Write one rectangle where it is nearer than what is there."""
    height, width = inverse.shape
    u, v = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[:, None]
    h = homography.astype(np.float32)
    a, b, z_inverse = (h[k, 0] * u + h[k, 1] * v + h[k, 2] for k in range(3))
    hit = (z_inverse > inverse) & (a >= 0) & (a <= z_inverse) & (b >= 0) & (b <= z_inverse)
    rows, columns = np.flatnonzero(hit.any(axis=1)), np.flatnonzero(hit.any(axis=0))
    if len(rows) == 0:
        return
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    hit, z = hit[part], np.where(hit[part], z_inverse[part], np.float32(1.0))
    map_u = a[part] / z * np.float32(pattern.shape[1]) - np.float32(0.5)
    map_v = b[part] / z * np.float32(pattern.shape[0]) - np.float32(0.5)
    drawn = cv2.remap(pattern, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inverse[part] = np.where(hit, z, inverse[part])
    grey[part] = np.where(hit, drawn, grey[part])


def drive(speed_mps: float = 0.0, turn_radps: float = 0.0) -> Callable[[float], PlanarPose]:
    """The robot's pose over time: straight on, with its heading turning (small turns)."""
    return lambda time_s: PlanarPose(speed_mps * time_s, 0.0, turn_radps * time_s)


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """A short recording: frames, and the true camera of each."""

    frames: list[RgbdFrame]
    cameras: list[Pose]


def record(
    quads: Sequence[Quad],
    path: Callable[[float], PlanarPose],
    count: int,
    camera: Intrinsics = VGA,
    mount: CameraMount = MOUNT,
    depth_sigma_per_m: float = 0.0,
) -> Take:
    """count frames at 30 Hz."""
    times = [k * FRAME_NS * 1e-9 for k in range(count)]
    cameras = [camera_in_floor(path(t), mount) for t in times]
    frames = [
        paint(quads, cameras[k], camera, times[k], k, depth_sigma_per_m=depth_sigma_per_m)
        for k in range(count)
    ]
    return Take(frames, cameras)
