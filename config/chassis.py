"""The chassis that the robot drives on, and the link that reaches it. Chosen by ``kind``."""

from __future__ import annotations

import ipaddress
from abc import abstractmethod
from typing import Annotated, Literal, Self, get_args
from urllib.parse import urlsplit

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from config.agilex import AGILEX_TOP_SPEED_MPS, AGILEX_TOP_YAW_RATE_RADPS, NO_SERIAL, AgilexModelName
from config.loader import Section

# A command may be early by a quarter of its period: a loop with jitter would else miss every other one.
COMMAND_EARLY = 0.75

CanInterface = Literal["virtual", "udp_multicast", "socketcan", "slcan", "pcan", "gs_usb"]

# Interfaces whose bit rate is set by python-can; SocketCAN's is set with `ip link`, the others have none.
_BITRATE_INTERFACES = frozenset({"slcan", "pcan", "gs_usb"})


class CanLinkConfig(Section):
    """A CAN bus, as python-can names it. Keys that the interface would ignore are refused.

    channel: "can0" (socketcan), a serial port (slcan), a group address (udp_multicast), any
    name (virtual). AgileX chassis run at 500 kbit/s; with socketcan that is set by the system:
    ``ip link set can0 up type can bitrate 500000``.
    """

    interface: CanInterface
    channel: str = Field(min_length=1)
    bitrate: int = Field(default=500_000, ge=10_000, le=1_000_000)
    port: int = Field(default=43113, ge=1024, le=65535, description="UDP port of udp_multicast")
    hop_limit: int = Field(default=0, ge=0, le=255, description="0 keeps udp_multicast on this machine")

    @model_validator(mode="after")
    def _no_idle_keys(self) -> Self:
        given = self.model_fields_set
        if self.interface == "udp_multicast" and not _is_multicast(self.channel):
            raise ValueError(
                f"channel: udp_multicast needs a group address such as 239.74.163.2, found {self.channel!r}"
            )
        if self.interface != "udp_multicast" and (idle := given & {"port", "hop_limit"}):
            raise ValueError(f"{', '.join(sorted(idle))}: only udp_multicast has this, not {self.interface}")
        if "bitrate" in given and self.interface == "socketcan":
            raise ValueError(
                "bitrate: socketcan takes it from the system; remove the key and run "
                f"`ip link set {self.channel} up type can bitrate {self.bitrate}`"
            )
        if "bitrate" in given and self.interface not in _BITRATE_INTERFACES:
            raise ValueError(f"bitrate: {self.interface} has none; remove the key")
        return self


def _is_multicast(address: str) -> bool:
    try:
        return ipaddress.ip_address(address).is_multicast
    except ValueError:
        return False


class SerialLinkConfig(Section):
    """A serial port: a device path, or a pyserial URL such as ``socket://host:port``.

    Over a network, opening waits for the other side for up to 5 s: at the start; a connection that was lost
    is made anew beside the control loop, which goes on.
    """

    url: str = Field(min_length=1)
    baud: int = Field(default=115_200, ge=1_200, le=4_000_000)

    @field_validator("url")
    @classmethod
    def _has_host_and_port(cls, url: str) -> str:
        scheme = url.partition("://")[0]
        if scheme in _NETWORK_SCHEMES and not _names_host_and_port(url):
            raise ValueError(f"needs a host and a port, such as {scheme}://192.168.0.7:4001")
        return url

    @property
    def over_network(self) -> bool:
        """The port is at the other end of a network."""
        return self.url.partition("://")[0] in _NETWORK_SCHEMES


# pyserial's ports at the other end of a network. pyserial does not say what is wrong with such a URL.
_NETWORK_SCHEMES = frozenset({"socket", "rfc2217"})


def _names_host_and_port(url: str) -> bool:
    try:
        parts = urlsplit(url)
        return bool(parts.hostname) and parts.port is not None
    except ValueError:  # a port beyond 65535 or of letters
        return False


def _wire(link: object) -> str:
    """Which of the two link sections this is: a serial port has a url."""
    if isinstance(link, dict):
        return "serial" if "url" in link else "can"
    return "serial" if isinstance(link, SerialLinkConfig) else "can"


AgilexLinkConfig = Annotated[
    Annotated[CanLinkConfig, Tag("can")] | Annotated[SerialLinkConfig, Tag("serial")], Discriminator(_wire)
]


