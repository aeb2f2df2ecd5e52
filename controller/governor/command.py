"""`treadwatch govern`: another planner drives, treadwatch decides how fast."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import dataclass, field

from config.app import AppConfig, RealtimeRunner, load_app
from config.governor import GovernorConfig, InputConfig, UdpInputConfig
from controller.build import build_path, build_simulation, open_commands
from controller.build_chassis import build_base
from controller.console import Console
from controller.control import ControlStep
from controller.ending import Outcome
from controller.errors import UserError
from controller.governor.build import build_governor_loop, build_inbox
from controller.governor.inbox import Inbox
from controller.governor.loop import GovernorLoop
from controller.mission import with_overrides
from controller.punctual import PunctualChassis
from controller.realtime import Punctuality, run_realtime
from controller.realtime_mission import HEAD_START_S, perception_beside
from controller.recorder import RecordingOptions
from controller.result import MissionOptions
from controller.scheduling import become_realtime
from controller.service import ServiceManager, stop_on_signals
from controller.summary import contact_text, limits_text, punctuality_text
from controller.tally import SetpointTally, ShaperFaults, Standstill, TimingTally
from hal.clocks import NS_PER_S, MonotonicClock
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

    @property
    def succeeded(self) -> bool:
        """Ended as asked, nothing touched, limits kept."""
        contacts = [] if self.simulation is None else self.simulation.referee.contacts
        return self.loop.ending.outcome is Outcome.STOPPED and not contacts and self.setpoints.violations == 0

    def take(self, step: ControlStep) -> None:
        """Account for one control step."""
        self.first = self.first or step
        self.last = step
        self.setpoints.add(step.chassis.sent)
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
    console = Console(options.quiet)
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
    clock = MonotonicClock()
    start_ns = clock.now_ns() + round(HEAD_START_S * NS_PER_S)
    start = build_path(config, options.config_path).start
    chassis, emulator = build_base(config, start, clock.now_ns())
    simulation = None
    if emulator is not None:
        simulation = build_simulation(config, options.config_path, emulator, start_ns)
    service = ServiceManager(os.environ, os.getpid())
    recording = RecordingOptions(options.observations, options.video)
    with ExitStack() as devices:
        link = devices.enter_context(open_commands(governor.input))
        if simulation is not None:
            devices.enter_context(simulation)
        period_ns = round(NS_PER_S / runner.control_rate_hz)
        punctual = devices.enter_context(PunctualChassis(chassis, clock, period_ns))
        inbox = build_inbox(link, governor, console.event)
        loop = build_governor_loop(config, options.config_path, punctual, inbox)
        perception = devices.enter_context(
            perception_beside(config, options.config_path, start_ns, recording)
        )
        stop = devices.enter_context(stop_on_signals())
        setpoints = SetpointTally(config.robot.limits, 1.0 / runner.control_rate_hz)
        governing = Governing(loop, inbox, setpoints, TimingTally(), simulation, Punctuality())
        # Last, so that the processes and threads started before keep ordinary scheduling.
        for refused in become_realtime(runner.priority):
            console.event(f"not permitted, running without: {refused}")
        moments = run_realtime(
            runner, clock, simulation, perception, loop, service, stop, governing.punctuality
        )
        told_ready = told_stopping = False
        for moment in moments:
            governing.take(moment.control)
            for message in moment.arrived:
                governing.timing.add(message.timing_ms)
            if perception.newest is not None and not told_ready:
                told_ready = True
                console.event(f"ready: commands are heard on {_where(governor.input)}")
                service.ready("governing")
            if loop.ending.stop_reason is not None and not told_stopping:
                told_stopping = True
                service.stopping(loop.ending.stop_reason)
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


def _summary_rows(config: AppConfig, governing: Governing) -> list[tuple[str, str]]:
    rows = [("governor", _drive_text(governing)), ("commands", _commands_text(governing.inbox))]
    if governing.simulation is not None:
        rows.append(("contacts", contact_text(governing.simulation)))
    rows.append(("limits", limits_text(config, governing.setpoints)))
    if governing.shaper_faults.count:
        rows.append(("shaper", governing.shaper_faults.line()))
    rows.append(("perception", governing.timing.line()))
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
