"""What several tests of the cameras are given."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.recordings import write_recording


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A good TUM folder of four small frames."""
    return write_recording(tmp_path / "recording", count=4)
