"""The command line. A user's mistake is one line on standard error and exit code 2, never a traceback."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Literal

import click

from config.camera import OdometryChoice
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
    from controller.mission import run_mission
    from controller.result import MissionOptions

    options = MissionOptions(config_path, scenario, seed, observations, video, quiet)
    sys.exit(run_mission(options))


@cli.command()
@click.option(
    "--config", "config_path", type=_FILE, default=CONFIG_DIR / "governor.yaml",
    show_default="a simulated warehouse, commands over UDP", help="YAML with a `governor` section.",
)  # fmt: skip
@click.option("--scenario", help="Simulation only: another world, a YAML file or the name of one that ships.")
@click.option("--seed", type=click.IntRange(min=0), help="Simulation only: another seed.")
@click.option("--observations", type=_FILE, help="Write what is seen and decided, one JSON line a frame.")
@click.option("--video", type=_FILE, help="Write an annotated video (.mp4, .webm or .avi).")
@click.option("--quiet", is_flag=True, help="Only the summary.")
def govern(
    config_path: Path,
    scenario: str | None,
    seed: int | None,
    observations: Path | None,
    video: Path | None,
    quiet: bool,
) -> None:
    """Let another planner drive: slow its (v, w) commands down to what is safe, until SIGTERM.

    The messages, and a client in thirty lines: docs/governor.md. Exit code 1 if anything was touched.
    """
    from controller.governor.command import run_governor
    from controller.result import MissionOptions

    sys.exit(run_governor(MissionOptions(config_path, scenario, seed, observations, video, quiet)))


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
    odometry: OdometryChoice,
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
@click.option(
    "--period", is_flag=True, help="Instead: the command period in real time, perception at full load."
)
@click.option(
    "--seconds", type=click.IntRange(5, 60), default=30, show_default=True,
    help="With --period: how long, with ordinary scheduling and again with SCHED_FIFO.",
)  # fmt: skip
def bench(json_path: Path | None, frames: int, period: bool, seconds: float) -> None:
    """Measure perception beside the bare OpenCV calls, renderer, control step, driver, lock-step speed."""
    if period:
        from controller.bench.period import run_period_bench

        run_period_bench(seconds)
        return
    from controller.bench.command import run_bench

    run_bench(frames, json_path)


@cli.command()
@click.argument("recordings", type=_FOLDER_OR_FILE, nargs=-1)
@click.option("--sim", "simulated", is_flag=True, help="The simulated set, with truth.")
@click.option(
    "--report", type=click.Path(path_type=Path, file_okay=False), required=True,
    help="Folder for report.md, summary.json and the figures.",
)  # fmt: skip
@click.option(
    "--odometry", type=click.Choice(["file", "none", "groundtruth"]), default="file", show_default=True,
    help="Recordings: prior of the camera's motion. The simulated set is run with and without.",
)  # fmt: skip
@click.option("--static", is_flag=True, help="Recordings: nothing moves but the camera, so all is false.")
@click.option(
    "--baselines", type=click.Choice(["none", "some", "all"]), default="some", show_default=True,
    help="Simulated set: the methods of the paper's Table 1 on no, some or all sequences.",
)  # fmt: skip
@click.option("--only", multiple=True, metavar="NAME", help="Simulated set: this sequence; may be repeated.")
@click.option(
    "--workers", type=click.IntRange(1, 64), default=min(os.cpu_count() or 1, 8), show_default=True,
    help="Processes that share the simulated set.",
)  # fmt: skip
@click.option("--quiet", is_flag=True, help="No progress bar.")
def evaluate(
    recordings: tuple[Path, ...],
    simulated: bool,
    report: Path,
    odometry: OdometryChoice,
    static: bool,
    baselines: Literal["none", "some", "all"],
    only: tuple[str, ...],
    workers: int,
    quiet: bool,
) -> None:
    """Measure detection: against the truth of the simulated set, and on recordings. Writes a report."""
    from controller.evaluation.evaluate import EvaluationOptions, run_evaluation

    run_evaluation(
        EvaluationOptions(recordings, simulated, report, odometry, static, baselines, only, workers, quiet)
    )


@cli.command()
@click.option(
    "--config", "config_path", type=_FILE, default=DEFAULT_CONFIG, show_default="the simulated warehouse",
    help="YAML of robot, camera, chassis, perception and decision.",
)  # fmt: skip
@click.option("--missions", type=click.IntRange(min=1), default=260, show_default=True)
@click.option("--families", metavar="A,B,...", help="Scenario families; all of them by default.")
@click.option("--policies", metavar="A,B,...", help="ours, paper, zones, field; all of them by default.")
@click.option(
    "--mode", type=click.Choice(["noise", "camera"]), default="noise", show_default=True,
    help="A noise model in place of the camera, or rendered and perceived frames.",
)  # fmt: skip
@click.option(
    "--workers", type=click.IntRange(1, 256), default=min(os.cpu_count() or 1, 8), show_default=True
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="The first seed.")
@click.option(
    "--report", type=click.Path(path_type=Path, file_okay=False),
    help="Folder for missions.jsonl, summary.json, report.md and the figures.",
)  # fmt: skip
@click.option("--resume", is_flag=True, help="Go on with a campaign that was broken off.")
@click.option(
    "--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, for example tcp://10.0.0.5:8786."
)
@click.option("--only", metavar="FAMILY:SEED", help="One mission alone.")
@click.option("--video", is_flag=True, help="Camera mode: keep recordings and videos of what fails.")
@click.option("--quiet", is_flag=True, help="No progress bar.")
def campaign(
    config_path: Path,
    missions: int,
    families: str | None,
    policies: str | None,
    mode: Literal["noise", "camera"],
    workers: int,
    seed: int,
    report: Path | None,
    resume: bool,
    scheduler: str | None,
    only: str | None,
    video: bool,
    quiet: bool,
) -> None:
    """Drive missions of all scenario families, several policies side by side. Exit code 1 if ours failed."""
    from controller.campaign.command import CampaignOptions, run_campaign

    options = CampaignOptions(
        config_path, missions, _names(families), _names(policies), mode, workers, seed, report, resume,
        scheduler, only, video, quiet,
    )  # fmt: skip
    sys.exit(run_campaign(options))


@cli.command("stop-and-go")
@click.option(
    "--config", "config_path", type=_FILE, default=DEFAULT_CONFIG, show_default="the simulated warehouse",
    help="YAML of robot, camera, chassis, perception and decision.",
)  # fmt: skip
@click.option("--drives", type=click.IntRange(1, 10_000), default=8, show_default=True)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="The first seed.")
@click.option(
    "--mode", type=click.Choice(["noise", "camera"]), default="camera", show_default=True,
    help="A noise model in place of the camera, or rendered and perceived frames.",
)  # fmt: skip
@click.option(
    "--report", type=click.Path(path_type=Path, file_okay=False), required=True,
    help="Folder for the recorded drives, report.md and summary.json.",
)  # fmt: skip
@click.option("--keep", is_flag=True, help="Camera mode: keep frames, observations and a video as well.")
@click.option("--quiet", is_flag=True, help="No progress bar.")
def stop_and_go(
    config_path: Path,
    drives: int,
    seed: int,
    mode: Literal["noise", "camera"],
    report: Path,
    keep: bool,
    quiet: bool,
) -> None:
    """Somebody steps into the way, stands, leaves: Nav2's bag metrics. Exit code 1 if a target is missed."""
    from controller.campaign.stop_and_go_command import StopAndGoOptions, run_stop_and_go

    sys.exit(run_stop_and_go(StopAndGoOptions(config_path, drives, seed, mode, report, keep, quiet)))


