"""The speed towards the camera of bodies seen in part, by the depth of their surface then and now."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from config.perception import DepthNoise
from hal.types import FloatArray, Pose
from tests.support.detections import AT_ORIGIN, FRAME_NS, detection, track
from tests.support.grids import grid_of, labelled, nearest, no_depth, plate, wall
from tests.support.judging import ALONG, one, rises
from vision.bodies import approach
from vision.bodies.approach import ApproachSpeeds
from vision.bodies.arrivals import ViewMemory
from vision.bodies.tracks import Tracks

FRAME_S = FRAME_NS * 1e-9
NOISE = DepthNoise(floor_m=0.005, quadratic_per_m=0.0075)
COUNT = 21  # frames: the last one is 0.67 s after the first
SPEED_MPS = 0.6
BACK = wall(8.0)
# As wide as the view: the border of the image cuts both of its sides.
WIDE, HIGH = (-9.0, 9.0), (-0.7, 0.6)
Depths = Callable[[float], FloatArray]


def tracks_of(depth_m: float = 5.0) -> Tracks:
    tracks = Tracks()
    tracks.start(np.array([(0.0, 0.0, depth_m)]), 0.2, 1.5, 0.0, 0)
    return tracks


def measured(
    body: Depths,
    *others: Depths,
    camera: Callable[[float], Pose] = lambda _: AT_ORIGIN,
    count: int = COUNT,
    noise_m: float = 0.0,
    size_m: float = 2.0,
) -> ApproachSpeeds:
    """Of the body, after count frames of it and of others. All are depths at a time in seconds."""
    memory, rng = ViewMemory(NOISE), np.random.default_rng(1)
    for k in range(count):
        time_s = k * FRAME_S
        depth_m = nearest(body(time_s), *(other(time_s) for other in others))
        labels = labelled((depth_m > 0.0) & (depth_m == body(time_s)))
        grid = grid_of(depth_m + noise_m * rng.standard_normal(depth_m.shape) * (depth_m > 0.0))
        seen = detection(grid, k, camera(time_s))
        memory.remember(grid, seen.pose, seen.captured_ns)
    tracks = tracks_of()
    tracks.cells[:] = np.count_nonzero(labels)
    tracks.extent_m[:] = size_m
    return approach.measure(tracks, seen, labels, memory, NOISE)


def back(_: float) -> FloatArray:
    return BACK


def comes(mps: float = SPEED_MPS, from_m: float = 5.0) -> Depths:
    return lambda time_s: plate(from_m - mps * time_s, WIDE, HIGH)


@pytest.mark.parametrize(("noise_m", "within_mps"), [(0.0, 0.01), (0.1, 0.05)])
def test_what_is_cut_on_both_sides_comes_nearer_as_fast_as_its_depth(
    noise_m: float, within_mps: float
) -> None:
    found = measured(comes(), back, noise_m=noise_m)
    assert found.mps[0] == pytest.approx(SPEED_MPS, abs=within_mps)
    assert found.lag_s == pytest.approx(0.6, abs=0.04)
    # 4.6 m away a pixel has 0.164 m, of which 0.2 sqrt(2) are common; the camera has 0.02 m; of some 1,500
    # cells 25 each are alike.
    common_m, median_m = 0.2 * math.sqrt(2.0) * 0.164, 1.2533 * math.sqrt(2.0) * 0.55 * 0.164 / 7.7
    assert found.sigma_mps[0] == pytest.approx(math.hypot(common_m, median_m, 0.02) / 0.6, rel=0.1)
    assert found.sigmas[0] > 5.0


@pytest.mark.parametrize("mps", [0.0, -0.6, 0.2])  # of the last, 2.2 standard deviations are no proof
def test_what_stands_goes_away_or_comes_slowly_is_not_measured(mps: float) -> None:
    found = measured(comes(mps), back, noise_m=0.1)
    assert found.mps[0] == 0.0
    assert found.sigmas[0] == 0.0


def test_the_way_of_the_camera_is_taken_out() -> None:
    """It drives at 0.5 m/s towards something that stands."""

    def camera(time_s: float) -> Pose:
        return Pose(np.eye(3), np.array([0.0, 0.0, 0.5 * time_s]))

    assert measured(comes(0.5), comes(0.5, 8.0), camera=camera).mps[0] == 0.0
    found = measured(comes(0.5 + SPEED_MPS), comes(0.5, 8.0), camera=camera)
    assert found.mps[0] == pytest.approx(SPEED_MPS, abs=0.02)


def test_something_static_that_was_hidden_or_that_comes_into_view_does_not_come() -> None:
    """A crate is uncovered by somebody who walks past 0.4 m before it; a wall by a door that opens."""
    crate = comes(0.0)
    walker = [lambda t: plate(4.6, (-0.9 + 1.5 * t, -0.1 + 1.5 * t), (-2.0, 2.0))]
    assert measured(crate, *walker, back).mps[0] == 0.0
    door = [lambda t: plate(2.0, (-1.5, 1.0 - 3.0 * t), (-2.0, 2.0))]
    assert measured(crate, *door, back).mps[0] == 0.0


def test_a_surface_that_has_jumped_is_not_measured() -> None:
    """Since 0.2 s ago other cells, 0.5 m nearer, have belonged to it."""
    found = measured(lambda time_s: plate(5.0 if time_s < 0.45 else 4.5, WIDE, HIGH), back)
    assert found.mps[0] == 0.0
    assert found.sigmas[0] == 0.0


def test_a_jump_in_the_shorter_time_is_told_from_a_steady_speed() -> None:
    steady = measured(comes(0.8), back)
    assert steady.mps[0] == pytest.approx(0.8, abs=0.02)
    jumped = measured(lambda time_s: plate(5.0 if time_s < 0.2 else 4.5, WIDE, HIGH), back)
    assert jumped.mps[0] == pytest.approx(0.5 / jumped.lag_s, abs=0.02)  # long ago: as a speed would look
    assert measured(lambda time_s: plate(5.0 if time_s < 0.4 else 4.5, WIDE, HIGH), back).mps[0] == 0.0


def test_nothing_is_measured_where_there_is_nothing_to_compare() -> None:
    for found in (
        measured(comes(), back, count=5),  # no view of 0.3 s ago or earlier
        measured(comes(), back, size_m=3.1),
        measured(lambda t: plate(5.0 - 0.6 * t, (-0.1, 0.1), (-0.2, 0.1)), back),  # 24 cells
        measured(lambda t: comes()(t) if t > 0.5 else no_depth()),  # nothing was measured there
    ):
        assert found.mps[0] == 0.0
        assert math.isinf(found.sigma_mps[0])


def test_where_noise_cuts_depth_off_at_the_end_of_the_range_nothing_is_measured() -> None:
    """10 m, less twice the noise there: 8.8 m have 0.59 m, 8.9 m have 0.6 m."""
    assert measured(comes(1.8, 9.9)).mps[0] == pytest.approx(1.8, abs=0.05)  # 8.7 m away now
    assert math.isinf(measured(comes(1.8, 10.1)).sigma_mps[0])


def test_the_filters_learn_the_speed_along_the_line_of_sight_only() -> None:
    tracks, found = tracks_of(), measured(comes(), back)
    for _ in range(30):
        approach.fuse(tracks, found, np.zeros(3), FRAME_S)
    for state, covariance in (
        (tracks.state, tracks.covariance),
        (tracks.surface_state, tracks.surface_covariance),
    ):
        np.testing.assert_allclose(state[0, 3:], [0.0, 0.0, -SPEED_MPS], atol=0.03)
        assert math.sqrt(covariance[0, 5, 5]) == pytest.approx(found.sigma_mps[0], rel=0.25)
        assert math.sqrt(covariance[0, 3, 3]) > 1.4  # sideways nothing is known
    before = tracks.state.copy()
    approach.fuse(tracks, measured(comes(0.0), back), np.zeros(3), FRAME_S)
    np.testing.assert_array_equal(tracks.state, before)
    tracks.moving[:] = True
    approach.fuse(tracks, found, np.zeros(3), FRAME_S)
    np.testing.assert_array_equal(tracks.state, before)


def test_the_time_of_an_approach_ends_with_the_first_frame_that_does_not_show_it() -> None:
    clear = ApproachSpeeds(np.array([0.6]), np.array([0.19]), 0.6)
    nothing = ApproachSpeeds(np.zeros(1), np.full(1, np.inf), 0.6)
    shown_s = np.zeros(1)
    for _ in range(3):
        shown_s = approach.approaching_s(shown_s, clear, FRAME_S)
    assert shown_s[0] == pytest.approx(3 * FRAME_S)
    assert approach.approaching_s(shown_s, nothing, FRAME_S)[0] == 0.0


def test_an_approach_that_lasts_proves_motion_by_itself() -> None:
    def seen(mps: float = 0.6, shown_s: float = 0.15, view_radps: float = 0.0) -> bool:
        turns = np.array([view_radps])
        approach_of = {"approach_mps": np.array([mps]), "approach_s": np.array([shown_s])}
        return rises(one(ALONG, **approach_of, view_radps=turns))

    assert seen()
    assert not seen(shown_s=0.1)
    assert not seen(mps=0.2)  # slower than 0.21 m/s
    # The viewpoint of 0.8 m changes: half of 0.8 rad/s are 0.32 m/s more.
    assert seen(view_radps=0.8)
    assert not seen(mps=0.5, view_radps=0.8)
    assert not rises(one(ALONG))


def test_a_plain_vehicle_of_which_one_side_is_in_view_moves_as_it_comes_nearer() -> None:
    """Its depth alone tells: there is no texture, and the visible side goes along the line of sight."""
    aside = (0.1, 9.0)
    percepts = track([nearest(plate(5.5 - 0.02 * k, aside, HIGH), BACK) for k in range(45)])
    for percept in percepts[20:]:
        (mover,) = [one for one in percept.scene.obstacles if one.moving]
        assert mover.velocity_mps[2] == pytest.approx(-0.6, abs=0.05)
        assert np.abs(mover.velocity_mps[:2]).max() < 0.15
    still = track([nearest(plate(5.5, aside, HIGH), BACK) for _ in range(45)])
    assert not any(one.moving for percept in still for one in percept.scene.obstacles)
