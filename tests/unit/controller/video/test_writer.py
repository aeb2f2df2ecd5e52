import errno
import os
import resource
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from controller.errors import UserError
from controller.video import disk_reservation
from controller.video.style import Image
from controller.video.writer import CODECS, VideoError, VideoWriter


def picture(level: int, width: int = 320, height: int = 180) -> Image:
    image = np.full((height, width, 3), level, np.uint8)
    image[:, : width // 2] = 255 - level
    return image


def read_back(path: Path) -> list[Image]:
    video = cv2.VideoCapture(str(path))
    pictures = []
    while True:
        there, image = video.read()
        if not there:
            break
        pictures.append(np.asarray(image, np.uint8))
    video.release()
    return pictures


@pytest.mark.parametrize("suffix", CODECS)
def test_written_video_can_be_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"drive{suffix}"
    levels = [20, 60, 100, 140, 180, 220]
    with VideoWriter(path, 12.5) as writer:
        for level in levels:
            writer.write(picture(level))
    pictures = read_back(path)
    assert len(pictures) == len(levels)
    for image, level in zip(pictures, levels, strict=True):
        assert image.shape == (180, 320, 3)
        assert abs(float(image[60:120, 220:300].mean()) - level) < 12
        assert abs(float(image[60:120, 20:100].mean()) - (255 - level)) < 12
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(12.5)
    video.release()


def test_a_suffix_in_capitals_is_the_same(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "DRIVE.MP4", 30.0) as writer:
        writer.write(picture(90))
    assert len(read_back(tmp_path / "DRIVE.MP4")) == 1


def test_no_picture_makes_no_file(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "drive.mp4", 30.0):
        pass
    assert list(tmp_path.iterdir()) == []


def test_closing_twice_is_safe(tmp_path: Path) -> None:
    writer = VideoWriter(tmp_path / "drive.mp4", 30.0)
    writer.write(picture(90))
    writer.close()
    writer.close()
    assert len(read_back(tmp_path / "drive.mp4")) == 1


def test_an_exception_inside_still_finishes_the_file(tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"

    def break_off() -> None:
        with VideoWriter(path, 30.0) as writer:
            writer.write(picture(90))
            writer.write(picture(95))
            raise RuntimeError("the run broke off")

    with pytest.raises(RuntimeError, match="broke off"):
        break_off()
    assert len(read_back(path)) == 2


def refusal(path: Path, fps: float = 30.0) -> str:
    with pytest.raises(VideoError) as caught:
        VideoWriter(path, fps)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    return message


@pytest.mark.parametrize("name", ["drive.gif", "drive", "drive.mp4.txt"])
def test_an_unknown_suffix_is_refused_with_those_that_work(tmp_path: Path, name: str) -> None:
    message = refusal(tmp_path / name)
    assert all(suffix in message for suffix in CODECS)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_refused_at_once(tmp_path: Path) -> None:
    assert "No such file or directory" in refusal(tmp_path / "nowhere" / "drive.mp4")


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("not a folder")
    assert "Not a directory" in refusal(tmp_path / "notes" / "drive.mp4")


def test_a_folder_in_place_of_the_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "drive.mp4").mkdir()
    assert "Is a directory" in refusal(tmp_path / "drive.mp4")


def test_a_folder_that_may_not_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", denied)
    assert "Permission denied" in refusal(tmp_path / "drive.mp4")


def test_checking_leaves_an_existing_file_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    path.write_bytes(b"an older drive")
    VideoWriter(path, 30.0)
    assert path.read_bytes() == b"an older drive"


@pytest.mark.parametrize("fps", [0.0, -5.0, float("nan")])
def test_a_rate_that_is_none_is_refused(tmp_path: Path, fps: float) -> None:
    assert "pictures a second" in refusal(tmp_path / "drive.mp4", fps)


def test_a_rate_that_no_encoder_takes_is_one_line(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "drive.mp4", 1e6) as writer, pytest.raises(VideoError, match="mp4v encoder"):
        writer.write(picture(90))


def test_a_picture_of_another_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    with VideoWriter(path, 30.0) as writer:
        writer.write(picture(90))
        with pytest.raises(VideoError, match="320x200"):
            writer.write(picture(90, 320, 200))
    assert len(read_back(path)) == 1


def test_the_error_is_one_that_the_program_reports_in_a_line() -> None:
    assert issubclass(VideoError, UserError)


@pytest.mark.parametrize("suffix", [".webm", ".mp4"])
def test_the_encoder_is_silent(tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture[str]) -> None:
    with VideoWriter(tmp_path / f"drive{suffix}", 30.0) as writer:
        writer.write(picture(90))
    os.write(2, b"still heard\n")
    heard = capfd.readouterr()
    assert heard.out == ""
    assert heard.err == "still heard\n"


def test_a_failing_encoder_is_silent_too(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with VideoWriter(tmp_path / "drive.mp4", 1e6) as writer, pytest.raises(VideoError):
        writer.write(picture(90))
    assert capfd.readouterr().err == ""


def test_a_name_like_a_protocol_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with VideoWriter(Path("pipe:7.mp4"), 30.0) as writer:
        writer.write(picture(90))
    assert len(read_back(tmp_path / "pipe:7.mp4")) == 1


def refuse_after(count: int, code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk gives room so many times."""
    given: list[int] = []

    def fallocate(_fd: int, offset: int, _length: int) -> int:
        given.append(offset)
        return 0 if len(given) <= count else code

    monkeypatch.setattr(disk_reservation, "fallocate", fallocate)


@pytest.mark.parametrize("suffix", CODECS)
def test_a_full_disk_is_told_before_a_picture_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """What was written before can be seen: there is room for the end of the file."""
    path = tmp_path / f"drive{suffix}"
    refuse_after(12, errno.ENOSPC, monkeypatch)
    noise = np.random.default_rng(1)
    written = 0

    def write() -> None:
        nonlocal written
        with VideoWriter(path, 30.0) as writer:
            for _ in range(2000):
                writer.write(noise.integers(0, 256, (360, 640, 3), np.uint8))
                written += 1

    with pytest.raises(
        VideoError, match=r"nothing more can be written \(No space left on device\); make room"
    ):
        write()
    assert 10 < written < 2000
    assert len(read_back(path)) == written
    assert capfd.readouterr().err == ""


def test_a_file_that_may_not_become_longer_is_told_before_a_picture_is_lost(tmp_path: Path) -> None:
    """Blocks beyond the limit of `ulimit -f` can be reserved, and then nothing is written to them."""
    path = tmp_path / "drive.webm"
    before, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    with VideoWriter(path, 30.0) as writer:
        writer.write(picture(10))
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, most))
        try:
            with pytest.raises(VideoError, match=r"File too large for `ulimit -f`, 100000 bytes"):
                writer.write(picture(20))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (before, most))
    assert len(read_back(path)) == 1


def test_a_file_system_that_reserves_nothing_is_asked_for_its_free_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "drive.mp4"
    refuse_after(0, errno.EOPNOTSUPP, monkeypatch)
    with VideoWriter(path, 30.0) as writer:
        writer.write(picture(10))
        full = SimpleNamespace(f_bavail=1000, f_frsize=4096)
        monkeypatch.setattr(os, "fstatvfs", lambda _fd: full)
        with pytest.raises(VideoError, match="No space left on device"):
            writer.write(picture(20))
    assert len(read_back(path)) == 1


def test_unused_reserved_space_is_freed(tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    with VideoWriter(path, 30.0) as writer:
        writer.write(picture(10))
    assert path.stat().st_blocks * 512 < 100_000


def test_an_end_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    """As where another limit than the disk's room is reached."""
    path = tmp_path / "drive.mp4"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    writer = VideoWriter(path, 30.0)
    writer.write(picture(10))
    resource.setrlimit(resource.RLIMIT_FSIZE, (20, limits[1]))
    try:
        with pytest.raises(VideoError, match=r"drive\.mp4: nothing more can be written"):
            writer.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
