"""`treadwatch campaign`: thousands of missions, or one of them alone."""

from __future__ import annotations

import math
import shlex
import sys
import time
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import click

from config.app import AppConfig, LockstepRunner, load_app
from config.scenario import Scenario
from controller.campaign.judge import Row
from controller.campaign.own_scenarios import OwnScenario, keep_own, kept_scenarios, label_of, load_own
from controller.campaign.plan import Mission, missions, run_local, run_on_cluster
from controller.campaign.policies import OURS, POLICY_NAMES
from controller.campaign.report import config_option_text, number_or_never, write_report
from controller.campaign.store import MissionStore
from controller.campaign.summary import Summary, why_failed
from controller.campaign.task import Mode, Task, failed, run_task, time_ratio
from controller.errors import Interrupted, UserError
from controller.terminal.outlet import say
from sim.families import FAMILY_NAMES

FAILING = "failing"
_MOST_NAMED = 6  # failed missions that are named in the terminal


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """The command line of `treadwatch campaign`.

    families: empty means all of them, or none where scenarios are given.
    policies: empty means all of them.
    only: FAMILY:SEED or FILE:SEED, a single mission.
    video: keep recordings and videos of the missions that fail; of a single mission in any case.
    scenarios: of the user's own: files, or names of those that ship.
    """

    config_path: Path
    missions: int
    families: tuple[str, ...]
    policies: tuple[str, ...]
    mode: Mode
    workers: int
    seed: int
    report: Path | None
    resume: bool = False
    scheduler: str | None = None
    only: str | None = None
    video: bool = False
    quiet: bool = False
    scenarios: tuple[str, ...] = ()


def run_campaign(options: CampaignOptions) -> int:
    """Run a campaign; return the exit code: 1 if our policy failed in any mission. Raises ConfigError,
    UserError."""
    config = load_app(options.config_path)
    _check(options, config)
    own = load_own(options.scenarios, config)
    if options.only is not None:
        return _run_one(options, config, _parse_mission(options.only, own, config))
    assert options.report is not None
    families = (options.families or (() if own else FAMILY_NAMES)) + tuple(own)
    policies = options.policies or POLICY_NAMES
    store = MissionStore(options.report, config.model_dump_json(indent=1))
    store.begin(options.resume)
    _check_modes(options, store)
    keep_own(options.report, own, {row.family for row in store.rows.values()})
    keep = options.report / FAILING if options.video else None
    named = list(missions(options.missions, families, options.seed))
    tasks = []
    for mission in named:
        to_drive = tuple(name for name in policies if (mission.family, mission.seed, name) not in store.rows)
        if to_drive:
            world = own[mission.family].scenario if mission.family in own else None
            task = Task(mission.family, mission.seed, to_drive, options.mode, config, keep, scenario=world)
            tasks.append(task)
    began_s = time.perf_counter()
    try:
        _run_all(options, tasks, store)
    except KeyboardInterrupt:
        done = f"{len(store.rows)} drives are in {store.path}" if store.rows else "no drive was done yet"
        raise Interrupted(f"{done}; the same command with --resume goes on") from None
    store.rewrite()
    summary = write_report(
        options.report,
        store.rows.values(),
        command_line(options),
        f"treadwatch campaign --mode {options.mode}{config_option_text(options.config_path)} --only",
        kept_scenarios(options.report),
    )
    _print_summary(summary, len(tasks), time.perf_counter() - began_s, options.report)
    _note_earlier(store, named)
    return int(any(failed(row) for row in store.rows.values() if row.policy == OURS))


def _note_earlier(store: MissionStore, named: list[Mission]) -> None:
    earlier = {(row.family, row.seed) for row in store.rows.values()}
    earlier -= {(mission.family, mission.seed) for mission in named}
    if earlier:
        say(
            f"note     the folder holds {len(earlier)} missions more than this command asks for; "
            "they are in the report, too"
        )


def _run_all(options: CampaignOptions, tasks: list[Task], store: MissionStore) -> None:
    hidden = options.quiet or not sys.stderr.isatty()
    with (
        # Closed here, so that the workers end whenever this block ends, not when the garbage is collected.
        closing(_execute(options, tasks)) as done,
        click.progressbar(length=len(tasks), label="missions", file=sys.stderr, hidden=hidden) as bar,
    ):
        for rows in done:
            store.add(rows)
            bar.update(1)


def _execute(options: CampaignOptions, tasks: list[Task]) -> Generator[list[Row], None, None]:
    if options.scheduler is not None:
        return run_on_cluster(tasks, options.scheduler)
    return run_local(tasks, options.workers)


