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
from hal.types import ColourImage, PlanarPose, RgbdFrame
from sim.contact import robot_footprint
from sim.rendering.camera import SimulatedCamera
from sim.rendering.render import Picture
from sim.world import World

_MAX_DEPTH_M = 10.0
_MAP_PX = (848, 480)
_INK = (60, 60, 60)


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
    """Depth in colours: near is blue, far is red, no data is black."""
    metres = frame.depth * frame.depth_scale_m
    grey = np.clip(metres / _MAX_DEPTH_M * 255.0, 0, 255).astype(np.uint8)
    colours = np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_TURBO), dtype=np.uint8)
    colours[frame.depth == 0] = 0
    return colours


def mask_colours(mask: NDArray[np.uint16]) -> ColourImage:
    """An instance mask in colours: one for each body, dark for the building."""
    hue = (mask.astype(np.uint32) * 47 % 180).astype(np.uint8)
    bright = np.where(mask == 0, 40, 220).astype(np.uint8)
    saturated = np.where(mask == 0, 0, 170).astype(np.uint8)
    coloured = cv2.cvtColor(np.stack([hue, saturated, bright], axis=2), cv2.COLOR_HSV2BGR)
    return np.asarray(coloured, dtype=np.uint8)


def _map(world: World, robot: Robot, pose: PlanarPose, t_s: float) -> ColourImage:
    """The scene from above: walls, path, the robot, and each body with its name and its way in one second."""
    room = world.scenario.room
    width, height = _MAP_PX
    scale = min(width / (room.x_max_m - room.x_min_m), height / (room.y_max_m - room.y_min_m))
    plan = np.full((height, width, 3), 235, np.uint8)

    def pixels(points: NDArray[np.float64]) -> NDArray[np.int32]:
        u = (points[:, 0] - room.x_min_m) * scale
        v = 0.5 * height - (points[:, 1] - 0.5 * (room.y_min_m + room.y_max_m)) * scale
        return np.stack([u, v], axis=1).round().astype(np.int32)

    low, high = pixels(np.array([[room.x_min_m, room.y_min_m], [room.x_max_m, room.y_max_m]])).tolist()
    cv2.rectangle(plan, low, high, _INK, 3)
    length = world.scenario.path.length_m
    stations = [pose_along(world.scenario.path, s) for s in np.linspace(0.0, length, 200)]
    route = pixels(np.array([[p.x_m, p.y_m] for p in stations]))
    cv2.polylines(plan, [route], False, (60, 160, 60), 2, cv2.LINE_AA)
    for state in world.bodies(t_s):
        colour = (40, 40, 210) if state.moves else (150, 120, 90)
        cv2.polylines(plan, [pixels(state.footprint_m)], True, colour, 1, cv2.LINE_AA)
        here = np.array([[state.pose.x_m, state.pose.y_m]])
        ends = pixels(np.concatenate([here, here + state.velocity_mps]))
        cv2.line(plan, tuple(ends[0].tolist()), tuple(ends[1].tolist()), colour, 2, cv2.LINE_AA)
        beside = (ends[0] + (6, -6)).tolist()
        cv2.putText(plan, state.name, beside, cv2.FONT_HERSHEY_SIMPLEX, 0.4, _INK, 1, cv2.LINE_AA)
    cv2.fillConvexPoly(plan, pixels(robot_footprint(robot.body, pose)), (200, 120, 40), cv2.LINE_AA)
    return plan


if __name__ == "__main__":
    main()
