"""A disk that fills up while the robot drives ends what is written there, and not the drive."""

import resource
import subprocess
import sys
from pathlib import Path

from config.loader import CONFIG_DIR
from hal.cameras.tum_replay import TumReplay
from tests.support.drive_process import perception_of

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "short_crossing.yaml"


def test_the_robot_reaches_its_target_and_says_what_is_cut_off(tmp_path: Path) -> None:
    recording, seen = tmp_path / "recording", tmp_path / "seen.jsonl"
    command = [sys.executable, "-u", "-m", "controller", "run"]
    command += ["--config", str(CONFIG_DIR / "sim-realtime.yaml"), "--scenario", str(SCENARIO)]
    command += ["--record", str(recording), "--observations", str(seen)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert any(" increase " in line for line in process.stdout)
        # No file may become longer than this: writing fails as on a full disk.
        resource.prlimit(perception_of(process), resource.RLIMIT_FSIZE, (3000, resource.RLIM_INFINITY))
        out, err = process.communicate(timeout=120)
    assert process.returncode == 1, out + err
    assert ": target reached;" in out
    assert "perception is lost" not in out
    warnings = [line for line in err.splitlines() if "the drive goes on without it" in line]
    assert len(warnings) == 2, err
    assert any(f"{seen}: nothing more can be written (File too large)" in line for line in warnings)
    assert any("cannot be written (File too large); make room" in line for line in warnings)
    assert "Traceback" not in err
    told = [line for line in out.splitlines() if line.startswith("cut off ")]
    assert len(told) == 2
    kept = TumReplay(recording)
    assert kept.frame_count == len(list((recording / "rgb").iterdir())) > 0
    assert kept.frame_count == len(list((recording / "depth").iterdir()))
    assert kept.skipped == ()
