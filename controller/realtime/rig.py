"""Everything around the loop of a drive in real time: base, world, perception process, service manager."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from typing import Protocol

from config.app import AppConfig, RealtimeRunner
from controller.base.drive_lifecycle import DriveLifecycle, Outcome
from controller.build import build_path, build_simulation, require_camera
from controller.build_chassis import build_base
from controller.control import Drive
from controller.realtime.channel import Channel, channel_sockets
from controller.realtime.perception_link import PerceptionLink
from controller.realtime.perception_process import perceive_forever
from controller.realtime.punctual import PunctualChassis
from controller.realtime.runner import Punctuality, RealtimeMoment, run_realtime
from controller.realtime.scheduling import become_realtime
from controller.realtime.service import ServiceManager, StopRequest
from controller.record.recorder import RecordingOptions, require_writable
from controller.terminal.console import Console
from controller.workers import held
from hal.clocks import NS_PER_S, MonotonicClock
from hal.errors import DeviceRefused
from sim.simulation import Simulation

# A simulated world starts this much later, because the perception process must import and open the camera.
HEAD_START_S = 3.0
GOODBYE_S = 5.0  # the perception process is killed if it has not ended after this time


class DriveWithLifecycle(Drive, Protocol):
    """A loop that says whether, how and why its drive has ended."""

    @property
    def lifecycle(self) -> DriveLifecycle: ...


@dataclass(frozen=True, slots=True)
class RealtimeRig:
    """The parts of a drive.

    recording: the files that the perception process writes.
    start_ns: time zero of a simulated world.
    chassis: open; sends each command at a fixed time within its period.
    simulation: the world of a simulated camera; None with a real one.
    punctuality: filled while it drives.
    cut_off: why outputs are not whole; filled until perception has ended.
    """

    config: AppConfig
    runner: RealtimeRunner
    recording: RecordingOptions
    clock: MonotonicClock
    start_ns: int
    chassis: PunctualChassis
    simulation: Simulation | None
    punctuality: Punctuality
    cut_off: list[str] = field(default_factory=list)

    @contextmanager
    def under_way(
        self, loop: DriveWithLifecycle, console: Console, on_ready: Callable[[ServiceManager], None]
    ) -> Iterator[Iterator[RealtimeMoment]]:
        """The control steps of a drive with this loop, until it has finished. Perception ends with the block.

        From now on signals are requests to stop, after the block, too: see StopRequest.
        on_ready: called once, when the first scene has arrived.
        """
        service = ServiceManager(os.environ, os.getpid())
        stop = StopRequest().listen()
        with (
            perception_beside(self.config, self.start_ns, self.recording) as link,
            console.beside_a_drive(),
        ):
            # After all else, so that processes and threads started before keep ordinary scheduling.
            for refused in become_realtime(self.runner.priority):
                console.event(f"not permitted, running without: {refused}")
            moments = run_realtime(
                self.runner, self.clock, self.simulation, link, loop, stop, self.punctuality
            )
            try:
                yield self._told(moments, loop.lifecycle, link, service, console, on_ready)
            except BaseException:
                # Ending the perception process takes seconds; the base must not drive on meanwhile.
                self.chassis.stop(self.clock.now_ns())
                raise
            finally:
                # The watchdog is no longer fed, and perception takes seconds to end and to close its files.
                service.stopping(_why_over(loop.lifecycle))
                stop.closing()
        warn_of_cut_off(link, self.cut_off, console)

    def _told(
        self,
        moments: Iterator[RealtimeMoment],
        lifecycle: DriveLifecycle,
        link: PerceptionLink,
        service: ServiceManager,
        console: Console,
        on_ready: Callable[[ServiceManager], None],
    ) -> Iterator[RealtimeMoment]:
        """Passes the moments on; tells the service manager that the drive goes on, is ready or is stopping.

        Raises DeviceRefused at the end if perception could not start: without a scene nothing has moved.
        """
        told_ready = False
        for moment in moments:
            service.feed_watchdog(moment.control.now_ns)
            if link.newest is not None and not told_ready:
                told_ready = True
                on_ready(service)
            warn_of_cut_off(link, self.cut_off, console, "; the drive goes on without it")
            if lifecycle.stop_reason is not None:
                service.stopping(lifecycle.stop_reason)
            yield moment
        if link.refused_reason is not None and lifecycle.outcome is Outcome.BROKEN_OFF:
            raise DeviceRefused(f"{link.refused_reason}; nothing has moved")


def _why_over(lifecycle: DriveLifecycle) -> str:
    if lifecycle.stop_reason is not None:
        return lifecycle.stop_reason
    return "ended by an error" if lifecycle.outcome is None else lifecycle.outcome.value


@contextmanager
def realtime_rig(
    config: AppConfig, runner: RealtimeRunner, recording: RecordingOptions
) -> Iterator[RealtimeRig]:
    """Open the base, and the simulated world if there is one. Raises ConfigError, HalError, UserError."""
    require_camera(config)
    require_writable(recording)
    clock = MonotonicClock()
    start_ns = clock.now_ns() + round(HEAD_START_S * NS_PER_S)
    start = build_path(config).start
    chassis, emulator = build_base(config, start, clock.now_ns())
    simulation = None
    if emulator is not None:
        simulation = build_simulation(config, emulator, start_ns)
    with ExitStack() as devices:
        if simulation is not None:
            devices.enter_context(simulation)
        period_ns = round(NS_PER_S / runner.control_rate_hz)
        punctual = devices.enter_context(PunctualChassis(chassis, clock, period_ns))
        yield RealtimeRig(
            config=config,
            runner=runner,
            recording=recording,
            clock=clock,
            start_ns=start_ns,
            chassis=punctual,
            simulation=simulation,
            punctuality=Punctuality(),
        )


def warn_of_cut_off(link: PerceptionLink, cut_off: list[str], console: Console, more: str = "") -> None:
    """Warn of the outputs that have ended since the last call, and append why to cut_off."""
    for reason in link.take_cut_off():
        cut_off.append(reason)
        console.warning(reason + more)


@contextmanager
def perception_beside(
    config: AppConfig, start_ns: int, recording: RecordingOptions
) -> Iterator[PerceptionLink]:
    """Run the perception process during the block.

    At the end of the block its channel closes, which makes it end. What it reports of its files until then is
    in the link. start_ns: time zero of a simulated world.
    """
    here, there = channel_sockets()
    process: BaseProcess = multiprocessing.get_context("spawn").Process(
        target=perceive_forever,
        args=(config, there, start_ns, recording),
        name="perception",
        daemon=True,
    )
    # The process inherits that these signals are blocked. Otherwise Ctrl-C or a closed terminal would end
    # the camera before the robot has come to rest.
    with held(signal.SIGINT, signal.SIGHUP):
        process.start()
    # Only the perception process may hold its end open, or this process would not notice its death.
    there.close()
    channel = Channel(here)
    link = PerceptionLink(channel)
    try:
        yield link
    finally:
        channel.end_sending()
        process.join(GOODBYE_S)
        link.receive()
        if process.is_alive():
            process.kill()
            process.join()
            if recording.paths:
                names = ", ".join(map(str, recording.paths))
                why = f"they were not closed within {GOODBYE_S:g} s; is the disk too slow?"
                link.cut_off.append(f"{names}: may not be whole: {why}")
        channel.close()
