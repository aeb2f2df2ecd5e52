"""The control process's end of the channel: what perception has sent, and whether it still sends."""

from __future__ import annotations

from controller.realtime.channel import Channel, PeerGone
from controller.realtime.messages import CutOff, Farewell, SceneMessage, StepMessage


class PerceptionLink:
    """The control process's link to the perception process. Once lost, it stays lost.

    newest: the newest scene.
    lost_reason: why the link is lost; None if it is not.
    refused_reason: the same, if perception said farewell before its first scene.
    cut_off: why outputs of the drive (observations, video, recording) are not whole.
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self.cut_off: list[str] = []
        self.newest: SceneMessage | None = None
        self.lost_reason: str | None = None
        self.refused_reason: str | None = None

    def receive(self) -> list[SceneMessage]:
        """All scenes that have arrived since the last call, oldest first."""
        arrived: list[SceneMessage] = []
        if self.lost_reason is not None:
            return arrived
        try:
            while self.lost_reason is None and (message := self._channel.receive()) is not None:
                if isinstance(message, SceneMessage):
                    arrived.append(message)
                elif isinstance(message, CutOff):
                    self.cut_off.append(message.reason)
                else:
                    assert isinstance(message, Farewell), f"perception sent {type(message).__name__}"
                    self.lost_reason = message.reason
                    if self.newest is None and not arrived:
                        self.refused_reason = message.reason
        except PeerGone as gone:
            self.lost_reason = str(gone)
        if arrived:
            self.newest = arrived[-1]
        return arrived

    def take_cut_off(self) -> list[str]:
        """The reasons in cut_off, which is empty afterwards."""
        reasons, self.cut_off = self.cut_off, []
        return reasons

    def send(self, message: StepMessage) -> None:
        """Send the control step to perception; the message is dropped if the buffer is full."""
        if self.lost_reason is not None:
            return
        try:
            self._channel.send(message)
        except PeerGone as gone:
            self.lost_reason = str(gone)
