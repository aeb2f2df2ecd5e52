"""Every driver over every link that works without hardware is measured, or left out where there is none."""

from __future__ import annotations

import pytest

from config.app import HIL_BASES
from controller.bench import exchanges
from controller.bench.exchanges import measure_exchanges, wires
from hal.errors import DeviceNotFound
from tests.support.bench_clocks import every

SERIAL = [kind.replace("-", "_") for kind in HIL_BASES if kind != "agilex"]
NAMES = ["agilex_in_memory", "agilex_virtual_can", "agilex_multicast_can"]
NAMES += [f"{kind}_{wire}" for kind in SERIAL for wire in ("in_memory", "pty")]


def test_every_driver_over_every_link() -> None:
    assert [wire.name for wire in wires()] == NAMES
    figures = measure_exchanges(5, every(1000))
    assert set(NAMES) - set(figures) <= {"agilex_multicast_can"}, "where the machine has no multicast"
    assert {(exchange.count, exchange.median_ms) for exchange in figures.values()} == {(5, 0.001)}


def test_a_link_that_is_not_there_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise DeviceNotFound("no such link")

    monkeypatch.setattr(exchanges, "_measure", refuse)
    assert measure_exchanges(5, every(1000)) == {}
