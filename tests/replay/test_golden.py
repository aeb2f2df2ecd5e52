"""What a change alters in what is seen: observations compared with those of before."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from tests.replay import golden


@pytest.mark.parametrize("name", golden.SOURCES)
def test_observations_equal_the_golden_ones(name: str) -> None:
    before, now = golden.read(golden.EXPECTED / f"{name}.jsonl"), golden.SOURCES[name]()
    found = golden.changes(before, now)
    if found:
        pytest.fail(golden.report(name, found), pytrace=False)


def test_the_golden_drive_holds_what_it_is_for() -> None:
    """Two people are seen moving, beside things that stand; the camera is good throughout."""
    frames = golden.read(golden.EXPECTED / "two_walkers.jsonl")
    assert len(frames) >= 60
    assert {one["camera"] for one in frames} == {"good"}
    last = frames[-1]["obstacles"]
    assert sum(one["moving"] for one in last) == 2
    assert sum(not one["moving"] for one in last) >= 2


def seen(number: int) -> dict[str, Any]:
    """Frame number: a mover and something that stands."""
    plain = {"bbox": [100, 80, 140, 200], "velocity": [0.0, 0.0, 0.0], "score": 0.5, "fragments": 10}
    return {
        "stamp": number / 30.0,
        "frame": number,
        "obstacles": [
            {**plain, "id": 1, "position": [0.5, 0.1, 4.0], "moving": True, "velocity": [0.8, 0.0, 0.0]},
            {**plain, "id": 2, "position": [-1.0, 0.1, 6.0], "moving": False},
        ],
        "decision": {"action": "keep", "target_speed_mps": 0.5},
        "camera": "good",
    }


BEFORE = [seen(number) for number in range(6)]


def changed(frame: int, obstacle: int, **values: object) -> list[str]:
    now = copy.deepcopy(BEFORE)
    now[frame]["obstacles"][obstacle].update(values)
    return golden.changes(BEFORE, now)


def test_unchanged_observations_give_no_message() -> None:
    assert golden.changes(BEFORE, copy.deepcopy(BEFORE)) == []


def test_each_changed_value_is_named_with_its_frame_and_its_obstacle() -> None:
    assert changed(3, 0, velocity=[0.5, 0.0, 0.0]) == [
        "frame 3, obstacle 1, velocity: [0.8, 0.0, 0.0] -> [0.5, 0.0, 0.0]"
    ]
    assert changed(3, 1, position=[-1.0, 0.1, 6.2]) == [
        "frame 3, obstacle 2, position: [-1.0, 0.1, 6.0] -> [-1.0, 0.1, 6.2]"
    ]
    assert changed(0, 0, bbox=[100, 80, 150, 200]) == [
        "frame 0, obstacle 1, bbox: [100, 80, 140, 200] -> [100, 80, 150, 200]"
    ]
    assert changed(0, 0, score=0.9) == ["frame 0, obstacle 1, score: 0.5 -> 0.9"]
    assert changed(0, 0, fragments=21) == ["frame 0, obstacle 1, fragments: 10 -> 21"]
    assert changed(2, 1, moving=True) == ["frame 2, obstacle 2, static -> moving"]


def test_rounding_noise_is_no_change() -> None:
    assert changed(3, 0, velocity=[0.83, 0.02, -0.03], position=[0.52, 0.12, 4.03], score=0.6) == []
    assert changed(3, 0, bbox=[103, 80, 142, 201], fragments=12) == []


def test_an_obstacle_that_is_gone_or_new_is_named() -> None:
    now = copy.deepcopy(BEFORE)
    now[3]["obstacles"].pop()
    assert golden.changes(BEFORE, now) == ["frame 3, obstacle 2, static -> not listed"]
    other = copy.deepcopy(BEFORE)
    for frame in other[3:]:
        frame["obstacles"][1]["id"] = 7
    found = golden.changes(BEFORE, other)
    assert "frame 4, obstacle 2, static -> not listed" in found
    assert "frame 3, obstacle 7, not listed -> static" in found


def test_a_verdict_may_come_one_frame_sooner_or_later_but_not_two() -> None:
    before, now = copy.deepcopy(BEFORE), copy.deepcopy(BEFORE)
    for k in range(6):
        before[k]["obstacles"][0]["moving"] = k >= 3
        now[k]["obstacles"][0]["moving"] = k >= 4
    assert golden.changes(before, now) == []
    now[4]["obstacles"][0]["moving"] = False
    assert golden.changes(before, now) == ["frame 4, obstacle 1, moving -> static"]


def test_a_changed_decision_is_named() -> None:
    now = copy.deepcopy(BEFORE)
    now[2]["decision"] = {"action": "decrease", "target_speed_mps": 0.1}
    assert golden.changes(BEFORE, now) == [
        "frame 2, decision, action: keep -> decrease",
        "frame 2, decision, target_speed_mps: 0.5 -> 0.1",
    ]


def test_missing_frames_and_a_worse_camera_are_named() -> None:
    assert golden.changes(BEFORE, BEFORE[:5]) == ["frames: 6 -> 5"]
    now = copy.deepcopy(BEFORE)
    now[1]["camera"] = "degraded"
    assert golden.changes(BEFORE, now) == ["frame 1, camera: good -> degraded"]


def test_a_report_has_at_most_twenty_changes_and_tells_how_to_accept_them() -> None:
    lines = golden.report(
        "desk", [f"frame {k}, obstacle 1, moving -> static" for k in range(30)]
    ).splitlines()
    assert lines[0] == "30 observations of desk changed (before -> now):"
    assert len(lines) == 1 + 20 + 2
    assert lines[-2] == "... and 10 more"
    assert "make golden" in lines[-1]
