"""Options of the test run."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """--hil: every hardware-in-the-loop test; without it the quick one. --fuzz: ten million of each."""
    parser.addoption("--hil", action="store_true", help="run every hardware-in-the-loop test, not one alone")
    parser.addoption("--fuzz", action="store_true", help="ten million frames for every decoder")