def _names(text: str | None) -> tuple[str, ...]:
    return tuple(name.strip() for name in (text or "").split(",") if name.strip())


@cli.command()
@click.argument("kind", type=click.Choice(["agilex", "roboclaw", "roboteq", "kobuki"]))
@click.option(
    "--channel",
    help="CAN: can0, vcan0, a multicast group. Serial: a path that becomes the port. Default: as in FILE.",
)
@click.option("--interface", help="CAN: another python-can interface than the channel suggests.")
@click.option("--port", type=click.IntRange(1024, 65535), help="CAN over multicast: the UDP port.")
@click.option(
    "--config", "config_path", type=_FILE, show_default="the hil-KIND.yaml that ships",
    help="YAML whose chassis and simulation.plant it plays.",
)  # fmt: skip
@click.option("--tell", is_flag=True, help="Say ten times a second how the base moves.")
def emulate(
    kind: str,
    channel: str | None,
    interface: str | None,
    port: int | None,
    config_path: Path | None,
    tell: bool,
) -> None:
    """Be a tracked base, in real time, until SIGTERM; drive it with `treadwatch run --config hil-KIND.yaml`.

    Type estop, release, restart, freeze or thaw and Enter to see what the driver makes of it.
    """
    from controller.emulate import EmulateOptions, run_emulator

    run_emulator(EmulateOptions(kind, channel, interface, port, config_path, tell), sys.stdin)


@cli.command()
@click.option(
    "--processes", "kind", type=click.Choice(["agilex", "roboclaw", "roboteq", "kobuki"]),
    help="Also kill and freeze the processes of this chassis' mission, in real time (two minutes).",
)  # fmt: skip
@click.option("--into", type=_FILE, help="Put the tables into this page, in place of the old ones.")
def faults(kind: str | None, into: Path | None) -> None:
    """Break things and tell what happened: e-stop, restart, unplugging, freezing, kill -9."""
    from controller.faults.command import FaultsOptions, run_faults

    run_faults(FaultsOptions(kind, into))


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
