"""docs/governor.md: its Python works, its keys are the program's, its numbers are the code's."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from config.governor import GovernorConfig, UnixInputConfig
from config.loader import CONFIG_DIR
from controller.__main__ import main
from controller.decision.decision import Action, Decision, Reason
from controller.governor.governor import Governed
from controller.governor.ground import _TRAVEL_M
from controller.governor.request import MOST_BYTES, MOST_MPS, Request, Twist, encode_reply, parse_request

ROOT = CONFIG_DIR.parent
PAGE = (ROOT / "docs" / "governor.md").read_text()
KEEP = Decision(Action.KEEP, 0.5, Reason("requested", "as asked"))
ANSWER = encode_reply(Request(1, 0.0, Twist(0.5, 0.02)), 0.5, 0.02, KEEP, "armed", 0)
PYTHON = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def test_the_request_on_the_page_is_one() -> None:
    line = next(line for line in PAGE.splitlines() if line.startswith('    {"seq": 17, "t_s"'))
    assert parse_request(line.encode()) == Request(17, 1234.5, Twist(0.5, 0.1))


def test_the_answer_on_the_page_has_the_keys_of_the_program() -> None:
    text = PAGE[PAGE.index('{"seq": 17, "v_mps": 0.32') :]
    shown = json.loads(text[: text.index("}") + 1])
    decision = Decision(Action.KEEP, 0.0, Reason("free", "the way is free"))
    assert (
        shown.keys()
        == json.loads(encode_reply(Request(1, 0.0, Twist(0.0, 0.0)), 0.0, 0.0, decision, "", 0)).keys()
    )


def test_the_client_has_about_thirty_lines_and_compiles() -> None:
    assert len(PYTHON[0].splitlines()) <= 35
    compile(PYTHON[0], "client.py", "exec")


@pytest.mark.parametrize("kind", ["udp", "unix"])
def test_the_client_waits_for_a_governor_and_outlives_it(kind: str, tmp_path: Path) -> None:
    unix = kind == "unix"
    where = str(tmp_path / "governor.sock") if unix else "127.0.0.1:0"
    with socket.socket(socket.AF_UNIX if unix else socket.AF_INET, socket.SOCK_DGRAM) as governor:
        if not unix:
            governor.bind(("127.0.0.1", 0))
            where = f"127.0.0.1:{governor.getsockname()[1]}"
        command = [sys.executable, "-u", "-c", PYTHON[0], where, "1.5"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as client:
            assert client.stdout is not None
            assert "is `treadwatch govern` running?" in client.stdout.readline()
            if unix:
                governor.bind(where)
            governor.settimeout(10.0)
            _, sender = governor.recvfrom(1000)
            governor.sendto(ANSWER, sender)
            assert client.stdout.readline() == "0.50 m/s, 0.02 rad/s: as asked\n"
            governor.close()
            if unix:
                Path(where).unlink()
            assert "is `treadwatch govern` running?" in client.stdout.readline()
    assert client.returncode == 0


def test_the_python_example_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    exec(PYTHON[1], names)
    governed = names["governed"]
    assert isinstance(governed, Governed)
    assert governed.decision.reason.sentence == "as asked: 0.50 m/s, 0.10 rad/s"
    assert governed.v_mps > 0.01
    assert governed.w_radps == pytest.approx(0.2 * governed.v_mps)


def test_the_keys_it_names_exist() -> None:
    fields = {*GovernorConfig.model_fields, *UnixInputConfig.model_fields}
    for key in ("turn_memory_s", "late_s", "timeout_s", "resume_s", "group_may_command"):
        assert f"`{key}" in PAGE
        assert key in fields


def test_the_numbers_of_the_page_are_those_of_the_code() -> None:
    assert f"more than {MOST_BYTES} bytes" in PAGE
    assert f"at most {MOST_MPS:g} of either" in PAGE
    assert f"moved on by {_TRAVEL_M:g} m" in PAGE


def test_a_configuration_without_a_governor_is_refused_in_one_line() -> None:
    command = [sys.executable, "-m", "controller", "govern", "--config", str(CONFIG_DIR / "sim.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "has no 'governor' section" in done.stderr
    assert done.stderr.count("\n") == 1


def test_run_refuses_a_governor(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["treadwatch", "run", "--config", str(CONFIG_DIR / "governor.yaml")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "use `treadwatch govern`" in capsys.readouterr().err
