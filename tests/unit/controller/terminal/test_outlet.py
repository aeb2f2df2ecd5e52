"""Words hold nobody up: not when nobody reads them, not when they cannot be shown, not when they are many."""

import io
import os
import threading
from collections.abc import Callable

import pytest

from controller.terminal.outlet import Outlet, Words, write

PATIENCE_S = 30.0


def returns(speak: Callable[[], None]) -> bool:
    """Whether speak comes to its end, even if nobody reads."""
    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    return not thread.is_alive()


def test_output_is_written_in_order_before_the_outlet_closes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with Outlet() as outlet:
        for number in range(100):
            outlet.write(Words(f"line {number}"))
        outlet.write(Words("[###]", to_stderr=True, whole=False))
    said = capsys.readouterr()
    assert said.out.splitlines() == [f"line {number}" for number in range(100)]
    assert said.err == "[###]"


def test_stalled_reader_blocks_nobody_and_is_told_how_much_was_left_out(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, writer = os.pipe()
    with os.fdopen(writer, "w") as unread, os.fdopen(reader) as reads:
        monkeypatch.setattr("sys.stdout", unread)

        def speak() -> None:
            for number in range(3000):
                outlet.write(Words(f"{number:>99}"))

        with Outlet() as outlet:
            assert returns(speak)
            # Reading is taken up again.
            assert [int(reads.readline()) for _ in range(400)] == list(range(400))
    left_out = capsys.readouterr().err
    assert "lines were not read and left out" in left_out


def test_reader_that_never_reads_again_does_not_block_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reader, writer = os.pipe()
    with os.fdopen(writer, "w") as unread:
        monkeypatch.setattr("sys.stdout", unread)
        outlet = Outlet()

        def drive() -> None:
            with outlet:
                for number in range(3000):
                    outlet.write(Words(f"{number:>99}"))

        assert returns(drive)
        # Its thread still waits to write: it is told that nobody reads any more, and what is left vanishes.
        os.close(reader)
        outlet._waiting.put(None, timeout=5.0)
        outlet._thread.join(5.0)
        assert not outlet._thread.is_alive()


def test_characters_that_the_terminal_cannot_show_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.BytesIO()
    with io.TextIOWrapper(shown, encoding="latin-1", write_through=True) as narrow:
        monkeypatch.setattr("sys.stdout", narrow)
        write(Words("küche"))
        write(Words("küche \u2192"))
        assert shown.getvalue().decode("latin-1") == "küche\nk\\xfcche \\u2192\n"
