"""The planned path as written in YAML: a start pose, then straight lines and arcs, end to end."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from config.loader import Section

# A bend shorter than this turns the robot by less than it errs: nobody plans one.
_SHORTEST_ARC_M = 0.5

MaxSpeed = Annotated[float | None, Field(default=None, gt=0, le=5)]


class StartSpec(Section):
    """Where the turning centre stands at the beginning, on the floor; heading is positive from x to y."""

    x_m: float = Field(default=0.0, ge=-1e4, le=1e4)
    y_m: float = Field(default=0.0, ge=-1e4, le=1e4)
    heading_deg: float = Field(default=0.0, ge=-360, le=360)


class LineSpec(Section):
    """Straight on for length_m."""

    kind: Literal["line"]
    length_m: float = Field(gt=0, le=1e4)
    max_speed_mps: MaxSpeed = None


class ArcSpec(Section):
    """A turn by angle_deg (positive: to the left) on a circle of radius_m.

    With blend_m, the curvature rises linearly from zero, and falls back to it, over that length at each end
    (a clothoid), so that the yaw rate has no step. angle_deg includes both blends.
    """

    kind: Literal["arc"]
    radius_m: float = Field(gt=0, le=1e4)
    angle_deg: float = Field(ge=-360, le=360)
    max_speed_mps: MaxSpeed = None
    blend_m: float = Field(default=0.0, ge=0, le=100)

    @property
    def length_m(self) -> float:
        """Length along the arc, both blends included."""
        return self.radius_m * abs(math.radians(self.angle_deg)) + self.blend_m

    @property
    def may_be_in_radians(self) -> bool:
        """Whether angle_deg was most likely given in radians: at most a turn of so many radians, and then the
        robot would hardly go anywhere on this arc."""
        return abs(self.angle_deg) <= math.tau and self.length_m - self.blend_m < _SHORTEST_ARC_M

    @property
    def in_degrees(self) -> str:
        """What to write in place of an angle in radians."""
        return f"angle_deg is in degrees: if radians were meant, write {math.degrees(self.angle_deg):.4g}"

    @model_validator(mode="after")
    def _has_an_angle_and_room_to_blend(self) -> Self:
        if self.angle_deg == 0:
            raise ValueError("angle_deg must not be zero; write a line instead")
        turn_m = self.radius_m * abs(math.radians(self.angle_deg))
        if self.blend_m > turn_m:
            raise ValueError(
                f"blend_m must not exceed radius_m x angle = {turn_m:.3f} m; shorten it or widen the turn"
                + (f"; {self.in_degrees}" if self.may_be_in_radians else "")
            )
        return self


SegmentSpec = Annotated[LineSpec | ArcSpec, Field(discriminator="kind")]


class PathSpec(Section):
    """The whole path. controller.path.path.Path computes positions along it."""

    start: StartSpec = StartSpec()
    segments: Annotated[tuple[SegmentSpec, ...], Field(strict=False)]

    @model_validator(mode="after")
    def _has_segments(self) -> Self:
        if not self.segments:
            raise ValueError("segments must hold at least one line or arc")
        return self

    @property
    def length_m(self) -> float:
        """From the start to the target point."""
        return sum(segment.length_m for segment in self.segments)
