"""The commands that measure: the code's speed, detection, missions by the thousand, what breaks.

The options of a command have the names of the fields of the record that is made of them.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import click

from controller.cli.options import (
    BASES,
    FILE,
    FOLDER,
    FOLDER_OR_FILE,
    ODOMETRY,
    Command,
    WholeNumber,
    config_option,
    first_seed,
    no_progress_bar,
    perception_mode,
)
from controller.errors import UserError


@click.command(cls=Command)
@click.option("--json", "json_path", type=FILE, help="Also write every figure as JSON.")
@click.option(
    "--frames", type=WholeNumber(min=10), default=150, show_default=True,
    help="Length of each simulated reel.",
)  # fmt: skip
@click.option(
    "--period", is_flag=True, help="Measure the command period in real time instead, perception at full load."
)
@click.option(
    "--seconds", type=WholeNumber(5, 60), default=30, show_default=True,
    help="With --period: duration of each run, one with ordinary scheduling and one with SCHED_FIFO.",
)  # fmt: skip
def bench(json_path: Path | None, frames: int, period: bool, seconds: float) -> None:
    """Measure speed, stage by stage.

    Perception compared with the bare OpenCV calls, renderer, control step, driver, lock-step runner.
    """
    if period:
        if json_path is not None:
            raise UserError("--json goes with the stages, not with --period, which only prints its table")
        from controller.bench.period import run_period_bench

        run_period_bench(seconds)
        return
    from controller.bench.command import run_bench

    run_bench(frames, json_path)


@click.command(cls=Command)
@click.argument("recordings", type=FOLDER_OR_FILE, nargs=-1)
@click.option("--sim", "simulated", is_flag=True, help="Run the simulated set, which has truth.")
@click.option(
    "--report", type=FOLDER, required=True, help="Folder for report.md, summary.json and the figures."
)
@click.option(
    "--odometry", type=ODOMETRY, default="auto", show_default="odometry.txt if there is one",
    help="Recordings: prior of the camera's motion. The simulated set is run with and without.",
)  # fmt: skip
@click.option(
    "--static", is_flag=True,
    help="Recordings in which only the camera moves: every moving obstacle is false.",
)  # fmt: skip
@click.option(
    "--baselines", type=click.Choice(["none", "some", "all"]), default="some", show_default=True,
    help="Simulated set: the methods of the paper's Table 1 on no, some or all sequences.",
)  # fmt: skip
@click.option("--only", multiple=True, metavar="NAME", help="Simulated set: only this one; may be repeated.")
@click.option(
    "--workers", type=WholeNumber(1, 64), default=min(os.cpu_count() or 1, 8), show_default=True,
    help="Processes that share the simulated set.",
)  # fmt: skip
@no_progress_bar
def evaluate(**given: Any) -> None:
    """Measure detection, simulated with truth and on recordings.

    Writes a report: the paper's tables and figures. It names the goals that are missed; the exit code is 0
    all the same.
    """
    from controller.evaluation.command import EvaluationOptions, run_evaluation

    run_evaluation(EvaluationOptions(**given))


def _names(_context: click.Context, option: click.Parameter, text: str | None) -> tuple[str, ...]:
    """Empty if the option was not given. Raises UserError if it was, and names nothing."""
    names = tuple(name.strip() for name in (text or "").split(",") if name.strip())
    if text is not None and not names:
        raise UserError(f"{option.opts[0]} {text!r}: names nothing; leave the option out for all of them")
    return names


@click.command(cls=Command)
@config_option("of robot, camera, chassis, perception and decision")
@click.option(
    "--missions", type=WholeNumber(1, 1_000_000), default=260, show_default=True,
    help="Number of missions, spread evenly over the families or scenarios, each with its own seeds.",
)  # fmt: skip
@click.option(
    "--families", metavar="A,B,...", callback=_names,
    help="Scenario families. Default: all; with --scenario: none.",
)  # fmt: skip
@click.option(
    "--scenario", "scenarios", multiple=True, metavar="FILE",
    help="A scenario file, or the name of one that ships, in place of the families; may be repeated.",
)  # fmt: skip
@click.option(
    "--policies", metavar="A,B,...", callback=_names, help="ours, paper, zones, field. Default: all."
)
@perception_mode("noise")
@click.option(
    "--workers", type=WholeNumber(1, 256), default=min(os.cpu_count() or 1, 8), show_default=True,
    help="Processes that share the missions.",
)  # fmt: skip
@first_seed(1)
@click.option(
    "--report", type=FOLDER,
    help="Folder for missions.jsonl, summary.json, report.md and the figures.",
)  # fmt: skip
@click.option("--resume", is_flag=True, help="Continue a campaign that was interrupted.")
@click.option(
    "--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, for example tcp://10.0.0.5:8786."
)
@click.option("--only", metavar="FAMILY:SEED", help="A single mission; also FILE.yaml:SEED.")
@click.option(
    "--video", is_flag=True,
    help="Camera mode: keep recordings and videos of failed missions; with --only, of that mission.",
)  # fmt: skip
@no_progress_bar
def campaign(**given: Any) -> None:
    """Drive missions of all families with several policies.

    Exit code 1 if treadwatch's own policy failed a mission.
    """
    from controller.campaign.command import CampaignOptions, run_campaign

    sys.exit(run_campaign(CampaignOptions(**given)))


@click.command("stop-and-go", cls=Command)
@config_option("of robot, camera, chassis, perception and decision")
@click.option("--drives", type=WholeNumber(1, 10_000), default=8, show_default=True, help="Number of drives.")
@first_seed(0)
@perception_mode("camera")
@click.option(
    "--report", type=FOLDER, required=True,
    help="Folder for the recorded drives, report.md and summary.json.",
)  # fmt: skip
@click.option("--keep", is_flag=True, help="Camera mode: keep frames, observations and a video as well.")
@no_progress_bar
def stop_and_go(**given: Any) -> None:
    """Measure how the robot stops for a person and drives on.

    The person steps in, stands and leaves. The metrics are those of Nav2's collision monitor. Exit code 1 if
    a target is missed.
    """
    from controller.campaign.stop_and_go_command import StopAndGoOptions, run_stop_and_go

    sys.exit(run_stop_and_go(StopAndGoOptions(**given)))


@click.command(cls=Command)
@click.option(
    "--processes", "kind", type=BASES,
    help="Also kill and freeze the processes of this chassis' mission, in real time (two minutes).",
)  # fmt: skip
@click.option("--into", type=FILE, help="Write the tables into this page, in place of the old ones.")
def faults(kind: str | None, into: Path | None) -> None:
    """Inject faults and report what happens.

    E-stop, restart, unplugging, freezing; with --processes also kill -9.
    """
    from controller.faults.command import FaultsOptions, run_faults

    run_faults(FaultsOptions(kind, into))
