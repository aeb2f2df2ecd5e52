from __future__ import annotations

import importlib.util
import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from config.loader import CONFIG_DIR
from controller.campaign.command import CampaignOptions, command_line, format_row
from controller.campaign.plan import Mission, missions, run_local
from controller.campaign.store import MISSIONS, SETTINGS
from controller.campaign.task import Task, run_task
from controller.cli.commands import cli
from controller.errors import UserError
from tests.support.campaign import CONFIG, made_row

KEYS = {
    "family", "seed", "policy", "reached", "contacts", "contacts_at_fault", "time_s", "oracle_time_s",
    "min_clearance_m", "max_jerk_mps3", "max_accel_mps2", "reversals", "false_stops", "flaps",
}  # fmt: skip


def campaign(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and output. A UserError is raised, as the entry point would catch it."""
    result = CliRunner().invoke(cli, ["campaign", *map(str, arguments)], standalone_mode=False)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


def rows(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / MISSIONS).read_text().splitlines()]


SMALL = ("--families", "plain_wall,feedback_lost", "--policies", "field,paper", "--workers", "1", "--quiet")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaign") / "small"
    campaign("--missions", "2", "--seed", "3", "--report", folder, *SMALL)
    return folder


def test_a_row_for_each_mission_and_policy_with_every_key(small: Path) -> None:
    found = rows(small)
    assert len(found) == 4
    assert all(set(row) >= KEYS for row in found)
    assert {(row["family"], row["seed"]) for row in found} == {
        ("plain_wall", 3),
        ("feedback_lost", 3),
    }


def test_the_report_has_its_files(small: Path) -> None:
    names = {path.name for path in small.iterdir()}
    pictures = {"ratio.png", "families.png", "clearance.png"}
    assert names == {MISSIONS, SETTINGS, "summary.json", "report.md"} | pictures
    summary = json.loads((small / "summary.json").read_text())
    assert summary["policies"]["field"]["missions"] == 2
    assert summary["missions"] == 2
    text = (small / "report.md").read_text()
    assert "--missions 2 --mode noise --seed 3" in text
    assert "plain_wall |" in text


def test_a_campaign_broken_off_is_resumed_without_losing_a_row(small: Path, tmp_path: Path) -> None:
    whole = (small / MISSIONS).read_text()
    lines = whole.splitlines(keepends=True)
    # The last line was cut by the power going out.
    (tmp_path / MISSIONS).write_text("".join(lines[:2]) + lines[2][:40])
    with pytest.raises(UserError, match="--resume"):
        campaign("--missions", "2", "--seed", "3", "--report", tmp_path, *SMALL)
    marked = json.loads(lines[0]) | {"flaps": 77}
    content = (tmp_path / MISSIONS).read_text().replace(lines[0], json.dumps(marked) + "\n")
    (tmp_path / MISSIONS).write_text(content)
    campaign("--missions", "2", "--seed", "3", "--report", tmp_path, "--resume", *SMALL)
    again = rows(tmp_path)
    assert again[0]["flaps"] == 77
    assert [json.dumps(row) for row in again[1:]] == [line.strip() for line in lines[1:]]


def test_a_report_of_more_missions_than_asked_for_says_so(small: Path, tmp_path: Path) -> None:
    for name in (MISSIONS, SETTINGS):
        (tmp_path / name).write_text((small / name).read_text())
    _, told = campaign("--missions", "2", "--seed", "3", "--report", tmp_path, "--resume", *SMALL)
    assert "more than this command" not in told
    _, told = campaign("--missions", "1", "--seed", "3", "--report", tmp_path, "--resume", *SMALL)
    assert "holds 1 missions more than this command asks for" in told


def test_our_failures_are_named_and_the_report_tells_how_to_repeat_them(tmp_path: Path) -> None:
    alone = ("--families", "empty_aisle", "--policies", "ours", "--workers", "1", "--quiet")
    given = ("--missions", "1", "--seed", "3", "--report", tmp_path, *alone)
    code, told = campaign(*given)
    assert (code, "failed" in told) == (0, False)
    row = rows(tmp_path)[0] | {"contacts": 1, "contacts_at_fault": 1, "touched": ["pallet"]}
    (tmp_path / MISSIONS).write_text(json.dumps(row) + "\n")
    code, told = campaign(*given, "--resume")
    assert code == 1
    assert "failed   empty_aisle:3 (ours)" in told
    text = (tmp_path / "report.md").read_text()
    assert "`treadwatch campaign --mode noise --only MISSION --policies POLICY`" in text
    assert "| empty_aisle:3 | ours | touched pallet while driving |" in text


def test_two_workers_find_what_one_finds(small: Path) -> None:
    tasks = [
        Task(one.family, one.seed, ("field", "paper"), "noise", CONFIG)
        for one in missions(2, ("plain_wall", "feedback_lost"), 3)
    ]
    found = {
        (row.family, row.seed, row.policy): row.as_dict() for done in run_local(tasks, 2) for row in done
    }
    expected = {(row["family"], row["seed"], row["policy"]): row for row in rows(small)}
    assert {key: json.loads(json.dumps(row)) for key, row in found.items()} == expected


def test_ours_drives_a_mission_the_same_way_twice() -> None:
    task = Task("camera_frozen", 1, ("ours",), "noise", CONFIG)
    first, again = run_task(task), run_task(task)
    assert first == again
    assert first[0].reached
    assert first[0].limit_violations == 0


def test_the_report_gives_the_command_that_repeats_it() -> None:
    options = CampaignOptions(
        Path("my robot.yaml"),
        4,
        ("group",),
        ("ours",),
        "camera",
        3,
        7,
        Path("out/a b"),
        scenarios=("my.yaml",),
    )
    again = cli.commands["campaign"].make_context("campaign", shlex.split(command_line(options))[2:]).params
    assert (again["config_path"], again["report"]) == (Path("my robot.yaml"), Path("out/a b"))
    assert (again["missions"], again["mode"], again["workers"], again["seed"]) == (4, "camera", 3, 7)
    assert (again["families"], again["policies"], again["scenarios"]) == (("group",), ("ours",), ("my.yaml",))


def test_missions_take_turns_over_the_families() -> None:
    assert missions(5, ("a", "b"), 7) == [
        Mission("a", 7), Mission("b", 7), Mission("a", 8), Mission("b", 8), Mission("a", 9),
    ]  # fmt: skip


def test_every_mission_is_run_once_however_many_there_are() -> None:
    """More than wait in front of the workers at a time."""
    tasks = [Task("plain_wall", seed, (), "noise", CONFIG) for seed in range(12)]
    assert len(list(run_local(tasks, 2))) == 12


def test_single_mission_prints_its_result() -> None:
    code, output = campaign("--only", "plain_wall:3", "--policies", "field")
    assert code == 0
    assert re.fullmatch(
        r"field    reached in 1[45]\.\d\d s, 1\.0\d x the oracle's; contacts 0 \(0 at fault\), "
        r"clearance \d\.\d\d m, false stops 0, flaps 0: ok\n",
        output,
    )


def test_a_target_that_even_the_oracle_misses_is_compared_with_nothing() -> None:
    assert "reached in 11.00 s, 1.10 x the oracle's; " in format_row(made_row(1))
    assert "reached in 11.00 s, not compared with the oracle; " in format_row(made_row(1, oracle_time_s=None))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--report", "x", "--families", "crossing_lft"), "--families crossing_lft"),
        (("--report", "x", "--policies", "theirs"), "--policies theirs"),
        (("--report", "x", "--families", " , "), "--families ' , ': names nothing"),
        (("--report", "x", "--policies", ""), "--policies '': names nothing"),
        ((), "--report"),
        (("--only", "plain_wall"), "FAMILY:SEED"),
        (("--only", "nothing:3"), "FAMILY:SEED"),
        (("--report", "x", "--video"), "--mode camera"),
        (("--report", "x", "--config", str(CONFIG_DIR / "robot-bunker.yaml")), "camera.kind 'simulated'"),
    ],
)
def test_mistakes_are_told_in_one_line(arguments: tuple[str, ...], message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        campaign(*arguments)
    assert "\n" not in str(caught.value)


def test_missions_of_another_mode_are_not_gone_on_with(tmp_path: Path) -> None:
    """They would count as driven with the camera."""
    (tmp_path / MISSIONS).write_text(json.dumps(made_row(1).as_dict()) + "\n")
    with pytest.raises(UserError, match="driven with --mode noise") as caught:
        campaign("--missions", "1", "--report", tmp_path, "--resume", "--mode", "camera", *SMALL)
    assert "\n" not in str(caught.value)


def test_missions_of_another_configuration_are_not_gone_on_with(small: Path, tmp_path: Path) -> None:
    for name in (MISSIONS, SETTINGS):
        (tmp_path / name).write_text((small / name).read_text())
    other = (CONFIG_DIR / "sim.yaml").read_text().replace("max_speed_mps: 1.5", "max_speed_mps: 1.2")
    (tmp_path / "other.yaml").write_text(other)
    with pytest.raises(UserError, match=f"another --config .*{SETTINGS}") as caught:
        campaign("--report", tmp_path, "--resume", "--config", tmp_path / "other.yaml", *SMALL)
    assert "\n" not in str(caught.value)
    assert (tmp_path / MISSIONS).read_text() == (small / MISSIONS).read_text()


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is not None, reason="Dask distributed is installed here"
)
def test_without_dask_a_scheduler_is_refused_with_what_to_install(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"pip install 'treadwatch\[campaign\]'"):
        campaign("--missions", "1", "--report", tmp_path, "--scheduler", "tcp://127.0.0.1:8786", *SMALL)


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="Dask distributed is not installed: pip install -e '.[campaign]'",
)
@pytest.mark.filterwarnings("default")
def test_a_local_cluster_finds_what_this_machine_finds(small: Path, tmp_path: Path) -> None:
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        campaign("--missions", "2", "--seed", "3", "--report", tmp_path, "--scheduler", address, *SMALL)
    assert rows(tmp_path) == rows(small)
