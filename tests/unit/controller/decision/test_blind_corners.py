"""The far end of a rack close beside the way, from what depth shows of it."""

from __future__ import annotations

import numpy as np
import pytest

from config.decision import SightConfig
from controller.decision.blind_corners import BlindCorners, SurfacesOnPath

BANDS = 80
EDGE_TAN = 0.687
CAMERA_M, FRONT_M, HALF_WIDTH_M = 0.45, 0.51, 0.39
BEARING = np.linspace(-EDGE_TAN, EDGE_TAN, 2 * BANDS + 1)[1::2]


class Aisle:
    """A rack from x = 0 to end_m, its face beside_m beside the swept width, on the left (1) or right (-1);
    behind it the room goes on for 9 m, or another rack stands in line gap_m behind."""

    def __init__(
        self, end_m: float, beside_m: float, side: int, start_m: float = 0.0, gap_m: float = 9.0
    ) -> None:
        self.corners = BlindCorners(SightConfig())
        self.start_m, self.end_m, self.side = start_m, end_m, side
        self.face_m, self.next_m = HALF_WIDTH_M + beside_m, end_m + gap_m

    def look(self, s_m: float, times: int = 1, stands: bool = True) -> None:
        """From s_m along a straight path."""
        right = -self.side * self.face_m
        with np.errstate(divide="ignore"):
            hit = right / BEARING
        at = hit + s_m + CAMERA_M
        forward = np.where((hit > 0.0) & (at < self.end_m) & (at > self.start_m), hit, 9.0)
        # Who looks past the end into the gap sees the next rack's end, or its face.
        behind = (hit > 0.0) & (at >= self.end_m)
        to_next = np.maximum(hit, self.next_m - s_m - CAMERA_M)
        forward = np.where(behind & (to_next < 9.0), to_next, forward)
        for _ in range(times):
            surfaces = SurfacesOnPath(
                bands=np.arange(BANDS),
                forward_m=forward,
                s_m=s_m + CAMERA_M + forward,
                d_m=-BEARING * forward,
                half_width_m=np.full(BANDS, HALF_WIDTH_M),
            )
            self.corners.look(surfaces, np.full(BANDS, stands), 2.0 * EDGE_TAN / BANDS, s_m + FRONT_M)


@pytest.mark.parametrize("side", [1, -1])
def test_the_end_of_a_rack_is_a_blind_corner(side: int) -> None:
    aisle = Aisle(5.0, 0.6, side)
    aisle.look(1.0, times=2)
    assert aisle.corners.nearest(1.51) is None
    aisle.look(1.0)
    corner = aisle.corners.nearest(1.51)
    assert corner is not None
    assert corner.s_m == pytest.approx(5.0, abs=0.5)
    assert corner.beside_m == pytest.approx(0.6, abs=0.05)


def test_corner_is_remembered_until_the_front_is_past_the_opening_behind_it() -> None:
    aisle = Aisle(5.0, 0.6, 1)
    for s_m in np.arange(1.0, 5.4, 0.05):
        aisle.look(float(s_m))
    assert aisle.corners.nearest(5.0 + 0.8) is not None
    assert aisle.corners.nearest(5.0 + 1.1) is None
    aisle.look(6.0)
    assert aisle.corners.nearest(5.0 + 0.8) is None  # forgotten once passed


def test_a_rack_further_away_leaves_time_enough() -> None:
    aisle = Aisle(5.0, 1.2, 1)
    aisle.look(1.0, times=5)
    assert aisle.corners.nearest(1.51) is None


def test_a_crate_is_no_corner() -> None:
    aisle = Aisle(4.4, 0.3, 1, start_m=3.8)
    aisle.look(1.0, times=5)
    assert aisle.corners.nearest(1.51) is None


