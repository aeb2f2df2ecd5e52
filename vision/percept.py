"""What perception says of one frame, to others and to itself in the next one."""

from __future__ import annotations

from dataclasses import dataclass

from vision.fragments.attention import Wanted
from vision.scene import Fragments, Scene


@dataclass(frozen=True, slots=True, eq=False)
class Percept:
    """scene and fragments of one frame; wanted: where more fragments would tell more."""

    scene: Scene
    fragments: Fragments
    wanted: Wanted
