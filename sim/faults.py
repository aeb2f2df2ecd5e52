"""What may go wrong in a mission, as data. Each mode of a mission decides how to make it happen."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Window:
    """From start_s to end_s, in seconds of the mission."""

    start_s: float
    end_s: float

    def contains(self, t_s: float) -> bool:
        """Whether t_s lies in the window."""
        return self.start_s <= t_s < self.end_s


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults of one mission.

    silent: when there are no frames.
    frozen: when the same image comes again and again, with new stamps.
    late, late_by_s: when scenes arrive late, and by how much.
    yaw_slip: share of every turn that the tracks lose.
    distance_slip: share by which the odometry counts the distance too long.
    feedback_lost_s: from this time on the chassis does not answer.
    glass: names of bodies that depth does not see.
    """

    silent: Window | None = None
    frozen: Window | None = None
    late: Window | None = None
    late_by_s: float = 0.0
    yaw_slip: float = 0.1
    distance_slip: float = 0.0
    feedback_lost_s: float | None = None
    glass: tuple[str, ...] = ()

    def late_by(self, t_s: float) -> float:
        """Seconds by which the scene of a frame exposed at t_s is late."""
        return self.late_by_s if self.late is not None and self.late.contains(t_s) else 0.0

    def blind_since(self, t_s: float, after_s: float = 0.0) -> float | None:
        """Since when the camera has shown nothing new at t_s, or within after_s before t_s; None if it does
        show new images then."""
        for window in (self.silent, self.frozen):
            if window is not None and window.start_s <= t_s < window.end_s + after_s:
                return window.start_s
        return None

    def demands_stop(self, t_s: float, after_s: float) -> bool:
        """Whether a fault that must lead to a stop holds at t_s, or did within after_s before t_s."""
        windows = [
            fault_window for fault_window in (self.silent, self.frozen, self.late) if fault_window is not None
        ]
        if any(fault_window.start_s <= t_s < fault_window.end_s + after_s for fault_window in windows):
            return True
        return self.feedback_lost_s is not None and t_s >= self.feedback_lost_s


NO_FAULTS = Faults()
