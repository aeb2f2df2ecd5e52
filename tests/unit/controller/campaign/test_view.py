from __future__ import annotations

import math

import numpy as np
import pytest

from config.camera import SimulatedCameraConfig
from config.robot import Mount
from config.scenario import BodySpec, Pallet, Pole
from controller.campaign.view import PlanarCamera, PlanarView
from hal.types import PlanarPose
from tests.support.campaign import crate, stage
from vision.scene import NEVER_M

LEVEL = Mount(forward_m=0.0, left_m=0.0, height_m=0.6, pitch_deg=0.0)
ORIGIN = PlanarPose(0.0, 0.0, 0.0)


def look(
    *bodies: BodySpec, mount: Mount = LEVEL, pose: PlanarPose = ORIGIN
) -> tuple[PlanarCamera, PlanarView]:
    made = stage(*bodies)
    planar_camera = PlanarCamera(made.world, SimulatedCameraConfig(), mount)
    return planar_camera, planar_camera.look(made.world.snapshot(0.0)[0], pose)


def distances(view: PlanarView, body: int = 0) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    row = np.flatnonzero(view.bodies == body)
    return view.forward_m[row[0]] if len(row) else np.full(80, np.inf)


def test_a_crate_ahead_is_seen_at_its_front_over_its_width() -> None:
    planar_camera, view = look(crate(5.0, size_m=1.0))
    seen = np.isfinite(distances(view))
    assert distances(view)[seen] == pytest.approx(4.5)
    edges = planar_camera.bearing_tan[seen]
    assert edges.min() == pytest.approx(-0.5 / 4.5, abs=2 * planar_camera.half_width_tan)
    assert edges.max() == pytest.approx(0.5 / 4.5, abs=2 * planar_camera.half_width_tan)


def test_the_right_hand_side_has_positive_bearings() -> None:
    planar_camera, view = look(crate(5.0, -1.0, size_m=0.4))
    assert (planar_camera.bearing_tan[np.isfinite(distances(view))] > 0.0).all()


def test_the_robot_turns_its_eye() -> None:
    _, view = look(crate(0.0, 5.0), pose=PlanarPose(0.0, 0.0, math.pi / 2))
    assert np.isfinite(distances(view)).any()


@pytest.mark.parametrize(("x_m", "y_m"), [(-5.0, 0.0), (3.0, 3.0), (12.0, 0.0)])
def test_behind_beside_and_beyond_the_range_nothing_is_seen(x_m: float, y_m: float) -> None:
    _, view = look(crate(x_m, y_m))
    assert not np.isfinite(distances(view)).any()


def test_body_behind_a_tall_one_is_hidden() -> None:
    _, view = look(crate(3.0, size_m=1.0, name="near"), crate(6.0, size_m=0.8, name="far"))
    assert np.isfinite(distances(view, 0)).any()
    assert not np.isfinite(distances(view, 1)).any()


def test_part_of_it_is_seen_beside_the_edge() -> None:
    planar_camera, view = look(
        crate(3.0, 0.5, size_m=1.0, name="near"), crate(6.0, 0.0, size_m=1.0, name="far")
    )
    seen = planar_camera.bearing_tan[np.isfinite(distances(view, 1))]
    assert len(seen)
    assert (seen > 0.0).all()


def test_body_lower_than_the_camera_hides_nothing() -> None:
    low = Pallet(kind="pallet", name="near", x_m=3.0, y_m=0.0)
    _, view = look(low, crate(6.0, size_m=0.8, name="far"))
    assert np.isfinite(distances(view, 1)).any()


def test_low_body_nearby_is_below_the_image() -> None:
    """A level camera at 0.6 m sees 0.144 m high things from 0.6 - 0.144 = 0.393 z on: 1.16 m."""
    low = Pallet(kind="pallet", name="pallet", x_m=1.0, y_m=0.0, length_m=0.2, width_m=0.4)
    assert not np.isfinite(distances(look(low)[1])).any()
    further = low.model_copy(update={"x_m": 1.4})
    assert np.isfinite(distances(look(further)[1])).any()


def test_a_thin_pole_between_two_rays_is_seen() -> None:
    for y_m in np.linspace(-0.05, 0.05, 9).tolist():
        pole = Pole(kind="pole", name="pole", x_m=7.0, y_m=y_m, diameter_m=0.04)
        assert np.isfinite(distances(look(pole)[1])).any()


def test_the_free_way_ends_at_what_hides_it_and_at_the_wall() -> None:
    planar_camera, view = look(crate(5.0, size_m=1.0))
    ahead = np.abs(planar_camera.bearing_tan) < 0.05
    assert view.free_m[ahead] == pytest.approx(4.5)
    wall = ~np.isfinite(distances(view)) & (np.abs(planar_camera.bearing_tan) < 0.45)
    assert view.free_m[wall] == pytest.approx(60.0, abs=4.0)


@pytest.mark.parametrize(("height_m", "pitch_deg"), [(0.6, 4.0), (1.1, 15.0)])
def test_the_floor_comes_into_view_where_the_lower_edge_of_the_image_meets_it(
    height_m: float, pitch_deg: float
) -> None:
    planar_camera, _ = look(crate(5.0), mount=Mount(forward_m=0.0, height_m=height_m, pitch_deg=pitch_deg))
    camera = SimulatedCameraConfig()
    down_rad = math.atan((camera.height - 0.5 - camera.cy) / camera.fy) + math.radians(pitch_deg)
    assert planar_camera.floor_from_m == pytest.approx(height_m / math.tan(down_rad))
    up_rad = math.atan((camera.cy + 0.5) / camera.fy) - math.radians(pitch_deg)
    assert planar_camera.up_tan == pytest.approx(math.tan(up_rad))
    upwards, _ = look(crate(5.0), mount=Mount(forward_m=0.0, height_m=height_m, pitch_deg=-40.0))
    assert upwards.floor_from_m == NEVER_M
