"""The style of the video: the palette, and the position of each panel in the 1280x720 picture.

Hues are those of Okabe and Ito (2008), some of them lightened: they can be distinguished with the common
colour-vision deficiencies. No meaning depends on the hue alone: moving obstacles also have thicker boxes and
arrows, actions also have a symbol and a word.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.decision.decision import Action
from vision.scene import CameraCondition

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]


def bgr(rgb_hex: str) -> Colour:
    """A colour in OpenCV's order (BGR) from the usual notation, such as "56B4E9"."""
    red, green, blue = bytes.fromhex(rgb_hex)
    return blue, green, red


BACKGROUND = bgr("101317")
PANEL = bgr("191E24")
GRID = bgr("333B44")
TEXT = bgr("EDEFF2")
FAINT_TEXT = bgr("A3ADB8")
DARK_TEXT = bgr("0B0D10")

STATIC = bgr("56B4E9")
MOVING = bgr("E69F00")
UNMEASURED = bgr("9AA2AB")
OWN = bgr("F4F6F8")  # the robot, its path and its commands
FREE_SPACE = bgr("24333C")
SURFACE = bgr("C3CCD6")
NO_DEPTH = bgr("08090B")

TARGET_SPEED = bgr("F0E442")
COMMANDED_SPEED = OWN
MEASURED_SPEED = bgr("DD8DBA")

WARNING = bgr("F0E442")
ALARM = bgr("E8703A")
FINE = bgr("2BBE91")
HEALTH = {
    CameraCondition.GOOD: FINE,
    CameraCondition.DEGRADED: WARNING,
    CameraCondition.UNTRUSTWORTHY: ALARM,
}


@dataclass(frozen=True, slots=True)
class ActionStyle:
    """How an action is marked in all panels."""

    symbol: str
    colour: Colour


ACTIONS = {
    Action.INCREASE: ActionStyle("▲", FINE),
    Action.KEEP: ActionStyle("■", bgr("B4BCC6")),
    Action.DECREASE: ActionStyle("▼", ALARM),
}


@dataclass(frozen=True, slots=True)
class Rect:
    """A rectangle of whole pixels."""

    x: int
    y: int
    width: int
    height: int

    @property
    def right(self) -> int:
        """The first column to the right of the rectangle."""
        return self.x + self.width

    @property
    def bottom(self) -> int:
        """The first row below the rectangle."""
        return self.y + self.height

    def of(self, image: Image) -> Image:
        """This part of the image, as a view: what is drawn on it is clipped to the rectangle."""
        return image[self.y : self.bottom, self.x : self.right]

    def overlaps(self, other: Rect) -> bool:
        """Whether both rectangles share a pixel."""
        return (
            self.x < other.right and other.x < self.right and self.y < other.bottom and other.y < self.bottom
        )

    def contains(self, other: Rect) -> bool:
        """Whether other lies entirely inside."""
        return (
            self.x <= other.x
            and self.y <= other.y
            and other.right <= self.right
            and other.bottom <= self.bottom
        )


WIDTH_PX, HEIGHT_PX = 1280, 720
MARGIN_PX = 10
CAPTION_PX = 20
HEADER = Rect(0, 0, WIDTH_PX, 44)

# The colour panel has the size of the usual image, so that nothing is resampled.
COLOUR_VIEW = Rect(MARGIN_PX, HEADER.bottom + MARGIN_PX + CAPTION_PX, 640, 480)
DEPTH_VIEW = Rect(COLOUR_VIEW.right + MARGIN_PX, COLOUR_VIEW.y, 232, 174)
DEPTH_SCALE = Rect(DEPTH_VIEW.x, DEPTH_VIEW.bottom + 6, DEPTH_VIEW.width, 26)
LEGEND = Rect(
    DEPTH_VIEW.x,
    DEPTH_SCALE.bottom + MARGIN_PX + CAPTION_PX,
    DEPTH_VIEW.width,
    COLOUR_VIEW.bottom - DEPTH_SCALE.bottom - MARGIN_PX - CAPTION_PX,
)
SPEED_STRIP = Rect(
    MARGIN_PX,
    COLOUR_VIEW.bottom + MARGIN_PX + CAPTION_PX,
    DEPTH_VIEW.right - MARGIN_PX,
    HEIGHT_PX - COLOUR_VIEW.bottom - 2 * MARGIN_PX - CAPTION_PX,
)
_TOP_X = DEPTH_VIEW.right + MARGIN_PX
TOP_VIEW = Rect(_TOP_X, COLOUR_VIEW.y, WIDTH_PX - MARGIN_PX - _TOP_X, HEIGHT_PX - MARGIN_PX - COLOUR_VIEW.y)
