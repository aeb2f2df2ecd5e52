from config.app import LockstepRunner
from controller.lockstep import run_lockstep
from hal.clocks import SimulatedClock
from tests.support.campaign import late
from tests.support.runner_doubles import EmptyScenePerceiver, PeriodicCamera, RecordingDrive, RecordingOutside

MS = 1_000_000


def drive(
    runner: LockstepRunner, steps: int, camera_ms: int
) -> tuple[RecordingDrive, RecordingOutside, list[int]]:
    loop, outside = RecordingDrive(steps), RecordingOutside()
    camera = PeriodicCamera(camera_ms * MS)
    moments = list(run_lockstep(runner, SimulatedClock(), outside, camera, EmptyScenePerceiver(), loop))
    return loop, outside, [len(moment.looks) for moment in moments]


def test_a_scene_is_known_only_after_its_latency() -> None:
    runner = LockstepRunner(kind="lockstep", control_rate_hz=50, perception_latency_s=0.06)
    loop, _, _ = drive(runner, steps=7, camera_ms=30)
    # Frame 0 is exposed at 0 and known at 60 ms; frame 1 at 30, known at 90, so first at the step at 100.
    assert [sequence for _, sequence in loop.seen] == [None, None, None, 0, 0, 1, 2]
    assert [now_ns // MS for now_ns, _ in loop.seen] == [0, 20, 40, 60, 80, 100, 120]


def test_late_scenes_come_late_and_none_overtakes_another() -> None:
    runner = LockstepRunner(kind="lockstep", control_rate_hz=50, perception_latency_s=0.0)
    loop, camera = RecordingDrive(6), PeriodicCamera(20 * MS)
    faults = late(0.02, 0.03, 0.05)
    run = run_lockstep(
        runner, SimulatedClock(), RecordingOutside(), camera, EmptyScenePerceiver(), loop, faults.late_by
    )
    assert len(list(run)) == 6
    # Frame 1, exposed at 20 ms, is known at 70: at the step at 80, together with those that came after it.
    assert [sequence for _, sequence in loop.seen] == [0, 0, 0, 0, 4, 5]


def test_the_outside_moves_on_before_every_exposure_and_every_step() -> None:
    runner = LockstepRunner(kind="lockstep", control_rate_hz=50, perception_latency_s=0.0)
    _, outside, _ = drive(runner, steps=4, camera_ms=30)
    assert [t // MS for t in outside.times_ns] == [0, 0, 20, 30, 40, 60, 60]
    assert outside.times_ns == sorted(outside.times_ns)


def test_a_camera_faster_than_the_control_loses_no_look() -> None:
    runner = LockstepRunner(kind="lockstep", control_rate_hz=50, perception_latency_s=0.0)
    _, _, looks = drive(runner, steps=3, camera_ms=10)
    assert looks == [1, 2, 2]


def test_a_drive_that_does_not_end_is_given_up() -> None:
    runner = LockstepRunner(kind="lockstep", control_rate_hz=50, max_duration_s=1.0)
    loop, _, _ = drive(runner, steps=10_000, camera_ms=100)
    assert len(loop.seen) == 50
    assert not loop.finished
