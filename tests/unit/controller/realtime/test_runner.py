from collections.abc import Iterator

import pytest

from config.app import RealtimeRunner
from controller.base.drive_lifecycle import Outcome
from controller.realtime.channel import Channel, channel_sockets
from controller.realtime.messages import CutOff, Farewell, SceneMessage, StepMessage
from controller.realtime.perception_link import PerceptionLink
from controller.realtime.runner import Punctuality, run_realtime
from controller.realtime.service import StopRequest
from hal.types import PlanarPose
from tests.support.runner_doubles import RecordingDrive, control_step
from tests.support.scenes import scene

MS = 1_000_000
RUNNER = RealtimeRunner(kind="realtime", control_rate_hz=50)


class LateClock:
    """Wakes up late by what it is told, once each."""

    def __init__(self, late_ms: dict[int, int]) -> None:
        self._now_ns = 0
        self._late_ms = late_ms

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        late_ns = self._late_ms.pop(deadline_ns // MS, 0) * MS
        self._now_ns = max(self._now_ns, deadline_ns) + late_ns


Ends = tuple[PerceptionLink, Channel]


@pytest.fixture
def ends() -> Iterator[Ends]:
    here, there = channel_sockets()
    with here, there:
        yield PerceptionLink(Channel(here)), Channel(there)


def steps_of(
    loop: RecordingDrive, link: PerceptionLink, clock: LateClock, runner: RealtimeRunner = RUNNER
) -> Punctuality:
    punctuality = Punctuality()
    stop = StopRequest()
    for _ in run_realtime(runner, clock, None, link, loop, stop, punctuality):
        pass
    return punctuality


def test_steps_keep_absolute_deadlines(ends: Ends) -> None:
    link, _there = ends
    loop = RecordingDrive(steps=4)
    steps_of(loop, link, LateClock({20: 3}))
    # 3 ms late once: the next step is on time again, not 3 ms later.
    assert [now_ns // MS for now_ns, _ in loop.seen] == [0, 23, 40, 60]


def test_an_overrun_skips_whole_periods_and_keeps_the_phase(ends: Ends) -> None:
    link, _there = ends
    loop = RecordingDrive(steps=3)
    punctuality = steps_of(loop, link, LateClock({20: 50}))
    assert [now_ns // MS for now_ns, _ in loop.seen] == [0, 70, 80]
    assert punctuality.skipped == 2
    assert list(punctuality.late_ns) == [0, 50 * MS, 0]


def test_the_newest_scene_is_used_and_none_is_lost(ends: Ends) -> None:
    link, there = ends
    for sequence in range(3):
        there.send(SceneMessage(scene(sequence=sequence), {}))
    assert [message.scene.sequence for message in link.receive()] == [0, 1, 2]
    assert link.newest is not None
    assert link.newest.scene.sequence == 2


def test_perception_that_ends_says_why_and_the_robot_stops(ends: Ends) -> None:
    link, there = ends
    there.send(Farewell("camera: unplugged"))
    loop = RecordingDrive(steps=100)
    steps_of(loop, link, LateClock({}))
    assert loop.stop_reasons == ["perception is lost: camera: unplugged"]
    assert loop.endings == [Outcome.BROKEN_OFF]
    assert link.refused_reason == "camera: unplugged"


@pytest.mark.parametrize("received_before", [True, False])
def test_perception_that_has_seen_something_did_not_refuse(ends: Ends, received_before: bool) -> None:
    link, there = ends
    there.send(SceneMessage(scene(), {}))
    if received_before:
        link.receive()
    there.send(Farewell("camera: unplugged"))
    link.receive()
    assert (link.lost_reason, link.refused_reason) == ("camera: unplugged", None)


def test_an_output_that_ends_is_no_loss_of_perception(ends: Ends) -> None:
    link, there = ends
    there.send(CutOff("rgb/1.png: cannot be written"))
    there.send(SceneMessage(scene(), {}))
    assert len(link.receive()) == 1
    assert link.cut_off == ["rgb/1.png: cannot be written"]
    assert link.lost_reason is None


def test_perception_that_dies_without_a_word_stops_the_robot_too(ends: Ends) -> None:
    link, there = ends
    there.close()
    loop = RecordingDrive(steps=100)
    steps_of(loop, link, LateClock({}))
    assert len(loop.stop_reasons) == 1
    assert loop.stop_reasons[0].startswith("perception is lost: the other process")


def test_a_stop_signal_becomes_a_stop_request(ends: Ends) -> None:
    link, _there = ends
    loop, stop = RecordingDrive(steps=100), StopRequest()
    stop.reason = "SIGTERM"
    moments = run_realtime(RUNNER, LateClock({}), None, link, loop, stop, Punctuality())
    assert len(list(moments)) == 1
    assert loop.stop_reasons == ["SIGTERM received"]
    assert loop.endings == [Outcome.STOPPED]


def test_a_drive_in_real_time_may_be_limited(ends: Ends) -> None:
    link, _there = ends
    loop = RecordingDrive(steps=100)
    steps_of(loop, link, LateClock({}), RealtimeRunner(kind="realtime", max_duration_s=0.1))
    assert loop.stop_reasons == ["max_duration_s of 0.1 s is over"]
    assert len(loop.seen) == 7


def test_perception_hears_every_step(ends: Ends) -> None:
    link, there = ends
    steps_of(RecordingDrive(steps=3), link, LateClock({}))
    heard = [there.receive() for _ in range(4)]
    assert heard.pop() is None
    steps = [message for message in heard if isinstance(message, StepMessage)]
    assert [step.control.now_ns for step in steps] == [0, 20 * MS, 40 * MS]
    assert [step.true_pose for step in steps] == [None, None, None]


class Merry:
    """A simulated world that turns the robot round."""

    def __init__(self) -> None:
        self.body_pose = PlanarPose(0.0, 0.0, 0.0)

    def advance_to(self, now_ns: int) -> None:
        self.body_pose = PlanarPose(0.0, 0.0, now_ns * 1e-9)


def test_perception_hears_where_the_world_has_the_robot(ends: Ends) -> None:
    link, there = ends
    moments = run_realtime(
        RUNNER,
        LateClock({}),
        Merry(),
        link,
        RecordingDrive(steps=3),
        StopRequest(),
        Punctuality(),
    )
    assert len(list(moments)) == 3
    heard = [there.receive() for _ in range(3)]
    headings_rad = [
        one.true_pose.heading_rad for one in heard if isinstance(one, StepMessage) and one.true_pose
    ]
    assert headings_rad == pytest.approx([0.0, 0.02, 0.04])


def test_telling_a_peer_that_is_gone_is_noticed_not_raised(ends: Ends) -> None:
    link, there = ends
    there.close()
    link.send(StepMessage(control_step(0, None), None))
    assert link.lost_reason is not None


@pytest.mark.parametrize("message", ["hello", 3])
def test_a_message_of_another_kind_is_a_defect_not_a_scene(ends: Ends, message: object) -> None:
    link, there = ends
    there.send(message)
    with pytest.raises(AssertionError, match="perception sent"):
        link.receive()
