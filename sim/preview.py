"""Draws a scenario: ``python -m sim.preview SCENARIO --time T --out file.png``."""

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
from hal.geometry import advance_pose
from hal.types import CameraMount, ColourImage, PlanarPose, RgbdFrame
from sim.contact import robot_footprint
from sim.rendering.camera import SimulatedCamera
from sim.rendering.render import Picture
from sim.world import World

_MAX_DEPTH_M = 10.0
_MAP_PX = (848, 480)


@click.command()
@click.argument("scenario")
@click.option(
    "--time", "t_s", type=click.FloatRange(min=0), default=0.0, help="Time of the world in seconds."
)
@click.option("--along", "along_m", type=float, default=0.0, help="Where the robot is on its path, in m.")
@click.option("--seed", type=int, default=1, help="Picks textures and jitter.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), required=True, help="PNG to write.")
def main(scenario: str, t_s: float, along_m: float, seed: int, out: Path) -> None:
    """Draw what the robot's camera sees in SCENARIO: colour, depth, instances and a map."""
    try:
        spec = load_scenario(scenario)
    except ConfigError as error:
        raise click.ClickException(str(error)) from error
    world, robot = World(spec, seed), Robot()
    mount = CameraMount(
        robot.camera_mount.forward_m,
        robot.camera_mount.left_m,
        robot.camera_mount.height_m,
        robot.camera_mount.pitch_rad,
    )
    pose = pose_along(spec.path, along_m)
    # The world began t_s ago, so the camera gives the frame of that time.
    clock = SimulatedClock(round(t_s * NS_PER_S))
    camera = SimulatedCamera(
        world, SimulatedCameraConfig(), mount, clock, body_pose=lambda _: pose, start_ns=0
    )
    frame = camera.read(timeout_s=1.0)
    picture = camera.last_picture
    if picture is None or not cv2.imwrite(str(out), sheet(frame, picture, world, robot, pose)):
        raise click.ClickException(f"{out}: cannot be written; check the folder and that it ends in .png")


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
    """The scene from above: path, footprints, the robot, and each body's velocity as its way in one
    second."""
    room = world.scenario.room
    width, height = _MAP_PX
    scale = min(width / (room.x_max_m - room.x_min_m), height / (room.y_max_m - room.y_min_m))
    plan = np.full((height, width, 3), 235, np.uint8)

    def pixels(points: NDArray[np.float64]) -> NDArray[np.int32]:
        u = (points[:, 0] - room.x_min_m) * scale
        v = 0.5 * height - (points[:, 1] - 0.5 * (room.y_min_m + room.y_max_m)) * scale
        return np.stack([u, v], axis=1).round().astype(np.int32)

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
    cv2.fillConvexPoly(plan, pixels(robot_footprint(robot.body, pose)), (200, 120, 40), cv2.LINE_AA)
    return plan


if __name__ == "__main__":
    main()
