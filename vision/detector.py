"""detect: an RGB-D frame and the odometry at its time become a Detection.

The steps of a frame (_next_frame): the prior of the camera's motion, optical flow of the fragments, their
depth, the camera's motion, the residuals of the ends, and new fragments. Before that the depth grid is made
and the camera's health is checked. track (vision/tracker.py) takes the Detection.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from config.own_parts import OwnPart
from config.perception import PerceptionConfig
from hal.records import record
from hal.types import CameraMount, FloatArray, Pose, RgbdFrame
from vision.camera.gyro import GyroMemory
from vision.camera.health import Continuity, FrameCheck, HealthMonitor, with_ego_motion
from vision.camera.lens import vector_from_rotation
from vision.camera.seen_depth import SeenDepth
from vision.depth.depth_grid import DepthGrid
from vision.depth.depth_mask import surface_depth
from vision.detection import NOT_COMPARED, CameraMotion, Detection, camera_motion_of, unknown_residuals
from vision.ego_motion.camera_motion import CameraEstimate, estimate
from vision.ego_motion.motion_memory import MotionMemory
from vision.ego_motion.motion_prior import MotionPrior
from vision.ego_motion.rolling_shutter import ReadOut
from vision.fragments import optical_flow
from vision.fragments.attention import Attention, NeedsFragments
from vision.fragments.candidates import NewFragments
from vision.fragments.edges import GreyImage
from vision.fragments.optical_flow import Pyramid, pyramid
from vision.fragments.renewal import Renewal
from vision.fragments.store import AnchorEnds, FragmentStore
from vision.motion.anchor_depths import AnchorDepths, average_depth, depths_with_sigma, static_points
from vision.motion.expected import expected_px, known_motion
from vision.motion.residuals import observed_variance_scale, residuals
from vision.motion.velocities import EndResiduals
from vision.percept import Percept
from vision.scene import CameraCondition, CameraHealth

_IDENTITY = Pose(np.eye(3), np.zeros(3))
_NO_SWEEP = np.zeros(2)
# A search for new fragments takes about a millisecond, which there is time for in every frame at 30 Hz. At a
# lower rate there is time for several in a frame, and the image must not take longer to be searched.
_TURN_S = 1.0 / 30.0


@record(frozen=True, slots=True, eq=False)
class _Now:
    """A frame, and what is known of it before anything is tracked in it.

    grey: its colour image. odometry: the camera by dead reckoning, None where not known.
    """

    frame: RgbdFrame
    grey: GreyImage
    grid: DepthGrid
    odometry: Pose | None
    health: CameraHealth


class Detector:
    """Keeps the fragments, the last image and the camera's pose in a fixed frame of its own."""

    def __init__(
        self, config: PerceptionConfig, mount: CameraMount | None, own_parts: Sequence[OwnPart] = ()
    ) -> None:
        self._config = config
        self._depth = SeenDepth(config, mount, own_parts)
        self._store = FragmentStore()
        self._renewal = Renewal(config)
        self._attention = Attention(config)
        self._renewed = True  # the fragments, in the last frame
        self._health = HealthMonitor(config)
        self._last_health = CameraHealth(CameraCondition.GOOD, "", float("nan"))
        self._images: Pyramid = ()
        self._last_ns = 0
        self._pose = _IDENTITY
        self._memory = MotionMemory(mount, config.ego_motion)
        self._gyro = GyroMemory()
        self._read_out = ReadOut(config.ego_motion.vibration_radps)
        self._variance_scale = 1.0

    def step(self, frame: RgbdFrame, odometry: Pose | None, previous: Percept | None = None) -> Detection:
        """Detect in one frame. odometry: the camera by dead reckoning at captured_ns, None where not known.

        previous: result of tracking for the frame before. By it, fragments on moving obstacles are left out
        of the ego-motion and searched for where the obstacle moves, and bodies that need fragments get more.
        """
        if frame.gyro is not None:
            self._gyro.add(frame.gyro)
        odometry = odometry if odometry is None or odometry.finite else None
        grey = np.asarray(cv2.cvtColor(frame.colour, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        frame, grid = self._depth.take(frame)
        check = self._health.check(frame, grey, grid, odometry)
        now = _Now(frame, grey, grid, odometry, self._judge(check, grid, frame.captured_ns))
        if not check.usable or check.continuity in (Continuity.REPEATED, Continuity.BACKWARD):
            return self._not_usable(now)
        # dt_s is negative if time stepped back at a frame that was not usable.
        dt_s = (frame.captured_ns - self._last_ns) * 1e-9
        in_time = check.continuity is Continuity.NEXT and 0.0 < dt_s <= self._config.max_gap_s
        if in_time and len(self._images) > 0 and self._images[0].shape == grey.shape:
            return self._next_frame(now, previous, dt_s)
        return self._restart(now)

    def _judge(self, check: FrameCheck, grid: DepthGrid, captured_ns: int) -> CameraHealth:
        """The camera's health by the images and the mounting, before anything is tracked."""
        health = check.health
        if check.usable:
            health = self._depth.judge(grid, captured_ns, health)
        if check.continuity is Continuity.REPEATED and health.condition is CameraCondition.GOOD:
            # A repeated image cannot have a better health than it was reported with before.
            health = replace(self._last_health, valid_depth_ratio=health.valid_depth_ratio)
        return health

    def _next_frame(self, now: _Now, previous: Percept | None, dt_s: float) -> Detection:
        """Detect in a frame that comes dt_s after the one before it and can be compared with it."""
        frame, config, store = now.frame, self._config, self._store
        turn_rad = self._gyro.turn_rad(self._last_ns, frame.captured_ns)
        prior = self._memory.prior(now.odometry, turn_rad, dt_s)
        images = pyramid(now.grey, config.fragments)
        excluded = self._track_ends(frame, images, prior, previous, dt_s)
        anchor = store.anchors(frame.captured_ns, config.motion.window_s)
        depths = depths_with_sigma(anchor, config.depth_noise)
        static = static_points(anchor, depths, store.pixel_cov, excluded, config.max_depth_m)
        pixels = store.ends_px.reshape(-1, 2).astype(float)
        sweep, obstacles = self._read_out.sweep(), previous.scene.obstacles if previous else ()
        found = estimate(static, pixels, self._pose, prior, sweep, frame.intrinsics, obstacles)
        motion = self._measure_residuals(frame, anchor, depths, found, excluded)
        camera = self._learn_motion(found, prior, dt_s)
        health = with_ego_motion(now.health, camera.ego, camera.blurred, camera.reckoned)
        detection = self._detection(now, health, motion, camera)
        self._renew_fragments(now, previous, excluded, dt_s)
        if camera.ego.source != "visual" or camera.blurred:
            store.break_history()
        self._commit(now, images, found.sweep_rad)
        return detection

    def _learn_motion(self, found: CameraEstimate, prior: MotionPrior, dt_s: float) -> CameraMotion:
        """Take over the camera's new pose, and learn from its motion for the frames to come."""
        step = self._pose.inverse() @ found.pose
        refuted = found.visual and self._memory.refutes(step, dt_s, prior.source)
        if refuted:
            found = replace(found, visual=False, disputed=True)
        self._read_out.learn(found, vector_from_rotation(step.rotation), dt_s)
        self._pose = found.pose
        camera = camera_motion_of(found, step, dt_s, prior)
        self._memory.learn(step, dt_s, camera.ego.source)
        if refuted:
            self._memory.begin_again()
        return camera

    def _track_ends(
        self, frame: RgbdFrame, images: Pyramid, prior: MotionPrior, previous: Percept | None, dt_s: float
    ) -> NDArray[np.bool_]:
        """Track the fragments into images and read their depth; those that are lost are dropped.

        Returns (N,) fragments that are not used for the camera's motion: moving ones, and body-only ones.
        """
        config, store = self._config, self._store
        moving, velocity = known_motion(store.ids, previous.fragments if previous else None)
        flow = optical_flow.track(
            self._images,
            images,
            store.ends_px.reshape(-1, 2),
            expected_px(store, velocity, prior.motion, dt_s, frame.intrinsics),
            store.pixel_cov.reshape(-1, 3),
            store.error_px.reshape(-1),
            config.fragments,
        )
        found = flow.found.reshape(-1, 2)
        both = found[:, 0] & found[:, 1] & ~self._depth.on_own(flow.pixels.reshape(-1, 2, 2))
        store.ends_px = flow.pixels.reshape(-1, 2, 2)
        store.error_px = flow.error_px.reshape(-1, 2)
        store.keep(both)
        surface = surface_depth(frame.depth, frame.depth_scale_m, store.ends_px.reshape(-1, 2), config)
        store.near_m = surface.near_m.reshape(-1, 2).astype(np.float32)
        store.far_m = surface.far_m.reshape(-1, 2).astype(np.float32)
        return moving[both] | store.body_only

    def _measure_residuals(
        self,
        frame: RgbdFrame,
        anchor: AnchorEnds,
        depths: AnchorDepths,
        found: CameraEstimate,
        excluded: NDArray[np.bool_],
    ) -> EndResiduals:
        """Residuals of all ends; updates the scale of the noise, and the running averages of depth."""
        store, noise, scale = self._store, self._config.depth_noise, self._variance_scale
        if found.noisy:
            scale = max(scale, found.noise_scale)
        motion = residuals(store, anchor, depths, found, frame.intrinsics, noise, scale)
        if found.visual:
            self._variance_scale = observed_variance_scale(
                motion, store.age_frames, excluded, scale, self._variance_scale
            )
        average_depth(store, store.last_entries(frame.captured_ns), found.pose, noise)
        return motion

    def _renew_fragments(
        self, now: _Now, previous: Percept | None, excluded: NDArray[np.bool_], dt_s: float
    ) -> None:
        """Make room where fragments on movers crowd, and find new ones. excluded (N,): see _track_ends."""
        store, turns = self._store, max(round(dt_s / _TURN_S), 1)
        on_movers = excluded & ~store.body_only
        store.keep(~self._renewal.crowded(store.ends_px, on_movers, now.grey.shape))
        looked = previous is not None and self._look_closer(now, previous.needs_fragments, turns)
        # A look at a body takes the place of a renewal, but never twice in a row.
        self._renewed = turns > 1 or not (looked and self._renewed)
        if self._renewed:
            self._renew(now, turns)

    def _renew(self, now: _Now, turns: int = 1) -> None:
        without_depth = int(np.count_nonzero(np.isnan(self._store.near_m).all(axis=1)))
        ends_px, near_own = self._store.ends_px, self._depth.near_own
        self._add(self._renewal.find(now.frame, now.grey, ends_px, without_depth, turns, near_own))

    def _look_closer(self, now: _Now, bodies: NeedsFragments, turns: int) -> bool:
        """Look at one body a turn, while it is the turn of any. Whether at least one was looked at."""
        for turn in range(turns):
            new = self._attention.find(now.frame, now.grey, self._store.ends_px, bodies)
            if new is None:
                return turn > 0
            self._add(new, body_only=True)
        return True

    def _add(self, new: NewFragments, body_only: bool = False) -> None:
        """Keep new fragments, unless they are on the robot itself."""
        self._store.add(new.select(~self._depth.on_own(new.ends_px)), body_only)

    def _commit(self, now: _Now, images: Pyramid, sweep_rad: FloatArray) -> None:
        """The next frame is compared with this one."""
        captured_ns = now.frame.captured_ns
        self._store.commit(captured_ns, self._pose, now.frame.intrinsics, sweep_rad)
        self._images, self._last_ns = images, captured_ns
        self._memory.note_odometry(now.odometry)
        self._gyro.forget(captured_ns)

    def _restart(self, now: _Now) -> Detection:
        """Begin anew: at the first frame, after a gap or a step back of time, or with another image size."""
        self._store.clear()
        self._read_out.forget_last()
        self._memory.forget()
        self._renew(now)
        unknown = unknown_residuals(2 * len(self._store))
        detection = self._detection(now, now.health, unknown, restarted=True)
        self._commit(now, pyramid(now.grey, self._config.fragments), _NO_SWEEP)
        return detection

    def _not_usable(self, now: _Now) -> Detection:
        """A frame in which nothing can be tracked; the fragments wait for the next usable frame."""
        self._read_out.forget_last()
        return self._detection(now, now.health, unknown_residuals(2 * len(self._store)))

    def _detection(
        self,
        now: _Now,
        health: CameraHealth,
        motion: EndResiduals,
        camera: CameraMotion = NOT_COMPARED,
        *,
        restarted: bool = False,
    ) -> Detection:
        frame, store, self._last_health = now.frame, self._store, health
        return Detection(
            captured_ns=frame.captured_ns,
            sequence=frame.sequence,
            dt_s=camera.ego.dt_s,
            camera=frame.intrinsics,
            grid=now.grid,
            ids=store.ids,
            ends_px=store.ends_px,
            near_m=store.near_m,
            age_frames=store.age_frames.copy(),
            motion=motion,
            pose=self._pose,
            ego_motion=camera.ego,
            health=health,
            restarted=restarted,
            motion_known=camera.known,
            reckoned=camera.reckoned,
            blurred=camera.blurred,
            floor=self._depth.floor,
        )
