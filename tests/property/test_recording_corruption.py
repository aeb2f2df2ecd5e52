"""Whatever is done to the files of a recording: frames, or one line that says what is wrong."""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hal.cameras.recording import frames_of
from hal.cameras.tum_replay import TumReplay
from hal.errors import BadRecording
from tests.support.recordings import write_recording

FRAMES = 3


@pytest.fixture(scope="module")
def faultless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("faultless") / "recording", FRAMES)


def replay(folder: Path) -> tuple[int, TumReplay] | BadRecording:
    """How many frames came, and the source with what it skipped; or why the recording is refused."""
    try:
        with TumReplay(folder, read_ahead=0) as source:
            frames = list(frames_of(source))
    except BadRecording as error:
        return error
    assert all(frame.colour.shape == (48, 64, 3) and frame.depth.shape == (48, 64) for frame in frames)
    return len(frames), source


def files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


@settings(deadline=None, max_examples=150)
@given(
    which=st.integers(0, 2 * FRAMES + 2),
    at=st.floats(0, 1, exclude_max=True),
    patch=st.binary(min_size=1, max_size=6),
    cut=st.booleans(),
)
def test_a_changed_or_cut_file_gives_frames_or_one_clear_line(
    faultless: Path, which: int, at: float, patch: bytes, cut: bool
) -> None:
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "recording"
        shutil.copytree(faultless, folder)
        target = files(folder)[which]
        data = target.read_bytes()
        place = int(at * len(data))
        target.write_bytes(data[:place] if cut else data[:place] + patch + data[place + len(patch) :])
        outcome = replay(folder)
        if isinstance(outcome, BadRecording):
            assert "\n" not in str(outcome)
            assert str(folder) in str(outcome)
        else:
            count, source = outcome
            assert count <= FRAMES
            if target.suffix == ".png" and target.read_bytes() != data:
                assert count == FRAMES - 1
                assert [bad.file for bad in source.skipped] == [str(target.relative_to(folder))]
