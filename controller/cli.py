"""The command line. A user's mistake is one line on standard error and exit code 2, never a traceback."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from config.loader import CONFIG_DIR, ConfigError
from controller.errors import UserError
from hal.errors import HalError

DEFAULT_CONFIG = CONFIG_DIR / "sim.yaml"
_FILE = click.Path(path_type=Path, dir_okay=False)
_FOLDER_OR_FILE = click.Path(path_type=Path)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="treadwatch", prog_name="treadwatch")
def cli() -> None:
    """Camera-based speed control for tracked robots on a fixed path."""


@cli.command()
@click.option(
    "--config", "config_path", type=_FILE, default=DEFAULT_CONFIG, show_default="the simulated warehouse",
    help="YAML of robot, camera, chassis and path.",
)  # fmt: skip
@click.option("--scenario", help="Simulation only: another world, a YAML file or the name of one that ships.")
@click.option("--seed", type=click.IntRange(min=0), help="Simulation only: another seed.")
@click.option("--observations", type=_FILE, help="Write what is seen and decided, one JSON line a frame.")
@click.option("--video", type=_FILE, help="Write an annotated video (.mp4, .webm or .avi).")
@click.option("--quiet", is_flag=True, help="Only the summary.")
def run(
    config_path: Path,
    scenario: str | None,
    seed: int | None,
    observations: Path | None,
    video: Path | None,
    quiet: bool,
) -> None:
    """Drive the path. Exit code 1 if anything was touched or the target was missed."""
    from controller.mission import MissionOptions, run_mission

    options = MissionOptions(config_path, scenario, seed, observations, video, quiet)
    sys.exit(run_mission(options))


@cli.command()
@click.argument("recording", type=_FOLDER_OR_FILE)
@click.option(
    "--odometry", type=click.Choice(["file", "none", "groundtruth"]), default="file", show_default=True,
    help="Prior of the camera's motion: odometry.txt if the recording has one, nothing, or the true poses.",
)  # fmt: skip
@click.option(
    "--config", "config_path", type=_FILE, default=CONFIG_DIR / "replay.yaml",
    help="YAML of robot, perception and decision.",
)  # fmt: skip
@click.option("--observations", type=_FILE, help="Write what is seen and decided, one JSON line a frame.")
@click.option("--video", type=_FILE, help="Write an annotated video (.mp4, .webm or .avi).")
@click.option("--quiet", is_flag=True, help="Only the summary.")
def replay(
    recording: Path,
    odometry: str,
    config_path: Path,
    observations: Path | None,
    video: Path | None,
    quiet: bool,
) -> None:
    """Look at a recording as the robot would: a TUM RGB-D folder."""
    from controller.replay import ReplayOptions, run_replay

    run_replay(ReplayOptions(recording, odometry, config_path, observations, video, quiet))


@cli.command()
@click.option(
    "--config", "config_path", type=_FILE, default=DEFAULT_CONFIG, show_default="the simulated warehouse"
)
def envelope(config_path: Path) -> None:
    """Stopping distances: the paper's, and with jerk and latency; what the camera's range admits."""
    from config.app import load_app
    from controller.envelope import describe_envelope

    for line in describe_envelope(load_app(config_path)):
        click.echo(line)


@cli.command()
@click.option("--json", "json_path", type=_FILE, help="Also write every figure as JSON.")
@click.option("--frames", type=click.IntRange(min=10), default=150, show_default=True)
def bench(json_path: Path | None, frames: int) -> None:
    """Measure perception beside the bare OpenCV calls, renderer, control step, driver, lock-step speed."""
    from controller.bench.command import run_bench

    run_bench(frames, json_path)


def main() -> None:
    """Entry point: turns every error that a user can mend into one line and exit code 2."""
    try:
        cli(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except click.Abort:
        sys.exit(130)
    except (ConfigError, HalError, UserError) as error:
        click.echo(f"treadwatch: {' '.join(str(error).split())}", err=True)
        sys.exit(2)
