import json
import math
from pathlib import Path

import pytest

from controller.decision import Action, Decision, Reason
from controller.errors import UserError
from controller.observations import ObservationFile, observation
from tests.support.scenes import obstacle, scene

SLOW = Decision(Action.DECREASE, 0.61999, Reason("crossing", "person 3 crosses in 2.1 s", obstacle_id=3))


def test_one_frame_has_the_documented_form() -> None:
    seen = scene(
        captured_ns=12_345_000_000,
        sequence=370,
        obstacles=(obstacle(3, (1.0, 0.5, 4.0), (-1.2, 0.0, 0.1), moving=True, score=0.97),),
    )
    assert observation(seen, SLOW, {"detect": 3.1004, "track": 0.4}) == {
        "stamp": 12.345,
        "frame": 370,
        "obstacles": [
            {
                "id": 3,
                "bbox": [300.0, 200.0, 340.0, 300.0],
                "position": [1.0, 0.5, 4.0],
                "velocity": [-1.2, 0.0, 0.1],
                "moving": True,
                "score": 0.97,
                "fragments": 12,
            }
        ],
        "decision": {
            "action": "decrease",
            "target_speed_mps": 0.62,
            "reason": "person 3 crosses in 2.1 s",
            "rule": "crossing",
            "obstacle": 3,
        },
        "camera": {"condition": "good", "reason": ""},
        "timing_ms": {"detect": 3.1, "track": 0.4},
    }


def test_a_recorded_time_keeps_its_microseconds() -> None:
    assert observation(scene(captured_ns=1_305_031_236_733_922_000), None, {})["stamp"] == 1305031236.733922


def test_what_is_not_known_is_null_not_zero() -> None:
    seen = scene(obstacles=(obstacle(velocity_mps=(math.nan, 0.0, math.inf)),))
    assert observation(seen, None, {})["obstacles"][0]["velocity"] == [None, 0.0, None]


def test_the_file_holds_one_json_line_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "out.jsonl"
    with ObservationFile(path) as sink:
        sink.write(scene(sequence=0), SLOW, {})
        sink.write(scene(sequence=1), None, {})
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["frame"] for line in lines] == [0, 1]
    assert lines[1]["decision"] is None


def test_what_was_in_the_file_goes_with_the_first_line_and_not_before(tmp_path: Path) -> None:
    path = tmp_path / "out.jsonl"
    path.write_text("of the last run\n")
    with ObservationFile(path):
        pass
    assert path.read_text() == "of the last run\n"
    with ObservationFile(path) as sink:
        for number in (0, 1):
            sink.write(scene(sequence=number), SLOW, {})
    assert [json.loads(line)["frame"] for line in path.read_text().splitlines()] == [0, 1]


def test_a_place_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    with (
        pytest.raises(UserError, match=r"none/out\.jsonl: observations cannot be written"),
        ObservationFile(tmp_path / "none" / "out.jsonl"),
    ):
        pytest.fail("must not open")


def test_a_full_disk_is_told_in_one_line_while_writing() -> None:
    with pytest.raises(UserError, match=r"/dev/full: .*No space left") as caught:
        write_frames(10_000)
    assert "\n" not in str(caught.value)


def test_a_full_disk_is_told_in_one_line_at_the_end() -> None:
    with pytest.raises(UserError, match=r"/dev/full: .*No space left"):
        write_frames(1)


def write_frames(count: int) -> None:
    """To a disk on which there is no room; a frame or two still fit into the buffer."""
    with ObservationFile(Path("/dev/full")) as sink:
        for number in range(count):
            sink.write(scene(sequence=number), SLOW, {})
