"""`treadwatch govern`: another planner drives, treadwatch decides how fast."""

from __future__ import annotations

from dataclasses import dataclass, field

from config.app import AppConfig, RealtimeRunner, load_app
from config.governor import GovernorConfig, InputConfig, UdpInputConfig
from controller.build import open_commands
from controller.console import Console
from controller.control import ControlStep
from controller.ending import Outcome
from controller.errors import UserError
from controller.governor.build import build_governor_loop, build_inbox
from controller.governor.inbox import Inbox
from controller.governor.loop import GovernorLoop
from controller.mission import with_overrides
from controller.possible_world import require_possible_world
from controller.realtime.rig import realtime_rig
from controller.realtime.runner import Punctuality
from controller.realtime.service import ServiceManager
from controller.record.observations import STANDARD_OUTPUT
from controller.record.tally import (
    Complaints,
    FrameTally,
    SetpointTally,
    ShaperFaults,
    Standstill,
    TimingTally,
)
from controller.result import MissionOptions
from controller.summary import contact_text, limits_text, punctuality_text
from hal.clocks import NS_PER_S
from sim.simulation import Simulation


@dataclass
class Governing:
    """What the summary is made of."""

    loop: GovernorLoop
    inbox: Inbox
    setpoints: SetpointTally
    timing: TimingTally
    simulation: Simulation | None
    punctuality: Punctuality
    first: ControlStep | None = None
    last: ControlStep | None = None
    standstill: Standstill = field(default_factory=Standstill)
    shaper_faults: ShaperFaults = field(default_factory=ShaperFaults)
    complaints: Complaints = field(default_factory=Complaints)
    frames: FrameTally = field(default_factory=FrameTally)

    @property
    def succeeded(self) -> bool:
        """Ended as asked, nothing touched, limits kept."""
        contacts = [] if self.simulation is None else self.simulation.referee.contacts
        return self.loop.ending.outcome is Outcome.STOPPED and not contacts and self.setpoints.violations == 0

    def take(self, step: ControlStep) -> None:
        """Account for one control step."""
        self.first = self.first or step
        self.last = step
        self.setpoints.add(step.chassis.sent, step.chassis.mode)
        self.standstill.add(step.setpoint)
        self.shaper_faults.add(step.fault)


def run_governor(options: MissionOptions) -> int:
    """Govern until SIGTERM; the exit code: 0, or 1 if anything was touched, broken or given up.

    Raises ConfigError, HalError, UserError.
    """
    config = with_overrides(load_app(options.config_path), options)
    if config.governor is None:
        raise UserError(f"{options.config_path}: has no 'governor' section; add one (docs/governor.md)")
    assert isinstance(config.runner, RealtimeRunner), "a governor in lock-step is refused by AppConfig"
    console = Console(options.quiet, aside=options.observations == STANDARD_OUTPUT)
    require_possible_world(config, options.config_path)
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
    with realtime_rig(config, runner, options) as rig, open_commands(governor.input) as link:
        inbox = build_inbox(link, governor, console.event)
        loop = build_governor_loop(config, options.config_path, rig.chassis, inbox)
        setpoints = SetpointTally(config.robot.limits, 1.0 / runner.control_rate_hz)
        governing = Governing(loop, inbox, setpoints, TimingTally(), rig.simulation, rig.punctuality)

        def ready(service: ServiceManager) -> None:
            console.event(f"ready: commands are heard on {_where(governor.input)}")
            service.ready("governing")

        with rig.under_way(loop, console, ready) as moments:
            for moment in moments:
                governing.take(moment.control)
                for message in moment.arrived:
                    governing.timing.add(message.timing_ms)
                    governing.frames.add(message.scene.sequence)
                _report(console, governing, moment.control)
    return governing


def _where(config: InputConfig) -> str:
    return f"udp {config.host}:{config.port}" if isinstance(config, UdpInputConfig) else config.path


def _report(console: Console, governing: Governing, step: ControlStep) -> None:
    assert governing.first is not None
    seconds = (step.now_ns - governing.first.now_ns) / NS_PER_S
    console.progress(0.0, f"{step.setpoint.v_mps:4.2f} m/s  {step.decision.reason.sentence}")
    console.decision(seconds, step.decision, step.setpoint.v_mps)
    console.standing(seconds, governing.standstill.lasted_s(step.now_ns), step.decision)
    console.complaints(seconds, governing.complaints.add(step.chassis.faults))


def _summary_rows(config: AppConfig, governing: Governing) -> list[tuple[str, str]]:
    rows = [("governor", _drive_text(governing)), ("commands", _commands_text(governing.inbox))]
    if governing.simulation is not None:
        rows.append(("contacts", contact_text(governing.simulation)))
    rows.append(("limits", limits_text(config, governing.setpoints)))
    if governing.shaper_faults.count:
        rows.append(("shaper", governing.shaper_faults.line()))
    if governing.complaints.told:
        rows.append(("base", governing.complaints.line()))
    rows.append(("perception", governing.timing.line()))
    if governing.frames.line():
        rows.append(("frames", governing.frames.line()))
    if governing.punctuality.late_ns:
        rows.append(("control", punctuality_text(governing.punctuality)))
    return rows


def _drive_text(governing: Governing) -> str:
    first, last, loop = governing.first, governing.last, governing.loop
    ended = "ended" if loop.ending.outcome is None else loop.ending.outcome.value
    if first is None or last is None:
        return ended
    seconds = (last.now_ns - first.now_ns) / NS_PER_S
    return f"{ended} ({loop.ending.stop_reason}); {last.progress_m:.2f} m in {seconds:.1f} s"


def _commands_text(inbox: Inbox) -> str:
    text = f"{inbox.accepted} obeyed"
    for kind, count in sorted(inbox.dropped.items()):
        text += f", {count} {kind}"
    return text
