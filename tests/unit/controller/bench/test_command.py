from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from controller.bench import command
from controller.bench.driving import ControlFigures
from controller.bench.figures import Durations
from controller.bench.mission_speed import LockstepFigures
from controller.bench.perception import PerceptionFigures
from controller.bench.rendering import RendererFigures
from controller.bench.report import BenchReport
from controller.bench.stages import StageFigures
from controller.cli.commands import cli
from controller.errors import UserError

MACHINE: dict[str, str | int] = {
    "cpu": "A CPU", "cores": 2, "system": "Linux", "python": "3.11", "opencv": "5.0.0", "numpy": "2.4",
}  # fmt: skip

SCENARIO = """
name: plain
path: {segments: [{kind: line, length_m: 9.0}]}
room: {floor: plain, walls: plain, ceiling: plain}
bodies: [{kind: crate, name: crate, x_m: 4.0, y_m: 1.5, texture: plain}]
"""


def duration(median_ms: float) -> Durations:
    return Durations(100, median_ms, 2.0 * median_ms)


def perception(total_ms: float, bare_ms: float) -> PerceptionFigures:
    return PerceptionFigures(
        alone=duration(0.9 * total_ms),
        total=duration(total_ms),
        elapsed=duration(5.0),
        detect=duration(0.75 * total_ms),
        track=duration(0.25 * total_ms),
        bare=duration(bare_ms),
        whole=duration(2.0 * bare_ms),
        first=duration(3.0 * total_ms),
        ratio_of_medians=total_ms / bare_ms,
        median_ratio=1.21,
        ratio_to_whole=0.5 * total_ms / bare_ms,
        opencv={"Canny": duration(0.5)},
        modules={
            "vision.fragments.edges": StageFigures(1.0, 0.1, 0.5),
            "vision.camera.lens": StageFigures(3.0, 0.001, 0.0),
        },
        functions={"vision.fragments.edges.find_edges": StageFigures(1.0, 0.1, 0.5)},
    )


def report(cpu_share: float = 0.99) -> BenchReport:
    return BenchReport(
        taken_at="2025-01-02T03:04:05+00:00",
        cpu_share=cpu_share,
        machine=MACHINE,
        perception={"simulated_640x480": perception(4.8, 4.0)},
        renderer=RendererFigures(640, 480, 61.0, duration(9.0), duration(14.0)),
        control=ControlFigures(10, duration(0.25)),
        drivers={"agilex_virtual_can": duration(0.06), "roboclaw_in_memory": duration(0.02)},
        lockstep=LockstepFigures(10.0, 8.0, 5.0, 300),
    )


def test_json_keys_stay() -> None:
    content = report().as_json()
    assert list(content) == [
        "schema", "taken_at", "cpu_share", "machine",
        "perception", "renderer", "control", "drivers", "lockstep",
    ]  # fmt: skip
    assert content["schema"] == 1
    assert content["lockstep"] == {
        "simulated_s": 10.0, "wall_s": 8.0, "processor_s": 5.0, "frames": 300,
        "speed": 1.25, "speed_on_own_core": 2.0,
    }  # fmt: skip
    assert content["drivers"] == {
        "agilex_virtual_can": {"count": 100, "median_ms": 0.06, "p99_ms": 0.12},
        "roboclaw_in_memory": {"count": 100, "median_ms": 0.02, "p99_ms": 0.04},
    }


def test_the_text_of_a_report_is_its_json() -> None:
    assert json.loads(report().to_text()) == report().as_json()


def test_the_table_says_what_was_measured() -> None:
    lines = list(report().lines())
    (row,) = [line for line in lines if line.startswith("simulated 640x480")]
    assert (
        " ".join(row.split()[2:]) == "4.32 8.64 4.80 9.60 3.60 1.20 4.00 1.20 1.21 8.00 0.60 14.40 5.00 10.00"
    )
    text = "\n".join(lines)
    assert "A CPU, 2 cores" in lines[0]
    assert "0.10 + 0.50" in text
    assert "vision.camera.lens" not in text, "what takes next to nothing is left to the JSON file"
    assert "renderer, 640x480, 61 faces" in text
    assert "10.0 s of the default mission in 8.0 s: 1.25 x real time, 2.00 x on a core of its own" in text
    assert "busy" not in text


