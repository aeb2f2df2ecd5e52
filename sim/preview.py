"""Draws a scenario: ``python -m sim.preview SCENARIO --time T --out file.png`` (docs/scenarios.md)."""

from __future__ import annotations

import math
from pathlib import Path

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from config.camera import SimulatedCameraConfig
from config.loader import ConfigError
from config.path import PathSpec
from config.robot import Robot
from config.scenario import load_scenario
from hal.clocks import NS_PER_S, SimulatedClock
from hal.geometry import advance_pose, mount_of
from hal.types import ColourImage, FloatArray, PlanarPose, RgbdFrame
from sim.contact import robot_footprint
from sim.rendering.camera import SimulatedCamera
from sim.rendering.render import Picture
from sim.world import World

_MAX_DEPTH_M = 10.0  # end of the colour scale: as far as perception uses depth
_MAP_PX = (848, 456)  # with the key below: the camera's 848 x 480
_KEY_PX = 24
_INK, _PAPER = (60, 60, 60), (235, 235, 235)
_PATH, _MOVER, _STANDING, _ROBOT = (60, 160, 60), (40, 40, 210), (150, 120, 90), (200, 120, 40)
_MEANINGS = (
    ("path", _PATH), ("robot", _ROBOT), ("stands", _STANDING),
    ("moves: dots each 0.5 s, line: in 1 s", _MOVER),
)  # fmt: skip
# Routes are shown for this long from the start.
_ROUTE_S, _ROUTE_STEP_S = 30.0, 0.5


class _Mistake(click.ClickException):
    """A mistake of the user: one line, and the exit code of the other commands."""

    exit_code = 2


def _finite(_context: click.Context, option: click.Parameter, value: float) -> float:
    if not math.isfinite(value):
        raise _Mistake(f"--{option.name}: {value} is no finite number")
    return value


@click.command()
@click.argument("scenario")
@click.option(
    "--time", type=click.FloatRange(min=0), default=0.0, callback=_finite, help="Time of the world, in s."
)
@click.option("--along", type=float, default=0.0, callback=_finite, help="How far on its path, in m.")
@click.option("--seed", type=click.IntRange(min=0), default=1, help="Picks textures and jitter.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), required=True, help="PNG to write.")
def main(scenario: str, time: float, along: float, seed: int, out: Path) -> None:
    """Draw what the robot's camera sees in SCENARIO: colour, depth, bodies and a map."""
    if not cv2.haveImageWriter(str(out)):
        raise _Mistake(f"{out}: is no kind of image; end its name with .png")
    try:
        spec = load_scenario(scenario)
    except ConfigError as error:
        raise _Mistake(str(error)) from error
    world, robot = World(spec, seed), Robot()
    pose = pose_along(spec.path, along)
    # The world began that long ago, so the camera gives the frame of that time.
    clock = SimulatedClock(round(time * NS_PER_S))
    camera = SimulatedCamera(
        world, SimulatedCameraConfig(), mount_of(robot), clock, body_pose=lambda _: pose, start_ns=0
    )
    frame = camera.read(timeout_s=1.0)
    picture = camera.last_picture
    if picture is None or not cv2.imwrite(str(out), sheet(frame, picture, world, robot, pose)):
        raise _Mistake(f"{out}: cannot be written; name a file in a folder that exists")


def pose_along(path: PathSpec, along_m: float) -> PlanarPose:
    """The pose of the turning centre after along_m on the path. Blended arcs count as circles of the same
    length and angle."""
    pose = PlanarPose(path.start.x_m, path.start.y_m, math.radians(path.start.heading_deg))
    for segment in path.segments:
        advance_m = min(max(along_m, 0.0), segment.length_m)
        bend = 0.0
        if segment.kind == "arc":
            bend = math.radians(segment.angle_deg) / segment.length_m
        pose = advance_pose(pose, advance_m, bend * advance_m, 1.0)
        along_m -= segment.length_m
    return pose


def sheet(frame: RgbdFrame, picture: Picture, world: World, robot: Robot, pose: PlanarPose) -> ColourImage:
    """Four images in one: colour and depth above, instances and map below."""
    height, width = frame.depth.shape
    plan = cv2.resize(_map(world, robot, pose, picture.t_s), (width, height))
    upper = np.hstack([frame.colour, depth_colours(frame)])
    lower = np.hstack([mask_colours(picture.instance_mask()), plan])
    return np.vstack([upper, lower]).astype(np.uint8)


def depth_colours(frame: RgbdFrame) -> ColourImage:
    """Depth in the colours of the video (viridis), with a scale: near is bright, far is dark, no data is
    black."""
    metres = frame.depth * frame.depth_scale_m
    colours = _viridis(np.asarray(metres / _MAX_DEPTH_M, np.float64))
    colours[frame.depth == 0] = 0
    height, width = frame.depth.shape
    colours[height - 34 :] = 0
    colours[height - 30 : height - 20, 10 : width - 10] = _viridis(np.linspace(0.0, 1.0, width - 20)[None])
    for share in (0.0, 0.5, 1.0):
        _write(colours, f"{share * _MAX_DEPTH_M:g} m", round(8 + share * (width - 52)), height - 6, _PAPER)
    return colours


def _viridis(shares: FloatArray) -> ColourImage:
    """0: near, bright; 1: far, dark."""
    levels = np.rint(255.0 * (1.0 - np.clip(shares, 0.0, 1.0))).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS), dtype=np.uint8)


