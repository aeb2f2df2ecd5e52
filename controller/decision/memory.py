"""Bodies that have left the camera's view but are still there: under the robot's nose, beside or above it.

A body of the last scene that is missing in this one is kept while its place is outside the view:

* Standing (seen for 0.5 s at least; the robot drives): kept where it was, until its place is in view again,
  a seen body covers it, or it lies 2 m behind the camera. If the robot stood, the body went away: dropped.
* Moving: goes on with its last velocity for 2 s, or for 6 s if that leads towards the robot's axis or along
  with the robot. Dropped earlier where its place is well within the view or lies 2 m behind the camera.
* Judged standing (a verdict takes some frames), but clearly measured as coming (or as going anywhere,
  if seen for 0.5 to 1 s): counts as moving, with the velocity measured last, even if the robot stands.
* Should have come in, but its place is seen to be free: moved sideways to the edge of the free space, and no
  longer coming (the velocity towards the axis becomes 0, the variance grows). The same 2 s or 6 s apply. Who
  was clearly coming may first be some decimetres late.
* Another body is seen where a moving one was expected: the kept one is dropped only if the other has been
  seen for more than 0.5 s, with the same velocity within 2 sigma. Else both count: they may be two people.
* A strip that was seen to move for less than 0.5 s within 0.5 m of a mover that is kept for longer, with the
  same velocity within 2 sigma, was the last of that one to be in view.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from controller.decision.bodies import Bodies, no_bodies
from controller.decision.limits import LEAVES_ASLANT
from controller.decision.view_edges import UNCERTAIN_M, highest_seen_m, lowest_seen_m
from hal.clocks import NS_PER_S
from hal.types import CameraMount, FloatArray, PlanarPose
from vision.bodies.judgement import IMPLAUSIBLE
from vision.scene import FreeSpace

BoolArray = NDArray[np.bool_]

_SAME_PLACE_M = 0.25
# What was seen for less than this is not believed once it is gone.
SETTLED_S = 0.5
_MOVING_KEPT_S, _MAY_COME_KEPT_S = 2.0, 6.0
_EDGE_M, _EDGE_MPS = 0.3, 0.15
# So far from the middle of the view stays whoever has not been seen to come in.
_MIDDLE_M = 0.1
# By so much in a second somebody unseen may have changed its velocity.
_TURNS_MPS2 = 0.25
_TOUCHING = 1e-6
# Noise makes whatever stands beside the view creep now and then, and each time the robot would slow down: so
# much is no noise.
_CLEAR_SIGMAS, _CLEAR_MPS = 3.3, 0.2
# Nobody is as narrow as this, and ends of racks are: half of the greatest width that was seen.
_NOBODY_HALF_M = 0.1
_REST_M = 0.5
# So certainly it goes that it will not be found where it was seen last. Who has been looked at for longer
# stands by a verdict that had time: what sinks below the view may well seem to move.
_CERTAIN_SIGMAS, _NO_VERDICT_S = 5.0, 1.0
# Two velocities that differ by so much are of two.
_APART_SIGMAS = 2.0


class OutOfView:
    """Call leaving, then update, once a scene. near_m: nearer than this ahead of the camera the floor is not
    seen; up_tan: so much a metre rises the upper edge of its view. Both to be set before, where the scene
    tells. max_obstacle_speed_mps: a velocity that was measured as much greater is a mistake."""

    def __init__(self, mount: CameraMount, near_m: float, max_obstacle_speed_mps: float) -> None:
        self._mount, self.near_m, self.up_tan = mount, near_m, math.inf
        self._mistaken_mps = IMPLAUSIBLE * max_obstacle_speed_mps
        self._bodies = no_bodies(0)
        self._since_s: FloatArray = np.zeros(0)
        # How those that stand by the verdict were measured when they were last seen, of whom clearly came.
        self._coming: dict[int, FloatArray] = {}
        self._widest_half_m: dict[int, float] = {}

    def leaving(self, seen: Bodies, pose: PlanarPose, edge_tan: float) -> Bodies:
        """The bodies seen; standing ones that perception no longer sees but still expects, out of view,
        count as moving if they came towards the robot's axis: with the velocity measured last."""
        # However long something stood there: the velocity of what has a new number was hardly measured.
        settled = ~seen.moving & (seen.tracked_s > SETTLED_S) & self._wide_enough(seen)
        out = settled & (seen.unseen_s > 0.0)
        comes = settled & ~out & _clearly_comes(seen, pose)
        if not self._coming and not comes.any():
            return seen
        ids, before = seen.ids.tolist(), self._coming
        self._coming = {ids[k]: seen.measured_mps[k] for k in np.flatnonzero(comes).tolist()}
        self._coming |= {ids[k]: before[ids[k]] for k in np.flatnonzero(out).tolist() if ids[k] in before}
        came = np.array([one in self._coming for one in ids], np.bool_)
        leaves = out & came & self._hidden(seen, pose, edge_tan)
        if not leaves.any():
            return seen
        velocity = seen.velocity_mps.copy()
        velocity[leaves] = [self._coming[ids[k]] for k in np.flatnonzero(leaves).tolist()]
        return replace(seen, velocity_mps=velocity, moving=seen.moving | leaves)

    def _wide_enough(self, seen: Bodies) -> BoolArray:
        """(N,) who was somebody's width at some time; at the edge of the view, everybody gets narrow."""
        ids, before = seen.ids.tolist(), self._widest_half_m
        widths = [
            max(half_m, before.get(one, 0.0))
            for one, half_m in zip(ids, seen.half_across_m.tolist(), strict=True)
        ]
        self._widest_half_m = dict(zip(ids, widths, strict=True))
        return np.array(widths) > _NOBODY_HALF_M

    def update(
        self,
        before: Bodies,
        seen: Bodies,
        pose: PlanarPose,
        edge_tan: float,
        standing: bool,
        free: FreeSpace,
    ) -> Bodies:
        """What is to be reckoned with besides seen. before: what was seen in the scene before. free: of this
        scene.

        What stood and vanishes while the robot stands has gone by itself, and so has what was part of
        something that is still seen.
        """
        dt_s = (seen.captured_ns - before.captured_ns) / NS_PER_S
        gone = before.select(_missing(before.ids, seen.ids))
        if len(gone):
            gone = _as_measured(gone, self._mistaken_mps)
            gone = gone.select(gone.moving | ((gone.age_s >= SETTLED_S) & (not standing)))
        if not len(self._since_s) and not len(gone):
            return no_bodies(seen.captured_ns)
        since = np.concatenate((self._since_s, np.zeros(len(gone)))) + dt_s
        bodies = self._bodies.joined(gone)
        bodies = replace(
            bodies,
            captured_ns=seen.captured_ns,
            xy_m=self._gone_on(bodies, dt_s, pose),
            unseen_s=bodies.unseen_s + dt_s,
        )
        part_of = seen.covers(bodies.xy_m, bodies.half_view_m, _SAME_PLACE_M)
        kept = self._hidden(bodies, pose, edge_tan) & _missing(bodies.ids, seen.ids)
        some_move = bodies.moving.any()
        if some_move:
            part_of &= _alike(bodies, seen) | ~bodies.moving[:, None]
            kept &= ~bodies.moving | (
                since <= np.where(_may_come(bodies, pose), _MAY_COME_KEPT_S, _MOVING_KEPT_S)
            )
        kept &= ~part_of.any(axis=1)
        if some_move:
            kept &= ~_rests(bodies, kept)
        self._since_s = since[kept]
        self._bodies = self._kept_out(bodies.select(kept), pose, free)
        return self._bodies

    def _gone_on(self, bodies: Bodies, dt_s: float, pose: PlanarPose) -> FloatArray:
        """(N, 2) where they are dt_s later if they go on as they did. Nobody has passed ahead of the robot
        unseen: who comes is still on the side where it was."""
        if not bodies.moving.any():
            return bodies.xy_m
        way = bodies.velocity_mps * dt_s
        forward = np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad)])
        leftward = np.array([-forward[1], forward[0]])
        offset = bodies.xy_m - (pose.x_m, pose.y_m)
        left = offset @ leftward - self._mount.left_m
        side = np.where(left < 0.0, -1.0, 1.0)
        ahead = offset @ forward - self._mount.forward_m - bodies.half_view_m > 0.0
        sigma_mps = np.sqrt(leftward @ bodies.covariance @ leftward)
        comes = bodies.moving & ahead & (-side * (bodies.velocity_mps @ leftward) > sigma_mps)
        past_m = np.where(comes, np.maximum(_MIDDLE_M - side * (left + way @ leftward), 0.0), 0.0)
        xy: FloatArray = bodies.xy_m + way + (side * past_m)[:, None] * leftward
        return xy

    def _kept_out(self, bodies: Bodies, pose: PlanarPose, free: FreeSpace) -> Bodies:
        """Who goes outwards and is not seen where it was expected is at least beside that place, where it
        would not be seen; so is who was not clearly coming. Who was may still come, a little later."""
        if not bodies.moving.any():
            return bodies
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        forward, leftward = np.array([cos, sin]), np.array([-sin, cos])
        offset = bodies.xy_m - (pose.x_m, pose.y_m)
        ahead, left = offset @ forward - self._mount.forward_m, offset @ leftward - self._mount.left_m
        near, far = ahead - bodies.half_view_m, ahead + bodies.half_view_m
        within = ~self._beyond_edges(bodies, near)
        side = np.where(left < 0.0, -1.0, 1.0)
        inner = side * left - bodies.half_across_m
        xy, velocity = bodies.xy_m.copy(), bodies.velocity_mps.copy()
        covariance, unseen_s = bodies.covariance.copy(), bodies.unseen_s.copy()
        for k in np.flatnonzero(bodies.moving & within & (near > 0.0)).tolist():
            from_tan = float(min(inner[k] / near[k], inner[k] / far[k]))
            outside_m = _seen_through_tan(free, float(side[k]), from_tan, float(far[k])) * far[k]
            late_m = outside_m - inner[k]
            inwards_mps = -side[k] * float(velocity[k] @ leftward)
            comes = -side[k] * _known_part(velocity[k], covariance[k], leftward) > 0.0
            if late_m < (_EDGE_M + _EDGE_MPS * unseen_s[k] if comes else -_TOUCHING):
                continue
            xy[k] += side[k] * late_m * leftward
            if inwards_mps > 0.0:
                velocity[k] = _known_part(velocity[k], covariance[k], forward) * forward
            turned_mps = _TURNS_MPS2 * float(self._since_s[k])
            np.fill_diagonal(covariance[k], np.maximum(np.diagonal(covariance[k]), turned_mps**2))
            unseen_s[k] = 0.0
        return replace(bodies, xy_m=xy, velocity_mps=velocity, covariance=covariance, unseen_s=unseen_s)

    def _beyond_edges(self, bodies: Bodies, near_face_m: FloatArray) -> BoolArray:
        """(N,) below the view or above it, where they begin near_face_m (N,) ahead of the camera."""
        height_m = self._mount.height_m
        lowest_m = lowest_seen_m(near_face_m, height_m, self.near_m) + UNCERTAIN_M
        highest_m = highest_seen_m(near_face_m, height_m, self.up_tan) - UNCERTAIN_M
        below = (near_face_m < self.near_m) & (bodies.top_m < lowest_m)
        beyond: BoolArray = below | (bodies.bottom_m > highest_m)
        return beyond

    def _hidden(self, bodies: Bodies, pose: PlanarPose, edge_tan: float) -> BoolArray:
        """(N,) beside, below or above the view, and not behind the camera by more than a robot's length."""
        cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        dx, dy = bodies.xy_m[:, 0] - pose.x_m, bodies.xy_m[:, 1] - pose.y_m
        ahead = dx * cos + dy * sin - self._mount.forward_m
        left = dy * cos - dx * sin - self._mount.left_m
        near_face = ahead - bodies.half_view_m
        # At the edge of the view it may be outside by what is not known of it: of who goes, more and more.
        late_m = np.where(bodies.moving, _EDGE_MPS * bodies.unseen_s, 0.0)
        edge_m = edge_tan * np.maximum(ahead, 0.0) - _EDGE_M - late_m
        beside = np.abs(left) > edge_m
        hidden: BoolArray = (self._beyond_edges(bodies, near_face) | beside) & (ahead > -2.0)
        return hidden


