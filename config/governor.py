"""The speed governor: who commands the robot in place of a path, and for how long a command holds."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from config.loader import Section


class UdpInputConfig(Section):
    """Commands arrive as UDP datagrams. Whoever can reach host:port can command the robot, so the default
    is this machine alone; beyond it, keep the port inside a network of the robot's own."""

    kind: Literal["udp"]
    host: str = Field(
        default="127.0.0.1", min_length=1, max_length=253, description="the address to listen on"
    )
    port: int = Field(default=7447, ge=1024, le=65535)


class UnixInputConfig(Section):
    """Commands arrive on a Unix datagram socket. Only processes of the same user, or of the same group with
    group_may_command, can send."""

    kind: Literal["unix"]
    path: str = Field(
        min_length=1,
        max_length=100,
        description="of the socket, relative to this file; made, and removed at the end",
    )
    group_may_command: bool = False

    @field_validator("path")
    @classmethod
    def _is_a_path(cls, path: str) -> str:
        if "\0" in path:
            raise ValueError("a path cannot hold a NUL character")
        return path


InputConfig = Annotated[UdpInputConfig | UnixInputConfig, Field(discriminator="kind")]


class GovernorConfig(Section):
    """How commands come in and how far they are trusted."""

    input: InputConfig = UdpInputConfig(kind="udp")
    timeout_s: float = Field(
        default=0.25,
        ge=0.05,
        le=2,
        description="without a command for this long, the robot makes a jerk-limited stop",
    )
    resume_s: float = Field(
        default=0.2,
        ge=0,
        le=5,
        description="after silence, commands must have kept coming for this long; 0: the first one is obeyed",
    )
    late_s: float = Field(
        default=0.2, gt=0, le=2, description="a message this much later than the fastest one is not obeyed"
    )
    turn_memory_s: float = Field(
        default=60.0,
        ge=0,
        le=3600,
        description="for a turn in place, floor that was seen to be free counts as free for this long",
    )