class AnyBaseConfig(Section):
    """What all bases have in common. An older setpoint than command_timeout_ms latches the robot."""

    command_timeout_ms: int = Field(default=100, ge=40, le=1000, description="older setpoints stop the robot")
    arming_timeout_ms: int = Field(default=3000, ge=200, le=60_000)
    battery_low_v: float | None = Field(
        default=None, gt=0, le=200, description="told where the battery stays below it for 3 s; null: never"
    )


class AgilexChassisConfig(AnyBaseConfig):
    """An AgileX base that speaks protocol V2, over CAN or, where it has that, over RS-232.

    link: ``{interface: socketcan, channel: can0}``, or ``{url: /dev/ttyUSB0}`` for RS-232.
    track_width_m: distance between the track centres. With it, dead reckoning counts the track
    odometer (0x311); with null, it integrates the reported speeds (0x221), whose yaw rate needs no
    geometry; without the key it is the model's, where a manual says it. slip_factor: effective over real
    track width, >= 1 because tracks scrub sideways in a turn: the base turns 1 / slip_factor of what its
    tracks say. Measure it by turning on the spot. actuators: how many motors report, where your base
    differs from its model. battery_low_v: without the key it is the model's, where a manual says it.
    """

    kind: Literal["agilex"]
    model: AgilexModelName = "bunker"
    link: AgilexLinkConfig
    command_period_ms: int = Field(default=20, ge=5, le=100)
    feedback_timeout_ms: int = Field(default=200, ge=40, le=2000, description="of motion feedback 0x221")
    status_timeout_ms: int = Field(default=700, ge=100, le=5000, description="of system state 0x211")
    track_width_m: float | None = Field(default=None, gt=0.05, le=5)
    slip_factor: float = Field(default=1.0, ge=1.0, le=3.0)
    actuators: int | None = Field(default=None, ge=1, le=8)

    @property
    def top_speed_mps(self) -> float:
        """No command goes beyond it."""
        return AGILEX_TOP_SPEED_MPS[self.model]

    def top_yaw_rate_radps(self, v_mps: float) -> float:
        """Maximum yaw rate at any speed v_mps.

        The base limits the commanded yaw rate, which is slip_factor times the yaw rate over ground. Above it,
        as above top_speed_mps, the driver would slow the robot in one step.
        """
        return AGILEX_TOP_YAW_RATE_RADPS[self.model] / self.slip_factor

    @model_validator(mode="after")
    def _has_that_wire(self) -> Self:
        if isinstance(self.link, SerialLinkConfig) and self.model in NO_SERIAL:
            raise ValueError(
                f"link: {self.model} cannot be driven over a serial port: {NO_SERIAL[self.model]}; use CAN, "
                "such as {interface: socketcan, channel: can0}"
            )
        return self


class _TwoChannelConfig(AnyBaseConfig):
    """What bases with one two-channel motor controller have in common: channel 1 left, channel 2 right.

    counts_per_m: encoder counts for one metre of track. slip_factor: as for AgileX.
    """

    link: SerialLinkConfig
    counts_per_m: float = Field(gt=0, le=1e7)
    track_width_m: float = Field(gt=0.05, le=5)
    slip_factor: float = Field(default=1.0, ge=1.0, le=3.0)
    invert_left: bool = False
    invert_right: bool = False
    feedback_timeout_ms: int = Field(default=300, ge=100, le=2000)
    status_timeout_ms: int = Field(default=1000, ge=200, le=5000)

    @property
    def left_sign(self) -> int:
        """Direction of channel 1 that means ahead."""
        return -1 if self.invert_left else 1

    @property
    def right_sign(self) -> int:
        """Direction of channel 2 that means ahead."""
        return -1 if self.invert_right else 1

    @property
    def effective_width_m(self) -> float:
        """See hal.chassis.tracks.TrackGeometry."""
        return self.track_width_m * self.slip_factor

    @property
    @abstractmethod
    def top_speed_mps(self) -> float:
        """No command to a track goes beyond it."""

    def top_yaw_rate_radps(self, v_mps: float) -> float:
        """With which the outer track goes as fast as it may, where the middle goes at v_mps."""
        return 2.0 * max(self.top_speed_mps - v_mps, 0.0) / self.effective_width_m


