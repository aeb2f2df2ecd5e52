"""Frames in which something went wrong: who was found, who was missed, and who need not be found."""

from __future__ import annotations

import numpy as np

from controller.evaluation.report.chart import BLUE, GREEN
from controller.evaluation.report.pictures import failure_picture
from controller.evaluation.run_sequence import Snapshot
from controller.evaluation.scores.scoring import FrameScore, Hit
from controller.evaluation.types import FrameTruth
from controller.video.style import Colour, Image, bgr
from tests.support.evaluation_cases import true_object

RED = bgr("E02424")
HEIGHT = 480


def picture() -> Image:
    """One is found, two missed, three missed in its first half second, four too hidden to be asked for."""
    boxes = [(40.0 + 150.0 * k, 200.0, 120.0 + 150.0 * k, 400.0) for k in range(4)]
    objects = tuple(true_object(number=k + 1, box=box) for k, box in enumerate(boxes))
    score = FrameScore((Hit(1, 4.0, 0.1, True),), (2, 3), (2,), (), ())
    colour = np.zeros((HEIGHT, 640, 3), np.uint8)
    depth_m = np.ones((HEIGHT, 640), np.float32)
    return failure_picture(Snapshot("walk", 7, colour, depth_m, FrameTruth(0.0, objects), (), None, score))


def sides(image: Image, colour: Colour) -> list[int]:
    """Which of the four boxes have left sides of this colour."""
    return [
        k + 1 for k in range(4) if (image[200:400, 38 + 150 * k : 43 + 150 * k] == colour).all(axis=2).any()
    ]


def test_every_true_body_has_the_colour_of_what_became_of_it() -> None:
    image = picture()
    assert sides(image, GREEN) == [1]
    assert sides(image, RED) == [2]
    assert sides(image, BLUE) == [3, 4]


def test_all_colours_are_explained_beneath() -> None:
    caption = picture()[HEIGHT:]
    assert all((caption == colour).all(axis=2).any() for colour in (GREEN, RED, BLUE))
