"""gyro.txt of a recording: lines ``t wx wy wz`` in s and rad/s, in optical axes of the colour camera."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from hal.cameras.gyro_track import GyroTrack
from hal.cameras.recording import SkippedFrame
from hal.cameras.tum_index import content_lines, format_stamp, parse_stamp_ns
from hal.types import GyroSamples

GYRO_FILE = "gyro.txt"
GYRO_HEADING = "# gyro, optical axes of the colour camera: time in seconds, wx wy wz in rad/s"
_COLUMNS = 4


def read_gyro(folder: Path) -> tuple[GyroTrack | None, tuple[SkippedFrame, ...]]:
    """(the readings, the lines that cannot be used); no track if there is no such file, or no usable line.

    Raises BadRecording if the file cannot be read.
    """
    path = folder / GYRO_FILE
    if not os.path.isfile(path):
        return None, ()
    stamps_ns: list[int] = []
    rates_radps: list[tuple[float, ...]] = []
    bad_lines: list[SkippedFrame] = []
    for number, line in content_lines(path):
        try:
            stamp_ns, rates = _parse(line)
        except ValueError as error:
            bad_lines.append(SkippedFrame(f"{GYRO_FILE}:{number}", str(error)))
            continue
        stamps_ns.append(stamp_ns)
        rates_radps.append(rates)
    if not stamps_ns:
        return None, tuple(bad_lines)
    track = GyroTrack(GYRO_FILE, np.array(stamps_ns, np.int64), np.array(rates_radps, np.float64))
    return track, tuple(bad_lines)


def gyro_lines(samples: GyroSamples) -> str:
    """The lines of gyro.txt for these readings; those that are not finite are left out."""
    return "\n".join(
        f"{format_stamp(stamp_ns)} {' '.join(f'{rate:.9f}' for rate in rates)}"
        for stamp_ns, rates in zip(samples.stamps_ns.tolist(), samples.rates_radps.tolist(), strict=True)
        if all(map(math.isfinite, rates))
    )


def _parse(line: str) -> tuple[int, tuple[float, ...]]:
    """Time and rates. Raises ValueError saying what is wrong."""
    fields = line.split()
    if len(fields) != _COLUMNS:
        raise ValueError(f"has {len(fields)} columns, a reading is t wx wy wz")
    try:
        rates = tuple(map(float, fields[1:]))
    except ValueError:
        raise ValueError(f"holds something that is not a number: {line!r}") from None
    if not all(map(math.isfinite, rates)):
        raise ValueError(f"holds a value that is not finite: {line!r}")
    return parse_stamp_ns(fields[0]), rates
