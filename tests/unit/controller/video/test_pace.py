from pathlib import Path
from threading import Event

import cv2
import numpy as np
import pytest

from controller.video.pace import MAX_STILL_S, Pace, PacedVideo
from controller.video.style import Image
from controller.video.writer import VideoError, VideoWriter

FPS = 30.0


def stamps_ns(rate_hz: float, count: int) -> list[int]:
    return [7_000_000_000 + round(k / rate_hz * 1e9) for k in range(count)]


def grey(level: int) -> Image:
    return np.full((64, 64, 3), level, np.uint8)


def levels(path: Path) -> list[int]:
    """The mean of each picture of the video."""
    video = cv2.VideoCapture(str(path))
    found = []
    while (picture := video.read()[1]) is not None:
        found.append(round(float(picture.mean())))
    video.release()
    return found


@pytest.mark.parametrize("rate_hz", [4.3, 5.0, 8.0, 29.97, 30.0, 60.0])
def test_a_video_lasts_as_long_as_the_drive(rate_hz: float) -> None:
    pace = Pace(FPS)
    count = round(20 * rate_hz)
    assert sum(map(pace.due, stamps_ns(rate_hz, count))) / FPS == pytest.approx(20.0, abs=0.25)


def test_jitter_neither_drops_nor_repeats_a_picture() -> None:
    jitter_ns = np.random.default_rng(1).integers(-10_000_000, 10_000_000, 200)
    pace = Pace(FPS)
    due = [pace.due(stamp + int(late)) for stamp, late in zip(stamps_ns(FPS, 200), jitter_ns, strict=True)]
    assert min(due) == 1
    assert sum(due) in (200, 201)


def test_a_long_gap_is_shortened() -> None:
    pace = Pace(FPS)
    assert [pace.due(stamp) for stamp in (0, 3_600_000_000_000, 3_600_100_000_000)] == [
        1, round(MAX_STILL_S * FPS), 3,
    ]  # fmt: skip


def test_a_clock_that_goes_back_starts_anew() -> None:
    pace = Pace(FPS)
    assert [pace.due(stamp) for stamp in (10_000_000_000, 9_000_000_000, 9_100_000_000)] == [1, 1, 3]


def test_a_picture_is_shown_until_the_next_one(tmp_path: Path) -> None:
    path = tmp_path / "v.avi"
    with PacedVideo(VideoWriter(path, FPS), FPS, may_drop=False) as video:
        for level, stamp_ns in ((40, 0), (120, 200_000_000), (200, 300_000_000)):
            video.write(grey(level), stamp_ns)
    assert np.allclose(levels(path), [40] * 6 + [120] * 3 + [200], atol=3)


def test_a_slow_encoder_is_not_waited_for_in_real_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_go_on, written = Event(), []

    def write(_video: VideoWriter, picture: Image) -> None:
        may_go_on.wait(10.0)
        written.append(int(picture[0, 0, 0]))

    monkeypatch.setattr(VideoWriter, "write", write)
    with PacedVideo(VideoWriter(tmp_path / "v.avi", FPS), FPS, may_drop=True) as video:
        for level, stamp_ns in enumerate(stamps_ns(FPS, 40)):
            video.write(grey(level), stamp_ns)
        may_go_on.set()
    assert written == list(range(8))


def test_what_waits_is_bounded_by_what_it_takes_to_encode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Slow pictures stand for many: few of them may wait, or the file is not closed in time."""
    may_go_on, written = Event(), []

    def write(_video: VideoWriter, picture: Image) -> None:
        may_go_on.wait(10.0)
        written.append(picture)

    monkeypatch.setattr(VideoWriter, "write", write)
    with PacedVideo(VideoWriter(tmp_path / "v.avi", FPS), FPS, may_drop=True) as video:
        for stamp_ns in stamps_ns(3.0, 20):
            video.write(grey(9), stamp_ns)
        may_go_on.set()
    assert 3 <= len(written) <= 1 + 10 + 10  # repeated pictures are not waited for at the end


def test_a_failure_is_told_and_nothing_is_written_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Image] = []

    def full(_video: VideoWriter, picture: Image) -> None:
        calls.append(picture)
        raise VideoError("full")

    monkeypatch.setattr(VideoWriter, "write", full)
    video = PacedVideo(VideoWriter(tmp_path / "v.avi", FPS), FPS, may_drop=True).__enter__()
    video.write(grey(9), 0)
    with pytest.raises(VideoError, match="full"):
        video.__exit__(None, None, None)
    assert len(calls) == 1
