from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from config.perception import FragmentSettings
from controller.bench.opencv_calls import OpenCvCall
from controller.bench.own_search import recorded_searches
from vision.fragments import lucas_kanade, optical_flow
from vision.fragments.edges import GreyImage

SETTINGS = FragmentSettings()
LEVELS = 1 + SETTINGS.lk_levels
BOTH_WAYS = LEVELS + 1  # all ends are where they are expected: the way back is the finest level alone


def image() -> GreyImage:
    noise = np.random.default_rng(1).integers(0, 256, (240, 320)).astype(np.uint8)
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), 2.0), np.uint8)


def track(pixels: NDArray[np.float32]) -> optical_flow.Flow:
    images = optical_flow.pyramid(image(), SETTINGS)
    steady = np.tile(np.array([0.04, 0.0, 0.04], np.float32), (len(pixels), 1))
    new = np.full(len(pixels), np.inf, np.float32)
    return optical_flow.track(images, images, pixels, pixels + np.float32(0.3), steady, new, SETTINGS)


def test_every_search_is_recorded_as_the_call_that_finds_the_same() -> None:
    pixels, calls = np.array([[100.0, 80.0], [200.0, 160.0]], np.float32), list[OpenCvCall]()
    with recorded_searches(calls):
        flow = track(pixels)
    assert [call.name for call in calls] == ["calcOpticalFlowPyrLK"] * BOTH_WAYS
    whole_image = calls[LEVELS - 1]
    there, status, _ = whole_image.execute()
    assert status.all()
    np.testing.assert_allclose(there, flow.pixels, atol=0.01)


def test_afterwards_nothing_is_recorded_even_after_an_error() -> None:
    own, calls = lucas_kanade.search, list[OpenCvCall]()
    with pytest.raises(KeyError), recorded_searches(calls):
        raise KeyError
    assert lucas_kanade.search is own
    track(np.array([[100.0, 80.0]], np.float32))
    assert calls == []
