"""A device that takes long to open and close: whoever uses the link never waits for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from hal.errors import DeviceNotFound, LinkLost
from hal.links import reopening
from hal.links.reopening import ReopeningLink

# Another thread has to have its turn, on a busy machine too.
PATIENCE_S = 10.0


class SlowLink(ReopeningLink[str]):
    """Opening and closing wait until the test lets them go on."""

    def __init__(self) -> None:
        super().__init__("port", (OSError,), slow=True)
        self.may_open, self.may_close = threading.Event(), threading.Event()
        self.refuses = False
        self.opened = 0
        self.closed: list[str] = []

    def _open(self) -> str:
        assert self.may_open.wait(PATIENCE_S)
        if self.refuses:
            raise DeviceNotFound("port: no answer; check the cable")
        self.opened += 1
        return f"device {self.opened}"

    def _close(self, device: str) -> None:
        assert self.may_close.wait(PATIENCE_S)
        self.closed.append(device)

    def use(self) -> str:
        return self._require_open()

    def lose(self) -> LinkLost:
        return self._mark_lost("reading", OSError("gone"))


@pytest.fixture
def link() -> SlowLink:
    """Open, and from then on slow."""
    made = SlowLink()
    made.may_open.set()
    made.__enter__()
    made.may_open.clear()
    return made


def reason_of(use: Callable[[], object]) -> str:
    with pytest.raises(LinkLost) as caught:
        use()
    return str(caught.value)


def wait_until(true: Callable[[], bool]) -> None:
    give_up_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < give_up_s
        time.sleep(0.001)


def eventually(use: Callable[[], str]) -> str:
    """What use gives once it no longer raises LinkLost."""
    give_up_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < give_up_s:
        try:
            return use()
        except LinkLost:
            time.sleep(0.001)
    raise AssertionError("it never came back")


def test_lost_and_opened_again_without_waiting(link: SlowLink) -> None:
    assert link.use() == "device 1"
    lost = str(link.lose())
    assert [reason_of(link.use) for _ in range(3)] == [lost] * 3, "under way, and nobody waits"
    link.may_open.set()
    assert [reason_of(link.use) for _ in range(3)] == [lost] * 3, "closing is still under way"
    assert (link.opened, link.closed) == (1, [])
    link.may_close.set()
    assert eventually(link.use) == "device 2"
    assert link.closed == ["device 1"]
    link.__exit__(None, None, None)
    assert link.closed == ["device 1", "device 2"]


def test_why_it_cannot_be_opened_is_told_and_it_is_tried_again(link: SlowLink) -> None:
    link.may_close.set()
    link.lose()
    link.refuses = True
    link.may_open.set()
    wait_until(lambda: reason_of(link.use) == "port: no answer; check the cable")
    assert reason_of(link.use) == "port: no answer; check the cable", "while it is tried anew"
    link.refuses = False
    assert eventually(link.use) == "device 2"


@pytest.mark.parametrize("early", [True, False])
def test_link_that_opens_after_the_end_is_closed(link: SlowLink, early: bool) -> None:
    link.may_close.set()
    link.lose()
    reason_of(link.use)
    if early:
        link.may_open.set()
        wait_until(lambda: link.opened == 2)
    link.__exit__(None, None, None)
    link.may_open.set()
    wait_until(lambda: sorted(link.closed) == ["device 1", "device 2"])
    assert reason_of(link.use) == "port: the link is closed"


def test_the_end_while_the_lost_one_is_closed_opens_nothing(link: SlowLink) -> None:
    link.may_open.set()
    link.lose()
    link.__exit__(None, None, None)
    assert link.closed == [], "nobody waits"
    link.may_close.set()
    wait_until(lambda: not reopening_threads())
    assert (link.opened, link.closed) == (1, ["device 1"])


def test_reopened_link_waits_until_the_lost_one_is_closed(link: SlowLink) -> None:
    link.may_open.set()
    link.lose()
    link.__exit__(None, None, None)
    again = threading.Thread(target=link.__enter__, daemon=True)
    again.start()
    again.join(0.02)
    assert link.opened == 1
    link.may_close.set()
    again.join(PATIENCE_S)
    assert (link.use(), link.closed) == ("device 2", ["device 1"])
    link.__exit__(None, None, None)
    assert link.closed == ["device 1", "device 2"]


def test_the_end_right_after_it_was_opened_closes_it_once(
    link: SlowLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worst moment: the thread has just told that it is done, and has not ended yet."""
    ended = threading.Event()

    class EndsTheLink:
        """A lock behind which, once the thread of the opening has released it, the link is left."""

        def __init__(self) -> None:
            self._lock = threading.Lock()

        def __enter__(self) -> None:
            self._lock.acquire()

        def __exit__(self, *_: object) -> None:
            self._lock.release()
            if threading.current_thread().name == "reopen port" and not ended.is_set():
                ended.set()
                link.__exit__(None, None, None)

    watched = SimpleNamespace(Lock=EndsTheLink, Thread=threading.Thread)
    monkeypatch.setattr(reopening, "threading", watched)
    link.may_close.set()
    link.lose()
    link.may_open.set()
    wait_until(lambda: ended.is_set() and not reopening_threads())
    assert sorted(link.closed) == ["device 1", "device 2"]


def reopening_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "reopen port"]
