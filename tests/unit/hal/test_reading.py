"""A link that gives little at a time, or never ends."""

from __future__ import annotations

from hal.chassis.reading import read_all
from hal.links.scripted import ScriptedSerialLink


class Flood(ScriptedSerialLink):
    """There is always more."""

    def __init__(self, a_read: bytes) -> None:
        super().__init__()
        self.a_read = a_read

    def read(self) -> bytes:
        return self.a_read


def test_short_reads_are_put_together() -> None:
    link = ScriptedSerialLink()
    link.limit_reads(3)
    link.deliver(bytes(range(100)))
    assert read_all(link) == bytes(range(100))
    assert read_all(link) == b""


def test_a_flood_ends_at_a_bound() -> None:
    assert read_all(Flood(bytes(4096))) == bytes(16_384)
    assert read_all(Flood(b"x")) == b"x" * 256
