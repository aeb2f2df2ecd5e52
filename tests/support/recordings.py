"""Small recordings for tests: TUM folders with images that are easy to tell apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hal.cameras.recording import Recording, frames_of
from hal.cameras.tum_writer import TumWriter
from hal.types import Intrinsics, RgbdFrame

DESK_RPY = Path(__file__).resolve().parents[1] / "recordings" / "desk_rpy"

SMALL = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
START_NS = 1_000_000_000
PERIOD_NS = 33_333_333


def small_frame(number: int) -> RgbdFrame:
    """64x48; the colour is 10 * number everywhere, the depth 1000 + number thousandths of a metre."""
    return RgbdFrame(
        colour=np.full((SMALL.height, SMALL.width, 3), 10 * number, np.uint8),
        depth=np.full((SMALL.height, SMALL.width), 1000 + number, np.uint16),
        depth_scale_m=0.001,
        captured_ns=START_NS + number * PERIOD_NS,
        device_s=0.0,
        sequence=number,
        intrinsics=SMALL,
    )


def write_recording(folder: Path, count: int = 4) -> Path:
    """A faultless recording of small frames, to be spoiled by the test. Returns folder."""
    with TumWriter(folder) as writer:
        for number in range(count):
            writer.write(small_frame(number))
    return folder


def colour_files(folder: Path) -> list[Path]:
    return sorted((folder / "rgb").iterdir())


def depth_files(folder: Path) -> list[Path]:
    return sorted((folder / "depth").iterdir())


def set_key(folder: Path, key: str, value: str | None) -> None:
    """Write ``key: value`` into camera.yaml in place of what stands there; None removes the key."""
    path = folder / "camera.yaml"
    lines = [line for line in path.read_text().splitlines() if not line.startswith(f"{key}:")]
    if value is not None:
        lines.append(f"{key}: {value}")
    path.write_text("\n".join(lines) + "\n")


def read_all(replay: Recording) -> list[RgbdFrame]:
    """Every frame of a recording, from opening it to its end."""
    with replay:
        return list(frames_of(replay))
