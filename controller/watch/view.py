"""What is printed of the present, once a second."""

from __future__ import annotations

import math

import numpy as np

from config.robot import Mount
from controller.control import ControlStep
from controller.decision.decision import Decision
from controller.realtime.messages import SceneMessage
from controller.terminal.console import Console
from controller.watch.result import Floor, Relative, WatchResult
from hal.clocks import NS_PER_S
from hal.types import ChassisState
from vision.scene import Scene

_EVERY_NS = NS_PER_S


class View:
    """Prints what is known once a second. configured: where the camera should be."""

    def __init__(self, console: Console, configured: Mount) -> None:
        self._console = console
        self._configured = configured
        self._since_ns: int | None = None
        self._durations_ms: list[float] = []

    def take_message(self, message: SceneMessage) -> None:
        """A frame that was processed."""
        self._durations_ms.append(sum(message.timing_ms.values()))

    def show(self, result: WatchResult, step: ControlStep) -> None:
        """Print if a second is over."""
        if self._since_ns is None:
            self._since_ns = step.now_ns
        elapsed_ns = step.now_ns - self._since_ns
        if elapsed_ns < _EVERY_NS:
            return
        rate_hz = len(self._durations_ms) * NS_PER_S / elapsed_ns
        rows = [("camera", camera_text(result.last_scene, rate_hz, self._durations_ms))]
        if result.last_scene is not None:
            rows.append(("floor", floor_text(result.floor_now(), self._configured)))
            rows.append(("obstacles", obstacles_text(result.obstacles())))
            rows.append(("decision", decision_text(step.decision)))
        rows.append(("base", base_text(step.chassis)))
        if step.chassis.pose.finite:
            rows.append(("odometry", odometry_text(step.chassis, result.odometry_turn_rad)))
        self._console.view(result.seconds(step.now_ns), rows)
        self._since_ns = step.now_ns
        self._durations_ms.clear()


def camera_text(scene: Scene | None, rate_hz: float, durations_ms: list[float]) -> str:
    """Condition, frame rate, and how long perception took for a frame."""
    if scene is None:
        return "no frame yet"
    health = scene.health
    text = f"{health.condition.value}{f' ({health.reason})' if health.reason else ''}"
    if not durations_ms:
        return f"{text}; no frame in the last second"
    return f"{text}; {rate_hz:.0f} frames/s, {np.median(durations_ms):.1f} ms each"


def floor_text(floor: Floor | None, configured: Mount) -> str:
    """The camera over the floor that it sees, beside where it is mounted by the configuration."""
    by_yaml = f"{configured.height_m:.2f} m and {configured.pitch_deg:.1f} degrees are configured"
    if floor is None:
        return f"not seen yet; {by_yaml}"
    return f"{placed(floor)}; {by_yaml}"


def placed(floor: Floor) -> str:
    """How the camera is mounted, by the floor."""
    roll_deg = math.degrees(floor.roll_rad)
    side = "right" if roll_deg > 0.0 else "left"
    return (
        f"{floor.camera_height_m:.2f} m below the camera, which looks down by "
        f"{math.degrees(floor.pitch_rad):.1f} degrees and leans to its {side} by {abs(roll_deg):.1f}"
    )


def obstacles_text(seen: list[Relative]) -> str:
    """How many, and the nearest that moves and the nearest that stands."""
    if not seen:
        return "none"
    texts = []
    for moving in (True, False):
        some = [obstacle for obstacle in seen if obstacle.moving is moving]
        if some:
            texts.append(_nearest_text(min(some, key=lambda obstacle: obstacle.ahead_m)))
    return f"{len(seen)}; nearest: {'; '.join(texts)}"


def _nearest_text(seen: Relative) -> str:
    side = "left" if seen.left_m >= 0.0 else "right"
    where = f"{seen.ahead_m:.1f} m ahead, {abs(seen.left_m):.1f} m to the {side}"
    if not seen.moving:
        return f"standing {where}"
    speed_mps = math.hypot(seen.ahead_mps, seen.left_mps)
    return f"moving {where}, {speed_mps:.2f} m/s ({seen.ahead_mps:+.1f} ahead, {seen.left_mps:+.1f} left)"


def decision_text(decision: Decision) -> str:
    """What the robot would do if it drove straight ahead."""
    reason = decision.reason
    why = "nothing is in the way" if reason.rule == "free" else reason.sentence
    return f"would {decision.action.value}, {decision.target_speed_mps:.2f} m/s straight ahead: {why}"


def base_text(state: ChassisState) -> str:
    """Mode with its reason, battery, faults."""
    texts = [f"{state.mode.value} ({state.reason})"]
    if math.isfinite(state.battery_v):
        texts.append(f"{state.battery_v:.1f} V")
    return "; ".join([*texts, *state.faults])


def odometry_text(state: ChassisState, turn_rad: float) -> str:
    """Pose by dead reckoning, what was turned in all, and the measured speed."""
    pose = state.pose
    text = (
        f"x {pose.x_m:z.2f} m, y {pose.y_m:z.2f} m, heading {math.degrees(pose.heading_rad):z.1f} degrees, "
        f"turned by {math.degrees(turn_rad):z.1f} in all"
    )
    if math.isfinite(state.v_mps + state.w_radps):
        text += f"; {state.v_mps:z.2f} m/s, {math.degrees(state.w_radps):z.1f} degrees/s"
    return text
