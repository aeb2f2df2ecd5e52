"""The file of a campaign's rows: what it keeps, refuses, and says where it cannot be written."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from controller.campaign.store import MISSIONS, SETTINGS, MissionStore
from controller.errors import UserError
from tests.support.campaign import made_row


def test_a_row_that_is_none_is_told_with_its_line(tmp_path: Path) -> None:
    (tmp_path / MISSIONS).write_text('{"family": 3}\n{}\n')
    with pytest.raises(UserError, match="line 1 is not a row"):
        MissionStore(tmp_path, "").begin(resume=True)


@pytest.mark.parametrize("last", ["{}\n", "hello\n"])
def test_a_last_row_that_is_whole_and_none_is_told_and_kept(tmp_path: Path, last: str) -> None:
    (tmp_path / MISSIONS).write_text(last)
    with pytest.raises(UserError, match="line 1 is not a row"):
        MissionStore(tmp_path, "").begin(resume=True)
    assert (tmp_path / MISSIONS).read_text() == last


def test_a_last_row_that_was_cut_off_is_driven_again(tmp_path: Path) -> None:
    (tmp_path / MISSIONS).write_text('{"family": "plain_w')
    store = MissionStore(tmp_path, "")
    store.begin(resume=True)
    assert store.rows == {}


@pytest.mark.parametrize("file", [MISSIONS, SETTINGS])
def test_a_file_that_is_no_text_is_told_and_kept(tmp_path: Path, file: str) -> None:
    (tmp_path / MISSIONS).write_text("")
    (tmp_path / file).write_bytes(b"\xff\xfe\n")
    with pytest.raises(UserError, match=f"{file}: is no text in UTF-8"):
        MissionStore(tmp_path, "").begin(resume=True)
    assert (tmp_path / file).read_bytes() == b"\xff\xfe\n"


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="choose a folder"):
        MissionStore(tmp_path / "file" / "report", "").begin(resume=False)


def test_a_folder_that_takes_no_files_is_told_before_anything_is_driven() -> None:
    with pytest.raises(UserError, match="choose a folder"):
        MissionStore(Path("/proc/self"), "").begin(resume=False)


def test_a_folder_is_left_as_it_was_until_the_first_row(tmp_path: Path) -> None:
    MissionStore(tmp_path, "").begin(resume=False)
    assert not list(tmp_path.iterdir())


def test_nothing_to_resume_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    MissionStore(tmp_path / "misspelt", "").begin(resume=True)
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "misspelt/missions.jsonl: no such file, so --resume has nothing to go on" in told
    MissionStore(tmp_path / "new", "").begin(resume=False)
    assert capsys.readouterr().err == ""


def test_a_disk_that_fills_is_told_with_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = MissionStore(tmp_path, "")
    store.begin(resume=False)
    store.add([made_row(1)])
    kept = store.path.read_text()

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(UserError, match=r"No space left.*--resume goes on"):
        store.add([made_row(2)])
    monkeypatch.undo()
    assert store.path.read_text() == kept