def _check(options: CampaignOptions, config: AppConfig) -> None:
    if config.camera.kind != "simulated" or not isinstance(config.runner, LockstepRunner):
        raise UserError(
            f"{options.config_path}: a campaign needs camera.kind 'simulated' and runner.kind 'lockstep'"
        )
    for option, names, known in (
        ("--families", options.families, FAMILY_NAMES),
        ("--policies", options.policies, POLICY_NAMES),
    ):
        unknown = [name for name in names if name not in known]
        if unknown:
            raise UserError(f"{option} {unknown[0]}: there is no such name; choose among {', '.join(known)}")
    if options.only is None and options.report is None:
        raise UserError("--report: give a folder for missions.jsonl and the report (or --only FAMILY:SEED)")
    if options.video and options.mode != "camera":
        raise UserError("--video needs --mode camera: without a camera there is nothing to film")


def _check_modes(options: CampaignOptions, store: MissionStore) -> None:
    """Raise UserError if the store has rows of another mode: rows are identified by family, seed and policy
    only, so those missions would count as done."""
    other = next((row.mode for row in store.rows.values() if row.mode != options.mode), None)
    if other is not None:
        raise UserError(
            f"{store.path}: was driven with --mode {other}; go on so, or give another --report folder"
        )


def _parse_mission(
    text: str, own: dict[str, OwnScenario], config: AppConfig
) -> tuple[Mission, Scenario | None]:
    """The mission of --only, and its world where it is a scenario file. Raises ConfigError, UserError."""
    family, _, seed = text.rpartition(":")
    is_file = family.endswith((".yaml", ".yml"))
    if not (family in FAMILY_NAMES or is_file) or not (seed.isascii() and seed.isdecimal()):
        raise UserError(
            f"--only {text}: give FAMILY:SEED, for example crossing_left:7, or FILE.yaml:SEED; families are: "
            f"{', '.join(FAMILY_NAMES)}"
        )
    if not is_file:
        return Mission(family, int(seed)), None
    one = own.get(family) or next(iter(load_own((family,), config).values()))
    return Mission(label_of(family), int(seed)), one.scenario


def _run_one(options: CampaignOptions, config: AppConfig, to_drive: tuple[Mission, Scenario | None]) -> int:
    """Run one mission in this process; write a line for each policy."""
    mission, scenario = to_drive
    policies = options.policies or (OURS,)
    keep = None
    if options.video:
        keep = (options.report or Path("out")) / f"{mission.family}-{mission.seed}"
    task = Task(
        mission.family, mission.seed, policies, options.mode, config, keep, keep_all=True, scenario=scenario
    )
    rows = run_task(task)
    for row in rows:
        say(format_row(row))
    if keep is not None:
        say(f"recording     {keep}")
    return int(any(failed(row) for row in rows))


def format_row(row: Row) -> str:
    """A row as a line of text."""
    if row.time_s is None:
        took = "not reached" if row.expected else "not reached, as it should be"
    else:
        ratio = time_ratio(row)
        compared = "not compared with the oracle" if math.isnan(ratio) else f"{ratio:.2f} x the oracle's"
        took = f"reached in {row.time_s:.2f} s, {compared}"
    verdict = f"FAILED: {why_failed(row)}" if failed(row) else "ok"
    return (
        f"{row.policy:<8} {took}; contacts {row.contacts} ({row.contacts_at_fault} at fault), "
        f"clearance {row.min_clearance_m:.2f} m, false stops {row.false_stops}, flaps {row.flaps}: {verdict}"
    )


def command_line(options: CampaignOptions) -> str:
    """The command that repeats the campaign."""
    parts = [
        f"treadwatch campaign --missions {options.missions} --mode {options.mode} --seed {options.seed}"
        f"{config_option_text(options.config_path)}"
    ]
    parts.extend(f"--scenario {shlex.quote(scenario)}" for scenario in options.scenarios)
    if options.families:
        parts.append(f"--families {','.join(options.families)}")
    if options.policies:
        parts.append(f"--policies {','.join(options.policies)}")
    parts.append(f"--workers {options.workers} --report {shlex.quote(str(options.report))}")
    return " ".join(parts)


def _print_summary(summary: Summary, count: int, took_s: float, folder: Path) -> None:
    for name, totals in summary.policies.items():
        median, p90 = number_or_never(totals.ratio_median), number_or_never(totals.ratio_p90)
        say(
            f"{name:<8} {totals.missions} missions, reached {totals.reached}/{totals.expected}, "
            f"contacts {totals.contacts} ({totals.contacts_at_fault} at fault), "
            f"time over the oracle's {median} (p90 {p90}), false stops {totals.false_stops}, "
            f"flaps {totals.flaps}, outside limits {totals.limit_violations}"
        )
    failing = [f"{family}:{seed}" for family, seed, policy, _ in summary.failing if policy == OURS]
    if failing:
        more = f" and {len(failing) - _MOST_NAMED} more" if len(failing) > _MOST_NAMED else ""
        say(f"failed   {', '.join(failing[:_MOST_NAMED])}{more} ({OURS})")
    if count:
        say(f"speed    {count} missions in {took_s:.1f} s: {count / took_s:.2g} a second")
    say(f"report   {folder / 'report.md'}")
