"""`treadwatch stop-and-go`: a person steps into the way, stands and leaves; the result is Nav2's bag
metrics."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from config.app import AppConfig, LockstepRunner, load_app
from controller.campaign import stop_and_go
from controller.campaign.camera_mission import drive_camera
from controller.campaign.noise_mission import drive_noise
from controller.campaign.policies import OURS, build_policy
from controller.campaign.report import config_option_text
from controller.campaign.stage import Stage
from controller.campaign.stop_and_go import StopAndGo
from controller.campaign.task import Mode
from controller.errors import UserError
from controller.evaluation.report import markdown
from controller.terminal.outlet import say
from sim.families.step_in import step_in

# The goals for Nav2's numbers, less what physics needs (docs/results.md).
TO_STOP_S, HOLD, TO_RESUME_S, FALSE_STOPS = 0.6, 0.95, 0.6, 0.01


@dataclass(frozen=True, slots=True)
class StopAndGoOptions:
    """The command line of `treadwatch stop-and-go`."""

    config_path: Path
    drives: int
    seed: int
    mode: Mode
    report: Path
    keep: bool = False
    quiet: bool = False


@dataclass(frozen=True, slots=True)
class _Target:
    """One of Nav2's numbers, minus what physics needs, and the limit that it must keep."""

    name: str
    value: Callable[[StopAndGo], float]
    limit: float
    is_minimum: bool = False

    def missed(self, result: StopAndGo) -> bool:
        value = self.value(result)
        return not (value >= self.limit if self.is_minimum else value <= self.limit)


TARGETS = (
    _Target("time to stop beyond braking, s", lambda result: result.to_stop_s - result.braking_s, TO_STOP_S),
    _Target("hold, share", lambda result: result.hold_share, HOLD, is_minimum=True),
    _Target(
        "time to resume beyond starting, s",
        lambda result: result.to_resume_s - result.starting_s,
        TO_RESUME_S,
    ),
    _Target("false stop, share", lambda result: result.false_stop_share, FALSE_STOPS),
)


def run_stop_and_go(options: StopAndGoOptions) -> int:
    """Drive, record, measure the recordings, report. The exit code: 1 if any drive misses a target.

    Raises ConfigError, UserError.
    """
    config = load_app(options.config_path)
    if config.camera.kind != "simulated" or not isinstance(config.runner, LockstepRunner):
        raise UserError(f"{options.config_path}: needs camera.kind 'simulated' and runner.kind 'lockstep'")
    if options.keep and options.mode != "camera":
        raise UserError("--keep needs --mode camera: without a camera there are no frames to keep")
    folder = options.report / "drives"
    for earlier in (folder, options.report / "report.md"):
        if earlier.exists():
            raise UserError(f"{earlier} exists: give another --report folder, or remove it")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({error.strerror}); choose another --report") from error
    seeds = range(options.seed, options.seed + options.drives)
    hidden = options.quiet or not sys.stderr.isatty()
    with click.progressbar(seeds, label="drives", file=sys.stderr, hidden=hidden) as bar:
        for seed in bar:
            _drive(options, config, seed, folder / f"{seed}.csv")
    # Measured from the files, which shows that a recording holds everything that is needed.
    results = {
        seed: stop_and_go.measure(stop_and_go.read(folder / f"{seed}.csv"), config.robot, config.decision)
        for seed in seeds
    }
    _write(options, results)
    for target in TARGETS:
        say(f"{target.name:<36} {_result_line(target, list(results.values()))}")
    say(f"report   {options.report / 'report.md'}")
    return int(any(target.missed(result) for result in results.values() for target in TARGETS))


def _drive(options: StopAndGoOptions, config: AppConfig, seed: int, file: Path) -> None:
    stage = Stage(step_in(seed), config.robot)
    if options.mode == "noise":
        log = drive_noise(stage, config, build_policy(OURS, config, stage))
    else:
        keep = options.report / f"step_in-{seed}" if options.keep else None
        log = drive_camera(stage, config, OURS, keep)
    stop_and_go.write(file, stop_and_go.record(stage, log))


def _result_line(target: _Target, results: list[StopAndGo]) -> str:
    values = [target.value(result) for result in results]
    worst = min(values) if target.is_minimum else max(values)
    missed = sum(target.missed(result) for result in results)
    verdict = "all reach it" if not missed else f"{missed} of {len(results)} miss it"
    sign = ">=" if target.is_minimum else "<="
    return (
        f"median {markdown.fixed(float(np.median(values)))}, worst {markdown.fixed(worst)}; "
        f"{sign} {target.limit:g}: {verdict}"
    )


def _write(options: StopAndGoOptions, results: dict[int, StopAndGo]) -> None:
    command = (
        f"treadwatch stop-and-go --drives {options.drives} --seed {options.seed} --mode {options.mode} "
        f"--report {shlex.quote(str(options.report))}{config_option_text(options.config_path)}"
    )
    lines = ["# Stop and go", "", f"    {command}", ""]
    lines += markdown.section(
        "Nav2's bag metrics",
        """A person steps into the way, stands, and leaves it. Stopped is 0.02 m/s, driving 0.10 m/s, three
        samples in a row. A stop is due from when the free way is no longer than a comfortable stop needs.
        Decided: until the decision says faster.""",
        """Two references come from physics alone: a comfortable stop from the speed at which the stop is due,
        at constant speed until then, down to 0 m/s; and a start from rest to 0.10 m/s at the jerk limit. The
        targets hold for what is beyond them. They are no parts of the measured times: the robot may have
        begun before the stop was due, or before the way was free, and then beyond is less or negative.""",
    )
    head = (
        "seed", "to stop s", "comfortable stop s", "hold", "to resume s", "start from rest s", "decided s",
        "false stops",
    )  # fmt: skip
    lines += markdown.table(head, [[str(seed), *_cells(result)] for seed, result in results.items()])
    lines += markdown.table(
        ("metric", "result"),
        [(target.name, _result_line(target, list(results.values()))) for target in TARGETS],
    )
    content = {"command": command, "drives": {seed: result.as_dict() for seed, result in results.items()}}
    try:
        (options.report / "report.md").write_text("\n".join(lines), encoding="utf-8")
        (options.report / "summary.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(f"{options.report}: the report cannot be written ({error.strerror})") from error


def _cells(result: StopAndGo) -> list[str]:
    share = "n/a" if math.isnan(result.hold_share) else f"{100 * result.hold_share:.1f} %"
    return [
        markdown.fixed(result.to_stop_s, 2),
        markdown.fixed(result.braking_s, 2),
        share,
        markdown.fixed(result.to_resume_s, 2),
        markdown.fixed(result.starting_s, 2),
        markdown.fixed(result.to_decide_s, 2),
        f"{100 * result.false_stop_share:.2f} %",
    ]