def test_a_busy_machine_is_told() -> None:
    assert any("this run got 45% of a core" in line for line in report(0.45).lines())


def test_the_command_prints_and_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def pretend(plan: command.Plan) -> BenchReport:
        asked.append(plan.frames)
        return report()

    monkeypatch.setattr(command, "measure_all", pretend)
    target = tmp_path / "new" / "bench.json"
    result = CliRunner().invoke(
        cli, ["bench", "--frames", "12", "--json", str(target)], catch_exceptions=False
    )
    assert result.exit_code == 0
    assert asked == [12]
    assert "simulated 640x480" in result.stdout
    assert json.loads(target.read_text()) == report().as_json()


def test_unwritable_report_is_reported_before_measuring(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "measure_all", lambda plan: pytest.fail("measured for nothing"))
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"file: cannot be made .*; choose another --json"):
        command.run_bench(10, tmp_path / "file" / "bench.json")


def test_a_disk_that_fills_up_while_measuring_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "bench.json"

    def pretend(plan: command.Plan) -> BenchReport:
        target.mkdir()
        return report()

    monkeypatch.setattr(command, "measure_all", pretend)
    with pytest.raises(UserError, match=r"bench\.json: cannot be written \(Is a directory\)"):
        command.run_bench(10, target)


def test_the_period_is_not_written_as_json(tmp_path: Path) -> None:
    result = CliRunner().invoke(cli, ["bench", "--period", "--json", str(tmp_path / "bench.json")])
    assert isinstance(result.exception, UserError)
    assert "--json goes with the stages" in str(result.exception)


def test_a_target_without_permission_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("controller.bench.command.os.access", lambda path, mode: False)
    with pytest.raises(UserError, match=r"bench\.json: may not be written"):
        command.run_bench(10, tmp_path / "bench.json")


def test_short_bench_of_all_stages_gives_all_figures(tmp_path: Path) -> None:
    (tmp_path / "plain.yaml").write_text(SCENARIO)
    mission = tmp_path / "mission.yaml"
    mission.write_text(
        command.Plan().mission.read_text().replace("scenario: warehouse", "scenario: plain.yaml")
    )
    figures = command.measure_all(
        command.Plan(
            mission=mission,
            sizes=((320, 240), (160, 120)),
            frames=3,
            recording_passes=1,
            pictures=2,
            control_steps=3,
            duration_s=0.2,
        )
    )
    content: dict[str, Any] = json.loads(figures.to_text())
    assert list(content["perception"]) == ["simulated_320x240", "simulated_160x120", "recorded_desk_rpy"]
    assert content["perception"]["simulated_160x120"]["total"]["count"] == 2
    assert content["perception"]["recorded_desk_rpy"]["total"]["count"] == 9
    assert content["lockstep"]["frames"] == 6
    assert content["lockstep"]["simulated_s"] == pytest.approx(0.2, abs=0.021)
    assert (content["renderer"]["width"], content["renderer"]["picture"]["count"]) == (320, 2)
    assert content["control"]["step"]["count"] == content["drivers"]["roboclaw_in_memory"]["count"] == 3


def test_without_the_recording_the_rest_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "_simulated_reel_figures", lambda *_: perception(4.0, 3.0))
    monkeypatch.setattr(command, "_renderer_figures", lambda *_: report().renderer)
    monkeypatch.setattr(command, "_control_figures", lambda *_: report().control)
    monkeypatch.setattr(command, "measure_exchanges", lambda *_: {"roboclaw_in_memory": duration(0.1)})
    monkeypatch.setattr(command, "_lockstep_figures", lambda *_: report().lockstep)
    figures = command.measure_all(command.Plan(recording=tmp_path / "none"))
    assert list(figures.perception) == ["simulated_640x480", "simulated_848x480"]
