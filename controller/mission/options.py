"""The options that all drives have in common."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from controller.record.recorder import RecordingOptions


@dataclass(frozen=True, slots=True)
class MissionOptions:
    """What `treadwatch run`, `govern` and `watch` are told on the command line."""

    config_path: Path
    scenario: str | None = None
    seed: int | None = None
    observations: Path | None = None
    video: Path | None = None
    record: Path | None = None
    quiet: bool = False

    def recording(self, *, timed: bool = True) -> RecordingOptions:
        """The files to write. timed: see there."""
        return RecordingOptions(self.observations, self.video, self.record, timed)


def scenario_as_typed(scenario: str) -> str:
    """A file on the command line is relative to the working directory (in a YAML, to that YAML)."""
    return str(Path.cwd() / scenario) if scenario.endswith((".yaml", ".yml")) else scenario
