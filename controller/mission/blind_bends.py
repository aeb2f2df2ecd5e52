"""Bends that the camera cannot see round: a warning before the drive, or the robot may wait there for ever.

There is no formula of its own here. controller/decision/sight.py, which decides during a drive how far the
floor is known, is moved along each bend of the path with all that this camera could see of an empty hall. If
there is a place where a standing robot would not be allowed to start again, the bend is reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from config.app import AppConfig
from config.decision import DecisionConfig
from config.path import ArcSpec, LineSpec, PathSpec
from config.robot import Robot
from controller import braking
from controller.build import build_path, path_spec
from controller.decision.bodies import no_bodies
from controller.decision.corridor import Corridor
from controller.decision.limits import min_start_mps
from controller.decision.sight import Sight
from controller.decision.surfaces import NO_SURFACES
from controller.path.path import Path
from hal.clocks import NS_PER_S
from hal.geometry import mount_of
from hal.types import CameraMount, FloatArray
from vision.scene import FreeSpace

_STEP_M = 0.1
# The check begins this far before a bend, so that the floor that is free by consent lies behind at the bend.
_RUN_IN_M = 3.0
# Reserve: floor is known in cells of 0.2 m, and real drives are less exact and real scans less complete.
_SPARE_M = 0.2
_BANDS = 80
_WIDEST_BEND_M = 20.0  # no larger radius is proposed
_RADIUS_PRECISION_M = 0.05  # precision of the proposed radius


@dataclass(frozen=True, slots=True)
class CameraView:
    """What the camera sees at most.

    left_tan, right_tan: tangents of the angles from the optical axis to the left and right edge of the image,
    both positive. range_m: how far the floor is seen.
    """

    left_tan: float
    right_tan: float
    range_m: float

    @property
    def degrees(self) -> float:
        """The angle of view, from edge to edge."""
        return math.degrees(math.atan(self.left_tan) + math.atan(self.right_tan))


@dataclass(frozen=True, slots=True)
class BlindBend:
    """A bend that the camera cannot see round.

    stop_s_m: where along the path the robot would stand.
    segment: index of the bend among the segments of the path.
    radius_m: its radius.
    min_radius_m: the least radius that the camera could see round; None if there is none.
    """

    stop_s_m: float
    segment: int
    radius_m: float
    min_radius_m: float | None


def view_of(config: AppConfig) -> CameraView | None:
    """What the camera of this configuration sees at most; None if only its recording tells."""
    tangents = config.camera.edge_tangents
    if tangents is None:
        return None
    level = math.cos(config.robot.camera_mount.pitch_rad)
    range_m = min(config.decision.sight.range_m, config.perception.max_depth_m)
    return CameraView(tangents[0] / level, tangents[1] / level, range_m)


def blind_bend_warning(config: AppConfig) -> str | None:
    """A warning about the first bend of the path that the camera cannot see round: where, why and what to do.

    One line. None if there is no such bend, or if the angle of view is not known. Raises ConfigError,
    PathError.
    """
    view = view_of(config)
    if view is None:
        return None
    where, spec = path_spec(config)
    path = build_path(config)
    check = BendCheck(config.robot, mount_of(config.robot), view, config.decision)
    bend = check.first_blind_bend(spec, path)
    if bend is None:
        return None
    wider = (
        "" if bend.min_radius_m is None else f"widen it to a radius of {bend.min_radius_m:.1f} m or more, or "
    )
    return (
        f"{where}: path.segments.{bend.segment}: a view of {int(view.degrees)} degrees does not reach round "
        f"this bend of {bend.radius_m:g} m radius: {bend.stop_s_m:.1f} m along the path the robot may wait "
        f"forever for floor that it cannot see; {wider}use a camera with a wider view"
    )


@dataclass(frozen=True, slots=True)
class BendCheck:
    """Looks for blind bends, for one robot and its camera."""

    robot: Robot
    mount: CameraMount
    view: CameraView
    decision: DecisionConfig

    def first_blind_bend(self, spec: PathSpec, path: Path) -> BlindBend | None:
        """The first bend of path, made of spec, in which a robot that stands would not start again."""
        ends = np.cumsum([segment.length_m for segment in spec.segments])
        arcs = [k for k, segment in enumerate(spec.segments) if isinstance(segment, ArcSpec)]
        for begin_m, end_m in _around(ends, arcs, path.length_m):
            found = self._first_deadlock(path, begin_m, end_m)
            if found is None:
                continue
            stop_s_m, unseen_s_m = found
            # The hidden floor may lie behind the bend, so the bend is the last one that begins before it.
            segment = max(
                (k for k in arcs if ends[k] - spec.segments[k].length_m <= unseen_s_m), default=arcs[0]
            )
            bend = spec.segments[segment]
            assert isinstance(bend, ArcSpec)
            min_radius_m = self._min_radius_m(bend)
            return BlindBend(stop_s_m, segment, bend.radius_m, min_radius_m)
        return None

    def _first_deadlock(self, path: Path, begin_m: float, end_m: float) -> tuple[float, float] | None:
        """Where from begin_m to end_m the robot would wait for ever; how far the floor is known there."""
        view, decision, comfort = self.view, self.decision, braking.comfort(self.robot.limits)
        corridor = Corridor(path, self.robot.body)
        sight = Sight(corridor, self.mount, decision, begin_m)
        half_width = 0.5 * (view.left_tan + view.right_tan) / _BANDS
        free = FreeSpace(
            half_width * (2.0 * np.arange(_BANDS, dtype=np.float64) + 1.0) - view.left_tan,
            half_width,
            np.full(_BANDS, math.inf),
            np.full(_BANDS, view.range_m),
        )
        go_mps = min_start_mps(decision.release, comfort)
        # Longer from step to step than floor is remembered, so that of the floor out of view only that right
        # ahead is still known, as after a stop.
        step_ns = round((decision.sight.memory_s + 1.0) * NS_PER_S)
        for k, s_m in enumerate(np.arange(begin_m, end_m, _STEP_M).tolist()):
            sight.look(free, NO_SURFACES, path.pose(s_m), s_m, k * step_ns, no_bodies(0), True)
            if sight.known_s_m >= path.length_m + corridor.front_m:
                continue
            allowed_mps = braking.speed_for_distance(
                sight.known_s_m - (s_m + corridor.front_m) - _SPARE_M,
                comfort,
                latency_s=decision.chassis_delay_s,
                margin_m=decision.margins.least_m,
            )
            if allowed_mps < go_mps:
                return s_m, sight.known_s_m
        return None

    def _min_radius_m(self, bend: ArcSpec) -> float | None:
        """The least radius that this camera sees round in a half turn, rounded up to 0.1 m; None above 20."""
        low_m, high_m = bend.radius_m, _WIDEST_BEND_M
        if low_m >= high_m or self._half_turn_blind(high_m):
            return None
        while high_m - low_m > _RADIUS_PRECISION_M:
            middle_m = 0.5 * (low_m + high_m)
            if self._half_turn_blind(middle_m):
                low_m = middle_m
            else:
                high_m = middle_m
        return math.ceil(high_m * 10.0) / 10.0

    def _half_turn_blind(self, radius_m: float) -> bool:
        line = LineSpec(kind="line", length_m=_RUN_IN_M)
        turn = ArcSpec(kind="arc", radius_m=radius_m, angle_deg=180.0)
        path = Path(PathSpec(segments=(line, turn, line)), self.robot)
        return self._first_deadlock(path, 0.0, path.length_m - _RUN_IN_M) is not None


def _around(ends: FloatArray, arcs: list[int], length_m: float) -> Iterator[tuple[float, float]]:
    """Stretches of the path (from, to) with a bend ahead or on them; bends that follow closely share one."""
    begin_m = end_m = -math.inf
    for k in arcs:
        starts_m = float(ends[k - 1]) if k > 0 else 0.0
        if starts_m - _RUN_IN_M > end_m:
            if end_m > begin_m:
                yield begin_m, end_m
            begin_m = max(starts_m - _RUN_IN_M, 0.0)
        end_m = min(float(ends[k]), length_m)
    if end_m > begin_m:
        yield begin_m, end_m