class RoboclawChassisConfig(_TwoChannelConfig):
    """A base with one RoboClaw for both tracks, packet serial, motor 1 left, motor 2 right.

    timeout_ms: after so long without a packet the controller itself stops the motors (command 14,
    steps of 100 ms); set and read back before arming. max_qpps, accel_qpps2: the fastest speed and
    the hardest ramp that may ever be sent, in counts per second (and second).
    """

    kind: Literal["roboclaw"]
    address: int = Field(default=0x80, ge=0x80, le=0x87)
    max_qpps: int = Field(gt=0, le=10_000_000)
    accel_qpps2: int = Field(gt=0, le=100_000_000)
    timeout_ms: int = Field(default=300, ge=100, le=2000, multiple_of=100)

    @property
    def top_speed_mps(self) -> float:
        """No command goes beyond it."""
        return self.max_qpps / self.counts_per_m


class RoboteqChassisConfig(_TwoChannelConfig):
    """A base with one two-channel Roboteq controller in closed-loop speed mode, channel 1 left, 2 right.

    full_speed_mps: what a track makes at command 1000, which is MXRPM through gear and sprocket. encoder:
    what the controller counts, a quadrature encoder (?C) or the motor's hall sensors (?CB). watchdog_ms:
    after so long without a command the controller itself stops the motors (RWD); set and read back before
    arming. More than twice the time between two commands: after half of it the driver says zero first.
    """

    kind: Literal["roboteq"]
    full_speed_mps: float = Field(gt=0, le=10)
    encoder: Literal["quadrature", "hall"] = "quadrature"
    watchdog_ms: int = Field(default=300, ge=100, le=2000)
    command_period_ms: int = Field(default=20, ge=10, le=100)

    @property
    def top_speed_mps(self) -> float:
        """No command goes beyond it."""
        return self.full_speed_mps


# What a wheel of a Kobuki makes (its user guide: 70 cm/s), and how far apart its wheels are.
KOBUKI_TOP_SPEED_MPS = 0.7
KOBUKI_WHEEL_BASE_M = 0.23


class KobukiChassisConfig(AnyBaseConfig):
    """A Kobuki, the base of Turtlebot 2. Its geometry is fixed: the base itself turns a twist into speeds.

    max_speed_mps, max_yaw_rate_radps: of the base; a bend in which a wheel would be faster than it makes,
    0.7 m/s, is driven slower. slip_factor: as for AgileX. base_timeout_ms: after so long without a command
    the base is taken to have stopped by itself. The firmware's time is not documented: measure it with the
    wheels off the floor.
    """

    kind: Literal["kobuki"]
    link: SerialLinkConfig
    slip_factor: float = Field(default=1.0, ge=1.0, le=3.0)
    max_speed_mps: float = Field(default=KOBUKI_TOP_SPEED_MPS, gt=0, le=KOBUKI_TOP_SPEED_MPS)
    max_yaw_rate_radps: float = Field(default=1.9, gt=0, le=3.1, description="faster, and the gyro is off")
    base_timeout_ms: int = Field(default=600, ge=100, le=5000)
    command_period_ms: int = Field(default=20, ge=10, le=100)
    feedback_timeout_ms: int = Field(default=200, ge=60, le=2000, description="of its stream, 50 a second")
    battery_low_v: float | None = Field(default=14.0, gt=0, le=200, description="as the vendor's driver")

    @property
    def top_speed_mps(self) -> float:
        """No command goes beyond it."""
        return self.max_speed_mps

    def top_yaw_rate_radps(self, v_mps: float) -> float:
        """With which the outer wheel goes as fast as it makes, where the middle goes at v_mps."""
        outer_radps = 2.0 * max(KOBUKI_TOP_SPEED_MPS - v_mps, 0.0) / (KOBUKI_WHEEL_BASE_M * self.slip_factor)
        return min(self.max_yaw_rate_radps, outer_radps)


AnyChassisConfig = (
    AgilexChassisConfig  # one a line: a kind more is a line more
    | RoboclawChassisConfig
    | RoboteqChassisConfig
    | KobukiChassisConfig
)
CHASSIS_KINDS: tuple[str, ...] = tuple(
    get_args(config.model_fields["kind"].annotation)[0] for config in get_args(AnyChassisConfig)
)
ChassisConfig = Annotated[AnyChassisConfig, Field(discriminator="kind")]
