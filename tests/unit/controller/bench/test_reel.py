from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pytest

from config.camera import SimulatedCameraConfig
from config.path import LineSpec, PathSpec
from config.robot import Robot
from config.scenario import Crate, Room, Scenario
from controller.bench.reel import cruise, recorded_reel, render_reel
from controller.bench.rendering import measure_renderer
from controller.path.path import Path
from hal.cameras.tum_replay import TumReplay
from hal.clocks import NS_PER_S, SimulatedClock
from hal.types import CameraMount
from sim.rendering.camera import SimulatedCamera
from sim.rendering.render import Renderer
from sim.world import World
from tests.support.bench_clocks import Ticks

DESK = FilePath(__file__).parents[3] / "recordings" / "desk_rpy"
MOUNT = CameraMount(0.4, 0.0, 0.6, 0.0)
ROUTE = PathSpec(segments=(LineSpec(kind="line", length_m=14.0),))
PATH = Path(ROUTE, Robot())
CAMERA = SimulatedCameraConfig(width=64, height=48, fx=61.0, fy=61.0, cx=31.5, cy=23.5, fps=10.0)


@pytest.fixture(scope="module")
def world() -> World:
    crate = Crate(kind="crate", name="crate", x_m=5.0, y_m=0.0, texture="plain")
    room = Room(floor="plain", walls="plain", ceiling="plain")
    return World(Scenario(name="a crate", path=ROUTE, room=room, bodies=(crate,)), seed=1)


def camera_in(world: World) -> SimulatedCamera:
    return SimulatedCamera(world, CAMERA, MOUNT, SimulatedClock(), lambda stamp_ns: cruise(PATH, stamp_ns))


def test_the_body_cruises_at_one_metre_a_second_and_stays_at_the_end() -> None:
    assert cruise(PATH, 0).x_m == pytest.approx(0.0)
    assert cruise(PATH, 3 * NS_PER_S // 2).x_m == pytest.approx(1.5)
    assert cruise(PATH, 1000 * NS_PER_S).x_m == pytest.approx(14.0)


def test_rendered_frames_come_with_the_odometry_of_their_time(world: World) -> None:
    ticks = Ticks()
    reel = render_reel(camera_in(world), PATH, MOUNT, 3, ticks)
    assert ticks.count == len(reel.frames) == 3
    assert [frame.captured_ns for frame in reel.frames] == [0, NS_PER_S // 10, NS_PER_S // 5]
    at_end = reel.odometry[2]
    assert at_end is not None
    np.testing.assert_allclose(at_end.translation_m, [0.6, 0.0, 0.6], atol=1e-9)
    assert reel.mount == MOUNT


def test_two_reels_are_the_same(world: World) -> None:
    one, other = (render_reel(camera_in(world), PATH, MOUNT, 2, lambda: None) for _ in range(2))
    np.testing.assert_array_equal(one.frames[1].colour, other.frames[1].colour)
    np.testing.assert_array_equal(one.frames[1].depth, other.frames[1].depth)


def test_a_recording_is_read_to_its_end() -> None:
    reel = recorded_reel(TumReplay(DESK))
    assert len(reel.frames) == 10
    assert reel.odometry == (None,) * 10
    assert reel.mount is None, "camera.yaml does not say where a camera held by hand is"


def test_each_picture_is_timed_alone_and_within_an_exposure(world: World) -> None:
    camera = camera_in(world)
    readings = iter(range(0, 10_000_000, 1_000_000))
    ticks = Ticks()
    figures = measure_renderer(camera, Renderer(world, camera.intrinsics), 2, lambda: next(readings), ticks)
    assert ticks.count == 3
    assert (figures.width, figures.height) == (64, 48)
    assert figures.picture.count == figures.exposure.count == 2
    assert figures.picture.median_ms == figures.exposure.median_ms == pytest.approx(1.0)
    assert camera.last_picture is not None
    assert figures.faces == len(camera.last_picture.drawn) > 2
    assert set(figures.as_json()) == {"width", "height", "faces", "picture", "exposure"}
