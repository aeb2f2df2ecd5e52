from __future__ import annotations

import numpy as np
import pytest

from config.path import LineSpec, PathSpec
from config.scenario import BodySpec, Crate, Go, MotionPlan, Person, Scenario, Wall
from hal.geometry import body_in_floor, camera_in_floor
from hal.types import CameraMount, FloatArray, Intrinsics, PlanarPose, Pose
from sim.rendering.render import Picture, Renderer
from sim.rendering.truth import GroundTruth
from sim.world import World

K = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
MOUNT = CameraMount(0.45, 0.0, 0.6, 0.07)
PATH = PathSpec(segments=(LineSpec(kind="line", length_m=5.0),))


def drive(x_m: float, y_m: float, speed_mps: float = 1.0) -> MotionPlan:
    return MotionPlan(accel_mps2=20.0, steps=(Go(kind="go", x_m=x_m, y_m=y_m, speed_mps=speed_mps),))


def eye(x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> Pose:
    return camera_in_floor(PlanarPose(x_m, y_m, heading_rad), MOUNT)


class Stage:
    def __init__(self, *bodies: BodySpec) -> None:
        self.world = World(Scenario(name="test", path=PATH, bodies=bodies))
        self.truth = GroundTruth(self.world, K)
        self._renderer = Renderer(self.world, K)

    def picture(self, t_s: float, camera: Pose) -> Picture:
        return self._renderer.render(t_s, camera)


def project(points: FloatArray) -> FloatArray:
    return np.stack([K.fx * points[:, 0] / points[:, 2] + K.cx, K.fy * points[:, 1] / points[:, 2] + K.cy], 1)


def surface(picture: Picture, rows: FloatArray, columns: FloatArray) -> FloatArray:
    z = picture.depth_m()[rows.astype(int), columns.astype(int)]
    return np.stack([(columns - K.cx) / K.fx * z, (rows - K.cy) / K.fy * z, z], axis=1)


def test_mask_and_depth_of_a_crate_by_hand() -> None:
    # Its near face stands 2 m ahead of a level camera and is 0.6 m wide and 0.6 m high, up to eye height.
    stage = Stage(Crate(kind="crate", name="c", x_m=2.3, y_m=0.0))
    level = camera_in_floor(PlanarPose(0.0, 0.0, 0.0), CameraMount(0.0, 0.0, 0.6, 0.0))
    picture = stage.picture(0.0, level)
    rows, columns = np.nonzero(picture.instance_mask() == 1)
    # 150 px * 0.3 m / 2 m = 22.5 px to both sides, 150 * 0.6 / 2 = 45 px down from the horizon; a centre
    # right on an edge belongs to what begins there.
    assert (columns.min(), columns.max()) == (57, 101)
    assert (rows.min(), rows.max()) == (60, 104)
    assert picture.depth_m()[80, 80] == pytest.approx(2.0, rel=1e-6)


def test_truth_of_a_moving_crate() -> None:
    stage = Stage(Crate(kind="crate", name="c", x_m=3.0, y_m=-1.0, motion=drive(3.0, 4.0, speed_mps=0.8)))
    picture = stage.picture(1.5, eye(heading_rad=0.2))
    (body,) = stage.truth.bodies(picture)
    mask = picture.instance_mask() == 1
    rows, columns = np.nonzero(mask)
    assert body.bbox_px == (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
    assert body.visible_px == mask.sum()
    assert body.visible_ratio == 1.0
    # Over ground 0.8 m/s to the left of the floor; the camera looks 0.2 rad to the left and 0.07 down.
    back = picture.camera.rotation @ body.velocity_mps
    assert back == pytest.approx([0.0, 0.8, 0.0], abs=1e-9)
    assert body.velocity_mps[0] == pytest.approx(-0.8 * np.cos(0.2))
    assert body.position_m[2] == pytest.approx(float(picture.depth_m()[mask].mean()))


def test_visible_ratio_counts_what_others_hide() -> None:
    behind = Wall(kind="wall", name="behind", x_m=5.0, y_m=0.0, heading_deg=90.0, length_m=1.0, height_m=0.5)
    before = Wall(kind="wall", name="before", x_m=3.0, y_m=-1.0, heading_deg=90.0, length_m=2.0)
    stage = Stage(behind, before)
    picture = stage.picture(0.0, eye())
    hidden = stage.truth.bodies(picture)[0]
    alone = Stage(behind)
    whole = alone.truth.bodies(alone.picture(0.0, eye()))[0]
    assert hidden.visible_px == pytest.approx(0.5 * whole.visible_px, rel=0.05)
    assert hidden.visible_ratio == pytest.approx(hidden.visible_px / whole.visible_px)
    assert whole.visible_ratio == 1.0


def test_a_body_out_of_view_is_not_listed() -> None:
    stage = Stage(Crate(kind="crate", name="behind us", x_m=-2.0, y_m=0.0))
    assert stage.truth.bodies(stage.picture(0.0, eye())) == ()


def test_flow_of_a_still_world_is_the_cameras_motion() -> None:
    stage = Stage(Crate(kind="crate", name="c", x_m=3.0, y_m=0.4, heading_deg=20.0))
    picture = stage.picture(0.0, eye())
    later = eye(0.08, 0.01, 0.03)
    flow = stage.truth.flow(picture, 0.033, later)
    rows, columns = (a.ravel().astype(float) for a in np.mgrid[0 : K.height : 3, 0 : K.width : 3])
    points = surface(picture, rows, columns)
    expected = project((later.inverse() @ picture.camera).apply(points)) - np.stack([columns, rows], axis=1)
    got = flow[rows.astype(int), columns.astype(int)]
    assert np.abs(got - expected).max() < 2e-3


def test_flow_of_a_moving_body_adds_its_own_motion() -> None:
    cart = Crate(kind="crate", name="c", x_m=2.5, y_m=-0.8, motion=drive(2.9, 1.6))
    stage = Stage(cart)
    t0_s, t1_s = 1.0, 1.05
    picture, later = stage.picture(t0_s, eye()), eye(0.05)
    rows, columns = (a.astype(float) for a in np.nonzero(picture.instance_mask() == 1))
    poses = [body_in_floor(stage.world.bodies(t_s)[0].pose) for t_s in (t0_s, t1_s)]
    on_the_move = later.inverse() @ poses[1] @ poses[0].inverse() @ picture.camera
    expected = project(on_the_move.apply(surface(picture, rows, columns))) - np.stack([columns, rows], axis=1)
    flow = stage.truth.flow(picture, t1_s, later)[rows.astype(int), columns.astype(int)]
    assert len(rows) > 500
    assert np.abs(flow - expected).max() < 2e-3


def test_flow_follows_limbs_not_only_the_body() -> None:
    walker = Person(kind="person", name="p", x_m=3.5, y_m=-2.0, heading_deg=90.0, motion=drive(3.5, 2.0, 1.2))
    stage = Stage(walker)
    slowest, fastest = [], []
    for t_s in (1.4, 1.5, 1.6, 1.7, 1.8):
        picture = stage.picture(t_s, eye())
        mine = stage.truth.flow(picture, t_s + 0.01, eye())[picture.instance_mask() == 1]
        # Walking to the left at 1.2 m/s, 3.05 m away: the trunk moves by -150 * 0.012 / 3.05 px.
        trunk = -150 * 0.012 / 3.05
        assert np.median(mine[:, 0]) == pytest.approx(trunk, rel=0.15)
        slowest.append(mine[:, 0].max() / trunk)
        fastest.append(mine[:, 0].min() / trunk)
    # The foot on the floor stands still, the other one hurries past the body.
    assert min(slowest) < 0.1
    assert max(fastest) > 1.8


def test_flow_is_unknown_behind_the_later_camera() -> None:
    stage = Stage(Crate(kind="crate", name="c", x_m=1.2, y_m=0.0, height_m=0.9))
    picture = stage.picture(0.0, eye())
    flow = stage.truth.flow(picture, 0.0, eye(3.0))
    assert np.isnan(flow[picture.instance_mask() == 1]).all()
    assert np.isfinite(flow[picture.depth_m() > 6.0]).all()
