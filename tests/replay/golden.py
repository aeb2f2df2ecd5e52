"""Golden observations: what was seen when last looked at, and which of it a change alters.

`python -m tests.replay.golden` (`make golden`) writes the files anew and says what has changed.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from config.app import LockstepRunner, load_app
from config.loader import CONFIG_DIR
from controller.mission.command import with_overrides
from controller.mission.lockstep_drive import drive_lockstep
from controller.mission.options import MissionOptions
from controller.replay.command import ReplayOptions, run_replay
from controller.terminal.console import Console
from tests.support.recordings import DESK_RPY

Observation = dict[str, Any]

EXPECTED = Path(__file__).resolve().parent / "expected"
SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "two_walkers.yaml"
ACCEPT = "if the change is meant, accept it with `make golden` and commit the files it writes"
MOST_LINES = 20
_DRIVE_S = 2.6

# Another processor rounds differently: this much is noise, more is a change.
_BBOX_PX = 6.0
_POSITION_M = 0.03
_POSITION_PER_METRE = 0.01
_VELOCITY_MPS = 0.10
_VELOCITY_PER_M2 = 0.0075  # as the noise of depth
_SCORE = 0.35
_FRAGMENTS = 8
_FRAGMENTS_SHARE = 0.2
_SPEED_MPS = 0.1


def desk() -> list[Observation]:
    """A real desk from a camera in the hand, without odometry."""
    config = CONFIG_DIR / "replay.yaml"
    return _observed(lambda file: run_replay(ReplayOptions(DESK_RPY, "none", config, file, quiet=True)))


def drive() -> list[Observation]:
    """A simulated drive towards two people, in lock-step."""

    def run(file: Path) -> None:
        options = MissionOptions(CONFIG_DIR / "sim.yaml", str(SCENARIO), 7, file, quiet=True)
        config = with_overrides(load_app(options.config_path), options)
        assert isinstance(config.runner, LockstepRunner)
        runner = config.runner.model_copy(update={"max_duration_s": _DRIVE_S})
        drive_lockstep(config, runner, options, Console(quiet=True))

    return _observed(run)


SOURCES: dict[str, Callable[[], list[Observation]]] = {"desk_rpy": desk, "two_walkers": drive}


def _observed(run: Callable[[Path], None]) -> list[Observation]:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "observations.jsonl"
        run(file)
        return [rounded(line) for line in read(file)]


def read(file: Path) -> list[Observation]:
    """The observations in file, one a line."""
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def write(file: Path, observations: Sequence[Observation]) -> None:
    """One observation a line, as short as may be."""
    lines = [json.dumps(one, separators=(",", ":"), allow_nan=False) for one in observations]
    file.write_text("".join(line + "\n" for line in lines), encoding="utf-8")


def rounded(seen: Observation) -> Observation:
    """An observation without what a machine's speed decides, and no more digits than mean something."""
    decision = seen["decision"]
    if decision is not None:
        decision = {
            "action": decision["action"],
            "target_speed_mps": round(decision["target_speed_mps"], 2),
        }
    obstacles = [
        {
            **one,
            "bbox": [round(edge) for edge in one["bbox"]],
            "position": [round(value, 2) for value in one["position"]],
            "velocity": [round(value, 2) for value in one["velocity"]],
            "score": round(one["score"], 1),
        }
        for one in seen["obstacles"]
    ]
    return {
        "stamp": round(seen["stamp"], 3),
        "frame": seen["frame"],
        "obstacles": obstacles,
        "decision": decision,
        "camera": seen["camera"]["condition"],
    }


def changes(before: Sequence[Observation], now: Sequence[Observation]) -> list[str]:
    """One line for each value that has changed: frame, obstacle, field, before, after.

    What is either so or not (moving, listed, the action) may come one frame sooner or later: just there
    the rounding of another processor decides.
    """
    if len(before) != len(now):
        return [f"frames: {len(before)} -> {len(now)}"]
    found: list[str] = []
    for k, (was, seen) in enumerate(zip(before, now, strict=True)):
        if was["frame"] != seen["frame"]:
            found.append(f"frame {was['frame']}, number: {was['frame']} -> {seen['frame']}")
        around = before[max(k - 1, 0) : k + 2]
        found += _frame_changes(f"frame {was['frame']}", was, seen, around)
    return found


