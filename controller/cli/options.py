"""Options that several commands have in common, each written once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from pathlib import Path
from typing import Any, Literal, get_args

import click

from config.camera import OdometryChoice
from config.chassis import CHASSIS_KINDS
from config.loader import CONFIG_DIR
from controller.mission.options import MissionOptions
from controller.terminal.outlet import result_on_stdout


class WholeNumber(click.IntRange):
    """click.IntRange with another name: its message for "x" would be: not a valid integer range."""

    name = "whole number"


class Command(click.Command):
    """click.Command whose --help says in one line that it cannot be written; click has a traceback there."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        # The options that print something and end the program do so here.
        with result_on_stdout():
            return super().parse_args(ctx, args)


class Group(Command, click.Group):
    """click.Group of such commands, of which --help and --version are written in the same way."""

    command_class = Command


FILE = click.Path(path_type=Path, dir_okay=False)
FILE_OR_DASH = click.Path(path_type=Path, dir_okay=False, allow_dash=True)
FOLDER = click.Path(path_type=Path, file_okay=False)
FOLDER_OR_FILE = click.Path(path_type=Path)
BASES = click.Choice(CHASSIS_KINDS)

Option = Callable[[Callable[..., None]], Callable[..., None]]

# The values of config.camera.OdometryChoice.
ODOMETRY = click.Choice(get_args(OdometryChoice))

no_progress_bar = click.option("--quiet", is_flag=True, help="No progress bar.")


def config_option(
    what: str, default: Path | None = CONFIG_DIR / "sim.yaml", shown: str = "the simulated warehouse"
) -> Option:
    """--config as config_path. what: the sections that the command reads; shown: the default in words."""
    return click.option(
        "--config", "config_path", type=FILE, default=default, show_default=shown, help=f"YAML {what}."
    )


def first_seed(default: int) -> Option:
    """--seed of the first of many drives."""
    return click.option(
        "--seed", type=WholeNumber(min=0), default=default, show_default=True, help="The first seed."
    )


def perception_mode(default: Literal["noise", "camera"]) -> Option:
    """--mode: what stands in for the robot's eyes."""
    return click.option(
        "--mode", type=click.Choice(["noise", "camera"]), default=default, show_default=True,
        help="A noise model in place of the camera, or rendered and perceived frames.",
    )  # fmt: skip


def recording_options(command: Callable[..., None]) -> Callable[..., None]:
    """--observations, --video and --quiet."""
    return _in_this_order(
        command,
        click.option(
            "--observations",
            type=FILE_OR_DASH,
            help="Write what is seen and decided, one JSON line per frame; - writes to standard output.",
        ),
        click.option(
            "--video",
            type=FILE,
            help="Write an annotated video (.mp4, .m4v, .mov, .mkv, .webm or .avi).",
        ),
        click.option("--quiet", is_flag=True, help="Print only the summary."),
    )


def topic_options(command: Callable[..., None]) -> Callable[..., None]:
    """--colour-topic, --depth-topic, --odometry-topic and --gyro-topic."""
    return _in_this_order(
        command,
        *(
            click.option(
                f"--{what}-topic", metavar="TOPIC", help=f"Bag: topic of the {what}, if it is not found."
            )
            for what in ("colour", "depth", "odometry", "gyro")
        ),
    )


def mission_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options of a drive and --config, handed to the command as one MissionOptions.

    Other options of the command are passed on by name.
    """

    @wraps(command)
    def with_options(**given: Any) -> None:
        of_mission = {each.name: given.pop(each.name) for each in fields(MissionOptions)}
        command(MissionOptions(**of_mission), **given)

    return _in_this_order(
        recording_options(with_options),
        click.option("--scenario", help="Simulation only: a scenario file, or the name of one that ships."),
        click.option("--seed", type=WholeNumber(min=0), help="Simulation only: the seed of the world."),
        click.option(
            "--record",
            type=FOLDER,
            help="Write the frames and the odometry, for `treadwatch replay`; about 30 MB a second.",
        ),
    )


def _in_this_order(command: Callable[..., None], *options: Option) -> Callable[..., None]:
    """Click lists the option first that is applied last."""
    for option in reversed(options):
        command = option(command)
    return command
