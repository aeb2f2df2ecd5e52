"""`treadwatch govern`: another planner drives, treadwatch limits the speed."""

from __future__ import annotations

from dataclasses import dataclass

from config.app import AppConfig, RealtimeRunner
from config.governor import GovernorConfig, InputConfig, UdpInputConfig
from controller.base.drive_lifecycle import Outcome
from controller.build import open_commands
from controller.control import ControlStep
from controller.errors import UserError
from controller.governor.build import build_governor_loop
from controller.governor.inbox import Inbox
from controller.governor.loop import GovernorLoop
from controller.mission.command import load_for_drive
from controller.mission.options import MissionOptions
from controller.mission.possible_world import require_possible_world
from controller.mission.result import DriveResult
from controller.mission.scenario_faults import unused_faults_warning
from controller.mission.summary import drive_rows
from controller.realtime.rig import realtime_rig
from controller.realtime.service import ServiceManager
from controller.record.observations import STANDARD_OUTPUT
from controller.record.tally import SetpointTally
from controller.terminal.console import Console


@dataclass(kw_only=True)
class Governing(DriveResult):
    """The result of a drive with the governor."""

    loop: GovernorLoop
    inbox: Inbox

    @property
    def succeeded(self) -> bool:
        """Whether it ended on request, without contact, within the limits."""
        return self.loop.lifecycle.outcome is Outcome.STOPPED and self.clean


def run_governor(options: MissionOptions) -> int:
    """Govern until SIGTERM. Exit code 0 where Governing says that it succeeded, else 1.

    Raises ConfigError, HalError, UserError.
    """
    config = load_for_drive(options)
    if config.governor is None:
        raise UserError(f"{options.config_path}: has no 'governor' section; add one (docs/governor.md)")
    assert isinstance(config.runner, RealtimeRunner), "a governor in lock-step is refused by AppConfig"
    console = Console(options.quiet, aside=options.observations == STANDARD_OUTPUT)
    require_possible_world(config)
    warning = unused_faults_warning(config)
    if warning is not None:
        console.warning(warning)
    governing = _govern(config, config.governor, config.runner, options, console)
    console.summary(_summary_rows(config, governing))
    return 0 if governing.succeeded else 1


def _govern(
    config: AppConfig,
    governor: GovernorConfig,
    runner: RealtimeRunner,
    options: MissionOptions,
    console: Console,
) -> Governing:
    with (
        realtime_rig(config, runner, options.recording()) as rig,
        open_commands(config) as link,
    ):
        inbox = Inbox(link, governor, console.event)
        loop = build_governor_loop(config, rig.chassis, inbox)
        setpoints = SetpointTally(config.robot.limits, 1.0 / runner.control_rate_hz)
        governing = Governing(
            loop=loop,
            inbox=inbox,
            setpoints=setpoints,
            simulation=rig.simulation,
            punctuality=rig.punctuality,
            cut_off=rig.cut_off,
        )

        def ready(service: ServiceManager) -> None:
            console.event(f"ready: commands are heard on {_where(config, governor.input)}")
            service.ready("governing")

        with rig.under_way(loop, console, ready) as moments:
            for moment in moments:
                governing.take(moment.control)
                for message in moment.arrived:
                    governing.take_message(message)
                _report(console, governing, moment.control)
    return governing


def _where(config: AppConfig, given: InputConfig) -> str:
    if isinstance(given, UdpInputConfig):
        return f"udp {given.host}:{given.port}"
    return str(config.resolve(given.path))


def _report(console: Console, governing: Governing, step: ControlStep) -> None:
    seconds = governing.seconds(step)
    console.progress(0.0, f"{step.setpoint.v_mps:4.2f} m/s  {step.decision.reason.sentence}")
    console.decision(seconds, step.decision, step.setpoint.v_mps)
    console.standing(seconds, governing.standstill.elapsed_s(step.now_ns), step.decision)
    console.unanswered(seconds, step.unanswered)
    console.complaints(seconds, governing.complaints.add(step.chassis.faults), step.chassis.battery_v)


def _summary_rows(config: AppConfig, governing: Governing) -> list[tuple[str, str]]:
    rows = [("governor", _drive_text(governing)), ("commands", _commands_text(governing.inbox))]
    return rows + drive_rows(config, governing)


def _drive_text(governing: Governing) -> str:
    last, loop = governing.last, governing.loop
    ended = "ended" if loop.lifecycle.outcome is None else loop.lifecycle.outcome.value
    if last is None:
        return ended
    driven = f"{last.progress_m:.2f} m in {governing.duration_s:.1f} s"
    return f"{ended} ({loop.lifecycle.stop_reason}); {driven}"


def _commands_text(inbox: Inbox) -> str:
    text = f"{inbox.accepted} accepted"
    for kind, count in sorted(inbox.dropped.items()):
        text += f", {count} {kind}"
    return text
