"""A mounting from which the floor right before the robot is not seen: a warning before the drive.

Whoever starts the robot consents to a little floor that was never seen (known_floor.MAX_ASSUMED_FREE_M). If
the image begins beyond that, the robot drives so far and then waits for floor that it cannot see.
"""

from __future__ import annotations

import math

from config.app import AppConfig
from controller.decision.known_floor import MAX_ASSUMED_FREE_M


def floor_view_warning(config: AppConfig) -> str | None:
    """One line about a camera that sees the floor from too far on; None if it sees it near enough.

    None also if the field of view is not known before the drive.
    """
    view = config.camera.nominal_view
    if view is None:
        return None
    _, height_px, _, focal_px, _, centre_px = view
    mount = config.robot.camera_mount
    half_rad = math.atan((height_px - 0.5 - centre_px) / focal_px)
    down_rad = half_rad + mount.pitch_rad
    from_m = mount.height_m / math.tan(down_rad) if down_rad > 0.0 else math.inf
    assumed_m = max(MAX_ASSUMED_FREE_M, config.decision.sight.near_m)
    if from_m <= assumed_m:
        return None
    least_deg = math.ceil(math.degrees(math.atan(mount.height_m / assumed_m) - half_rad))
    sees = "never sees the floor" if math.isinf(from_m) else f"sees the floor only from {from_m:.1f} m on"
    return (
        f"robot.camera_mount: a camera {mount.height_m:g} m above the floor with a pitch of "
        f"{math.degrees(mount.pitch_rad):g} degrees {sees}, and at most {assumed_m:g} m of it are taken as "
        "free unseen: the robot will wait there forever; "
        f"set a pitch_deg of at least {least_deg} or mount it lower"
    )
