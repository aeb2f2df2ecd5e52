"""Options of the test run."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

from controller.realtime.service import handlers_kept

# How long an example takes tells of the machine and its other work, not of the code.
settings.register_profile("treadwatch", deadline=None)
settings.load_profile("treadwatch")


# Whoever starts the tests in the background of a script has them ignore Ctrl-C, and all their children.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _signals() -> Iterator[None]:
    """A drive keeps its handlers until the process ends."""
    with handlers_kept():
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    """--hil: every hardware-in-the-loop test; without it the quick one. --fuzz: ten million of each."""
    parser.addoption("--hil", action="store_true", help="run every hardware-in-the-loop test, not one alone")
    parser.addoption(
        "--channel", help="run the contract suite on a real base, tracks in the air: can0, a port"
    )
    parser.addoption("--base", help="with --channel: the YAML whose chassis it is (robot-bunker.yaml)")
    parser.addoption("--attended", action="store_true", help="with --channel: ask a person to press buttons")
    parser.addoption("--fuzz", action="store_true", help="ten million frames for every decoder")
