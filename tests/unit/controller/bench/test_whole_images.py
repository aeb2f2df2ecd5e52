"""The paper's calls on whole images: what is called, on what, and how often."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import pytest

from config.perception import PerceptionConfig
from controller.bench import whole_images
from controller.bench.opencv_calls import recorded_calls
from controller.bench.whole_images import WholeImages
from hal.types import ColourImage

SETTINGS = PerceptionConfig().fragments


def squares(shift_px: int) -> ColourImage:
    image = np.full((240, 320, 3), 90, np.uint8)
    for left in (40, 140, 230):
        cv2.rectangle(image, (left + shift_px, 60), (left + shift_px + 60, 180), (200, 200, 200), -1)
    return image


@pytest.fixture
def whole() -> WholeImages:
    return WholeImages(SETTINGS, itertools.count(0, 5).__next__)


def names(whole: WholeImages, image: ColourImage) -> list[str]:
    with recorded_calls([whole_images]) as calls:
        assert whole.step(image) == 5
    return [call.name for call in calls]


def test_the_first_image_is_searched_and_the_next_one_followed_there_and_back(whole: WholeImages) -> None:
    assert names(whole, squares(0)) == ["cvtColor", "findContours"]
    again = names(whole, squares(2))
    assert again == ["cvtColor", "findContours", "calcOpticalFlowPyrLK", "calcOpticalFlowPyrLK"]


def test_without_points_found_none_are_followed(whole: WholeImages) -> None:
    blank = np.full((240, 320, 3), 90, np.uint8)
    whole.step(blank)
    assert "calcOpticalFlowPyrLK" not in names(whole, blank)
