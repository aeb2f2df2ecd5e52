"""The result of perception for one frame: for the decision, and for perception itself in the next frame."""

from __future__ import annotations

from hal.records import record
from vision.fragments.attention import NeedsFragments
from vision.scene import Fragments, Scene


@record(frozen=True, slots=True, eq=False)
class Percept:
    """scene, fragments: of one frame. needs_fragments: bodies on which the next frame looks for more."""

    scene: Scene
    fragments: Fragments
    needs_fragments: NeedsFragments
