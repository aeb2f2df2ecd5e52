"""`treadwatch run`: put the parts together, drive the path, and print a summary."""

from __future__ import annotations

from config.app import AppConfig, LockstepRunner, load_app
from controller.errors import UserError
from controller.mission.blind_bends import blind_bend_warning
from controller.mission.close_by import close_by_warning
from controller.mission.floor_view import floor_view_warning
from controller.mission.lockstep_drive import drive_lockstep
from controller.mission.options import MissionOptions, scenario_as_typed
from controller.mission.possible_world import require_possible_world
from controller.mission.realtime_drive import drive_realtime
from controller.mission.scenario_faults import unused_faults_warning, with_scenario_faults
from controller.mission.short_arcs import short_arc_warning
from controller.mission.summary import summary_rows
from controller.mission.unseen_bodies import unseen_bodies_warning
from controller.record.observations import STANDARD_OUTPUT
from controller.terminal.console import Console

_WARNINGS = (
    short_arc_warning,
    close_by_warning,
    unseen_bodies_warning,
    floor_view_warning,
    blind_bend_warning,
    unused_faults_warning,
)


def run_mission(options: MissionOptions) -> int:
    """Drive once; returns the exit code: 0 if it succeeded (MissionResult.succeeded), else 1.

    Raises ConfigError, HalError, UserError.
    """
    config = load_for_drive(options)
    if config.governor is not None:
        raise UserError(
            f"{options.config_path}: has a 'governor' and no path to drive; use `treadwatch govern`"
        )
    console = Console(options.quiet, aside=options.observations == STANDARD_OUTPUT)
    require_possible_world(config)
    for warning_of in _WARNINGS:
        warning = warning_of(config)
        if warning is not None:
            console.warning(warning)
    if isinstance(config.runner, LockstepRunner):
        result = drive_lockstep(config, config.runner, options, console)
    else:
        result = drive_realtime(config, config.runner, options, console)
    console.summary(summary_rows(config, result))
    return 0 if result.succeeded else 1


def load_for_drive(options: MissionOptions) -> AppConfig:
    """The configuration of a drive: of the file, with what the command line and the scenario change in it.

    Raises ConfigError, UserError.
    """
    return with_scenario_faults(with_overrides(load_app(options.config_path), options))


def with_overrides(config: AppConfig, options: MissionOptions) -> AppConfig:
    """The configuration with another scenario or seed. Raises UserError where nothing is simulated."""
    changes: dict[str, object] = {}
    if options.scenario is not None:
        changes["scenario"] = scenario_as_typed(options.scenario)
    if options.seed is not None:
        changes["seed"] = options.seed
    if not changes:
        return config
    if config.simulation is None:
        raise UserError(
            f"--{' and --'.join(changes)}: {options.config_path} simulates nothing; leave the option out"
        )
    return config.model_copy(update={"simulation": config.simulation.model_copy(update=changes)})
