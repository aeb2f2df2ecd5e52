"""camera.yaml of a recording: calibration of the camera that took the images, and where it was mounted."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from config.loader import Section


def _number(value: object) -> object:
    """Convert a number as other programs write it: YAML 1.1 reads ``5e3`` and ``1e-3`` as text."""
    if not isinstance(value, str):
        return value
    try:
        return float(value)
    except ValueError:
        return value


def _whole_number(value: object) -> object:
    """Convert a whole number as other programs write it: 640.0 is 640."""
    value = _number(value)
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _five_coefficients(value: tuple[float, ...]) -> tuple[float, ...]:
    if len(value) not in (0, 4, 5):
        raise ValueError(f"must be [k1, k2, p1, p2, k3], found {len(value)} numbers")
    return value


Number = Annotated[float, BeforeValidator(_number)]
Positive = Annotated[Number, Field(gt=0)]
Pixels = Annotated[int, BeforeValidator(_whole_number), Field(gt=0, le=4096)]
# Smaller images have no room for the neighbourhoods that are searched (vision/depth/depth_grid.py).
ImageSide = Annotated[int, BeforeValidator(_whole_number), Field(ge=32, le=4096)]

# How far a rotation matrix written with few digits may be from orthonormal.
_ROTATION_TOLERANCE = 1e-3


class RecordingCamera(Section):
    """camera.yaml. Integer coordinates are pixel centres; lengths in metres.

    A recording often comes from another program, so unknown keys are ignored, and listed in ``ignored_keys``.
    In treadwatch's own files they are errors.

    depth_factor: depth image value / depth_factor = metres (5000 for TUM, 1000 for millimetres).
    distortion: [k1, k2, p1, p2, k3] of the colour image, in OpenCV's order.
    camera_pitch_deg: positive looks down.
    camera_forward_m, camera_left_m: ahead and to the left of the turning centre.
    depth_min_m, depth_max_m: depth outside counts as not measured.

    Where depth is not registered to colour, these keys let it be registered: depth_fx, depth_fy, depth_cx,
    depth_cy (with depth_width and depth_height if the size differs), depth_to_colour_translation_m [x, y, z]
    and depth_to_colour_rotation (nine numbers, row by row): p_colour = rotation @ p_depth + translation.
    """

    model_config = ConfigDict(extra="allow")

    width: ImageSide
    height: ImageSide
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number
    depth_factor: Annotated[Number, Field(ge=1, le=1e6)]
    distortion: (
        Annotated[tuple[Number, ...], Field(strict=False), AfterValidator(_five_coefficients)] | None
    ) = None
    depth_registered: bool = True
    fps: Positive | None = None
    camera_height_m: Annotated[Number, Field(gt=0, le=5)] | None = None
    camera_pitch_deg: Annotated[Number, Field(ge=-90, le=90)] = 0.0
    camera_forward_m: Number = 0.0
    camera_left_m: Number = 0.0
    depth_min_m: Annotated[Number, Field(ge=0)] | None = None
    depth_max_m: Positive | None = None
    depth_width: Pixels | None = None
    depth_height: Pixels | None = None
    depth_fx: Positive | None = None
    depth_fy: Positive | None = None
    depth_cx: Number | None = None
    depth_cy: Number | None = None
    depth_to_colour_translation_m: Annotated[tuple[Number, Number, Number], Field(strict=False)] = (
        0.0,
        0.0,
        0.0,
    )
    depth_to_colour_rotation: Annotated[
        tuple[Number, ...], Field(strict=False, min_length=9, max_length=9)
    ] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    @property
    def ignored_keys(self) -> tuple[str, ...]:
        """The keys of the file that mean nothing here, sorted."""
        return tuple(sorted(self.model_extra or {}))

    @property
    def depth_intrinsics(self) -> tuple[float, float, float, float] | None:
        """(fx, fy, cx, cy) of the depth camera where the file gives them."""
        if self.depth_fx is None or self.depth_fy is None or self.depth_cx is None or self.depth_cy is None:
            return None
        return self.depth_fx, self.depth_fy, self.depth_cx, self.depth_cy

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not (0 <= self.cx < self.width and 0 <= self.cy < self.height):
            raise ValueError(f"cx, cy must lie inside the {self.width}x{self.height} image, in pixels")
        if self.depth_max_m is not None and self.depth_max_m <= (self.depth_min_m or 0.0):
            raise ValueError("depth_max_m must be greater than depth_min_m")
        return self

    @model_validator(mode="after")
    def _depth_camera_whole(self) -> Self:
        given = [self.depth_fx, self.depth_fy, self.depth_cx, self.depth_cy]
        if any(value is not None for value in given) and self.depth_intrinsics is None:
            raise ValueError("depth_fx, depth_fy, depth_cx and depth_cy must be given together")
        if (self.depth_width is None) != (self.depth_height is None):
            raise ValueError("depth_width and depth_height must be given together")
        r = self.depth_to_colour_rotation
        rows = (r[0:3], r[3:6], r[6:9])
        for i, first in enumerate(rows):
            for j, second in enumerate(rows):
                product = sum(a * b for a, b in zip(first, second, strict=True))
                if abs(product - (i == j)) > _ROTATION_TOLERANCE:
                    raise ValueError("depth_to_colour_rotation must be a rotation matrix, row by row")
        return self
