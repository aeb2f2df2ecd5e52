"""The path's YAML: lengths by hand, and what is refused with which words."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from config.loader import ConfigError, load
from config.path import ArcSpec, LineSpec, PathSpec


def read(tmp_path: Path, text: str) -> PathSpec:
    file = tmp_path / "path.yaml"
    file.write_text(text)
    return load(file, PathSpec)


def test_every_key_of_a_path_is_read(tmp_path: Path) -> None:
    spec = read(
        tmp_path,
        """
start: {x_m: 1, y_m: -2.5, heading_deg: 90}
segments:
  - {kind: line, length_m: 10}
  - {kind: arc, radius_m: 2, angle_deg: -90, max_speed_mps: 0.5, blend_m: 1}
""",
    )
    assert (spec.start.x_m, spec.start.y_m, spec.start.heading_deg) == (1.0, -2.5, 90.0)
    line, arc = spec.segments
    assert isinstance(line, LineSpec)
    assert isinstance(arc, ArcSpec)
    assert line.max_speed_mps is None
    assert arc.max_speed_mps == 0.5
    assert spec.length_m == pytest.approx(10.0 + math.pi + 1.0)


@pytest.mark.parametrize(
    ("segments", "said"),
    [
        ("[]", "segments must hold at least one line or arc"),
        ("[{kind: line, length_m: 0}]", "segments.0.length_m: Input should be greater than 0, found 0"),
        ("[{kind: line, length_m: .nan}]", "segments.0.length_m"),
        ("[{kind: line, length_m: '3'}]", "segments.0.length_m: Input should be a valid number"),
        ("[{kind: line}]", "segments.0.length_m: missing key"),
        ("[{kind: line, length_m: 1, speed: 2}]", "segments.0.speed: unknown key"),
        ("[{kind: bow, length_m: 1}]", "'bow'"),
        ("[{kind: arc, radius_m: -1, angle_deg: 90}]", "radius_m: Input should be greater than 0"),
        ("[{kind: arc, radius_m: 1, angle_deg: 0}]", "angle_deg must not be zero; write a line instead"),
        ("[{kind: arc, radius_m: 1, angle_deg: 400}]", "angle_deg"),
        ("[{kind: arc, radius_m: 1, angle_deg: 90, blend_m: 1.6}]", "radius_m x angle = 1.571 m"),
        ("[{kind: line, length_m: 1, max_speed_mps: 0}]", "max_speed_mps"),
    ],
)
def test_impossible_paths_are_refused_in_one_line(tmp_path: Path, segments: str, said: str) -> None:
    with pytest.raises(ConfigError) as refused:
        read(tmp_path, f"segments: {segments}")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "path.yaml" in str(refused.value)
