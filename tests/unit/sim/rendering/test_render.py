from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from config.path import LineSpec, PathSpec
from config.scenario import BodySpec, Crate, Light, Room, Scenario, load_scenario
from hal.geometry import camera_in_floor
from hal.types import CameraMount, ColourImage, Intrinsics, PlanarPose, Pose
from sim.models.textures import draw
from sim.rendering import raster
from sim.rendering.render import Renderer
from sim.world import World

K = Intrinsics(320, 240, 305.0, 305.0, 159.5, 119.5)
MOUNT = CameraMount(0.45, 0.0, 0.6, math.radians(4.0))
PATH = PathSpec(segments=(LineSpec(kind="line", length_m=5.0),))


def eye(x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> Pose:
    return camera_in_floor(PlanarPose(x_m, y_m, heading_rad), MOUNT)


def scene(*bodies: BodySpec, light: Light | None = None) -> World:
    bright = light or Light(ambient=1.0)
    room = Room(floor="plain", walls="plain", ceiling="plain")
    return World(Scenario(name="test", path=PATH, bodies=bodies, light=bright, room=room), seed=1)


def look(world: World, camera: Pose, t_s: float = 0.0) -> ColourImage:
    return Renderer(world, K).render(t_s, camera).colour


def test_a_texture_stands_upright_and_unmirrored() -> None:
    crate = Crate(kind="crate", name="c", x_m=2.25, y_m=0.0, length_m=0.9, width_m=0.9, height_m=0.9)
    world = scene(crate)
    level = camera_in_floor(PlanarPose(0.0, 0.0, 0.0), CameraMount(0.0, 0.0, 0.6, 0.0))
    picture = Renderer(world, K).render(0.0, level)
    rows, columns = np.nonzero(picture.labels == picture.labels[120, 160])
    cut = picture.colour[rows.min() + 1 : rows.max(), columns.min() + 1 : columns.max()]
    # The crate's back is what a camera before it sees: its corners come as the texture's.
    face = picture.drawn.face[picture.labels[120, 160] - 1]
    texture = draw(1, world.textures[picture.geometry.texture[face]]).astype(np.float64)
    expected = np.asarray(cv2.resize(texture, cut.shape[1::-1], interpolation=cv2.INTER_AREA))

    def alike(other: NDArray[Any]) -> float:
        return float(np.corrcoef(cut.astype(np.float64).ravel(), other.ravel())[0, 1])

    assert alike(expected) > 0.9
    assert alike(expected) > alike(expected[:, ::-1]) + 0.2
    assert alike(expected) > alike(expected[::-1]) + 0.2


def test_large_and_small_faces_look_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(load_scenario("crossing"), seed=1)
    pictures = []
    for limit in (0, 10**9):
        monkeypatch.setattr(raster, "SMALL_PX", limit)
        pictures.append(Renderer(world, K).render(3.0, eye()))
    large, small = pictures
    assert np.array_equal(large.labels, small.labels)
    assert np.abs(large.inverse_depth - small.inverse_depth).max() < 1e-6
    # Large faces change the texture's scale within themselves, small ones do not.
    difference = np.abs(large.colour.astype(int) - small.colour.astype(int))
    assert np.median(difference) <= 1
    assert (difference > 24).mean() < 0.02


def test_every_pixel_in_a_closed_hall_shows_something() -> None:
    picture = Renderer(World(load_scenario("warehouse"), seed=1), K).render(4.0, eye())
    assert (picture.labels > 0).all()
    assert (picture.colour.max(axis=2) > 0).all()


def test_edges_are_blended_by_the_share_that_is_covered() -> None:
    # The upright edge of a block slides over a pixel column in tenths.
    near = Crate(kind="crate", name="near", x_m=3.0, y_m=-1.0, length_m=0.2, width_m=2.0, texture="plain")
    world = scene(near)
    level = CameraMount(0.0, 0.0, 0.3, 0.0)
    values = []
    for tenth in range(11):
        # The near face is 2.9 m away: a pixel is 2.9 / 305 m wide.
        shift_m = 0.1 * tenth * 2.9 / 305.0
        camera = camera_in_floor(PlanarPose(0.0, 0.5 * 2.9 / 305.0 + shift_m, 0.0), level)
        colour = look(world, camera)[118].astype(float).mean(axis=1)
        values.append(colour[158:164])
    profile = np.array(values)
    inside, outside = profile[:, -1].mean(), profile[:, 0].mean()
    covered = ((profile - outside) / (inside - outside)).sum(axis=1)
    # What the pixels say about where the edge is follows it, without steps.
    assert np.diff(covered) == pytest.approx(np.full(10, np.diff(covered).mean()), abs=0.06)
    assert abs(covered[-1] - covered[0]) == pytest.approx(1.0, abs=0.08)


def test_nothing_flickers_when_the_camera_creeps() -> None:
    renderer = Renderer(World(load_scenario("warehouse"), seed=1), K)
    first = renderer.render(30.0, eye()).colour.astype(int)
    second = renderer.render(30.0, eye(0.001)).colour.astype(int)
    difference = np.abs(second - first).max(axis=2)
    # A millimetre ahead moves nothing by more than a fifth of a pixel.
    assert np.quantile(difference, 0.99) <= 16
    assert difference.mean() < 1.5


def test_faces_of_one_box_differ_in_brightness() -> None:
    crate = Crate(kind="crate", name="c", x_m=2.5, y_m=0.0, heading_deg=40.0, texture="plain", height_m=0.4)
    world = scene(crate, light=Light(ambient=0.5))
    picture = Renderer(world, K).render(0.0, eye())
    mine = np.flatnonzero(picture.geometry.body[picture.drawn.face] == 1)
    means = sorted(float(picture.colour[picture.labels == number + 1].mean()) for number in mine)
    assert len(means) == 3
    assert means[1] - means[0] > 8
    assert means[2] - means[1] > 8


def test_pictures_are_the_same_to_the_byte() -> None:
    world = World(load_scenario("warehouse"), seed=4)
    one, two = Renderer(world, K), Renderer(World(world.scenario, seed=4), K)
    one.render(1.0, eye(3.0))
    a, b = one.render(4.0, eye()), two.render(4.0, eye())
    assert a.colour.tobytes() == b.colour.tobytes()
    assert a.inverse_depth.tobytes() == b.inverse_depth.tobytes()
    assert a.labels.tobytes() == b.labels.tobytes()


def test_the_mask_names_the_bodies_of_the_scenario() -> None:
    world = World(load_scenario("crossing"), seed=1)
    picture = Renderer(world, K).render(4.0, eye())
    mask = picture.instance_mask()
    walker = next(state for state in world.bodies(4.0) if state.name == "walker")
    rows, columns = np.nonzero(mask == walker.id)
    z = float(np.median(picture.depth_m()[rows, columns]))
    ahead = picture.camera.inverse().apply(np.array([[walker.pose.x_m, walker.pose.y_m, 0.9]]))[0]
    assert z == pytest.approx(ahead[2], abs=0.3)
    assert columns.mean() == pytest.approx(K.fx * ahead[0] / ahead[2] + K.cx, abs=8)


def test_body_on_the_floor_casts_a_shadow_on_the_floor_alone() -> None:
    crate = Crate(kind="crate", name="c", x_m=3.0, y_m=0.0, texture="plain")
    high = crate.model_copy(update={"name": "hangs", "z_m": 1.5})
    bare, with_crate, with_high = (Renderer(scene(*b), K).render(0.0, eye()) for b in ((), (crate,), (high,)))
    change = bare.colour.astype(int) - with_crate.colour
    building = with_crate.instance_mask() == 0
    foot = np.flatnonzero(with_crate.instance_mask()[:, 160] == 1).max()
    # Right before its foot the floor is darker, two metres nearer it is as it was.
    assert change[foot + 3, 160].min() > 10
    assert (np.abs(change[230]) <= 1).all()
    walls = building & (with_crate.geometry.normals[with_crate.drawn.face[with_crate.labels - 1], 2] < 0.5)
    beside = np.zeros_like(walls)
    beside[:80] = True  # above the crate: no edge is shared with it
    assert (np.abs(change[walls & beside]) <= 1).all()
    untouched = with_high.instance_mask()[150:] == 0
    assert np.array_equal(with_high.colour[150:][untouched], bare.colour[150:][untouched])