def _seen_through_tan(free: FreeSpace, side: float, from_tan: float, far_m: float) -> float:
    """How far out from from_tan on, to the left (side 1) or right (-1), all bands are seen through as far as
    far_m; -inf if the first one is not."""
    outwards = -side * free.bearing_tan
    order = np.argsort(outwards)
    order = order[outwards[order] + free.half_width_tan > from_tan - _TOUCHING]
    closed = np.flatnonzero(~(free.known_m[order] >= far_m))
    opened = order[: closed[0]] if len(closed) else order
    return float(outwards[opened[-1]]) + free.half_width_tan if len(opened) else -math.inf


def _known_part(velocity_mps: FloatArray, covariance: FloatArray, along: FloatArray) -> float:
    """The velocity's part along a direction (2,), 0 if that is less than its spread."""
    part_mps = float(velocity_mps @ along)
    return part_mps if abs(part_mps) > math.sqrt(float(along @ covariance @ along)) else 0.0


def _may_come(bodies: Bodies, pose: PlanarPose) -> BoolArray:
    """(N,) towards the robot's axis, from either side, or along with the robot: that is how one cuts in."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    left = (bodies.xy_m[:, 1] - pose.y_m) * cos - (bodies.xy_m[:, 0] - pose.x_m) * sin
    leftward = bodies.velocity_mps[:, 1] * cos - bodies.velocity_mps[:, 0] * sin
    forward = bodies.velocity_mps[:, 0] * cos + bodies.velocity_mps[:, 1] * sin
    comes: BoolArray = (left * leftward < 0.0) | (forward > LEAVES_ASLANT * np.abs(leftward))
    return comes


def _clearly_comes(bodies: Bodies, pose: PlanarPose) -> BoolArray:
    """(N,) who was measured, beyond what noise explains, on a way towards the robot's axis."""
    leftward = np.array([-math.sin(pose.heading_rad), math.cos(pose.heading_rad)])
    side = np.sign((bodies.xy_m - np.array([pose.x_m, pose.y_m])) @ leftward)
    inwards_mps = -side * (bodies.measured_mps @ leftward)
    sigma_mps = np.sqrt(leftward @ bodies.covariance @ leftward)
    return np.asarray(inwards_mps > np.maximum(_CLEAR_SIGMAS * sigma_mps, _CLEAR_MPS))


