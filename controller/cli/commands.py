"""The command line. A user's mistake is one line on standard error and exit code 2, never a traceback.

The options of a command have the names of the fields of the record that is made of them.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NoReturn

import click

from config.loader import CONFIG_DIR, ConfigError
from controller.cli.measuring import bench, campaign, evaluate, faults, stop_and_go
from controller.cli.options import (
    BASES,
    FOLDER_OR_FILE,
    ODOMETRY,
    Group,
    WholeNumber,
    config_option,
    mission_options,
    recording_options,
    topic_options,
)
from controller.errors import INTERRUPTED, Interrupted, UserError
from controller.mission.options import MissionOptions
from hal.errors import HalError


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="treadwatch", prog_name="treadwatch")
def cli() -> None:
    """Camera-based speed control for tracked robots on a fixed path."""


@cli.command()
@config_option("of robot, camera, chassis and path")
@mission_options
def run(options: MissionOptions) -> None:
    """Drive the path.

    Exit code 0 if the target was reached, or the robot came to rest before it because a signal (Ctrl-C,
    SIGTERM) asked for that, and nothing was touched, the limits were kept and all files were written; else 1.
    """
    from controller.mission.command import run_mission

    sys.exit(run_mission(options))


@cli.command()
@config_option("of robot, camera and chassis", CONFIG_DIR / "sim-realtime.yaml")
@click.option(
    "--for", "duration_s", type=WholeNumber(min=1), metavar="SECONDS", show_default="until Ctrl-C",
    help="Watch for this long, from the first frame on.",
)  # fmt: skip
@click.option("--no-chassis", is_flag=True, help="Look through the camera alone; no base is opened.")
@mission_options
def watch(options: MissionOptions, duration_s: int | None, no_chassis: bool) -> None:
    """Look and listen, without driving.

    Prints once a second what the camera sees, where the floor is, what the robot would decide, and what the
    base reports. The base is never armed, and no command is sent to it. Ends with Ctrl-C or SIGTERM.
    Exit code 0 if it ended as asked and all files were written; else 1.
    """
    from controller.watch.command import WatchOptions, run_watch

    sys.exit(run_watch(WatchOptions(options, duration_s, no_chassis)))


@cli.command()
@config_option(
    "with a `governor` section", CONFIG_DIR / "governor.yaml", "a simulated warehouse, commands over UDP"
)
@mission_options
def govern(options: MissionOptions) -> None:
    """Slow another planner's commands down to what is safe.

    The planner sends (v, w); the drive ends with SIGTERM. The messages, and a client in thirty lines, are in
    docs/governor.md.
    Exit code 0 if the robot came to rest as the signal asked, nothing was touched, the limits were kept and
    all files were written; else 1.
    """
    from controller.governor.command import run_governor

    sys.exit(run_governor(options))


@cli.command()
@click.argument("recording", type=FOLDER_OR_FILE)
@click.option(
    "--odometry", type=ODOMETRY, default="auto", show_default=True,
    help="Prior of the camera's motion. file: odometry.txt or a bag's topic; auto: that, if there is one; "
    "none: images and depth alone; groundtruth: the true poses.",
)  # fmt: skip
@click.option("--no-gyro", is_flag=True, help="Leave the recorded gyro out.")
@topic_options
@config_option("of robot, perception and decision", CONFIG_DIR / "replay.yaml", "the replay.yaml that ships")
@recording_options
def replay(
    no_gyro: bool,
    colour_topic: str | None,
    depth_topic: str | None,
    odometry_topic: str | None,
    gyro_topic: str | None,
    **given: Any,
) -> None:
    """Perceive and decide on a recording, as the robot would.

    RECORDING is a TUM RGB-D folder or a ROS bag (.bag, .db3, .mcap), also one of a RealSense viewer. If it
    does not give the camera's mounting, that of the robot's FILE is used; without FILE, the floor is found in
    the depth.
    """
    from controller.replay.command import ReplayOptions, run_replay
    from hal.cameras.bag_topics import WantedTopics

    topics = WantedTopics(colour_topic, depth_topic, odometry_topic, gyro_topic)
    run_replay(ReplayOptions(topics=topics, use_gyro=not no_gyro, **given))


@cli.command()
@config_option("of robot, camera and decision")
def envelope(config_path: Path) -> None:
    """Stopping distances, and the speed the camera's range admits.

    First the paper's numbers, then the same with jerk and latency.
    """
    from config.app import load_app
    from controller.cli.envelope import describe_envelope
    from controller.terminal.outlet import say_result

    for line in describe_envelope(load_app(config_path)):
        say_result(line)


@cli.command()
@click.argument("kind", type=BASES)
@click.option(
    "--channel",
    help="CAN: can0, vcan0, a multicast group. Serial: a path that becomes the port. Default: as in FILE.",
)
@click.option("--interface", help="CAN: another python-can interface than the channel suggests.")
@click.option("--port", type=WholeNumber(1024, 65535), help="CAN over multicast: the UDP port.")
@config_option("whose chassis and simulation.plant are emulated", None, "the hil-KIND.yaml that ships")
@click.option("--tell", "telling", is_flag=True, help="Print the motion of the base ten times per second.")
def emulate(**given: Any) -> None:
    """Emulate a tracked base, in real time, until SIGTERM.

    Drive it with `treadwatch run --config config/hil-KIND.yaml`.

    Type estop, release, restart, freeze or thaw and Enter to see how the driver reacts.
    """
    from controller.cli.emulate import EmulateOptions, run_emulator

    run_emulator(EmulateOptions(**given), sys.stdin)


for measuring in (bench, evaluate, campaign, stop_and_go, faults):
    cli.add_command(measuring)


def main() -> None:
    """Turns every error that a user can mend into one line and exit code 2; KeyboardInterrupt passes."""
    try:
        cli(prog_name="treadwatch", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        sys.exit(2)
    except click.UsageError as error:
        command = "treadwatch" if error.ctx is None else error.ctx.command_path
        _refuse(f"{error.format_message().rstrip('.')}; see `{command} --help`")
    except click.ClickException as error:
        _refuse(error.format_message())
    except click.Abort as error:
        # A command that can say what it has done so far raises Interrupted instead.
        raise KeyboardInterrupt from error
    except Interrupted as error:
        _say(f"interrupted: {error}")
        sys.exit(INTERRUPTED)
    except SystemError as error:
        # Compiled steps call Python from C; Ctrl-C in there becomes the cause of a SystemError.
        if isinstance(error.__cause__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise
    except (ConfigError, HalError, UserError) as error:
        _refuse(str(error))


def _refuse(mistake: str) -> NoReturn:
    _say(mistake)
    sys.exit(2)


def _say(line: str) -> None:
    from controller.terminal.outlet import say

    say(f"treadwatch: {' '.join(line.split())}", to_stderr=True)
