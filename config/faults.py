"""What goes wrong during a simulated drive, as written in a scenario's section `faults`.

Times are in seconds since the scenario began. Where a fault is brought about: camera faults in
sim/rendering/faulty_camera.py and late_camera.py, slip in sim/plant.py, lost feedback in sim/simulation.py.
Where perception is a noise model, it is controller/campaign/noise_mission.py; there is no vibration there.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from config.loader import Section

_Second = Annotated[float, Field(ge=0, le=3600)]


class Window(Section):
    """From start_s to just before end_s."""

    start_s: _Second
    end_s: _Second

    @model_validator(mode="after")
    def _has_a_length(self) -> Self:
        if self.end_s <= self.start_s:
            raise ValueError(f"end_s ({self.end_s:g}) must be more than start_s ({self.start_s:g})")
        return self

    def contains(self, t_s: float, after_s: float = 0.0) -> bool:
        """Whether t_s lies in the window, or within after_s behind its end."""
        return self.start_s <= t_s < self.end_s + after_s


class LateWindow(Window):
    """Frames exposed in this window reach the decision delay_s later than usual."""

    delay_s: float = Field(gt=0, le=10)


class Vibration(Section):
    """The camera pitches up and down, sinusoidally, by amplitude_deg either way."""

    amplitude_deg: float = Field(gt=0, le=5)
    frequency_hz: float = Field(default=8.0, gt=0, le=100)


Windows = Annotated[tuple[Window, ...], Field(strict=False)]
LateWindows = Annotated[tuple[LateWindow, ...], Field(strict=False)]


class Faults(Section):
    """The faults of one drive; without a key that fault does not occur."""

    no_frames: Windows = Field(default=(), description="the camera sends nothing")
    frozen_frames: Windows = Field(
        default=(), description="the camera sends the same image and depth again and again, with new stamps"
    )
    late_frames: LateWindows = ()
    yaw_slip: float | None = Field(
        default=None,
        ge=0,
        le=0.5,
        description="share of every turn that the tracks lose; without it that of simulation.plant",
    )
    distance_slip: float | None = Field(
        default=None,
        ge=-0.2,
        le=0.5,
        description="share by which the tracks count the distance too long; below 0, too short",
    )
    feedback_lost_s: _Second | None = Field(
        default=None, description="from then on the base answers nothing; its own time-out stops it"
    )
    vibration: Vibration | None = None

    def late_by(self, t_s: float) -> float:
        """Seconds by which the scene of a frame exposed at t_s is late."""
        return max((late.delay_s for late in self.late_frames if late.contains(t_s)), default=0.0)

    def is_silent(self, t_s: float) -> bool:
        """Whether the camera sends nothing at t_s."""
        return any(window.contains(t_s) for window in self.no_frames)

    def is_frozen(self, t_s: float) -> bool:
        """Whether the camera repeats its last image at t_s."""
        return any(window.contains(t_s) for window in self.frozen_frames)

    def blind_since(self, t_s: float, after_s: float = 0.0) -> float | None:
        """Since when the camera has shown nothing new at t_s, or within after_s before t_s; None if it does
        show new images then."""
        for window in (*self.no_frames, *self.frozen_frames):
            if window.contains(t_s, after_s):
                return window.start_s
        return None

    def demands_stop(self, t_s: float, after_s: float) -> bool:
        """Whether a fault that must lead to a stop holds at t_s, or did within after_s before t_s."""
        windows = (*self.no_frames, *self.frozen_frames, *self.late_frames)
        if any(window.contains(t_s, after_s) for window in windows):
            return True
        return self.feedback_lost_s is not None and t_s >= self.feedback_lost_s


NO_FAULTS = Faults()