def _as_measured(bodies: Bodies, mistaken_mps: float) -> Bodies:
    """With the velocity that was measured for who stands by the verdict alone, which takes some frames.
    Thought to stand where it is not seen, it would be waited for without end. Not with a velocity above
    mistaken_mps: it is none."""
    squared = np.einsum("ni,ni->n", bodies.measured_mps, bodies.measured_mps)
    # Along its way: v' C v / v'v is the variance there.
    variance = np.einsum("ni,nij,nj->n", bodies.measured_mps, bodies.covariance, bodies.measured_mps)
    goes = ~bodies.moving & (bodies.tracked_s >= SETTLED_S) & (bodies.tracked_s < _NO_VERDICT_S)
    goes &= (squared**2 > _CERTAIN_SIGMAS**2 * variance) & (squared > _CLEAR_MPS**2)
    goes &= squared <= mistaken_mps**2
    if not goes.any():
        return bodies
    velocity = np.where(goes[:, None], bodies.measured_mps, bodies.velocity_mps)
    return replace(bodies, velocity_mps=velocity, moving=bodies.moving | goes)


def _alike(bodies: Bodies, seen: Bodies) -> BoolArray:
    """(N, M) whether the velocities of M that are seen could be those of these N; not while they are young:
    then they could be anybody's."""
    spread = np.diagonal(bodies.covariance, axis1=1, axis2=2)[:, None]
    seen_spread = np.diagonal(seen.covariance, axis1=1, axis2=2)
    differs = bodies.velocity_mps[:, None] - seen.measured_mps
    same = np.all(differs**2 <= _APART_SIGMAS**2 * (spread + seen_spread), axis=2)
    return np.asarray(same & (seen.tracked_s > SETTLED_S))


def _rests(bodies: Bodies, kept: BoolArray) -> BoolArray:
    """(N,) strips hardly seen beside one that is kept, was seen for longer and may go just as they do."""
    older = kept & bodies.moving & (bodies.tracked_s > SETTLED_S)
    rests = bodies.moving & (bodies.tracked_s <= SETTLED_S) & (bodies.half_across_m < _NOBODY_HALF_M)
    if not (older.any() and rests.any()):
        return np.zeros(len(bodies), np.bool_)
    others = bodies.select(older)
    beside = others.covers(bodies.xy_m, bodies.half_view_m, _REST_M) & _alike(bodies, others)
    return np.asarray(rests & beside.any(axis=1))


def _missing(ids: NDArray[np.int64], among: NDArray[np.int64]) -> BoolArray:
    """(N,) which are not among the others; for a few, a table is faster than sorting."""
    missing: BoolArray = (ids[:, None] != among).all(axis=1)
    return missing
