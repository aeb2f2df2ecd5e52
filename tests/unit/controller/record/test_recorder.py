import gc
import json
import time
import weakref
from pathlib import Path as FilePath

import cv2
import pytest

from controller.perceive import Look
from controller.record.observations import ObservationFile
from controller.record.recorder import (
    MAX_WAITING,
    Recorder,
    RecordingOptions,
    RunRecorder,
    open_recorder,
)
from hal.types import ColourImage
from tests.support.floor_bodies import line_path
from tests.support.runner_doubles import EmptyScenePerceiver, PeriodicCamera, control_step
from tests.support.video_moments import AROUND, frame

STRAIGHT = line_path(20.0)


def written(path: FilePath) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_a_frame_is_written_with_the_first_decision_that_knew_it(tmp_path: FilePath) -> None:
    camera, eyes = PeriodicCamera(33_000_000), EmptyScenePerceiver()
    with ObservationFile(tmp_path / "o.jsonl") as observations:
        recorder = RunRecorder(Recorder(observations, None, None, AROUND, timed=False), STRAIGHT)
        recorder.add_look(eyes.look(camera.read(0.0)))
        recorder.add_step(control_step(20_000_000, None))
        recorder.add_look(eyes.look(camera.read(0.0)))
        recorder.add_step(control_step(40_000_000, 0))
        recorder.add_step(control_step(60_000_000, 0))
        recorder.add_look(eyes.look(camera.read(0.0)))
        recorder.finish()
    lines = written(tmp_path / "o.jsonl")
    assert [line["frame"] for line in lines] == [0, 1, 2]
    assert [line["decision"] is not None for line in lines] == [True, False, False]


def test_a_camera_that_counts_anew_is_paired_all_the_same(tmp_path: FilePath) -> None:
    """It was re-plugged: its numbers begin at 0, and its time may be an earlier one."""
    eyes = EmptyScenePerceiver()
    with ObservationFile(tmp_path / "o.jsonl") as observations:
        recorder = RunRecorder(Recorder(observations, None, None, AROUND, timed=False), STRAIGHT)
        for captured_ms, sequence in ((100, 7), (133, 8), (33, 0), (66, 1)):
            recorder.add_look(eyes.look(frame(sequence, captured_ms * 1_000_000)))
            recorder.add_step(control_step(200_000_000, captured_ms * 1_000_000))
        recorder.add_look(eyes.look(frame(2, 99_000_000)))
        recorder.finish()
    lines = written(tmp_path / "o.jsonl")
    assert [line["frame"] for line in lines] == [7, 8, 0, 1, 2]
    assert [line["decision"] is not None for line in lines] == [True] * 4 + [False]


def test_frames_that_no_decision_comes_for_do_not_pile_up(
    tmp_path: FilePath, capsys: pytest.CaptureFixture[str]
) -> None:
    camera, eyes = PeriodicCamera(33_000_000), EmptyScenePerceiver()
    frames: list[weakref.ref[ColourImage]] = []
    with ObservationFile(tmp_path / "o.jsonl") as observations:
        recorder = RunRecorder(Recorder(observations, None, None, AROUND, timed=False), STRAIGHT)
        for _ in range(MAX_WAITING + 10):
            taken = camera.read(0.0)
            frames.append(weakref.ref(taken.colour))
            recorder.add_look(eyes.look(taken))
        del taken
        gc.collect()
        assert [kept() is None for kept in frames] == [True] * 10 + [False] * MAX_WAITING
        recorder.add_step(control_step(20_000_000, 33_000_000 * (MAX_WAITING + 9)))
        recorder.finish()
    lines = written(tmp_path / "o.jsonl")
    assert [line["frame"] for line in lines] == list(range(MAX_WAITING + 10))
    assert [line["decision"] is None for line in lines] == [True] * 10 + [False] * MAX_WAITING
    assert capsys.readouterr().err == (
        "treadwatch: 10 frames were recorded without a decision: none came within 45 frames\n"
    )


def test_no_frame_is_kept_without_a_recording() -> None:
    with open_recorder(RecordingOptions(), AROUND) as nothing:
        recorder = RunRecorder(nothing, STRAIGHT)
        taken = PeriodicCamera(33_000_000).read(0.0)
        kept = weakref.ref(taken.colour)
        recorder.add_look(EmptyScenePerceiver().look(taken))
        del taken
        gc.collect()
        assert kept() is None


def test_durations_are_written_only_where_time_is_real(tmp_path: FilePath) -> None:
    for timed in (True, False):
        options = RecordingOptions(tmp_path / f"{timed}.jsonl", timed=timed)
        with open_recorder(options, AROUND) as recorder:
            recorder.record(EmptyScenePerceiver().look(PeriodicCamera(1).read(0.0)), None)
    assert written(tmp_path / "True.jsonl")[0]["timing_ms"] == {"detect": 1.0, "track": 0.5}
    assert written(tmp_path / "False.jsonl")[0]["timing_ms"] == {}


def test_a_video_gets_one_picture_a_look(tmp_path: FilePath) -> None:
    camera = PeriodicCamera(33_000_000)
    with open_recorder(RecordingOptions(video=tmp_path / "v.mp4"), AROUND) as recorder:
        for _ in range(3):
            recorder.record(EmptyScenePerceiver().look(camera.read(0.0)), None, 0.5, 0.5)
    video = cv2.VideoCapture(str(tmp_path / "v.mp4"))
    assert int(video.get(cv2.CAP_PROP_FRAME_COUNT)) == 3
    video.release()


def test_the_last_frames_have_the_last_speeds_and_the_ending(monkeypatch: pytest.MonkeyPatch) -> None:
    recorded: list[tuple[object, ...]] = []

    def record(_recorder: Recorder, _look: Look, *given: object, **named: object) -> None:
        recorded.append((*given, *named.values()))

    monkeypatch.setattr(Recorder, "record", record)
    monkeypatch.setattr(Recorder, "records", True)
    camera, eyes = PeriodicCamera(33_000_000), EmptyScenePerceiver()
    run_recorder = RunRecorder(Recorder(None, None, None, AROUND, timed=False), STRAIGHT)
    step = control_step(20_000_000, None)
    run_recorder.add_step(step)
    run_recorder.add_look(eyes.look(camera.read(0.0)))
    run_recorder.finish("target reached")
    assert recorded == [(None, step.setpoint.v_mps, step.chassis.v_mps, "target reached")]


def test_a_drive_in_real_time_has_a_video_of_fewer_pictures(tmp_path: FilePath) -> None:
    found = []
    for cut_off in (None, print):
        path = tmp_path / "v.avi"
        with open_recorder(RecordingOptions(video=path), AROUND, cut_off) as recorder:
            for captured_ns in range(0, 1_000_000_000, 200_000_000):
                recorder.record(EmptyScenePerceiver().look(frame(0, captured_ns)), None)
                time.sleep(0.05)
        video = cv2.VideoCapture(str(path))
        found.append((video.get(cv2.CAP_PROP_FPS), video.get(cv2.CAP_PROP_FRAME_COUNT)))
        video.release()
    assert found[0] == (30.0, 25.0)
    assert found[1][0] == 10.0
    assert 5 <= found[1][1] <= 9  # 9, unless the end came before the last repeats
