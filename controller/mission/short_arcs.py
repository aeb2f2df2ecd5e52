"""Arcs whose angle was most likely given in radians: a warning before the drive."""

from __future__ import annotations

from config.app import AppConfig
from config.path import ArcSpec
from controller.build import path_spec


def short_arc_warning(config: AppConfig) -> str | None:
    """One line about every arc of the path that hardly turns; None if there is none. Raises ConfigError."""
    if config.path is None and config.simulation is None:
        return None
    where, spec = path_spec(config)
    warnings = [
        f"path.segments.{number}: the arc is only {segment.length_m - segment.blend_m:.2f} m long; "
        f"{segment.in_degrees}"
        for number, segment in enumerate(spec.segments)
        if isinstance(segment, ArcSpec) and segment.may_be_in_radians
    ]
    return f"{where}: {'; '.join(warnings)}" if warnings else None
