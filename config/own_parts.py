"""Parts of the robot that its own camera sees: boxes that are cut out of the images (`camera.own_parts`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from config.loader import Section
from config.robot import Mount, Robot

# A box may reach so far beyond the outline: a bumper is measured to a few centimetres. It is less than what
# the robot keeps free around it (decision.margins), so nothing that it could touch first is cut out.
_OUTLINE_TOLERANCE_M = 0.05
_AXES = ("x", "y", "z")


def _three(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) != len(_AXES):
        raise ValueError(f"must be [x, y, z] in metres, found {len(values)} numbers")
    return values


_Metres = Annotated[float, Field(ge=-10, le=10)]
Corner = Annotated[tuple[_Metres, ...], Field(strict=False), AfterValidator(_three)]


class OwnPart(Section):
    """An upright box around a part of the robot, in its body frame: x forward from the turning centre, y
    left, z up from the floor, as in robot.camera_mount. from_m, to_m: two opposite corners [x, y, z]."""

    name: str = Field(min_length=1, max_length=40, description="names the part in messages")
    from_m: Corner
    to_m: Corner

    @model_validator(mode="after")
    def _has_an_inside(self) -> Self:
        for axis, low, high in zip(_AXES, self.from_m, self.to_m, strict=True):
            if low >= high:
                raise ValueError(
                    f"from_m must be smaller than to_m in x, y and z; {axis} goes from {low:g} to {high:g} m"
                )
        return self


def check_own_parts(parts: Sequence[OwnPart], robot: Robot) -> None:
    """A box may cut out nothing but the robot. Raises ValueError, naming the box.

    What a box hides lies in it, or between it and the camera, so inside the outline if both of these are.
    """
    twice = [name for name, count in Counter(part.name for part in parts).items() if count > 1]
    if twice:
        raise ValueError(f"camera.own_parts: names must be unique; {', '.join(sorted(twice))} is given twice")
    for part in parts:
        if _contains(part, robot.camera_mount):
            raise ValueError(
                f"camera.own_parts ({part.name!r}): the camera itself is inside this box, which would hide "
                "everything; measure both in the robot's frame: x ahead of the turning centre, y left, z up"
            )
        beyond_m, side = _beyond_outline(part, robot)
        if beyond_m > _OUTLINE_TOLERANCE_M:
            raise ValueError(
                f"camera.own_parts ({part.name!r}): reaches {beyond_m:.2f} m beyond the robot's {side}, "
                "where it would hide what stands in the way; measure it again, or correct robot.body"
            )


def _contains(part: OwnPart, mount: Mount) -> bool:
    camera_m = mount.forward_m, mount.left_m, mount.height_m
    return all(a <= c <= b for a, c, b in zip(part.from_m, camera_m, part.to_m, strict=True))


def _beyond_outline(part: OwnPart, robot: Robot) -> tuple[float, str]:
    """How far a box reaches beyond the robot's footprint, and on which side most; negative: it is inside."""
    body = robot.body
    half_m = 0.5 * body.width_m
    sides = (
        (part.to_m[0] - body.front_m, "front"),
        (-body.rear_m - part.from_m[0], "tail"),
        (part.to_m[1] - half_m, "left side"),
        (-half_m - part.from_m[1], "right side"),
    )
    return max(sides)
