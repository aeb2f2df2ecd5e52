"""What fails to be written ends by itself in real time, and ends the run where nothing moves."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from controller.errors import UserError
from controller.record.observations import ObservationFile
from controller.record.recorder import Recorder, RecordingOptions, open_recorder
from controller.video.compose import Composer
from controller.video.writer import VideoError, VideoWriter
from hal.cameras.tum_replay import TumReplay
from hal.cameras.tum_writer import TumWriter
from hal.errors import DeviceRefused
from tests.support.runner_doubles import EmptyScenePerceiver, PeriodicCamera
from tests.support.video_moments import AROUND


def record(recorder: Recorder, frames: int) -> None:
    camera = PeriodicCamera(33_000_000)
    for _ in range(frames):
        recorder.record(EmptyScenePerceiver().look(camera.read(0.0)), None, 0.5, 0.5)


@pytest.fixture
def full(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither observations nor pictures fit on the disk."""

    def refuse(kind: type[Exception], name: str) -> Any:
        def write(*_: object) -> None:
            raise kind(f"{name}: full")

        return write

    monkeypatch.setattr(ObservationFile, "write", refuse(UserError, "observations"))
    monkeypatch.setattr(VideoWriter, "write", refuse(VideoError, "video"))


@pytest.mark.usefixtures("full")
def test_each_is_told_once_and_the_others_go_on(tmp_path: Path) -> None:
    told: list[str] = []
    options = RecordingOptions(tmp_path / "o.jsonl", tmp_path / "v.mp4", tmp_path / "frames")
    with open_recorder(options, AROUND, told.append) as recorder:
        record(recorder, 3)
        assert recorder.records
    assert told == ["observations: full", "video: full"]
    assert TumReplay(tmp_path / "frames").frame_count == 3


@pytest.mark.usefixtures("full")
def test_no_frame_is_kept_once_nothing_can_be_written(tmp_path: Path) -> None:
    with open_recorder(RecordingOptions(tmp_path / "o.jsonl"), AROUND, lambda _why: None) as recorder:
        assert recorder.records
        record(recorder, 1)
        assert not recorder.records


@pytest.mark.usefixtures("full")
def test_a_run_that_moves_nothing_ends(tmp_path: Path) -> None:
    with (
        pytest.raises(UserError, match="observations: full"),
        open_recorder(RecordingOptions(tmp_path / "o.jsonl"), AROUND) as recorder,
    ):
        record(recorder, 1)


def test_failure_at_the_very_end_is_reported_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever ended the drive: the error that perception ends with hides nothing."""
    told: list[str] = []

    def write(*_: object) -> None:
        raise DeviceRefused("frames: full")

    def drive() -> None:
        with open_recorder(RecordingOptions(frames=tmp_path), AROUND, told.append) as recorder:
            record(recorder, 1)
            raise ZeroDivisionError

    monkeypatch.setattr(TumWriter, "write", write)
    with pytest.raises(ZeroDivisionError):
        drive()
    assert told == ["frames: full"]


def test_a_file_that_cannot_be_opened_is_refused_at_once(tmp_path: Path) -> None:
    options = RecordingOptions(tmp_path / "nowhere" / "o.jsonl")
    with (
        pytest.raises(UserError, match="cannot be written there"),
        open_recorder(options, AROUND, lambda _why: None),
    ):
        pass


def test_unforeseen_error_in_an_output_ends_that_output_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []

    def compose(*_: object) -> None:
        raise ValueError("operands could not be\nbroadcast")

    monkeypatch.setattr(Composer, "compose", compose)
    options = RecordingOptions(tmp_path / "o.jsonl", tmp_path / "v.mp4")
    with open_recorder(options, AROUND, told.append) as recorder:
        record(recorder, 3)
    assert told == ["PacedVideo: ValueError: operands could not be broadcast"]
    assert len((tmp_path / "o.jsonl").read_text().splitlines()) == 3
    with pytest.raises(ValueError, match="broadcast"), open_recorder(options, AROUND) as recorder:
        record(recorder, 1)


def test_recording_ends_where_the_camera_comes_back_with_another_lens(tmp_path: Path) -> None:
    """TumWriter refuses such a frame with a ValueError."""
    told: list[str] = []
    with open_recorder(RecordingOptions(frames=tmp_path), AROUND, told.append) as recorder:
        camera = PeriodicCamera(33_000_000)
        look = EmptyScenePerceiver().look(camera.read(0.0))
        recorder.record(look, None)
        then = camera.read(0.0)
        other = replace(then, intrinsics=replace(then.intrinsics, fx=2.0 * then.intrinsics.fx))
        recorder.record(replace(look, frame=other), None)
        third = camera.read(0.0)
        recorder.record(replace(look, frame=third), None)
    reason = "a recording has one camera: intrinsics or depth scale changed"
    assert told == [f"{tmp_path}: the recording ends here: {reason}"]
    assert TumReplay(tmp_path).frame_count == 1