def _frame_changes(
    where: str, was: Observation, seen: Observation, around: Sequence[Observation]
) -> list[str]:
    found = []
    if abs(was["stamp"] - seen["stamp"]) > 0.0015:
        found.append(f"{where}, stamp: {was['stamp']} -> {seen['stamp']}")
    if seen["camera"] not in [one["camera"] for one in around]:
        found.append(f"{where}, camera: {was['camera']} -> {seen['camera']}")
    found += _decision_changes(where, seen["decision"], was["decision"], [one["decision"] for one in around])
    listed = {one["id"]: one for one in seen["obstacles"]}
    known = {one["id"]: one for one in was["obstacles"]}
    near = [{one["id"]: one for one in frame["obstacles"]} for frame in around]
    for number in sorted(listed.keys() | known.keys()):
        place = f"{where}, obstacle {number}"
        flags = [one[number]["moving"] if number in one else None for one in near]
        flag = listed[number]["moving"] if number in listed else None
        if flag not in flags:
            found.append(f"{place}, {_flag(known.get(number))} -> {_flag(listed.get(number))}")
        elif number in listed and number in known:
            found += _obstacle_changes(place, known[number], listed[number])
    return found


def _flag(one: Observation | None) -> str:
    return "not listed" if one is None else ("moving" if one["moving"] else "static")


def _decision_changes(
    where: str,
    seen: Observation | None,
    was: Observation | None,
    around: Sequence[Observation | None],
) -> list[str]:
    if seen is None or was is None:
        return [] if seen is was else [f"{where}, decision: {was} -> {seen}"]
    near = [one for one in around if one is not None]
    found = []
    if seen["action"] not in [one["action"] for one in near]:
        found.append(f"{where}, decision, action: {was['action']} -> {seen['action']}")
    speeds = [one["target_speed_mps"] for one in near]
    if all(abs(seen["target_speed_mps"] - speed) > _SPEED_MPS for speed in speeds):
        found.append(
            f"{where}, decision, target_speed_mps: {was['target_speed_mps']} -> {seen['target_speed_mps']}"
        )
    return found


def _obstacle_changes(place: str, was: Observation, seen: Observation) -> list[str]:
    distance_m = math.hypot(*was["position"])
    allowed = {
        "bbox": _BBOX_PX,
        "position": _POSITION_M + _POSITION_PER_METRE * distance_m,
        "velocity": _VELOCITY_MPS + _VELOCITY_PER_M2 * distance_m**2,
    }
    found = [
        f"{place}, {field}: {was[field]} -> {seen[field]}"
        for field, limit in allowed.items()
        if max(abs(a - b) for a, b in zip(was[field], seen[field], strict=True)) > limit
    ]
    if was["moving"] == seen["moving"] and abs(was["score"] - seen["score"]) > _SCORE:
        found.append(f"{place}, score: {was['score']} -> {seen['score']}")
    if abs(was["fragments"] - seen["fragments"]) > _FRAGMENTS + _FRAGMENTS_SHARE * was["fragments"]:
        found.append(f"{place}, fragments: {was['fragments']} -> {seen['fragments']}")
    return found


def report(name: str, found: Sequence[str]) -> str:
    """What has changed in one golden file, at most MOST_LINES lines of it, and how to accept it."""
    shown = list(found[:MOST_LINES])
    if len(found) > MOST_LINES:
        shown.append(f"... and {len(found) - MOST_LINES} more")
    count = f"{len(found)} observation{'s' if len(found) > 1 else ''} of {name} changed"
    return "\n".join([f"{count} (before -> now):", *shown, ACCEPT])


def main() -> None:
    """Write every golden file anew; say what has changed."""
    EXPECTED.mkdir(exist_ok=True)
    for name, source in SOURCES.items():
        file = EXPECTED / f"{name}.jsonl"
        before, now = read(file) if file.exists() else [], source()
        found = changes(before, now)
        write(file, now)
        sys.stdout.write((report(name, found) if found else f"{name}: nothing has changed") + "\n")


if __name__ == "__main__":
    main()