def _write(image: ColourImage, words: str, x: int, y: int, colour: tuple[int, int, int] = _INK) -> None:
    cv2.putText(image, words, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.4, colour, 1, cv2.LINE_AA)


def mask_colours(mask: NDArray[np.uint16]) -> ColourImage:
    """An instance mask in colours: one for each body, dark for the building."""
    hue = (mask.astype(np.uint32) * 47 % 180).astype(np.uint8)
    bright = np.where(mask == 0, 40, 220).astype(np.uint8)
    saturated = np.where(mask == 0, 0, 170).astype(np.uint8)
    coloured = cv2.cvtColor(np.stack([hue, saturated, bright], axis=2), cv2.COLOR_HSV2BGR)
    return np.asarray(coloured, dtype=np.uint8)


def _map(world: World, robot: Robot, pose: PlanarPose, t_s: float) -> ColourImage:
    """The scene from above: walls, path, the robot, and each body with its name, its route and its way in one
    second; below them a scale and a legend."""
    room = world.scenario.room
    width, height = _MAP_PX
    scale = min(width / (room.x_max_m - room.x_min_m), height / (room.y_max_m - room.y_min_m))
    plan = np.full((height, width, 3), _PAPER, np.uint8)

    def pixels(points: NDArray[np.float64]) -> NDArray[np.int32]:
        u = (points[:, 0] - room.x_min_m) * scale
        v = 0.5 * height - (points[:, 1] - 0.5 * (room.y_min_m + room.y_max_m)) * scale
        return np.stack([u, v], axis=1).round().astype(np.int32)

    low, high = pixels(np.array([[room.x_min_m, room.y_min_m], [room.x_max_m, room.y_max_m]])).tolist()
    cv2.rectangle(plan, low, high, _INK, 3)
    length = world.scenario.path.length_m
    stations = [pose_along(world.scenario.path, s) for s in np.linspace(0.0, length, 200)]
    route = pixels(np.array([[p.x_m, p.y_m] for p in stations]))
    cv2.polylines(plan, [route], False, _PATH, 2, cv2.LINE_AA)
    for places_m in _routes(world):
        for place in pixels(places_m):
            cv2.circle(plan, place.tolist(), 1, _MOVER, -1, cv2.LINE_AA)
    for state in world.bodies(t_s):
        colour = _MOVER if state.moves else _STANDING
        cv2.polylines(plan, [pixels(state.footprint_m)], True, colour, 1, cv2.LINE_AA)
        here = np.array([[state.pose.x_m, state.pose.y_m]])
        ends = pixels(np.concatenate([here, here + state.velocity_mps]))
        cv2.line(plan, tuple(ends[0].tolist()), tuple(ends[1].tolist()), colour, 2, cv2.LINE_AA)
        _write(plan, state.name, *(ends[0] + (6, -6)).tolist())
    cv2.fillConvexPoly(plan, pixels(robot_footprint(robot.body, pose)), _ROBOT, cv2.LINE_AA)
    return np.vstack([plan, _map_key(width, scale)]).astype(np.uint8)


def _routes(world: World) -> list[FloatArray]:
    """Where each mover is at each half second, (T, 2)."""
    times_s = np.arange(0.0, _ROUTE_S, _ROUTE_STEP_S)
    states = [[state for state in world.bodies(t_s) if state.moves] for t_s in times_s.tolist()]
    return [
        np.array([[state.pose.x_m, state.pose.y_m] for state in of_one])
        for of_one in zip(*states, strict=True)
    ]


def _map_key(width: int, px_per_m: float) -> ColourImage:
    """The scale of the map, and what its colours mean."""
    key = np.full((_KEY_PX, width, 3), _PAPER, np.uint8)
    length_m = next(m for m in (10, 5, 2, 1) if m * px_per_m < 0.3 * width or m == 1)
    cv2.line(key, (10, 12), (10 + round(length_m * px_per_m), 12), _INK, 3)
    x = 18 + round(length_m * px_per_m)
    _write(key, f"{length_m} m", x, 16)
    x += 56
    for words, colour in _MEANINGS:
        cv2.rectangle(key, (x, 6), (x + 12, 18), colour, -1)
        _write(key, words, x + 17, 16)
        x += 34 + 8 * len(words)
    return key


if __name__ == "__main__":
    main()
