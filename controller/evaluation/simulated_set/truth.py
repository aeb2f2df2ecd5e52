"""Ground truth of one frame from the simulator, in the form that the scores need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.evaluation.types import NO_BOX, FrameTruth, TrueObject
from hal.types import FloatArray, Intrinsics, Pose
from sim.rendering.render import Picture
from sim.rendering.truth import BodyTruth, GroundTruth
from sim.world import BodyState, World

_MIN_TURN_RADPS = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class TrueImages:
    """instances: (H, W) uint16 body ids. depth_m: (H, W) float32, 0 where there is no surface."""

    instances: NDArray[np.uint16]
    depth_m: NDArray[np.float32]


class FrameTruthBuilder:
    """Ground truth of one world as seen by one camera."""

    def __init__(self, world: World, intrinsics: Intrinsics) -> None:
        self._world = world
        self._truth = GroundTruth(world, intrinsics)
        self._movers = frozenset(body.id for body in world.bodies(0.0) if body.moves)

    def images(self, picture: Picture) -> TrueImages:
        """True images of instances and depth; copies, so they stay valid after the picture."""
        inverse = picture.inverse_depth
        depth_m = np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0.0)
        return TrueImages(picture.instance_mask(), depth_m)

    def frame(self, picture: Picture) -> FrameTruth:
        """All bodies that have a motion plan, visible or not."""
        if not self._movers:
            return FrameTruth(picture.t_s, ())
        visible = {body.state.id: body for body in self._truth.bodies(picture, self._movers)}
        objects = tuple(
            _visible_object(visible[body.id]) if body.id in visible else _hidden_object(body, picture.camera)
            for body in self._world.bodies(picture.t_s)
            if body.moves
        )
        return FrameTruth(picture.t_s, objects)


def _is_turning(body: BodyState) -> bool:
    return abs(body.yaw_rate_radps) > _MIN_TURN_RADPS


def _visible_object(body: BodyTruth) -> TrueObject:
    u0, v0, u1, v1 = body.bbox_px
    return TrueObject(
        id=body.state.id,
        kind=body.state.kind,
        box=(float(u0), float(v0), float(u1), float(v1)),
        visible_px=body.visible_px,
        visible_ratio=body.visible_ratio,
        position_m=body.position_m,
        velocity_mps=body.velocity_mps,
        turning=_is_turning(body.state),
    )


def _hidden_object(body: BodyState, camera: Pose) -> TrueObject:
    velocity: FloatArray = np.array([*body.velocity_mps, 0.0]) @ camera.rotation
    on_floor = np.array([[body.pose.x_m, body.pose.y_m, 0.5 * sum(body.z_m)]])
    middle = camera.inverse().apply(on_floor)[0]
    return TrueObject(
        id=body.id,
        kind=body.kind,
        box=NO_BOX,
        visible_px=0,
        visible_ratio=0.0,
        position_m=middle,
        velocity_mps=velocity,
        turning=_is_turning(body),
    )