@pytest.mark.parametrize(("gap_m", "corner"), [(0.3, False), (0.7, False), (1.5, True)])
def test_gap_between_goods_in_a_rack_is_no_passage(gap_m: float, corner: bool) -> None:
    aisle = Aisle(5.0, 0.4, 1, gap_m=gap_m)
    for s_m in np.arange(0.5, 2.5, 0.05):
        aisle.look(float(s_m))
    assert (aisle.corners.nearest(2.5 + FRONT_M) is not None) == corner


def test_people_one_behind_the_other_are_no_face() -> None:
    aisle = Aisle(5.0, 0.6, 1)
    aisle.look(1.0, times=5, stands=False)
    assert aisle.corners.nearest(1.51) is None


def test_corner_by_noise_is_forgotten() -> None:
    aisle = Aisle(5.5, 0.6, 1)
    aisle.look(0.5, times=4)
    assert aisle.corners.nearest(1.01) is not None
    aisle.end_m = 0.0
    aisle.look(0.5, times=9)
    assert aisle.corners.nearest(1.01) is None


class Rack(Aisle):
    """A rack without an end on the left, its goods 0.45 m beside the swept width, and boxes in front of them
    from x = 4 to 6 m, 0.3 m beside it. With opening_m, so much of the rack behind the boxes is a way. On the
    right another rack goes on all the way."""

    def __init__(self, opening_m: float) -> None:
        super().__init__(6.0, 0.3, 1)
        self.goods_m, self.goes_on_m = HALF_WIDTH_M + 0.45, 6.0 + opening_m

    def look(self, s_m: float, times: int = 1, stands: bool = True) -> None:
        right = np.where(BEARING < 0.0, -BEARING, np.nan)  # to the left of the camera
        before = s_m + CAMERA_M
        boxes, goods = self.face_m / right, self.goods_m / right
        on_boxes = (boxes + before > 4.0) & (boxes + before < self.end_m)
        # Who looks into the way sees the side of the goods behind it.
        goods = np.where(goods + before < self.end_m, goods, np.maximum(goods, self.goes_on_m - before))
        forward = np.where(on_boxes, boxes, goods)
        opposite = self.goods_m / np.where(BEARING > 0.0, BEARING, np.nan)
        forward = np.nan_to_num(np.where(BEARING > 0.0, opposite, forward), nan=9.0)
        near = forward < 9.0
        for _ in range(times):
            surfaces = SurfacesOnPath(
                bands=np.flatnonzero(near),
                forward_m=forward[near],
                s_m=before + forward[near],
                d_m=(-BEARING * forward)[near],
                half_width_m=np.full(near.sum(), HALF_WIDTH_M),
            )
            self.corners.look(surfaces, np.full(near.sum(), stands), 2.0 * EDGE_TAN / BANDS, s_m + FRONT_M)

    def drive(self, from_m: float, to_m: float) -> bool:
        """Whether there is a corner for a robot that has looked ten times in each metre of this way."""
        for s_m in np.arange(from_m, to_m, 0.1):
            self.look(float(s_m))
        return self.corners.nearest(to_m + FRONT_M) is not None


def test_boxes_that_hide_a_strip_of_a_rack_are_given_up_as_a_corner_once_the_rack_is_seen_to_go_on() -> None:
    rack = Rack(opening_m=0.0)
    assert rack.drive(0.5, 1.3)  # from afar a passage fits into what they hide
    assert not rack.drive(1.3, 3.5)


@pytest.mark.parametrize("opening_m", [0.9, 1.2, 2.0])
def test_a_way_behind_the_boxes_remains_a_corner(opening_m: float) -> None:
    rack = Rack(opening_m)
    assert rack.drive(0.5, 1.3)
    assert rack.drive(1.3, 3.5)
    assert rack.drive(3.5, 6.0)
    assert not rack.drive(6.0, 7.5)


def test_movers_in_front_of_the_way_do_not_close_it() -> None:
    rack = Rack(opening_m=1.2)
    assert rack.drive(0.5, 3.0)
    rack.goes_on_m = rack.end_m
    rack.look(3.0, times=9, stands=False)
    assert rack.corners.nearest(3.0 + FRONT_M) is not None
