"""Finds the gyro in a ROS bag, and turns its readings into the optical axes of the colour camera."""

from __future__ import annotations

from collections.abc import Sequence
from os.path import commonpath

import numpy as np

from hal.cameras.bag_file import BagFile, Topic
from hal.cameras.bag_odometry import stamp_ns
from hal.cameras.bag_realsense import stream_of
from hal.cameras.bag_topics import list_names, named_topic
from hal.cameras.bag_transforms import StaticTransforms, frame_name
from hal.cameras.gyro_track import GyroTrack
from hal.errors import BadRecording

_IMU = "sensor_msgs/msg/Imu"
_GYRO, _ACCELEROMETER = "gyro", "accel"
_NOT_MEASURED = -1.0  # in the first place of a covariance (sensor_msgs/Imu)


def read_gyro(
    bag: BagFile, wanted: str | None, colour_topic: str, camera: str, transforms: StaticTransforms
) -> tuple[GyroTrack | None, tuple[str, ...]]:
    """(the gyro's readings, notes for the summary); no track if there is none that can be used.

    wanted: the topic that the user chose; None: to be found. camera: frame of the colour camera. Raises
    BadRecording if wanted is not there, or cannot be used, and if the bag is damaged.
    """
    imus = [topic for topic in bag.topics if topic.kind == _IMU]
    if wanted is not None:
        chosen = named_topic(bag.path, imus, wanted, "gyro").name
        return _track(bag, chosen, colour_topic, camera, transforms), ()
    best = _nearest(imus, colour_topic)
    if not best:
        return None, ()
    if len(best) > 1:
        return None, (f"several topics could be the gyro: {list_names(best)}; choose one with --gyro-topic",)
    try:
        return _track(bag, best[0].name, colour_topic, camera, transforms), ()
    except BadRecording as error:
        return None, (f"the gyro is not used: {error}",)


def _nearest(imus: Sequence[Topic], colour_topic: str) -> list[Topic]:
    """The topics whose names are most like that of the camera's gyro; several if they are equally like it."""
    ranked: dict[Topic, tuple[int, bool]] = {}
    for topic in imus:
        name = topic.name.lower()
        if _ACCELEROMETER not in name:
            ranked[topic] = (len(commonpath((colour_topic, topic.name))), _GYRO in name)
    return [topic for topic in ranked if ranked[topic] == max(ranked.values())]


def _track(
    bag: BagFile, topic: str, colour_topic: str, camera: str, transforms: StaticTransforms
) -> GyroTrack:
    """Raises BadRecording if the gyro's axes are not known, or a reading is none."""
    stamps_ns: list[int] = []
    rates: list[tuple[float, float, float]] = []
    frame = ""
    for _, message in bag.messages((topic,)):
        frame = frame or stream_of(topic) or frame_name(message.header.frame_id)
        rate = message.angular_velocity
        if message.angular_velocity_covariance[0] == _NOT_MEASURED:
            raise BadRecording(f"{bag.path}: {topic}: has no angular velocity; choose another --gyro-topic")
        stamps_ns.append(stamp_ns(message))
        rates.append((rate.x, rate.y, rate.z))
    rates_radps = np.array(rates, np.float64)
    if not np.isfinite(rates_radps).all():
        raise BadRecording(
            f"{bag.path}: {topic}: holds readings that are not finite; leave it out: --no-gyro"
        )
    in_camera = transforms.find(camera, frame)
    if in_camera is not None:
        rates_radps = rates_radps @ in_camera.rotation.T
    elif not (stream_of(topic) and stream_of(colour_topic)):
        # In a RealSense, the housing aligns the two to within a degree; its viewer may not record how.
        raise BadRecording(
            f"{bag.path}: {topic}: how {frame or 'its frame'} is turned to {camera} was not recorded in "
            "/tf_static; record it, or replay with --no-gyro"
        )
    return GyroTrack(topic, np.array(stamps_ns, np.int64), rates_radps)
